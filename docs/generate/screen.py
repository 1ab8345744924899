"""Runs the real teleop, or another command, in a pseudo-terminal, and emulates the terminal and its screen."""

import asyncio
import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress

import pyte

from bench.rig.program import end

ARE_YOU_THERE, I_AM = b"\x1b[5n", "\x1b[0n"
PATIENCE_S = 60.0


class Screen:
    """A terminal on the event loop that reads output immediately, answers status queries, and emulates the screen.

    Args:
        columns: width of the terminal.
        rows: height of the terminal.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self.screen)
        self._changed = asyncio.Event()
        self._master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        os.set_blocking(self._master, False)
        asyncio.get_running_loop().add_reader(self._master, self._read)

    def _read(self) -> None:
        with suppress(OSError):
            data = os.read(self._master, 65536)
            self._stream.feed(data)
            self._changed.set()
            for _ in range(data.count(ARE_YOU_THERE)):
                self.type(I_AM)

    def type(self, keys: str) -> None:
        with suppress(BlockingIOError):
            os.write(self._master, keys.encode())

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        os.close(self._master)
        os.close(self.slave)

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until something about the screen is so.

        Raises:
            TimeoutError: it is not; the error has the screen.
        """
        try:
            async with asyncio.timeout(PATIENCE_S):
                while not condition():
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError as error:
            raise TimeoutError("\n".join(self.screen.display)) from error

    async def until_shows(self, *texts: str) -> None:
        """Wait until the screen shows some texts, whatever the spaces between their words.

        Raises:
            TimeoutError: it does not show them.
        """
        await self.until(
            lambda: all(text in " ".join(" ".join(self.screen.display).split()) for text in texts)
        )

    @property
    def rows(self) -> list[str]:
        """The lines, without spaces at their ends."""
        return [row.rstrip() for row in self.screen.display]


@contextmanager
def running(screen: Screen, *command: str, **environment: str) -> Generator[None]:
    """Run a command in a terminal while the context is open, then close the terminal."""
    process = subprocess.Popen(
        command,
        stdin=screen.slave,
        stdout=screen.slave,
        stderr=screen.slave,
        start_new_session=True,
        env=os.environ | {"TERM": "xterm-256color", "PYTHONIOENCODING": "utf-8"} | environment,
    )
    try:
        yield
    finally:
        end(process)
        screen.close()


@contextmanager
def teleop(screen: Screen, *arguments: str) -> Generator[None]:
    """Run `python -m teleop` in a terminal while the context is open, then close the terminal."""
    with running(screen, sys.executable, "-m", "teleop", *arguments):
        yield
