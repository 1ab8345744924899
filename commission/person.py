"""The person at the terminal: what is shown, lines that answer questions, and any key that aborts a drive."""

import os
import signal
import sys
import termios
import tty
from contextlib import suppress
from types import TracebackType
from typing import Protocol, Self

from deploy.stack.console import StatusLine
from wire.text import printable

READ_BYTES = 256
LONGEST_LINE = 64
_ENTER, _ERASE = "\r\n", "\x7f\b"


class LineEditor:
    """Makes lines of typed characters; pure."""

    def __init__(self) -> None:
        self.text = ""
        """The line so far."""

    def feed(self, typed: str) -> str | None:
        """Add typed characters; return the line if Enter is among them, and discard what follows it."""
        for character in typed:
            if character in _ENTER:
                line, self.text = self.text.strip(), ""
                return line
            if character in _ERASE:
                self.text = self.text[:-1]
            elif character.isprintable() and len(self.text) < LONGEST_LINE:
                self.text += character
        return None


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

    def echo(self, text: str, *, ends: bool = False) -> None:
        """Show the line that is being typed, and end it with Enter."""
        ...

    def take(self) -> str:
        """Return the characters that were typed since the last call."""
        ...


class TerminalPerson:
    """The person at the terminal on standard input and output, whose keys are neither echoed nor waited for.

    A context manager that restores the terminal. Ctrl-C stays a signal.
    """

    def __init__(self) -> None:
        self._status = StatusLine()
        self.has_ended = False

    def __enter__(self) -> Self:
        # In the background, a read then fails instead of stopping this process and its heartbeat.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
        self._modes = termios.tcgetattr(0)
        tty.setcbreak(0)
        os.set_blocking(0, False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._status.clear()
        os.set_blocking(0, True)
        with suppress(termios.error, OSError):
            termios.tcsetattr(0, termios.TCSAFLUSH, self._modes)

    def say(self, sentence: str) -> None:
        self._status.say(f"lifeline: {sentence}")

    def show(self, line: str) -> None:
        self._status.show(line)

    def echo(self, text: str, *, ends: bool = False) -> None:
        end = "\n" if ends else ""
        sys.stdout.write(f"\r\x1b[K> {printable(text)}{end}")
        sys.stdout.flush()

    def take(self) -> str:
        try:
            data = os.read(0, READ_BYTES)
        except BlockingIOError:
            return ""
        except OSError:
            data = b""
        if not data:
            self.has_ended = True
        return data.decode("utf-8", "replace")
