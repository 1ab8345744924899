"""Collect warnings: log lines that a hostile client can provoke."""

import warnings
from collections.abc import Generator
from contextlib import contextmanager

Warned = set[str]


@contextmanager
def warned() -> Generator[Warned]:
    """Collect each warning once by its place, without showing or raising it."""
    told: Warned = set()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        try:
            yield told
        finally:
            told.update(f"{w.category.__name__} at {w.filename}:{w.lineno}: {w.message}" for w in caught)
