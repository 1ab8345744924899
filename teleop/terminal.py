"""The terminal: keys in, pictures out, restored at the end.

Nothing here blocks the loop. Output that the terminal does not accept is kept and written later; no new picture is begun
before that. A closed terminal is the end of the keys, not an error.
"""

import asyncio
import math
import os
import select
import signal
import termios
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import FrameType, TracebackType
from typing import NoReturn, Protocol, Self

from teleop.guards import Pulse
from teleop.pilots.keys import CTRL_Z, UNFINISHED, KeyDecoder, ReportKind, TypedKeys
from teleop.pilots.pilot import KeyEvent
from teleop.screen.output import FrameWriter
from teleop.screen.view import Line, Tone
from teleop.terminal_guard import BY_PARENT, Modes, TerminalGuard

READ_BYTES = 1024
MAX_READS = 16
"""Maximum number of reads per take, so that a flood of input does not delay the heartbeat."""
UNFINISHED_S = 0.1
"""A key sequence that is unfinished for longer is an Escape that was pressed, or unknown."""
LAST_WORDS = 5
"""Number of notes that are printed again after the picture is removed."""
LEAVE_LIMIT_S = 0.3
ANSWER_LIMIT_S = 0.15
"""How long to wait at the end for replies of the terminal: a later reply would go to the shell as input."""

WHEEL_TRIES = 10
"""Number of unanswered requests for the wheel's mode: some terminals without such requests print a part of them."""

_ASK, _ASK_WHEEL, _ASK_KEYBOARD = "\x1b[5n", "\x1b[?1007$p", "\x1b[?u"
"""Requests for the terminal's status, for the mode of its wheel, and for the keyboard flags of the kitty protocol."""
_NO_MOUSE = "".join(f"\x1b[?{mode}l" for mode in (9, 1000, 1001, 1002, 1003, 9001))
"""Switch off what an earlier program may have left on: mouse reports, and win32-input-mode."""
_MARK_PASTE = "\x1b[?2004h"
_TYPED = f"{_MARK_PASTE}\x1b[?1004h\x1b[?1007l{_NO_MOUSE}"
_NOT_TYPED = "\x1b[?2004l\x1b[?1004l\x1b[?1007h"
"""Let the terminal mark pasted text and report the keyboard focus, and keep the mouse from sending keys; restore the usual modes."""
_ENTER = f"\x1b[?1049h\x1b[?25l{_TYPED}"
_LEAVE = f"{_NOT_TYPED}\x1b[?2026l\x1b[?7h\x1b[0m\x1b[?25h\x1b[?1049l"
"""Also resets the modes that a picture sets, because the last picture may be incomplete."""
_KITTY_FLAGS = 1 | 2 | 4 | 8
"""Report every key as a sequence, with its release, and with its position on the US layout."""
_KITTY_NEEDED = 2 | 8
_PUSH, _POP = f"\x1b[>{_KITTY_FLAGS}u", "\x1b[<u"
RESTORE = _POP + _LEAVE
"""Sequences that restore the terminal after teleop was killed.
They have no effect on a shell's main screen, which has its own keyboard flags."""
_COLOURS = {Tone.GOOD: "\x1b[32m", Tone.CAUTION: "\x1b[1;33m", Tone.STOP: "\x1b[1;31m"}
_NO_COLOUR = "\x1b[0m"
_CLEAR = "\r\x1b[K"


def is_terminal() -> bool:
    """Return whether standard input and output are terminals."""
    return os.isatty(0) and os.isatty(1)


def is_dumb() -> bool:
    """Return whether the terminal has no control sequences (TERM)."""
    return os.environ.get("TERM", "dumb") == "dumb"


class OnReleases(Protocol):
    """Callback with whether the terminal reports key releases; called on every change."""

    def __call__(self, *, reported: bool) -> None: ...


class Terminal:
    """Standard input and output as key source and screen; a context manager that restores the terminal.

    Args:
        wake: set when there are keys to take.
        plain: show one line at the bottom with notes above it, instead of using the whole screen.
        on_releases: for control by holding; called with whether the terminal reports key releases. They count only
            on a terminal that answers status requests: behind a dead link, the release of a key never arrives.
        on_answer: called when the terminal answers its first status request.
    """

    def __init__(
        self,
        wake: asyncio.Event,
        *,
        plain: bool,
        on_releases: OnReleases | None = None,
        on_answer: Callable[[], None] | None = None,
    ) -> None:
        self._wake, self._on_releases, self._on_answer = wake, on_releases, on_answer
        self._decoder, self._typed_keys = KeyDecoder(), TypedKeys()
        self.ended = False
        self._has_terminal = False
        self._guard: TerminalGuard | None = None
        self._typed: list[KeyEvent] = []
        """Keys that arrived as signals."""
        self._backlog = b""
        dumb = self._is_dumb = is_dumb()
        colours = not dumb and not os.environ.get("NO_COLOR")
        self._face = _PlainFace(is_dumb=dumb, colours=colours) if plain else _FullFace(colours=colours)
        self._pulse = Pulse()
        self._has_pushed = False
        self._flags, self._wheel_mode, self._wheel_asks = 0, 0, 0
        """The keyboard flags and the wheel's mode that were reported since the last reply to a status request, and the number of
        requests for the wheel's mode since its last report."""
        self._unfinished_s = math.inf
        """Time at which an unfinished key sequence stops the robot."""

    def __enter__(self) -> Self:
        self._loop = asyncio.get_running_loop()
        self._saved = termios.tcgetattr(0)
        self._ours = _cbreak(self._saved)
        self._out = _open_output()
        if BY_PARENT not in os.environ:
            ending = RESTORE if self._face.is_full else f"{self._face.leave}\r\n"
            self._guard = TerminalGuard(self._out, self._saved, self._ours, ending)
        try:
            self._begin()
        except BaseException:
            self._restore()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._leave()
        os.close(self._out)

    @property
    def size(self) -> tuple[int, int]:
        """Number of columns and rows."""
        with suppress(OSError):
            size = os.get_terminal_size(1)
            if size.columns > 0 and size.lines > 0:
                return size.columns, size.lines
        return 80, 24

    def take(self) -> list[KeyEvent]:
        self._keep_modes()
        signalled, self._typed = self._typed, []
        keys: list[KeyEvent] = []
        for _ in range(MAX_READS):
            if self.ended or not select.select([0], [], [], 0)[0]:
                break
            try:
                data = os.read(0, READ_BYTES)
            except OSError:  # EIO: the terminal is closed
                data = b""
            if not data:
                self._end()
            self._unfinished_s = self._loop.time() + UNFINISHED_S
            keys += self._decoded(data)
        if self._decoder.is_unfinished and self._loop.time() > self._unfinished_s:
            self._unfinished_s = math.inf
            keys.append(KeyEvent(UNFINISHED))
        return [*signalled, *self._typed_keys.take(keys, self._loop.time())]

    def show(self, lines: Sequence[Line]) -> bool:
        if not self._flush():
            return False
        text, now_s = self._face.picture(lines, *self.size), self._loop.time()
        is_lost = self._pulse.is_lost(now_s)
        if not self._is_dumb and self._pulse.is_due(now_s):
            self._pulse.ask(now_s)
            # Another program may have disabled the marks of pasted text.
            text += self._questions() + _MARK_PASTE + _ASK
        return (self._write(text) if text else self._is_writable()) and not is_lost

    def note(self, text: str) -> None:
        self._write(self._face.note(text, self.size[0]))

    def bell(self) -> None:
        self._write("\a")

    def doubt(self) -> None:
        self._pulse.doubt(self._loop.time())

    def suspend(self) -> None:
        """Suspend all processes of the job like Ctrl-Z; return when this process continues.

        Suspending only this process is not enough: a parent process that waits for it would keep the terminal.
        """
        self._leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(0, signal.SIGTSTP)
        self._begin()

    # --- keys

    def _decoded(self, data: bytes) -> list[KeyEvent]:
        keys: list[KeyEvent] = []
        for event in self._decoder.feed(data):
            if isinstance(event, KeyEvent):
                keys.append(event._replace(is_old=not self._pulse.is_live(self._loop.time())))
            elif event.kind is ReportKind.KEYBOARD_FLAGS:
                self._on_keyboard_flags(event.value)
            elif event.kind is ReportKind.WHEEL_MODE:
                self._wheel_mode, self._wheel_asks = event.value, 0
            else:
                self._on_status()
        return keys

    def _questions(self) -> str:
        """Return the requests whose replies precede that to the status request: what teleop relies on may change."""
        text = _ASK_KEYBOARD if self._has_pushed else ""
        if self._on_releases is not None and self._wheel_asks < WHEEL_TRIES:
            self._wheel_asks += 1
            text += _ASK_WHEEL
            if self._wheel_asks == WHEEL_TRIES:
                self._face.forget()  # the next picture removes what the terminal may have printed
        return text

    def _on_status(self) -> None:
        """Handle a reply to a status request. Only what was reported just before it counts."""
        is_first = not self._pulse.answers
        self._pulse.answer(self._loop.time())
        if is_first and self._pulse.answers and self._on_answer is not None:
            self._on_answer()
        if self._on_releases is not None:
            self._rely(flags=self._flags, wheel_mode=self._wheel_mode)

    def _on_keyboard_flags(self, flags: int) -> None:
        """Handle a report of the kitty protocol's flags: request key releases, and note whether they are active."""
        if self._has_pushed:
            self._flags, self._decoder.tells_releases = flags, _tells_releases(flags)
        elif self._has_terminal and self._face.is_full and self._on_releases is not None:
            self._has_pushed = True
            self._write(_PUSH)

    def _rely(self, *, flags: int = 0, wheel_mode: int = 0) -> None:
        """Rely on key releases and arrow keys only if the terminal reports the modes that they need."""
        self._flags = self._wheel_mode = 0
        self._decoder.tells_releases = _tells_releases(flags)
        self._decoder.doubts_arrows = self._on_releases is not None and not wheel_mode
        if self._on_releases is not None:
            self._on_releases(reported=_tells_releases(flags) and self._pulse.answers)
            self._wake.set()

    def _on_signal(self, key: str) -> None:
        self._typed.append(KeyEvent(key))
        self._wake.set()

    # --- modes

    def _begin(self) -> None:
        self._face.forget()
        self._enter()
        self.doubt()
        self._loop.add_reader(0, self._wake.set)
        self._loop.add_signal_handler(signal.SIGTSTP, self._on_signal, CTRL_Z)
        self._loop.add_signal_handler(signal.SIGCONT, self._on_continue)
        self._loop.add_signal_handler(signal.SIGWINCH, self._face.forget)
        signal.signal(signal.SIGQUIT, self._on_quit)

    def _enter(self) -> None:
        self._has_terminal = True
        if self._guard is not None:
            self._guard.tell(has_terminal=True)
        self._keep_modes()
        hold = self._face.is_full and self._on_releases is not None
        self._has_pushed, self._wheel_asks = False, 0
        self._decoder = KeyDecoder()  # another program may have read the report that the focus is back
        self._rely()
        self._write(self._face.enter + (_ASK_KEYBOARD if hold else ""))

    def _keep_modes(self) -> None:
        """Set the modes again if another program has changed them: otherwise, a SPACE may wait for Enter."""
        with suppress(termios.error):  # the terminal is closed, which the next read reports
            if self._has_terminal and termios.tcgetattr(0) != self._ours:
                termios.tcsetattr(0, termios.TCSANOW, self._ours)

    def _on_continue(self) -> None:
        """Set up the terminal again after an external stop and continue: another program may have changed it."""
        if self._has_terminal:
            if self._has_pushed:
                self._write(_POP)
            self._face.forget()
            self._enter()
            self.doubt()

    def _on_quit(self, _number: int, _frame: FrameType | None) -> NoReturn:
        r"""Handle Ctrl-\: end immediately with the terminal restored, even if the loop hangs."""
        self._leave()
        os._exit(128 + signal.SIGQUIT)

    def _leave(self) -> None:
        self._has_terminal = False
        with suppress(OSError):
            self._loop.remove_reader(0)
        for number in (signal.SIGTSTP, signal.SIGCONT, signal.SIGWINCH):
            self._loop.remove_signal_handler(number)
        signal.signal(signal.SIGQUIT, signal.SIG_DFL)
        ending = self._face.leave + self._face.ending(self.size[0])
        if self._has_pushed:
            ending = _POP + ending
        self._rely()
        self._has_pushed = False
        self._write_for_certain(ending)
        self._await_answers()
        self._restore()
        if self._guard is not None:
            self._guard.tell(has_terminal=False)

    def _await_answers(self) -> None:
        """Read pending replies of the terminal, so that they do not go to the shell."""
        deadline_s = time.monotonic() + ANSWER_LIMIT_S
        while not self.ended and self._pulse.answers and self._pulse.open:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0 or not select.select([0], [], [], left_s)[0]:
                return
            self.take()

    def _restore(self) -> None:
        """Restore the modes immediately, without waiting for pending output; discard unread keys."""
        with suppress(termios.error):  # the terminal is closed
            termios.tcflush(0, termios.TCIFLUSH)
            termios.tcsetattr(0, termios.TCSANOW, self._saved)

    # --- output

    def _is_writable(self) -> bool:
        return bool(select.select([], [self._out], [], 0)[1])

    def _write(self, text: str) -> bool:
        """Write pending output and this text; return False if the terminal has not accepted all of it yet."""
        self._backlog += text.encode(errors="replace")
        return self._flush()

    def _flush(self) -> bool:
        try:
            if self._backlog and self._is_writable():
                self._backlog = self._backlog[os.write(self._out, self._backlog) :]
        except BlockingIOError:
            pass
        except OSError:  # EIO: the terminal is closed
            self._end()
            return False
        return not self._backlog

    def _write_for_certain(self, text: str) -> None:
        """Write the last output within a time limit; pending output is discarded if necessary."""
        if not self._flush():
            with suppress(termios.error):
                termios.tcflush(self._out, termios.TCOFLUSH)
            self._backlog = b""
        self._backlog += text.encode(errors="replace")
        deadline_s = time.monotonic() + LEAVE_LIMIT_S
        while not self.ended and not self._flush() and (left_s := deadline_s - time.monotonic()) > 0:
            select.select([], [self._out], [], left_s)
        self._backlog = b""

    def _end(self) -> None:
        """Stop watching a closed terminal, because it is always readable."""
        if not self.ended:
            self.ended = True
            self._loop.remove_reader(0)
            self._wake.set()


class _FullFace:
    """Output on the whole screen."""

    is_full = True
    enter, leave = _ENTER, _LEAVE

    def __init__(self, *, colours: bool) -> None:
        self._writer = FrameWriter(colours=colours)
        self._notes: deque[str] = deque(maxlen=LAST_WORDS)

    def forget(self) -> None:
        self._writer.forget()

    def picture(self, lines: Sequence[Line], columns: int, rows: int) -> str:
        return self._writer.frame(lines, columns, rows)

    def note(self, text: str, _columns: int) -> str:
        """Store the note for the end; the picture shows it as well."""
        self._notes.append(f"{time.strftime('%H:%M:%S')} {text}")
        return ""

    def ending(self, _columns: int) -> str:
        """Return the last notes, once."""
        text = "".join(f"{note}\n" for note in self._notes)
        self._notes.clear()
        return text


class _PlainFace:
    """Output of one line, with notes above it."""

    is_full = False

    def __init__(self, *, is_dumb: bool, colours: bool) -> None:
        self._is_dumb, self._has_colours = is_dumb, colours
        self.enter, self.leave = ("", "") if is_dumb else (_TYPED, _NOT_TYPED)
        self._shown = ""

    def forget(self) -> None:
        self._shown = ""

    def picture(self, lines: Sequence[Line], columns: int, _rows: int) -> str:
        text = "".join(self._coloured(segment.text, segment.tone) for line in lines[:1] for segment in line)
        if text == self._shown:
            return ""
        self._shown = text
        return self._clear(columns) + text

    def note(self, text: str, columns: int) -> str:
        return f"{self._clear(columns)}{text}\n{self._shown}"

    def ending(self, columns: int) -> str:
        """Clear the line, because it is outdated."""
        return self._clear(columns)

    def _clear(self, columns: int) -> str:
        return f"\r{' ' * (columns - 1)}\r" if self._is_dumb else _CLEAR

    def _coloured(self, text: str, tone: Tone) -> str:
        colour = _COLOURS.get(tone, "") if self._has_colours else ""
        return f"{colour}{text}{_NO_COLOUR}" if colour else text


def _open_output() -> int:
    """Open the terminal of standard output again, so that O_NONBLOCK is not shared with the shell."""
    try:
        return os.open(os.ttyname(1), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return os.dup(1)


def _tells_releases(flags: int) -> bool:
    """Return whether the terminal reports the release of each key with these flags of the kitty protocol."""
    return flags & _KITTY_NEEDED == _KITTY_NEEDED


def _cbreak(saved: Modes) -> Modes:
    r"""Return modes for unbuffered keys of 8 bits without echo; Ctrl-C, Ctrl-Z and Ctrl-\ stay signals, Ctrl-S is disabled."""
    iflag, oflag, cflag, lflag, ispeed, ospeed, cc = saved
    assert isinstance(iflag, int)
    assert isinstance(lflag, int)
    assert isinstance(cc, list)
    control = list(cc)
    control[termios.VMIN], control[termios.VTIME] = 1, 0
    return [
        iflag & ~(termios.IXON | termios.ISTRIP),
        oflag,
        cflag,
        lflag & ~(termios.ICANON | termios.ECHO),
        ispeed,
        ospeed,
        control,
    ]
