"""Restore the terminal after teleop was killed, because a killed process cannot do it itself.

A second process waits for the end of teleop, in a process group of its own, so that no key ends or stops it. If teleop
had not restored the terminal, the process leaves the alternate screen, and restores the modes unless another program
has changed them since. It changes nothing if the program in the foreground was started after it: that program has a
screen and modes of its own. This file imports only the standard library, so that it starts within milliseconds.
"""

import os
import select
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from contextlib import suppress

BY_PARENT = "LIFELINE_PARENT_RESTORES_TERMINAL"
"""Set in the environment of a teleop whose parent restores the terminal: restoring it twice moves the cursor twice."""

Modes = list[int | list[bytes | int]]
"""Terminal attributes as `termios.tcgetattr` returns them."""

_HAS_IT, _HAS_IT_NOT = b"1", b"0"

_READ_LIMIT_S = 60.0
"""Time limit for writing the final sequences to a terminal that does not accept output."""


class TerminalGuard:
    """The second process, seen from teleop.

    Args:
        terminal: a descriptor of the terminal, open for writing.
        before: the modes to restore.
        ours: the modes that teleop sets.
        ending: the characters to write at the end, such as those that leave the alternate screen.
    """

    def __init__(self, terminal: int, before: Modes, ours: Modes, ending: str) -> None:
        command = [sys.executable, "-I", "-S", __file__, _spelled(before), _spelled(ours), ending]
        read, self._write = os.pipe()  # open until this process ends
        try:
            # With an empty environment: this process must not have the marks of a stack's processes.
            self._process = subprocess.Popen(
                command, stdin=read, stdout=terminal, stderr=subprocess.DEVNULL, env={}, process_group=0
            )
        except OSError:  # teleop works without it; only a SIGKILL leaves the terminal in cbreak mode
            pass
        finally:
            os.close(read)

    def tell(self, *, has_terminal: bool) -> None:
        """Tell the second process whether teleop uses the terminal from now on."""
        with suppress(BrokenPipeError):
            os.write(self._write, _HAS_IT if has_terminal else _HAS_IT_NOT)


def _spelled(modes: Modes) -> str:
    *flags, characters = modes
    assert isinstance(characters, list)
    numbers = [*flags, *(c if isinstance(c, int) else c[0] for c in characters)]
    return ",".join(map(str, numbers))


def _modes(spelled: str) -> Modes:
    numbers = [int(number) for number in spelled.split(",")]
    return [*numbers[:6], [*numbers[6:]]]


def _main(before: str, ours: str, ending: str) -> None:
    # The terminal is restored even if another process group is in the foreground, or if this one was stopped.
    for number in (signal.SIGTTOU, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    last = _HAS_IT_NOT
    while told := os.read(0, 1):
        last = told
    if last == _HAS_IT_NOT or _started_ticks(_foreground()) > _started_ticks(os.getpid()):
        return
    if _spelled(termios.tcgetattr(1)) == ours:
        termios.tcsetattr(1, termios.TCSANOW, _modes(before))
    _write(ending.encode())


def _foreground() -> int:
    """Return the foreground process group; 0 if the terminal is not this process's controlling terminal."""
    try:
        return os.tcgetpgrp(1)
    except OSError:
        return 0


def _started_ticks(pid: int) -> int:
    """Return the start time of a process in the kernel's ticks since boot; 0 if there is no such process."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as stat:  # noqa: PTH123 - to import pathlib takes milliseconds
            return int(stat.read().rpartition(b")")[2].split()[19])
    except OSError:  # also if the process was reaped since the file was opened
        return 0


def _write(text: bytes) -> None:
    """Write with retries: the descriptor is shared with teleop and non-blocking, so a write may fail temporarily."""
    deadline_s = time.monotonic() + _READ_LIMIT_S
    while text and select.select([], [1], [], max(0.0, deadline_s - time.monotonic()))[1]:
        with suppress(BlockingIOError):
            text = text[os.write(1, text) :]


def main(arguments: Sequence[str]) -> None:
    with suppress(OSError, termios.error):  # the terminal is closed
        _main(*arguments)


if __name__ == "__main__":
    main(sys.argv[1:])
