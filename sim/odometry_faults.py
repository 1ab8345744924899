"""Apply sensor faults to odometry. Pure."""

import math

from sim.encoders import Reckoning
from sim.sensor_faults import SensorFaults

START = (0.0, 0.0, 0.0)
Pose = tuple[float, float, float]


class FaultyOdometry:
    """Wheel odometry with faults; errors of the pose remain after a fault ends."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Restart at the origin, together with the odometry itself."""
        self._counted: Pose = START
        self._said: Pose = START
        self._frozen: Reckoning | None = None

    def spoil(self, faults: SensorFaults, true: Reckoning) -> Reckoning | None:
        """Return the reading with these faults; None if no odometry is sent.

        Args:
            faults: the active faults.
            true: the reading without faults.
        """
        factor = 0.0 if faults.odom_zero else 1.0 if faults.odom_scale is None else faults.odom_scale
        if factor == 1.0 and self._said == self._counted:
            self._said = true[:3]  # bit for bit equal as long as no fault was ever active
        else:
            self._said = _moved(self._said, self._counted, true[:3], factor)
        self._counted = true[:3]
        x_m, y_m, yaw_rad = self._said
        said = true._replace(
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            linear_m_s=factor * true.linear_m_s,
            angular_rad_s=factor * true.angular_rad_s,
        )
        if not faults.odom_freeze:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = said
        return None if faults.no_odom else self._frozen or said


def _moved(said: Pose, before: Pose, after: Pose, factor: float) -> Pose:
    """Return the pose `said`, moved by `factor` times the displacement from `before` to `after`."""
    dx_m, dy_m, turn_rad = after[0] - before[0], after[1] - before[1], after[2] - before[2]
    angle_rad = said[2] - before[2]
    cos, sin = factor * math.cos(angle_rad), factor * math.sin(angle_rad)
    turn_rad = factor * math.remainder(turn_rad, math.tau)
    return (
        said[0] + cos * dx_m - sin * dy_m,
        said[1] + sin * dx_m + cos * dy_m,
        math.remainder(said[2] + turn_rad, math.tau),
    )
