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
from deploy.stack.keyboard import COLUMNS, ESCAPE, REPLY, ROWS, SCREEN_BYTES, requests_in
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
        self._loop = asyncio.get_running_loop()
        self._mark = environment[leftovers.MARK]
        self._whole_group = whole_group
        self.greets = False
        """Whether it has printed anything before the first key; a terminal echoes keys."""
        self._has_keys = False
        self._screen = b""
        self._unread = b""
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
        os.set_blocking(self._terminal, False)
        self._loop.add_reader(self._terminal, self._on_output)

    def _pid_and_code(self) -> list[int]:
        """Return the program's pid once it has started, and then its exit code once it has ended."""
        news = self._news.read_text() if self._news.exists() else ""
        return [int(line) for line in news.splitlines()]

    @property
    def has_ended(self) -> bool:
        return len(self._pid_and_code()) > 1 or self._leader.poll() is not None

    @property
    def end(self) -> str:
        """How it ended, with its last lines, for people."""
        codes = self._pid_and_code()[1:]
        text = ESCAPE.sub("", self._screen.decode(errors="replace"))
        lines = [printable(line.strip()) for line in text.splitlines() if line.strip()]
        how = f"ended with code {codes[0]}" if codes else "runs"
        return f"it {how}, and its last lines are: {' | '.join(lines[-3:])[-LAST_CHARACTERS:] or 'none'}"

    def type(self, data: bytes) -> None:
        """Type bytes on its keyboard; a full or closed terminal drops them."""
        self._has_keys = self._has_keys or bool(data)
        with suppress(OSError):
            os.write(self._terminal, data)

    def hold(self, key: bytes) -> None:
        """Hold a key down until `let_go`."""
        self.type(key)
        self._holding = self._loop.call_later(REPEAT_S, self.hold, key)

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
        self._loop.remove_reader(self._terminal)
        os.close(self._terminal)

    def _on_output(self) -> None:
        try:
            data = os.read(self._terminal, SCREEN_BYTES)
        except BlockingIOError:
            return
        except OSError:  # EIO: the program has closed its side
            self._loop.remove_reader(self._terminal)
            return
        self.greets = self.greets or not self._has_keys
        self._screen = (self._screen + data)[-SCREEN_BYTES:]
        requests, self._unread = requests_in(self._unread + data)
        if requests:
            self.type(REPLY * requests)


def found(command: Sequence[str], path: str) -> None:
    """Check that the program exists.

    Raises:
        DeployError: it does not.
    """
    name = command[0]
    places = [Path(name)] if "/" in name else [Path(place) / name for place in path.split(os.pathsep)]
    if not any(place.is_file() and os.access(place, os.X_OK) for place in places):
        raise DeployError(f"there is no program {printable(name)!r} to grade: give its command after --")
