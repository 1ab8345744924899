r"""The terminal's bytes -> keys, and the keys for the program itself; the pilots define the keys for motion.

Cursor and function keys arrive as escape sequences, in one or several pieces. Their letters must not drive the robot
("\x1b[D" is not "D"). With the kitty keyboard protocol, every key arrives as a sequence with its event:

    ESC [ code : shifted : base ; modifiers : event u       any key; event 1 press, 2 repeat, 3 release
    ESC [ 1 ; modifiers : event A                           likewise the arrows and some more

xterm's modifyOtherKeys, which another program may have left on, reports keys as ESC [ 27 ; modifiers ; code ~.

A SPACE and a Ctrl-C are always recognised: as plain bytes, they are not part of any sequence, and as sequences, they
begin with an ESC, which ends every unfinished sequence. A stray ESC therefore never swallows the emergency stop. Each
space character of Unicode (category Zs) is the SPACE. Input that no person typed is not decoded to its keys but to a key
that says what it is (`NOT_TYPED`); no pilot knows these keys, and what a pilot does not know stops the robot.
"""

import codecs
import math
import re
import sys
import unicodedata
from collections import deque
from collections.abc import Iterator, Sequence
from enum import Enum, StrEnum, auto
from itertools import islice
from typing import NamedTuple, Protocol

from teleop.pilots.pilot import KeyEvent, KeyKind


class KeySource(Protocol):
    """Interface to a source of keys. It sets the `wake` of its user when there are keys, or when they end."""

    @property
    def ended(self) -> bool:
        """Whether there will be no more keys."""
        ...

    def take(self) -> Sequence[KeyEvent]:
        """Return all key events since the last call; never blocks."""
        ...


class Command(StrEnum):
    """Commands to the program, as opposed to motion of the robot. The values are the texts of the help."""

    ESTOP = "stop + emergency stop"
    RESET = "reset the emergency stop"
    QUIT = "quit"
    SUSPEND = "stop, and suspend until fg"
    HELP = "show or hide all keys"


CTRL_C, CTRL_D, CTRL_Z, CTRL_BACKSLASH = "\x03", "\x04", "\x1a", "\x1c"
"""Most terminals send these as signals; if they arrive as keys, they have the same effect."""

COMMANDS = {
    " ": Command.ESTOP,
    "r": Command.RESET,
    "q": Command.QUIT,
    CTRL_C: Command.QUIT,
    CTRL_D: Command.QUIT,
    CTRL_BACKSLASH: Command.QUIT,
    CTRL_Z: Command.SUSPEND,
    "?": Command.HELP,
    "h": Command.HELP,
}
"""Command of each key; a control mode may use a key otherwise (controls.py)."""
STOP_KEY = "s"
"""Key that sets the velocity to zero in control by steps, and ends the hold of a gamepad."""
PRESENCE_KEY = "enter"
"""Key that only shows that the operator is present, in control by steps."""
LEVEL_KEYS = ("1", "2", "3", "4", "5")
"""Keys that select the speed level of their digit."""


def level_of(key: str) -> int | None:
    """Return the speed level that a key selects; None if it selects none."""
    return int(key) if key in LEVEL_KEYS else None


def name_of(key: str) -> str:
    """Return the name of a key as it is printed: "SPACE", "Ctrl-C", "w", "acute accent"."""
    if key == " ":
        return "SPACE"
    if len(key) == 1 and not key.isascii():
        return unicodedata.name(key, f"U+{ord(key):04X}").lower()
    return f"Ctrl-{chr(ord(key) | 0x40)}" if len(key) == 1 and key < " " else key


ESCAPE = "\x1b"
SPACE = " "
QUESTION = "?"
ALWAYS_KEYS = frozenset({SPACE, CTRL_C})
FOCUS_OUT = "focus out"
"""Pseudo key: the terminal has lost the keyboard focus."""

PASTED = "pasted text"
SEVERAL = "different keys at once"
PLAIN = "a key without its release"
"""A plain character, although the terminal reports each key as a sequence with its release."""
WHEEL = "an arrow, which may be the mouse wheel"
"""An arrow key where the terminal does not report that its mouse wheel sends no arrows."""
UNKNOWN = "an unknown key sequence"
REPLY = "a reply to another program"
"""A string of any characters and length, such as a colour or a clipboard; its end may arrive much later."""
UNFINISHED = "Escape, or an unfinished key sequence"
UNFOCUSED = "a key while the terminal does not have the keyboard focus"
"""Another program copied it from another window or pane."""
UNPRESSED = "a release without its press"
"""A key was released whose press is unknown while another key is down. A change of the layout or of Num Lock renames a key, so
this may be the release of the held key. While no key is down, such a release is not reported: its key was pressed before teleop
read the terminal, such as the Enter that started teleop."""
NOT_TYPED = frozenset({PASTED, SEVERAL, PLAIN, WHEEL, UNKNOWN, REPLY, UNFINISHED, UNFOCUSED, UNPRESSED})
"""Pseudo keys in place of input that is not the press of a known key."""
NO_MOTION = frozenset({*COMMANDS, FOCUS_OUT})
"""Keys that the program handles, and that need not stop the robot."""

MAX_KEYS = 3
"""Maximum number of different keys that a person presses between two reads, also over a slow link."""
PAUSE_S = 1.0
"""Keys within this time after input that no person typed belong to this input: a slow link may cut it at each packet."""
TOGETHER_S = 0.03
"""No person presses more than `MAX_KEYS` different keys within this time of one another."""
MAX_DOWN = 32
"""Maximum number of keys that count as pressed at the same time. A person holds fewer."""
MAX_PARAMETERS = 64
"""Maximum number of parameter characters in a key's sequence."""

_SHIFT, _CTRL, _FOREIGN = 1, 4, 8 | 16 | 32
"""Modifiers; the foreign ones (Super, Hyper and Meta) make a key one of the desktop."""
_KINDS = {0: KeyKind.PRESS, 1: KeyKind.PRESS, 2: KeyKind.REPEAT, 3: KeyKind.RELEASE}
_BYTES = {"\r": "enter", "\n": "enter", "\t": "tab", "\x7f": "backspace", "\x08": "backspace"}
_FINALS = {
    "A": "up",
    "B": "down",
    "C": "right",
    "D": "left",
    "H": "home",
    "F": "end",
    "P": "f1",
    "Q": "f2",
    "R": "f3",
    "S": "f4",
    "Z": "tab",
}
ARROWS = frozenset({"up", "down", "left", "right"})
_STRINGS = "P]X^_"
"""After ESC: the beginning of a string of any characters, such as a reply with a colour or the terminal's name."""
_VT52_KEYPAD = "?"
"""After ESC, on a terminal that a program left in VT52 mode: a key of the keypad, whose letter follows."""
_C1 = {chr(ord(char) + 0x40): ESCAPE + char for char in "[O" + _STRINGS}
"""The same introducers as one character, from terminals with 8-bit controls."""
_KEY = re.compile(r"[0-9:;]*")
"""The parameters of a key."""
_REPORTS = re.compile(r"I|[?>]?[0-9;]+[cnt]|(?!1;)[?>]?[0-9;]+R|\?[0-9;]+\$y")
"""Parameters and final bytes of reports that are not keys: focus, identification, status, size, cursor and modes.
A cursor in the first row looks like F3 with a modifier, and counts as this key."""
_OTHER_KEY = re.compile(r"27;(?P<modifiers>[0-9]*);(?P<code>[0-9]*)")
_WIN32_ALWAYS = re.compile(r"[0-9]*;[0-9]*;(32|3);1[0-9;]*")
"""The press of SPACE or Ctrl-C in win32-input-mode, which ends in an underscore."""
_PASTE = 200
_WHEEL_MODE = re.compile(r"\?1007;([0-4])\$")
_RESET_MODES = (2, 4)
"""The states "reset" and "permanently reset" in a report of a mode (DECRPM)."""
_MODIFIER_KEYS = frozenset({*range(57358, 57361), *range(57441, 57455)})
"""Modifier keys pressed alone, such as Shift, Ctrl and caps lock; they are ignored."""
_CODES = {
    9: "tab",
    13: "enter",
    27: "escape",
    127: "backspace",
    57414: "enter",
    57417: "left",
    57418: "right",
    57419: "up",
    57420: "down",
} | {57399 + digit: str(digit) for digit in range(10)}
"""Key codes of the kitty keyboard protocol, including the keypad."""
_SHIFTED = frozenset(map(ord, (QUESTION, *LEVEL_KEYS)))
_PRIVATE_USE = range(57344, 63744)


class ReportKind(StrEnum):
    """Kinds of reports from a terminal that are not keys."""

    KEYBOARD_FLAGS = "keyboard flags"
    """Present flags of the kitty keyboard protocol; reported only by terminals that support it."""
    WHEEL_MODE = "wheel mode"
    """Whether the mode is reset, known and off, in which the mouse wheel sends arrow keys (alternate scroll, 1007)."""
    WELL = "well"
    """The reply to a status request (DSR)."""


class Report(NamedTuple):
    """A reply of the terminal."""

    kind: ReportKind
    value: int = 0


class _State(Enum):
    GROUND = auto()
    ESCAPED = auto()
    """After ESC: the introducer of a sequence, a key pressed together with Alt, or a function key of an old terminal."""
    CSI = auto()
    """After ESC [: parameters, then one final byte."""
    SS3 = auto()
    """After ESC O: one byte."""


class TypedKeys:
    """Replaces the key events of a read by one pseudo key if no person typed them, with the keys that always count.

    More than `MAX_KEYS` different keys at once were pasted. Characters after an unknown sequence may belong to it, as in a mouse
    report. Characters after the end of pasted text may belong to the text, because the text may contain this end. Each of these
    inputs lasts until a pause of `PAUSE_S`, because a link may cut it into several reads.
    """

    def __init__(self) -> None:
        self._why, self._keys = "", frozenset[str]()
        """Why the newest keys were not typed, and which different keys were pressed together."""
        self._last_s = -math.inf

    def take(self, events: Sequence[KeyEvent], now_s: float) -> Sequence[KeyEvent]:
        if not events:
            return events
        pause_s, self._last_s = now_s - self._last_s, now_s
        keys = {event.key for event in events if event.kind is KeyKind.PRESS} - ALWAYS_KEYS
        typed = keys - NOT_TYPED - {FOCUS_OUT}
        together = typed | (self._keys if pause_s <= TOGETHER_S else frozenset[str]())
        self._keys = frozenset(islice(together, MAX_KEYS + 1))  # more make no difference
        if pause_s > PAUSE_S:
            self._why = ""
        several = SEVERAL if len(self._keys) > MAX_KEYS else ""
        self._why = self._why or next((why for why in (PASTED, REPLY, UNKNOWN) if why in keys), several)
        if not self._why:
            return events
        return [KeyEvent(self._why), *(event for event in events if event.key in ALWAYS_KEYS)]


class KeyDecoder:
    """Decodes keys from a stream of bytes that arrives in arbitrary pieces."""

    def __init__(self) -> None:
        self._utf8 = codecs.getincrementaldecoder("utf-8")("surrogateescape")
        self._state = _State.GROUND
        self._parameters = ""
        self._outer: tuple[_State, str] | None = None
        """The state and parameters of the sequence inside which another one began. mosh and multiplexers insert an answer at any
        byte of a sequence; the rest of the sequence follows the answer."""
        self._is_told = False
        """Whether the unfinished sequence was already reported as `UNFINISHED`."""
        self._down: deque[str] = deque(maxlen=MAX_DOWN)
        """The keys that were pressed and not released, named as their releases would be."""
        self._has_focus = True
        self._is_pasting = False
        self._is_noted = False
        """Whether pasted text was reported for this read."""
        self.tells_releases = False
        """Set once the kitty protocol is active. A key that still arrives as a plain character was not pressed."""
        self.doubts_arrows = False
        """Set while an arrow key may be the mouse wheel, and would move the robot."""

    @property
    def is_unfinished(self) -> bool:
        """Whether the last bytes are an Escape, or the beginning of a sequence or character."""
        is_begun = self._state is not _State.GROUND and not self._is_told
        return is_begun or bool(self._utf8.getstate()[0])

    def feed(self, data: bytes) -> list[KeyEvent | Report]:
        """Return the keys and reports that `data` completes, in order. Bytes that are not UTF-8 count as Latin-1."""
        chars = (
            chr(ord(char) & 0xFF) if "\udc80" <= char <= "\udcff" else char
            for char in self._utf8.decode(data)
        )
        chars = (part for char in chars for part in _C1.get(char, char))
        self._is_noted = False
        return [event for char in chars for event in self._take(SPACE if _is_space(char) else char)]

    def _take(self, char: str) -> Iterator[KeyEvent | Report]:
        for event in self._decoded(char):
            if isinstance(event, Report) or event.key in ALWAYS_KEYS:
                yield event
            elif self._is_pasting or event.key == PASTED:  # once for each read, also if the end never arrives
                self._is_pasting = True
                yield from () if self._is_noted else (KeyEvent(PASTED),)
                self._is_noted = True
            elif not self._has_focus and event.key != FOCUS_OUT and event.kind is not KeyKind.RELEASE:
                yield KeyEvent(UNFOCUSED)
            elif self.doubts_arrows and event.key in ARROWS and event.kind is not KeyKind.RELEASE:
                yield KeyEvent(WHEEL)
            else:
                yield event

    def _decoded(self, char: str) -> Iterator[KeyEvent | Report]:
        state, self._state = self._state, _State.GROUND
        if state is _State.GROUND:
            self._outer, self._is_told = None, False
        if char in ALWAYS_KEYS:
            yield from self._typed(char)
        elif char == ESCAPE:
            self._state = _State.ESCAPED
            if state is not _State.GROUND:
                self._outer = state, self._parameters
                yield from () if self._is_told else (KeyEvent(UNFINISHED),)
                self._is_told = True
        elif state is _State.GROUND:
            yield from self._typed(char)
        elif state is _State.ESCAPED:
            yield from self._escaped(char)
        elif state is _State.SS3:
            yield from self._typed(_FINALS.get(char, UNKNOWN))
        elif "@" <= char <= "~":
            yield from self._finished(char)
        else:
            self._state = _State.CSI
            self._parameters = (self._parameters + char)[:MAX_PARAMETERS]

    def _escaped(self, char: str) -> Iterator[KeyEvent]:
        self._state = {"[": _State.CSI, "O": _State.SS3}.get(char, _State.GROUND)
        self._parameters = ""
        if self._state is not _State.GROUND:
            return
        if char in _STRINGS:
            yield KeyEvent(REPLY)
        elif char == _VT52_KEYPAD:
            yield KeyEvent(UNKNOWN)
        else:  # F8 of an HP terminal is ESC w
            yield from self._typed(f"Alt-{char}" if char > SPACE else char)

    def _finished(self, final: str) -> Iterator[KeyEvent | Report]:
        outer, self._outer = self._outer, None
        if (self._parameters, final) == ("201", "~"):
            self._is_pasting = False
            return
        if final == "~" and (other := _OTHER_KEY.fullmatch(self._parameters)):
            typed = _sequence(f"{other['code']};{other['modifiers']}", "u")
            yield from self._typed(typed.key) if isinstance(typed, KeyEvent) else ()
            return
        found = _sequence(self._parameters, final)
        if not self._parameters and final in "IO":
            self._has_focus = final == "I"
            if not self._has_focus:
                self._down.clear()  # their releases go to another window
        elif isinstance(found, KeyEvent):
            outer = None
            yield from () if self._is_paired(found, final) else (KeyEvent(UNPRESSED),)
        if found is not None:
            yield found
        if outer is not None:  # the report arrived inside another sequence, which continues now
            self._state, self._parameters = outer

    def _is_paired(self, event: KeyEvent, final: str) -> bool:
        """Note a press or a release; return False for a release that may be that of a held key with a changed name."""
        alone = _sequence(f"{self._parameters.partition(';')[0]};1:3", final)
        name = alone.key if isinstance(alone, KeyEvent) else ""
        is_down = name in self._down
        if event.kind is KeyKind.RELEASE:
            is_renamed = self.tells_releases and self._down and not is_down
            if is_down:
                self._down.remove(name)
            return not is_renamed
        if not is_down:
            self._down.append(name)
        return True

    def _typed(self, char: str) -> Iterator[KeyEvent]:
        is_pressed = char in ALWAYS_KEYS or not self.tells_releases
        yield KeyEvent(_BYTES.get(char, char) if is_pressed else PLAIN)


def _is_space(char: str) -> bool:
    """Return whether a character is a space of any kind, or Ctrl-SPACE of a terminal without the kitty protocol."""
    return char == "\0" or unicodedata.category(char) == "Zs"


def _sequence(parameters: str, final: str) -> KeyEvent | Report | None:
    """Return the key or report in the sequence ESC [ parameters final; None if it is neither."""
    if final == "u" and parameters.startswith("?"):
        return Report(ReportKind.KEYBOARD_FLAGS, _number(parameters[1:]))
    if parameters == "0" and final == "n":
        return Report(ReportKind.WELL)
    if final == "_" and (always := _WIN32_ALWAYS.fullmatch(parameters)):
        return KeyEvent(chr(int(always[1])))
    if final == "y" and (mode := _WHEEL_MODE.fullmatch(parameters)):
        return Report(ReportKind.WHEEL_MODE, int(int(mode[1]) in _RESET_MODES))
    if parameters == "" and final == "O":
        return KeyEvent(FOCUS_OUT)
    if _REPORTS.fullmatch(parameters + final):
        return None
    fields = [[_number(part) for part in field.split(":")] for field in parameters.split(";")]
    modifiers, event = (*(fields[1] if len(fields) > 1 else ()), 0, 0)[:2]
    kind = _KINDS.get(event, KeyKind.PRESS)
    held = max(modifiers - 1, 0)
    if final == "u":
        key = _key(fields[0], held, kind)
    elif final == "~":
        key = PASTED if fields[0][0] == _PASTE else f"~{fields[0][0]}"
    else:
        key = _FINALS.get(final, UNKNOWN)
    if key is None:
        return None
    is_key = event in _KINDS and _KEY.fullmatch(parameters)
    is_foreign = not is_key or (held & _FOREIGN and kind is not KeyKind.RELEASE)
    return KeyEvent(UNKNOWN if is_foreign and key not in ALWAYS_KEYS else key, kind)


def _key(codes: list[int], modifiers: int, kind: KeyKind) -> str | None:
    """Return the key of a code, with its alternatives (shifted, and on the US layout) if they are reported.

    Only the question mark and the digits of the levels are taken from the shifted alternative, because their keys differ
    between layouts. A release is that of the key alone: Shift or Ctrl may have been pressed after the key, and then the
    release must end that key's press.
    """
    code = codes[0]
    if any(_is_space(chr(code)) for code in codes if 0 < code <= sys.maxunicode):
        return SPACE
    if modifiers & _SHIFT and len(codes) > 1 and codes[1] in _SHIFTED and kind is not KeyKind.RELEASE:
        return chr(codes[1])
    if code > 0x7F and code not in _PRIVATE_USE and len(codes) > 2:
        code = codes[2]
    if code in _MODIFIER_KEYS:
        return None
    char = chr(code) if 0x20 <= code < 0x7F else ""
    if modifiers & _CTRL and kind is not KeyKind.RELEASE and "@" <= char.upper() <= "_":
        return chr(ord(char.upper()) & 0x1F)
    if char:
        return char.upper() if modifiers & _SHIFT else char
    return _CODES.get(code, f"key {code}")


def _number(text: str) -> int:
    """Return the number in a field; 0 if it is missing or not a number."""
    return int(text) if text.isascii() and text.isdigit() else 0
