"""When a process started, as the guard of the terminal sees it."""

import os
import subprocess
from typing import BinaryIO

import pytest

from teleop import terminal_guard
from teleop.terminal_guard import _started_ticks  # pyright: ignore[reportPrivateUsage]


def test_a_child_started_after_its_parent() -> None:
    with subprocess.Popen(["sleep", "5"]) as child:
        assert _started_ticks(child.pid) >= _started_ticks(os.getpid()) > 0
        child.kill()


def test_a_process_that_does_not_exist_never_started() -> None:
    with subprocess.Popen(["true"]) as child:
        child.wait()
    assert _started_ticks(child.pid) == 0


def test_a_process_that_is_reaped_while_its_start_is_read_never_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A shell reaps a killed teleop at the moment at which the guard asks for the process in the foreground."""
    with subprocess.Popen(["sleep", "5"]) as child:

        def opened(path: str, mode: str) -> BinaryIO:
            stat: BinaryIO = open(path, mode)  # type: ignore[assignment]  # noqa: SIM115, PTH123
            child.kill()
            child.wait()
            return stat

        monkeypatch.setattr(terminal_guard, "open", opened, raising=False)
        assert _started_ticks(child.pid) == 0
