"""Drive the legs of a path in sequence, with a turn on the spot before each leg and to the final heading."""

from teleop.path.legs import Path
from teleop.path.pose import Pose, wrap
from teleop.path.progress import Station, nearest
from teleop.path.pursuit import Limits, bearing, lookahead_m, pursue, turn
from teleop.pilot import Velocity

HEADING_RAD = 0.02
"""A turn on the spot is finished when the heading error is below this."""
ARRIVED_M = 0.01
"""A leg is finished at this distance from its end; the base stops within the rest."""
ON_PATH_M = 0.05
"""A robot farther from the path was pushed or driven away, and must return first."""
ASTRAY_RAD = 1.0
"""With a larger bearing of the target point, turn on the spot first instead of driving an arc."""
AIMED_RAD = 0.15


class Course:
    """One drive along a path. It can be interrupted for any time and continues where it was."""

    def __init__(self, path: Path, limits: Limits) -> None:
        self.path = path
        self._limits = limits
        self._index = 0
        self._along_m = 0.0
        self._turning = True
        self._aiming = False

    @property
    def leg(self) -> int:
        """Number of the current leg; at the end, that of the last leg."""
        return min(self._index, len(self.path.legs) - 1)

    @property
    def along_m(self) -> float:
        """Distance driven along the current leg."""
        return self._along_m

    @property
    def done_m(self) -> float:
        """How much of the whole path has been driven."""
        return sum(leg.length_m for leg in self.path.legs[: self.leg]) + self._along_m

    def station(self, pose: Pose) -> Station:
        """Return the point of the path where the robot should be, and its distance from it; does not change the state."""
        return nearest(self.path.legs[self.leg], pose.x_m, pose.y_m, self._along_m)

    def step(self, pose: Pose, speed_m_s: float) -> Velocity | None:
        """Compute the velocity to request.

        Args:
            pose: the robot's pose in the path's frame.
            speed_m_s: its speed.

        Returns:
            The velocity; None if the path has been completed.
        """
        while self._index < len(self.path.legs):
            station = self.station(pose)
            self._along_m = station.along_m
            velocity = self._on_leg(pose, speed_m_s, station)
            if velocity is not None:
                return velocity
            self._along_m = self.path.legs[self._index].length_m
            self._index += 1
            self._turning = True
            self._aiming = False
            if self._index < len(self.path.legs):
                self._along_m = 0.0
        error_rad = wrap(self.path.end.yaw_rad - pose.yaw_rad)
        return turn(error_rad, self._limits) if abs(error_rad) > HEADING_RAD else None

    def _on_leg(self, pose: Pose, speed_m_s: float, station: Station) -> Velocity | None:
        """Return the velocity on the current leg; None if it is finished."""
        leg = self.path.legs[self._index]
        on_path = station.off_m <= ON_PATH_M
        left_m = leg.length_m - station.along_m
        at_end = left_m <= ARRIVED_M
        if at_end and on_path:
            return None
        if self._turning and on_path:
            error_rad = wrap(leg.heading_at(station.along_m) - pose.yaw_rad)
            if abs(error_rad) > HEADING_RAD:
                return turn(error_rad, self._limits)
        self._turning = False
        point_m = leg.point_at(leg.length_m if at_end else station.along_m + lookahead_m(speed_m_s))
        error_rad = bearing(point_m, pose, backwards=leg.backwards)
        self._aiming = abs(error_rad) > (AIMED_RAD if self._aiming else ASTRAY_RAD)
        if self._aiming:
            return turn(error_rad, self._limits)
        return pursue(leg, point_m, station.along_m, left_m + station.off_m, pose, self._limits)
