"""The person at the terminal: what is shown, lines that answer questions, and any key that aborts a drive."""

import os
import select
import signal
import termios
import tty
from contextlib import suppress
from types import TracebackType
from typing import Protocol, Self

from deploy.stack.console import StatusLine

READ_BYTES = 1024


class Person(Protocol):
    """A person who is shown what happens, and who types."""

    has_ended: bool
    """Whether the person has left: nothing more will be typed."""

    def say(self, sentence: str) -> None:
        """Print a sentence that stays visible."""
        ...

    def show(self, line: str) -> None:
        """Show a line in place of the previous one."""
        ...

    def expect(self, *, line: bool) -> None:
        """Discard what was typed before, and take a line that ends with Enter from now on, or each key at once."""
        ...

    def take(self) -> str:
        """Return the line or the keys that were typed since the last call; empty if there is none."""
        ...


class TerminalPerson:
    """The person at the terminal on standard input and output, who is never waited for.

    A context manager that restores the terminal. Ctrl-C stays a signal.
    """

    def __init__(self) -> None:
        self._status = StatusLine()
        self.has_ended = False

    def __enter__(self) -> Self:
        # In the background, a read then fails instead of stopping this process and its heartbeat.
        for number in (signal.SIGTTIN, signal.SIGTTOU):
            signal.signal(number, signal.SIG_IGN)
        self._modes = termios.tcgetattr(0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(termios.error, OSError):  # the terminal may be closed
            termios.tcsetattr(0, termios.TCSAFLUSH, self._modes)
            self._status.clear()

    def say(self, sentence: str) -> None:
        with suppress(OSError):  # the terminal is closed, which the next read reports
            self._status.say(f"lifeline: {sentence}")

    def show(self, line: str) -> None:
        with suppress(OSError):
            self._status.show(line)

    def expect(self, *, line: bool) -> None:
        with suppress(termios.error):
            if line:
                termios.tcsetattr(0, termios.TCSAFLUSH, self._modes)
            else:
                tty.setcbreak(0, termios.TCSAFLUSH)

    def take(self) -> str:
        if not select.select([0], [], [], 0)[0]:
            return ""
        data = b""
        with suppress(OSError):  # the terminal is closed, or in the background
            data = os.read(0, READ_BYTES)
        self.has_ended = self.has_ended or not data
        return data.decode("utf-8", "replace")
