"""Samples of commands and motion, for the demo and the fault campaign (pure)."""

from typing import NamedTuple

STILL_M_S = 0.01
STILL_RAD_S = 0.02


class Command(NamedTuple):
    """A sample of `cmd_vel`."""

    arrival_s: float
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_zero(self) -> bool:
        return self.linear_m_s == 0.0 and self.angular_rad_s == 0.0


def is_still(linear_m_s: float, angular_rad_s: float) -> bool:
    """Return whether the robot is at rest, within the accuracy of the measurement."""
    return abs(linear_m_s) < STILL_M_S and abs(angular_rad_s) < STILL_RAD_S
