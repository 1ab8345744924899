"""If no keeper is possible, a process runs without one and without a message; see also tests/system/test_memory_keeper.py."""

import ctypes
import gc
from pathlib import Path
from types import SimpleNamespace

import pytest

from wire.host.memory_keeper import MemoryKeeper

C = ctypes.CDLL(None)


def refused(*_: object) -> int:
    return -1


class Forbidding:
    """The C library in a sandbox that refuses one call."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __getattr__(self, name: str) -> object:
        return refused if name == self.name else getattr(C, name)


OLD = SimpleNamespace(prctl=C.prctl)


def descriptors() -> set[str]:
    return {path.name for path in Path("/proc/self/fd").iterdir() if path.exists()}


@pytest.mark.parametrize(
    "library",
    [OLD, *map(Forbidding, ("timerfd_create", "setvbuf", "close_range", "clone"))],
    ids=lambda library: getattr(library, "name", "an old C library"),
)
def test_where_it_cannot_be_done_there_is_no_keeper_and_nothing_else_happens(
    monkeypatch: pytest.MonkeyPatch, library: object
) -> None:
    def load(_: None) -> object:
        return library

    monkeypatch.setattr(ctypes, "CDLL", load)
    before = descriptors()
    keeper = MemoryKeeper()
    assert keeper.pid is None
    keeper.end()
    assert descriptors() == before
    assert gc.isenabled()


def test_without_memory_for_a_keeper_the_process_gets_an_error_and_does_not_wait_for_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its event loop waited forever for a thread that had ended, and only SIGKILL ended the process."""
    make = ctypes.create_string_buffer

    def allocate(size: int) -> object:
        if size >= 1 << 16:
            raise MemoryError
        return make(size)

    monkeypatch.setattr(ctypes, "create_string_buffer", allocate)
    with pytest.raises(MemoryError):
        MemoryKeeper()
