"""Drive a path: pure pursuit along each leg, a turn on the spot before each leg and to the final heading.

Pure pursuit steers along the arc through a target point ahead on the path. For a target point at the distance d and the
angle α from the direction of motion, the curvature is 2·sin(α)/d (Coulter, 1992).
"""

import math

from teleop.path.course import Leg, Path, Pose, Station, wrap
from teleop.pilots.pilot import Velocity

LOOKAHEAD_S = 0.6
MIN_LOOKAHEAD_M = 0.15
MAX_LOOKAHEAD_M = 0.6
CREEP_M_S = 0.05
"""Minimum speed toward the end of a leg; below 0.02 m/s, the supervisor counts the robot as standing still."""
TURN_GAIN_PER_S = 4.0
MIN_TURN_RAD_S = 0.1
NEAR_M = 0.01
"""For a target point nearer than this, the bearing counts as zero."""
HEADING_RAD = 0.02
"""A turn on the spot is finished when the heading error is below this."""
ARRIVED_M = 0.01
"""A leg is finished at this distance from its end; the base stops within the rest."""
ON_PATH_M = 0.05
"""A robot farther from the path was pushed or driven away, and must return first."""
ASTRAY_RAD = 1.0
"""With a larger bearing of the target point, turn on the spot first instead of driving an arc."""
AIMED_RAD = 0.15
MAX_TURN_RAD_S = 1.5
BRAKING_M_S2 = 0.4
"""Deceleration toward the end of a leg."""
LATERAL_M_S2 = 0.5
"""Lateral acceleration in curves."""


def lookahead_m(speed_m_s: float) -> float:
    """Return the distance [m] of the target point ahead."""
    return min(max(LOOKAHEAD_S * abs(speed_m_s), MIN_LOOKAHEAD_M), MAX_LOOKAHEAD_M)


def turn(error_rad: float) -> Velocity:
    """Return the velocity for a turn on the spot toward a heading that is `error_rad` to the left."""
    rate_rad_s = min(max(TURN_GAIN_PER_S * abs(error_rad), MIN_TURN_RAD_S), MAX_TURN_RAD_S)
    return Velocity(0.0, math.copysign(rate_rad_s, error_rad))


def bearing(point_m: tuple[float, float], pose: Pose, *, backwards: bool) -> float:
    """Return the bearing [rad] of a point from the direction of motion, positive to the left; zero at the robot's place."""
    if math.dist(point_m, pose[:2]) < NEAR_M:
        return 0.0
    return wrap(
        math.atan2(point_m[1] - pose.y_m, point_m[0] - pose.x_m)
        - pose.yaw_rad
        - (math.pi if backwards else 0.0)
    )


def pursue(
    leg: Leg, point_m: tuple[float, float], along_m: float, left_m: float, pose: Pose, max_m_s: float
) -> Velocity:
    """Return the velocity on the arc through a target point, limited for its curvature, the next bend and the leg's end.

    Args:
        leg: the current leg.
        point_m: the target point.
        along_m: distance driven along the leg.
        left_m: remaining distance on the leg.
        pose: the robot's pose.
        max_m_s: the maximum speed.
    """
    distance_m = max(math.dist(point_m, pose[:2]), NEAR_M)
    curvature_per_m = 2.0 * math.sin(bearing(point_m, pose, backwards=leg.backwards)) / distance_m
    bend_rad = abs(wrap(leg.heading_at(along_m + MAX_LOOKAHEAD_M) - leg.heading_at(along_m)))
    sharpest_per_m = max(abs(curvature_per_m), bend_rad / MAX_LOOKAHEAD_M)
    speed_m_s = min(max_m_s, math.sqrt(2.0 * BRAKING_M_S2 * max(left_m, 0.0)))
    if sharpest_per_m > 0.0:
        speed_m_s = min(speed_m_s, MAX_TURN_RAD_S / sharpest_per_m, math.sqrt(LATERAL_M_S2 / sharpest_per_m))
    speed_m_s = min(max(speed_m_s, CREEP_M_S), max_m_s)
    rate_rad_s = min(max(curvature_per_m * speed_m_s, -MAX_TURN_RAD_S), MAX_TURN_RAD_S)
    return Velocity(-speed_m_s if leg.backwards else speed_m_s, rate_rad_s)


class Course:
    """One drive along a path, at up to a speed. It can be interrupted for any time and continues where it was."""

    def __init__(self, path: Path, speed_m_s: float) -> None:
        self.path = path
        self._max_m_s = speed_m_s
        self._index = 0
        self._along_m = 0.0
        self._turning = True
        self._aiming = False

    @property
    def done_m(self) -> float:
        """How much of the whole path has been driven."""
        return sum(leg.length_m for leg in self.path.legs[: self._index]) + self._along_m

    def station(self, pose: Pose) -> Station:
        """Return the point of the path where the robot should be, and its distance from it; does not change the state."""
        at_end = self._index == len(self.path.legs)
        leg = self.path.legs[-1] if at_end else self.path.legs[self._index]
        return leg.nearest(pose.x_m, pose.y_m, leg.length_m if at_end else self._along_m)

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
            self._index, self._along_m = self._index + 1, 0.0
            self._turning, self._aiming = True, False
        error_rad = wrap(self.path.end.yaw_rad - pose.yaw_rad)
        return turn(error_rad) if abs(error_rad) > HEADING_RAD else None

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
                return turn(error_rad)
        self._turning = False
        point_m = leg.point_at(leg.length_m if at_end else station.along_m + lookahead_m(speed_m_s))
        error_rad = bearing(point_m, pose, backwards=leg.backwards)
        self._aiming = abs(error_rad) > (AIMED_RAD if self._aiming else ASTRAY_RAD)
        if self._aiming:
            return turn(error_rad)
        return pursue(leg, point_m, station.along_m, left_m + station.off_m, pose, self._max_m_s)
