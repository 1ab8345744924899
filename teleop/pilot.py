"""Interface of a pilot, which converts the operator's input to a velocity: keys held, keys as steps, or a gamepad."""

from enum import StrEnum
from typing import NamedTuple, Protocol


class Velocity(NamedTuple):
    """A requested velocity; neutral means that both components are exactly zero."""

    linear_m_s: float = 0.0
    """Forward velocity."""
    angular_rad_s: float = 0.0
    """Turn rate, counter-clockwise."""

    @property
    def is_neutral(self) -> bool:
        return self == NEUTRAL


NEUTRAL = Velocity()


def amount(value: float) -> str:
    """Return a number above zero with two decimals, or with three digits if these would change it."""
    text = f"{value:.2f}"
    return text if abs(float(text) - value) < 1e-9 else f"{value:.3g}"


def amounts(velocity: Velocity) -> str:
    """Return a velocity with its units: "0.60 m/s, 1.20 rad/s"."""
    return f"{amount(velocity.linear_m_s)} m/s, {amount(velocity.angular_rad_s)} rad/s"


class KeyKind(StrEnum):
    """Kind of a key event."""

    PRESS = "press"
    REPEAT = "repeat"
    RELEASE = "release"


class KeyEvent(NamedTuple):
    """A key event as decoded by keys.py."""

    key: str
    """The character, or a name: "up", "down", "left", "right", "enter", "f1"."""
    kind: KeyKind = KeyKind.PRESS
    """A terminal without the kitty keyboard protocol reports only presses; a held key is a series of presses."""


class Pilot(Protocol):
    """Converts the operator's input to a velocity. Pure: time, in seconds of the loop's clock, is an argument."""

    def on_key(self, event: KeyEvent, now_s: float) -> None:
        """Process a key; a key without a function has no effect, or stops the robot if the pilot stops on any key."""
        ...

    def velocity(self, now_s: float) -> Velocity:
        """Return the velocity to send, which approaches `wanted` along a ramp; exactly zero when neutral."""
        ...

    def wanted(self) -> Velocity:
        """The requested velocity, at the end of the ramp."""
        ...

    def let_go(self) -> None:
        """Become neutral immediately, without a ramp; keys and buttons that are still held no longer count."""
        ...

    @property
    def next_s(self) -> float:
        """Time at which `velocity` may change without a key; `math.inf` if it does not."""
        ...

    @property
    def note(self) -> str:
        """A short text for the screen on how the control works."""
        ...

    @property
    def level(self) -> int:
        """The speed level, 1 to 5."""
        ...

    @property
    def limit(self) -> Velocity:
        """Maximum of each velocity at the speed level, and on a gamepad with or without turbo."""
        ...
