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


class Program:
    """A running instance of the program; it leads a session, and its terminal is the controlling terminal.

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
        self._screen = b""
        self._unread = b""
        self._holding: asyncio.TimerHandle | None = None
        self._terminal, program_side = pty.openpty()
        try:
            fcntl.ioctl(program_side, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            self._child = subprocess.Popen(
                ["setsid", "--ctty", *command],  # noqa: S607 - of util-linux; it replaces itself by the program
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

    @property
    def has_ended(self) -> bool:
        return self._child.poll() is not None

    @property
    def has_printed(self) -> bool:
        return bool(self._screen)

    @property
    def end(self) -> str:
        """How it ended, with its last lines, for people."""
        code = self._child.poll()
        text = ESCAPE.sub("", self._screen.decode(errors="replace"))
        lines = [printable(line.strip()) for line in text.splitlines() if line.strip()]
        how = "runs" if code is None else f"ended with code {code}"
        return f"it {how}, and its last lines are: {' | '.join(lines[-3:])[-LAST_CHARACTERS:] or 'none'}"

    def type(self, data: bytes) -> None:
        """Type bytes on its keyboard; a full or closed terminal drops them."""
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
            (os.killpg if self._whole_group else os.kill)(self._child.pid, number)
        return at_s

    def close(self) -> None:
        """Kill the program and everything that it started, and close its terminal."""
        self.let_go()
        leftovers.kill(self._mark)
        self._child.kill()  # also if it has cleared its environment
        self._child.wait()
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
