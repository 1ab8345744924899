"""Runs the real teleop, or another command, in a pseudo-terminal, and emulates the terminal."""

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

from bench.rig.program import end

ARE_YOU_THERE, I_AM = b"\x1b[5n", "\x1b[0n"


class Terminal:
    """A terminal on the event loop that reads output immediately and answers status queries.

    Args:
        columns: width of the terminal.
        rows: height of the terminal.
        see: called with every chunk of output.
    """

    def __init__(self, columns: int, rows: int, see: Callable[[bytes], object] = len) -> None:
        self._see = see
        self._master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        os.set_blocking(self._master, False)
        self.taken_bytes = 0
        asyncio.get_running_loop().add_reader(self._master, self._read)

    def _read(self) -> None:
        with suppress(OSError):
            data = os.read(self._master, 65536)
            self.taken_bytes += len(data)
            self._see(data)
            for _ in range(data.count(ARE_YOU_THERE)):
                self.type(I_AM)

    def type(self, keys: str) -> None:
        with suppress(BlockingIOError):
            os.write(self._master, keys.encode())

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        os.close(self._master)
        os.close(self.slave)


@contextmanager
def running(terminal: Terminal, *command: str, **environment: str) -> Generator[None]:
    """Run a command in `terminal` while the context is open, then close the terminal."""
    process = subprocess.Popen(
        command,
        stdin=terminal.slave,
        stdout=terminal.slave,
        stderr=terminal.slave,
        start_new_session=True,
        env=os.environ | {"TERM": "xterm-256color", "PYTHONIOENCODING": "utf-8"} | environment,
    )
    try:
        yield
    finally:
        end(process)
        terminal.close()


@contextmanager
def teleop(terminal: Terminal, *arguments: str) -> Generator[None]:
    """Run `python -m teleop` in `terminal` while the context is open, then close the terminal."""
    with running(terminal, sys.executable, "-m", "teleop", *arguments):
        yield
