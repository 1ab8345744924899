"""The program under test, in a terminal of its own, with the keys that a person would press."""

import asyncio
import fcntl
import os
import pty
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from deploy.stack.errors import DeployError
from deploy.stack.keyboard import COLUMNS, ROWS, Screen
from faults.grade import leftovers
from wire.text import printable

LAST_CHARACTERS = 300
REPEAT_S = 1.0 / 30.0
"""Of a held key: a usual value of a desktop."""
LEADER = (
    'trap : INT QUIT TSTP; news=$1; shift; sh -c "$0" "$news" "$@"; echo $? >>"$news"; exec sleep infinity'
)
CHILD = 'echo $$ >"$0"; exec "$@"'
"""The shell commands of the session's leader and of the program; they write the program's pid and its exit code to a file."""


class Program:
    """A running instance of the program, in a session whose leader lives as long as the terminal.

    As in a shell, the program is not the leader: the kernel would end what it started as soon as it is killed.

    Args:
        command: its command line.
        environment: its complete environment, with its mark.
        whole_group: whether signals go to everything that it started in its process group, not only to itself.

    Raises:
        DeployError: it cannot be started.
    """

    def __init__(self, command: Sequence[str], environment: dict[str, str], *, whole_group: bool) -> None:
        self._mark = environment[leftovers.MARK]
        self._whole_group = whole_group
        self._greets: bool | None = None
        self._holding: asyncio.TimerHandle | None = None
        self._terminal, program_side = pty.openpty()
        self._news = Path(f"{self._mark}news")
        try:
            fcntl.ioctl(program_side, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            self._leader = subprocess.Popen(
                ["setsid", "--ctty", "sh", "-c", LEADER, CHILD, str(self._news), *command],  # noqa: S607 - the system's
                stdin=program_side,
                stdout=program_side,
                stderr=program_side,
                env=environment | {"TERM": "xterm-256color"},
            )
        except OSError as error:
            os.close(self._terminal)
            raise DeployError(f"cannot start the program in a terminal: {error}") from error
        finally:
            os.close(program_side)
        self._screen = Screen(self._terminal, self._write)

    def _pid_and_code(self) -> list[int]:
        """Return the program's pid once it has started, and then its exit code once it has ended."""
        news = self._news.read_text() if self._news.exists() else ""
        return [int(line) for line in news.splitlines()]

    @property
    def has_ended(self) -> bool:
        return len(self._pid_and_code()) > 1 or self._leader.poll() is not None

    @property
    def greets(self) -> bool:
        """Whether it has printed anything before the first key; a terminal echoes keys."""
        return bool(self._screen.output) if self._greets is None else self._greets

    @property
    def end(self) -> str:
        """How it ended, with its last lines, for people."""
        codes = self._pid_and_code()[1:]
        how = f"ended with code {codes[0]}" if codes else "runs"
        return f"it {how}, and its last lines are: {printable(self._screen.last_lines)[-LAST_CHARACTERS:]}"

    def type(self, data: bytes) -> None:
        """Type bytes on its keyboard; a full or closed terminal drops them."""
        if data:
            self._greets = self.greets
        self._write(data)

    def _write(self, data: bytes) -> None:
        with suppress(OSError):
            os.write(self._terminal, data)

    def hold(self, key: bytes) -> None:
        """Hold a key down until `let_go`."""
        self.type(key)
        self._holding = asyncio.get_running_loop().call_later(REPEAT_S, self.hold, key)

    def let_go(self) -> None:
        if self._holding is not None:
            self._holding.cancel()
            self._holding = None

    def send(self, number: signal.Signals) -> float:
        """Send a signal; return the time just before."""
        at_s = time.monotonic()
        with suppress(ProcessLookupError):
            if self._whole_group:
                os.killpg(self._leader.pid, number)
            else:
                os.kill(self._pid_and_code()[0], number)
        return at_s

    def close(self) -> None:
        """Kill the program and everything that it started, and close its terminal."""
        self.let_go()
        with suppress(ProcessLookupError):
            os.killpg(self._leader.pid, signal.SIGKILL)  # also what has cleared its environment
        leftovers.kill(self._mark)
        self._leader.wait()
        self._screen.close()


def found(command: Sequence[str], path: str) -> None:
    """Check that the program exists.

    Raises:
        DeployError: it does not.
    """
    name = command[0]
    places = [Path(name)] if "/" in name else [Path(place) / name for place in path.split(os.pathsep)]
    if not any(place.is_file() and os.access(place, os.X_OK) for place in places):
        raise DeployError(f"there is no program {printable(name)!r} to grade: give its command after --")
