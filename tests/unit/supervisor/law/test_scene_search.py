"""The law in random scenes; `python -m tests.scenes` searches many more of them."""

import pytest

from tests.scenes.run import run
from tests.scenes.scene import random_scene

BLOCKS = 5
PER_BLOCK = 15

REGRESSIONS: tuple[int, ...] = (
    4,
    6,
    25,
    28,
    151,
    171,
    231,
    235,
    257,
    276,
    293,
    1584,
    3263,
    3498,
    7431,
    13636,
    14519,
)
"""Seeds of scenes that once ended with a violation; `--replay SEED --verbose --plot FILE` shows one."""

pytestmark = [pytest.mark.proof, pytest.mark.timeout(600)]


@pytest.mark.parametrize("block", range(BLOCKS))
def test_in_random_scenes_the_hull_keeps_its_distance(block: int) -> None:
    for seed in range(1000 + block * PER_BLOCK, 1000 + (block + 1) * PER_BLOCK):
        _keeps_its_distance(seed)


@pytest.mark.parametrize("seed", REGRESSIONS)
def test_a_scene_that_once_ended_too_close_does_so_no_more(seed: int) -> None:
    _keeps_its_distance(seed)


def _keeps_its_distance(seed: int) -> None:
    outcome = run(random_scene(seed))
    assert outcome.closest_m >= outcome.bound_m, f"python -m tests.scenes --replay {seed} --verbose"
