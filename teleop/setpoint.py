"""What the operator asks of the robot, in steps within limits.

Steps are counted, not added up: ten up and ten down is zero exactly, and only an exact zero is neutral.
"""

import math
from dataclasses import dataclass, replace
from typing import assert_never

from teleop.keymap import Action


@dataclass(frozen=True, slots=True)
class Steps:
    """How much one key press changes, and how far it goes. All above zero."""

    linear_step_m_s: float = 0.1
    angular_step_rad_s: float = 0.2
    max_linear_m_s: float = 1.0
    max_angular_rad_s: float = 2.0


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Forward velocity and turn rate (counter-clockwise positive) as asked for."""

    steps: Steps = Steps()
    linear_steps: int = 0
    angular_steps: int = 0

    @property
    def linear_m_s(self) -> float:
        return _velocity(self.linear_steps, self.steps.linear_step_m_s, self.steps.max_linear_m_s)

    @property
    def angular_rad_s(self) -> float:
        return _velocity(self.angular_steps, self.steps.angular_step_rad_s, self.steps.max_angular_rad_s)

    @property
    def is_neutral(self) -> bool:
        """Both velocities are exactly zero."""
        return self.linear_steps == 0 and self.angular_steps == 0

    def neutral(self) -> "Setpoint":
        return Setpoint(self.steps)

    def apply(self, action: Action) -> "Setpoint":
        """The setpoint after `action`; the same one where the action asks for no other motion."""
        match action:
            case Action.FASTER:
                return self._moved(linear=1)
            case Action.SLOWER:
                return self._moved(linear=-1)
            case Action.LEFT:
                return self._moved(angular=1)
            case Action.RIGHT:
                return self._moved(angular=-1)
            case Action.STOP | Action.ESTOP | Action.QUIT:
                return self.neutral()
            case Action.RESET:
                return self
            case _:
                assert_never(action)

    def _moved(self, *, linear: int = 0, angular: int = 0) -> "Setpoint":
        top_linear = _top(self.steps.linear_step_m_s, self.steps.max_linear_m_s)
        top_angular = _top(self.steps.angular_step_rad_s, self.steps.max_angular_rad_s)
        return replace(
            self,
            linear_steps=_clamp(self.linear_steps + linear, top_linear),
            angular_steps=_clamp(self.angular_steps + angular, top_angular),
        )


def _velocity(steps: int, step: float, limit: float) -> float:
    """`steps` of `step` within ±`limit`, without the noise of binary fractions (3 x 0.1 is 0.3)."""
    return max(-limit, min(limit, round(steps * step, 9)))


def _top(step: float, limit: float) -> int:
    """The first count of steps that reaches the limit; what is beyond it would have to be counted back."""
    return math.ceil(round(limit / step, 9))


def _clamp(steps: int, top: int) -> int:
    return max(-top, min(top, steps))
