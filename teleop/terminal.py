"""The terminal itself: cbreak mode, bytes in, line out, restored at the end.

Nothing here blocks the loop, and nothing but the terminal's modes is changed, so that even after a SIGKILL a
shell is usable. A terminal that is gone is the end of the keys, not an error.
"""

import asyncio
import os
import select
import termios
from types import TracebackType
from typing import Self

from teleop.display import Line, Tone
from teleop.keys import KeyDecoder

READ_BYTES = 1024
MAX_READS = 16
"""For each take: a flood of input does not hold up the heartbeat."""

_COLOURS = {Tone.PLAIN: "", Tone.GOOD: "\x1b[32m", Tone.CAUTION: "\x1b[1;33m", Tone.STOP: "\x1b[1;31m"}
_NO_COLOUR = "\x1b[0m"
_CLEAR = "\r\x1b[K"


def is_terminal() -> bool:
    """Whether there is a person at both ends: keys to read and a line to see."""
    return os.isatty(0) and os.isatty(1)


class Terminal:
    """Standard input and output as key source and screen; a context manager that restores the terminal."""

    def __init__(self, wake: asyncio.Event) -> None:
        self._wake = wake
        self._decoder = KeyDecoder()
        self._ended = False
        self._shown: str = ""
        self._pending: str = ""
        self._is_dumb = os.environ.get("TERM", "dumb") == "dumb"
        self._has_colours = not self._is_dumb and not os.environ.get("NO_COLOR")

    def __enter__(self) -> Self:
        self._saved = termios.tcgetattr(0)
        self._out = _open_output()
        self._watched = asyncio.get_running_loop()
        try:
            termios.tcsetattr(0, termios.TCSANOW, _cbreak(self._saved))
            self._watched.add_reader(0, self._wake.set)
        except BaseException:
            self._restore()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._watched.remove_reader(0)
        self._write(self._pending + self._clear)  # what it showed is no longer so
        self._restore()

    @property
    def ended(self) -> bool:
        return self._ended

    @property
    def width(self) -> int:
        """One less than the columns: a character in the last one would leave the cursor undecided."""
        try:
            return max(1, os.get_terminal_size(1).columns - 1)
        except OSError:
            return 79

    def take(self) -> list[str]:
        keys: list[str] = []
        for _ in range(MAX_READS):
            if self._ended or not select.select([0], [], [], 0)[0]:
                break
            try:
                data = os.read(0, READ_BYTES)
            except OSError:  # EIO: the terminal is gone
                data = b""
            if not data:
                self._end()
            keys += self._decoder.feed(data)
        return keys

    def show(self, line: Line) -> bool:
        text = "".join(self._coloured(segment.text, segment.tone) for segment in line)
        if text == self._shown and not self._pending:
            return self._is_writable()
        if not self._write(self._pending + self._clear + text):
            return False
        self._shown, self._pending = text, ""
        return True

    def note(self, text: str) -> None:
        """Kept until the terminal takes output, with the next line."""
        self._pending += f"{self._clear}{text}\n"
        if self._write(self._pending + self._shown):
            self._pending = ""

    @property
    def _clear(self) -> str:
        return f"\r{' ' * self.width}\r" if self._is_dumb else _CLEAR

    def _coloured(self, text: str, tone: Tone) -> str:
        colour = _COLOURS[tone] if self._has_colours else ""
        return f"{colour}{text}{_NO_COLOUR}" if colour else text

    def _is_writable(self) -> bool:
        return bool(select.select([], [self._out], [], 0)[1])

    def _write(self, text: str) -> bool:
        data = text.encode(errors="replace")
        try:
            return self._is_writable() and os.write(self._out, data) == len(data)
        except BlockingIOError:
            return False
        except OSError:  # EIO: the terminal is gone
            self._end()
            return False

    def _end(self) -> None:
        """A terminal at its end is always readable: it must not be watched any more."""
        if not self._ended:
            self._ended = True
            self._watched.remove_reader(0)
            self._wake.set()

    def _restore(self) -> None:
        """At once, without waiting for output to drain; keys that nobody took do not reach the shell."""
        try:
            termios.tcflush(0, termios.TCIFLUSH)
            termios.tcsetattr(0, termios.TCSANOW, self._saved)
        except termios.error:  # the terminal is gone
            pass
        finally:
            os.close(self._out)


def _open_output() -> int:
    """The terminal behind standard output, opened anew: its O_NONBLOCK is not shared with the shell."""
    try:
        return os.open(os.ttyname(1), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return os.dup(1)


def _cbreak(saved: list[int | list[bytes | int]]) -> list[int | list[bytes | int]]:
    r"""Keys at once and without echo; Ctrl-C stays a signal.

    Ctrl-S must not freeze the line and Ctrl-Z not the heartbeat; Ctrl-\ still kills a teleop that hangs.
    """
    iflag, oflag, cflag, lflag, ispeed, ospeed, cc = saved
    assert isinstance(iflag, int)
    assert isinstance(lflag, int)
    assert isinstance(cc, list)
    control = list(cc)
    control[termios.VMIN], control[termios.VTIME] = 1, 0
    control[termios.VSUSP] = b"\x00"
    return [
        iflag & ~termios.IXON,
        oflag,
        cflag,
        lflag & ~(termios.ICANON | termios.ECHO),
        ispeed,
        ospeed,
        control,
    ]
