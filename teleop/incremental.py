"""Control by steps: each key press changes the requested velocity, which holds until the next press.

A stop by the supervisor does not change the requested velocity. The law waits for a neutral command, which must come
from the operator: a program that sent it automatically would re-arm the robot without the operator's knowledge.
"""

from dataclasses import dataclass, replace

from teleop.keys import level_of
from teleop.pilot import LEVELS, KeyEvent, KeyKind, Ramp, Velocity, amount

DIGITS = 9
"""Decimal places for rounding: finer than any step, coarser than floating-point errors (3 x 0.1 is 0.3)."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Requested forward velocity and turn rate (counter-clockwise positive), changed in steps within limits.

    Sums of steps are rounded: ten steps up and ten down give exactly zero, and only exact zero is neutral. A step never
    crosses zero but stops at it, even after a change of level.
    """

    full_step: Velocity = Velocity(0.1, 0.2)
    """Step of each velocity at the highest speed level, above zero."""
    most: Velocity = Velocity(1.0, 2.0)
    """Maximum of each velocity at the highest speed level, above zero."""
    level: int = LEVELS
    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0

    @property
    def velocity(self) -> Velocity:
        return Velocity(self.linear_m_s, self.angular_rad_s)

    @property
    def is_neutral(self) -> bool:
        """Whether both velocities are exactly zero."""
        return self.velocity.is_neutral

    @property
    def step(self) -> Velocity:
        """Step of each velocity at this speed level."""
        return self.full_step.scaled(self.level / LEVELS)

    @property
    def limit(self) -> Velocity:
        """Maximum of each velocity at this speed level."""
        return self.most.scaled(self.level / LEVELS)

    def neutral(self) -> "Setpoint":
        return replace(self, linear_m_s=0.0, angular_rad_s=0.0)

    def moved(self, *, linear: int = 0, angular: int = 0) -> "Setpoint":
        """Return the setpoint after `linear` steps forward and `angular` steps to the left, each -1, 0 or 1."""
        step, limit = self.step, self.limit
        return replace(
            self,
            linear_m_s=_stepped(self.linear_m_s, linear * step.linear_m_s, limit.linear_m_s),
            angular_rad_s=_stepped(self.angular_rad_s, angular * step.angular_rad_s, limit.angular_rad_s),
        )

    def at_level(self, level: int) -> "Setpoint":
        """Return the setpoint at another speed level, 1 to 5, limited to its maximum."""
        return replace(self, level=level).moved()


def _stepped(velocity: float, step: float, limit: float) -> float:
    there = round(velocity + step, DIGITS)
    if velocity * there < 0.0:
        return 0.0
    top = round(limit, DIGITS)
    return max(-top, min(top, there)) + 0.0


STEPS = {"w": (1, 0), "x": (-1, 0), "a": (0, 1), "d": (0, -1)}
"""Steps (forward, left) of the keys."""
STOP = "s"
"""Key that sets the velocity to zero."""


class Incremental:
    """A `Pilot` that counts key presses.

    Args:
        setpoint: a neutral setpoint at the initial speed level.
        ramp: limits the acceleration of the sent velocity.
    """

    def __init__(self, setpoint: Setpoint, ramp: Ramp) -> None:
        self._setpoint, self._ramp = setpoint, ramp

    @property
    def level(self) -> int:
        return self._setpoint.level

    @property
    def limit(self) -> Velocity:
        return self._setpoint.limit

    @property
    def note(self) -> str:
        step = self._setpoint.step
        return f"each press: {amount(step.linear_m_s)} m/s or {amount(step.angular_rad_s)} rad/s"

    @property
    def next_s(self) -> float:
        return self._ramp.next_s

    def on_key(self, event: KeyEvent, now_s: float) -> None:  # noqa: ARG002 - a step is a step at any time
        if event.kind is KeyKind.RELEASE:
            return
        key = event.key.lower()
        level = level_of(key)
        if key == STOP:
            self.let_go()
        elif key in STEPS:
            linear, angular = STEPS[key]
            self._setpoint = self._setpoint.moved(linear=linear, angular=angular)
        elif level is not None:
            self._setpoint = self._setpoint.at_level(level)

    def velocity(self, now_s: float) -> Velocity:
        return self._ramp.toward(self._setpoint.velocity, now_s)

    def wanted(self) -> Velocity:
        return self._setpoint.velocity

    def let_go(self) -> None:
        self._setpoint = self._setpoint.neutral()
        self._ramp.reset()
