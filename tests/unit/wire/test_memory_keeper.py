"""Where no keeper can be had, a process has none, and says nothing. What a keeper does: tests/system/test_memory_keeper.py."""

import ctypes
from types import SimpleNamespace

import pytest

from wire.memory_keeper import MemoryKeeper


def done(*_: object) -> int:
    return 0


def refused(*_: object) -> int:
    return -1


OLD = SimpleNamespace(prctl=done)
FORBIDDING = SimpleNamespace(prctl=done, close_range=refused)


@pytest.mark.parametrize("library", [OLD, FORBIDDING], ids=["an old C library", "a sandbox"])
def test_where_it_cannot_be_done_there_is_no_keeper_and_nothing_else_happens(
    monkeypatch: pytest.MonkeyPatch, library: SimpleNamespace
) -> None:
    def load(_: None) -> SimpleNamespace:
        return library

    monkeypatch.setattr(ctypes, "CDLL", load)
    keeper = MemoryKeeper()
    assert keeper.pid is None
    keeper.end()


def test_on_another_system_there_is_no_keeper(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    keeper = MemoryKeeper()
    assert keeper.pid is None
    keeper.end()
