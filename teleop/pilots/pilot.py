"""Interface of a pilot, which converts the operator's input to a velocity: keys held, keys as steps, or a gamepad."""

import math
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

    def scaled(self, share: float) -> "Velocity":
        """Return this share of both components."""
        return Velocity(share * self.linear_m_s, share * self.angular_rad_s)


NEUTRAL = Velocity()
LEVELS = 5
"""Number of speed levels."""


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
    is_old: bool = False
    """Whether it may have been typed before the operator saw the present screen: such a key requests no motion."""


class Pilot(Protocol):
    """Converts the operator's input to a velocity. Pure: time, in seconds of the loop's clock, is an argument."""

    def on_key(self, event: KeyEvent, now_s: float) -> bool:
        """Process a key; return False if it has no function: then the pilot has become neutral."""
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


RAMP_PERIOD_S = 0.02
"""Time between two steps of the ramp: shorter than the 20 Hz heartbeat, and equal to the supervisor's tick."""


class Ramp:
    """Limits the increase of the sent velocity toward the requested one; it falls immediately.

    It never exceeds the operator's request, and a stop needs no bypass of the ramp.

    Args:
        acceleration_m_s2: maximum increase of the forward velocity, in either direction.
        angular_acceleration_rad_s2: maximum increase of the turn rate, in either direction.
    """

    def __init__(self, acceleration_m_s2: float, angular_acceleration_rad_s2: float) -> None:
        self._rates = (acceleration_m_s2, angular_acceleration_rad_s2)
        self._sent = NEUTRAL
        self._moving = False
        self._since_s = -math.inf

    @property
    def next_s(self) -> float:
        """Time at which the next step is due; `math.inf` at the end of the ramp."""
        return self._since_s + RAMP_PERIOD_S if self._moving else math.inf

    def toward(self, wanted: Velocity, now_s: float) -> Velocity:
        """Return the velocity to send at `now_s`. A new ramp makes its first step immediately."""
        elapsed_s = max(0.0, now_s - self._since_s)
        if not self._moving:
            elapsed_s = min(elapsed_s, RAMP_PERIOD_S)
        self._sent = Velocity(
            *(
                _grown(sent, goal, rate * elapsed_s)
                for sent, goal, rate in zip(self._sent, wanted, self._rates, strict=True)
            )
        )
        self._moving, self._since_s = self._sent != wanted, now_s
        return self._sent

    def reset(self) -> None:
        """Set the sent velocity to zero immediately."""
        self._sent, self._moving = NEUTRAL, False


def _grown(sent: float, wanted: float, most: float) -> float:
    """Return `sent` moved toward `wanted`, by at most `most` away from zero and by any amount toward zero."""
    start = sent if sent * wanted > 0.0 else 0.0
    return math.copysign(min(abs(wanted), abs(start) + most), wanted) if wanted else 0.0
