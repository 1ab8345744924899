"""The motion of a differential-drive base: ramps, and a command timeout of its own. Pure: time is an argument."""

import math
from dataclasses import dataclass

SPEED_UP_M_S2, BRAKING_M_S2 = 1.0, 2.0
TURN_UP_RAD_S2, TURN_BRAKING_RAD_S2 = 4.0, 8.0
MAX_M_S, MAX_RAD_S = 1.0, 2.0


@dataclass
class Drive:
    """Pose in `odom` (x [m], y [m], yaw [rad]) and velocity of the base.

    Args:
        timeout_s: how long it keeps a command; None: it keeps the last one.
    """

    timeout_s: float | None
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    v_m_s: float = 0.0
    w_rad_s: float = 0.0
    _command: tuple[float, float] = (0.0, 0.0)
    _commanded_s: float = -math.inf

    def command(self, now_s: float, v_m_s: float, w_rad_s: float) -> None:
        self._command = (_clamped(v_m_s, MAX_M_S), _clamped(w_rad_s, MAX_RAD_S))
        self._commanded_s = now_s

    def target(self, now_s: float) -> tuple[float, float]:
        """Return the velocity that it aims at: zero once the last command is older than the timeout."""
        silent = self.timeout_s is not None and now_s - self._commanded_s > self.timeout_s
        return (0.0, 0.0) if silent else self._command

    def step(self, now_s: float, elapsed_s: float) -> None:
        """Move for `elapsed_s` until `now_s`."""
        v_m_s, w_rad_s = self.target(now_s)
        self.v_m_s = _ramped(self.v_m_s, v_m_s, SPEED_UP_M_S2 * elapsed_s, BRAKING_M_S2 * elapsed_s)
        self.w_rad_s = _ramped(
            self.w_rad_s, w_rad_s, TURN_UP_RAD_S2 * elapsed_s, TURN_BRAKING_RAD_S2 * elapsed_s
        )
        middle_rad = self.yaw_rad + self.w_rad_s * elapsed_s / 2
        self.x_m += self.v_m_s * math.cos(middle_rad) * elapsed_s
        self.y_m += self.v_m_s * math.sin(middle_rad) * elapsed_s
        self.yaw_rad = math.remainder(self.yaw_rad + self.w_rad_s * elapsed_s, math.tau)


def _clamped(value: float, limit: float) -> float:
    return max(-limit, min(limit, value)) if math.isfinite(value) else 0.0


def _ramped(value: float, target: float, up: float, down: float) -> float:
    """Return the value after a step towards the target; it speeds up by at most `up` and slows down by at most `down`."""
    slows = abs(target) < abs(value) or target * value < 0
    largest = down if slows else up
    return value + _clamped(target - value, largest)
