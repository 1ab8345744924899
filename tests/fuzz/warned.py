"""What warned on the way: no crash, but a line in somebody's log that a stranger can provoke."""

import warnings
from collections.abc import Generator
from contextlib import contextmanager

Warned = set[str]


@contextmanager
def warned() -> Generator[Warned]:
    """Each warning once, by its place; none of them is shown or raised."""
    told: Warned = set()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        try:
            yield told
        finally:
            told.update(f"{w.category.__name__} at {w.filename}:{w.lineno}: {w.message}" for w in caught)
