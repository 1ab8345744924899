"""Configuration of all tests."""

import gc
import os
import sys
import warnings

from hypothesis import Phase, settings

# With PYTHONDONTWRITEBYTECODE, each worker would rewrite the assertions of all test modules again, which takes ten seconds.
sys.dont_write_bytecode = False

# A deadline for each example would test the machine's speed; pytest-timeout ends hanging tests.
# Examples are derived from the tests themselves, so that the same commit is always green or always red, and each
# mutant always killed or never. LIFELINE_RANDOM=1 looks for new ones instead.
# A mutant is killed by the first example that fails: the search for a smaller one takes minutes, and nobody reads it.
settings.register_profile(
    "lifeline",
    deadline=None,
    derandomize="LIFELINE_RANDOM" not in os.environ,
    phases=[phase for phase in Phase if phase is not Phase.shrink or "LIFELINE_MUTATION" not in os.environ],
)
# `make test` tries fewer examples of each property than `make coverage` in .ci/run.
settings.register_profile("quick", settings.get_profile("lifeline"), max_examples=20)
settings.load_profile("lifeline")

# Until the tests are collected, all objects stay: looking for garbage among them takes a sixth of the time.
gc.disable()


def pytest_collection_finish() -> None:
    """Look for garbage from now on, but not among the modules and the tests."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # of the collection, which no test causes
        gc.collect()
    gc.freeze()
    gc.enable()
