"""Runs the real teleop on pseudo-terminals, types keys, and can hang up the terminals."""

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
from collections.abc import Callable
from contextlib import suppress

ROWS, COLUMNS = 24, 100
SCREEN_BYTES = 4096
BUFFER_READS = 16
"""Of `SCREEN_BYTES`: three times what the kernel keeps of a terminal's output. A limit, because the program may still print."""
END_LIMIT_S = 4.0
REQUEST, REPLY = b"\x1b[5n", b"\x1b[0n"
"""A status request of the program, and the terminal's reply."""
ESCAPE = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|[@-Z\\-_])")


def requests_in(output: bytes) -> tuple[int, bytes]:
    """Return the number of status requests, and the last bytes, which may be the beginning of another one."""
    *requests, rest = output.split(REQUEST)
    return len(requests), rest[1 - len(REQUEST) :]


class Screen:
    """What a program prints on a pseudo-terminal, which answers each status request.

    Args:
        terminal: our side of it.
        reply: types an answer.
    """

    def __init__(self, terminal: int, reply: Callable[[bytes], None]) -> None:
        self._terminal, self._reply = terminal, reply
        self._loop = asyncio.get_running_loop()
        self.output = b""
        """The last bytes of the output."""
        self._unread = b""
        """The end of the output, which may be the beginning of a status request."""
        self._is_closed = False
        os.set_blocking(terminal, False)
        self._loop.add_reader(terminal, self._on_output)

    @property
    def last_lines(self) -> str:
        """The last three non-empty lines, without escape sequences, including output that the event loop has not read yet."""
        for _ in range(0 if self._is_closed else BUFFER_READS):
            self._on_output()
        text = ESCAPE.sub("", self.output.decode(errors="replace"))
        return " | ".join([line.strip() for line in text.splitlines() if line.strip()][-3:]) or "no output"

    def close(self) -> None:
        """Close the terminal."""
        self._is_closed = True
        self._loop.remove_reader(self._terminal)
        os.close(self._terminal)

    def _on_output(self) -> None:
        try:
            data = os.read(self._terminal, SCREEN_BYTES)
        except BlockingIOError:
            return
        except OSError:  # EIO: the other side is closed
            self._loop.remove_reader(self._terminal)
            return
        self.output = (self.output + data)[-SCREEN_BYTES:]
        requests, self._unread = requests_in(self._unread + data)
        if requests:
            self._reply(REPLY * requests)


class TypedTeleop:
    """The process of teleop, or of another program that reads keys. Its keys and its screen are two terminals, which can be closed separately.

    It is spawned, not forked: a fork would inherit this process's Zenoh session.

    Args:
        command: the command line of teleop.
        environment: its complete environment.
    """

    def __init__(self, command: list[str], environment: dict[str, str]) -> None:
        self._keys, keys_slave = pty.openpty()
        self._display, display_slave = pty.openpty()
        self._masters = [self._keys, self._display]
        try:
            fcntl.ioctl(display_slave, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            self._child = subprocess.Popen(
                command,
                stdin=keys_slave,
                stdout=display_slave,
                stderr=display_slave,
                start_new_session=True,
                env=environment | {"TERM": "xterm-256color"},
            )
        except OSError:
            for descriptor in self._masters:
                os.close(descriptor)
            raise
        finally:
            os.close(keys_slave)
            os.close(display_slave)
        os.set_blocking(self._keys, False)
        self._screen = Screen(self._display, self._type)

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def running(self) -> bool:
        return self._child.poll() is None

    @property
    def last_lines(self) -> str:
        return self._screen.last_lines

    def press(self, keys: str) -> None:
        """Type the keys in order."""
        self._type(keys.encode())

    def _type(self, data: bytes) -> None:
        if self._keys in self._masters:
            with suppress(OSError):
                os.write(self._keys, data)

    def send(self, number: signal.Signals) -> float:
        """Signal the process; return the time just before."""
        now_s = time.monotonic()
        with suppress(ProcessLookupError):
            self._child.send_signal(number)
        return now_s

    def end_input(self) -> float:
        """Close the keys' terminal and keep the screen; return the time just before."""
        now_s = time.monotonic()
        self._shut(self._keys)
        return now_s

    def hang_up(self) -> float:
        """Close both terminals like a closed window (the kernel sends SIGHUP); return the time just before."""
        now_s = time.monotonic()
        self._shut(self._display)
        self._shut(self._keys)
        return now_s

    async def close(self) -> None:
        """End the process, even a suspended one, and close its terminals."""
        self.send(signal.SIGTERM)
        self.send(signal.SIGCONT)
        try:
            with suppress(subprocess.TimeoutExpired):
                await asyncio.to_thread(self._child.wait, END_LIMIT_S)
        finally:
            self._child.kill()
            self._child.wait()
            self._shut(self._display)
            self._shut(self._keys)

    def _shut(self, descriptor: int) -> None:
        if descriptor in self._masters:
            self._masters.remove(descriptor)
            if descriptor == self._display:
                self._screen.close()
            else:
                os.close(descriptor)
