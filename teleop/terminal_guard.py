"""Restore the terminal of a teleop that was killed: a process that is killed cannot do it itself.

A second process waits for the end of teleop, in a process group of its own, so that no key ends or stops it. If teleop
still had the terminal, it leaves the picture, and sets the modes back unless somebody else has changed them since. Run
as a program, this file needs nothing but the standard library, so that it starts within milliseconds.
"""

import os
import signal
import subprocess
import sys
import termios
from collections.abc import Sequence
from contextlib import suppress

BY_PARENT = "LIFELINE_PARENT_RESTORES_TERMINAL"
"""Set in the environment of a teleop whose parent restores the terminal itself: two of them would move the cursor twice."""

Modes = list[int | list[bytes | int]]
"""As termios has them."""

_HAS_IT, _HAS_IT_NOT = b"1", b"0"


class TerminalGuard:
    """The second process, seen from teleop.

    Args:
        terminal: a descriptor of the terminal, open for writing.
        before: the modes to restore.
        ours: the modes that teleop sets.
        ending: what leaves the picture.
    """

    def __init__(self, terminal: int, before: Modes, ours: Modes, ending: str) -> None:
        command = [sys.executable, "-I", "-S", __file__, _spelled(before), _spelled(ours), ending]
        read, self._write = os.pipe()  # open until this process ends
        try:
            # Without our environment: what marks the processes of a stack must not be found in this one.
            self._process = subprocess.Popen(
                command, stdin=read, stdout=terminal, stderr=subprocess.DEVNULL, env={}, process_group=0
            )
        except OSError:  # a terminal that stays raw after SIGKILL is no reason not to drive
            pass
        finally:
            os.close(read)

    def tell(self, *, has_terminal: bool) -> None:
        """Whether teleop has the terminal from now on."""
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
    # The terminal is restored even if another process group has the foreground by now.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    last = _HAS_IT_NOT
    while told := os.read(0, 1):
        last = told
    if last == _HAS_IT_NOT:
        return
    if _spelled(termios.tcgetattr(1)) == ours:
        termios.tcsetattr(1, termios.TCSANOW, _modes(before))
    os.write(1, ending.encode())


def main(arguments: Sequence[str]) -> None:
    with suppress(OSError, termios.error):  # the terminal is gone
        _main(*arguments)


if __name__ == "__main__":
    main(sys.argv[1:])
