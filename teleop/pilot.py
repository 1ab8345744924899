"""A pilot turns what the operator does into a velocity: what a keyboard held, stepped or a gamepad has in common."""

from enum import StrEnum
from typing import NamedTuple, Protocol


class Velocity(NamedTuple):
    """What is asked of the robot; neutral is exactly zero in both."""

    linear_m_s: float = 0.0
    """Forward."""
    angular_rad_s: float = 0.0
    """Counter-clockwise."""

    @property
    def is_neutral(self) -> bool:
        return self == NEUTRAL


NEUTRAL = Velocity()


class KeyKind(StrEnum):
    """What happened to a key."""

    PRESS = "press"
    REPEAT = "repeat"
    RELEASE = "release"


class KeyEvent(NamedTuple):
    """A key and what happened to it, as keys.py decodes it."""

    key: str
    """The character, or a name: "up", "down", "left", "right", "enter", "f1"."""
    kind: KeyKind = KeyKind.PRESS
    """A terminal without the kitty keyboard protocol tells presses only; a held key is one press after another."""


class Pilot(Protocol):
    """Turns what the operator does into a velocity. Pure: time, in seconds of the loop's clock, is an argument."""

    def on_key(self, event: KeyEvent, now_s: float) -> None:
        """Take a key; one that means nothing to this pilot changes nothing, unless it stops at any key."""
        ...

    def velocity(self, now_s: float) -> Velocity:
        """What is sent now, on its way along a ramp to what is wanted; exact zeros when neutral."""
        ...

    def wanted(self) -> Velocity:
        """Where the ramp goes."""
        ...

    def let_go(self) -> None:
        """Neutral at once, past every ramp, and whatever is held does not count any more."""
        ...

    @property
    def next_s(self) -> float:
        """When `velocity` may change without a key; `math.inf`: never."""
        ...

    @property
    def note(self) -> str:
        """How it works here, for the screen."""
        ...

    @property
    def level(self) -> int:
        """The speed level, 1 to 5."""
        ...
