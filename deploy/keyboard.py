"""The real teleop on a pseudo-terminal, and a hand that types."""

import asyncio
import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress

from deploy.launch import Launch
from wire import topics

ROWS, COLUMNS = 24, 100
SCREEN_BYTES = 4096
END_LIMIT_S = 4.0
ESCAPE = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|[@-Z\\-_])")


class TypedTeleop:
    """A teleop process in its own terminal. Spawned, not forked: a fork would inherit our Zenoh session."""

    def __init__(self, launch: Launch, environment: dict[str, str]) -> None:
        self._master, slave = pty.openpty()
        self.screen = b""
        """The last of what it drew."""
        try:
            fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            self._child = subprocess.Popen(
                launch.command(topics.TELEOP),
                stdin=slave,
                stdout=slave,
                stderr=slave,
                start_new_session=True,
                env=os.environ | environment | {"TERM": "xterm-256color"},
            )
        except OSError:
            os.close(self._master)
            raise
        finally:
            os.close(slave)
        os.set_blocking(self._master, False)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._master, self._on_output)

    @property
    def running(self) -> bool:
        return self._child.poll() is None

    @property
    def last_line(self) -> str:
        """The last that it said, without colours and cursor movements."""
        text = ESCAPE.sub("", self.screen.decode(errors="replace"))
        return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "it said nothing")

    def press(self, keys: str) -> None:
        """Type, one key after the other."""
        with suppress(OSError):
            os.write(self._master, keys.encode())

    def send(self, number: signal.Signals) -> float:
        """Signal the process; returns the time just before."""
        now_s = time.monotonic()
        self._child.send_signal(number)
        return now_s

    async def close(self) -> None:
        """End the process, also a stopped one, and its terminal."""
        self._child.send_signal(signal.SIGTERM)
        self._child.send_signal(signal.SIGCONT)
        try:
            with suppress(subprocess.TimeoutExpired):
                await asyncio.to_thread(self._child.wait, END_LIMIT_S)
        finally:
            self._child.kill()
            self._child.wait()
            self._loop.remove_reader(self._master)
            os.close(self._master)

    def _on_output(self) -> None:
        try:
            self.screen = (self.screen + os.read(self._master, SCREEN_BYTES))[-SCREEN_BYTES:]
        except BlockingIOError:
            return
        except OSError:  # EIO: the other side is closed
            self._loop.remove_reader(self._master)


@asynccontextmanager
async def typing(launch: Launch, environment: dict[str, str]) -> AsyncGenerator[TypedTeleop]:
    """A teleop for a while."""
    teleop = TypedTeleop(launch, environment)
    try:
        yield teleop
    finally:
        await teleop.close()
