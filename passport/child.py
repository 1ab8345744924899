"""A program of the measurement in a process of its own, which ends with the measurement, even while it is stopped."""

import asyncio
import ctypes
import os
import signal
import subprocess
import sys
from contextlib import suppress

_PR_SET_PDEATHSIG = 1
READY = "ready"
"""The first line of a program that can work; any other is the reason why it cannot."""
END_LIMIT_S = 2.0


def die_with_parent(parent: int) -> None:
    """In the child: let the kernel kill this process when its parent ends.

    Args:
        parent: the pid of the parent, which may have ended already.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


def stop_with_stdin(stop: asyncio.Event) -> None:
    """In the child: set `stop` when stdin ends, because the measurement ends the program or has ended itself."""
    reading = asyncio.ensure_future(asyncio.to_thread(sys.stdin.read))
    reading.add_done_callback(lambda _: stop.set())


class Child:
    """A child process. The kernel kills it when this process ends; a terminal's Ctrl-C does not reach it.

    Args:
        command: the command line; the program calls `die_with_parent` with the pid that is added to it.
    """

    def __init__(self, command: list[str]) -> None:
        self._process = subprocess.Popen(
            [*command, str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        os.set_blocking(self._stdin.fileno(), False)

    async def first_line(self) -> str:
        """Return its first line, without the newline; empty if it has ended."""
        return (await asyncio.to_thread(self._stdout.readline)).decode(errors="replace").strip()

    def order(self, line: str) -> None:
        """Send a line; one that does not fit or finds no reader is lost."""
        with suppress(OSError):
            os.write(self._stdin.fileno(), f"{line}\n".encode())

    def send(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            self._process.send_signal(number)

    async def end(self, limit_s: float = END_LIMIT_S) -> None:
        """Close its stdin, wait, and kill it after a limit."""
        self._stdin.close()
        try:
            with suppress(subprocess.TimeoutExpired):
                await asyncio.to_thread(self._process.wait, limit_s)
        finally:
            self._process.kill()
            self._process.wait()
            self._stdout.close()
