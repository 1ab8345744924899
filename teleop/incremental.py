"""Control by steps: each key press changes the requested velocity, which holds until the next press.

A stop by the supervisor does not change the requested velocity. The law waits for a neutral command, which must come
from the operator: a program that sent it automatically would re-arm the robot without the operator's knowledge.
"""

from teleop.keymap import level_of
from teleop.pilot import KeyEvent, KeyKind, Velocity, amount
from teleop.ramp import Ramp
from teleop.setpoint import Setpoint

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
