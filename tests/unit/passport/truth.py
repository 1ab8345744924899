"""A robot that drives toward a wall and stops, of which everything is known."""

from typing import NamedTuple

import numpy as np

from commission.estimate import Floats

FAULT_S = 10.0
WALL_M = 4.0
"""Distance of the wall where the way is zero, which is at the fault."""


class Stopped(NamedTuple):
    """It keeps its speed for a time after the fault, and then brakes."""

    speed_m_s: float = 0.5
    late_s: float = 0.1
    braking_m_s2: float = 2.0

    @property
    def stops_s(self) -> float:
        """Time from the fault to the standstill."""
        return self.late_s + self.speed_m_s / self.braking_m_s2

    @property
    def distance_m(self) -> float:
        return self.speed_m_s * self.late_s + self.speed_m_s**2 / (2.0 * self.braking_m_s2)

    def motion(self, at_s: Floats) -> tuple[Floats, Floats]:
        """Return the ways from the fault [m] and the speeds [m/s] at these times."""
        braking_s = np.clip(at_s - FAULT_S - self.late_s, 0.0, self.stops_s - self.late_s)
        steady_s = np.minimum(at_s - FAULT_S, self.late_s)
        ways = self.speed_m_s * (steady_s + braking_s) - 0.5 * self.braking_m_s2 * braking_s**2
        return ways, self.speed_m_s - self.braking_m_s2 * braking_s

    def odometry(self, until_s: float = 12.5) -> Floats:
        at_s = np.arange(8.0, until_s, 0.02) + 0.003
        return np.stack((at_s, *self.motion(at_s)), axis=1)

    def walls(self, until_s: float = 12.5) -> Floats:
        at_s = np.arange(8.0, until_s, 0.05) + 0.007
        return np.stack((at_s, WALL_M - self.motion(at_s)[0]), axis=1)
