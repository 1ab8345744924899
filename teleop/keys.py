r"""The terminal's bytes -> keys.

Cursor and function keys arrive as escape sequences whose letters must not drive the robot ("\x1b[D" is no
"D"), in one piece or in several. Whatever surrounds them, a SPACE and a Ctrl-C always come through: neither
is part of any sequence here, so that the emergency stop is never swallowed by a stray ESC.
"""

from enum import Enum, auto

from teleop.keymap import CTRL_C

ESCAPE = "\x1b"
ALWAYS_KEYS = frozenset({" ", CTRL_C})


class _State(Enum):
    GROUND = auto()
    ESCAPED = auto()
    """After ESC: the introducer of a sequence, or a key pressed together with Alt."""
    CSI = auto()
    """After ESC [: parameters, then one final byte."""
    SS3 = auto()
    """After ESC O: one byte."""


class KeyDecoder:
    """Finds the keys in a stream of bytes, however it is cut into pieces."""

    def __init__(self) -> None:
        self._state = _State.GROUND

    def feed(self, data: bytes) -> list[str]:
        """The keys that `data` completes, in order. Bytes of no ASCII character are keys without a meaning."""
        return [char for char in data.decode("latin-1") if self._is_key(char)]

    def _is_key(self, char: str) -> bool:
        state, self._state = self._state, _State.GROUND
        if char in ALWAYS_KEYS:
            return True
        if char == ESCAPE:
            self._state = _State.ESCAPED
            return False
        match state:
            case _State.GROUND:
                return True
            case _State.ESCAPED:
                self._state = {"[": _State.CSI, "O": _State.SS3}.get(char, _State.GROUND)
                return self._state is _State.GROUND
            case _State.CSI:
                if not "@" <= char <= "~":
                    self._state = _State.CSI
                return False
            case _State.SS3:
                return False
