"""Records the drives: odometry, scans, the wall in them, and the supervisor's commands."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from commission.estimate import Floats
from commission.mounting import Motion
from commission.wall import Wall, follow, nearest_wall
from supervisor.law.scan import Geometry, LaserScan, Mount
from teleop.path.course import Pose, seen_from, wrap

MAX_SAMPLES = 60_000
"""Twenty minutes of odometry at 50 Hz; older samples are dropped."""
LOST_S = 1.0
"""A wall that is not seen for this long is lost."""


class Odom(NamedTuple):
    """A sample of odometry."""

    at_s: float
    pose: Pose
    linear_m_s: float
    angular_rad_s: float
    sent_s: float
    """By the clock of its sender; if it has no stamp, its arrival."""


class Scan(NamedTuple):
    """A scan: its readings, and the wall in it."""

    at_s: float
    ranges_m: Floats
    """(n,): not finite without a return."""
    wall: Wall | None
    """In the lidar's frame, as seen from above."""


class Command(NamedTuple):
    """A command of the supervisor to the base."""

    at_s: float
    is_zero: bool


class Trace:
    """The samples, the oldest first.

    Args:
        mount: the configured mount of the lidar.
    """

    def __init__(self, mount: Mount) -> None:
        self._mount = mount
        self.odometry = deque[Odom](maxlen=MAX_SAMPLES)
        self.scans = deque[Scan](maxlen=MAX_SAMPLES)
        self.commands = deque[Command](maxlen=MAX_SAMPLES)
        self._wall: tuple[float, float, Wall] | None = None
        """When the wall was seen last, the yaw by odometry at this time, and the wall."""

    def add_scan(self, scan: LaserScan) -> None:
        """Add a scan, and follow the wall in it."""
        at_s, geometry = scan.arrival_s, Geometry.of(scan, self._mount)
        angles = geometry.angle_min + geometry.increment * np.arange(geometry.beams, dtype=np.float64)
        ranges = np.asarray(scan.ranges, dtype=np.float64)
        ranges = np.where((ranges > scan.range_min) & (ranges < scan.range_max), ranges, math.inf)
        yaw_rad = self.odometry[-1].pose.yaw_rad if self.odometry else 0.0
        if self._wall is None:
            wall = nearest_wall(angles, ranges)
        else:
            _, before_rad, before = self._wall
            turned_rad = wrap(before_rad - yaw_rad)
            # A wrong turn sign of odometry or a mirrored lidar moves the wall the other way.
            found = (
                follow(before, angles, ranges, rad) for rad in dict.fromkeys((turned_rad, 0.0, -turned_rad))
            )
            wall = next(filter(None, found), None)
        if wall is not None:
            self._wall = (at_s, yaw_rad, wall)
        self.scans.append(Scan(at_s, ranges, wall))

    def forget_wall(self) -> None:
        """Choose the nearest wall anew in the next scan."""
        self._wall = None

    def wall(self, now_s: float) -> Wall | None:
        """Return the wall as seen last; None if it is lost."""
        if self._wall is None or now_s - self._wall[0] > LOST_S:
            return None
        return self._wall[2]

    def between(self, from_s: float, to_s: float) -> "Trace":
        """Return the samples of a time."""
        part = Trace(self._mount)
        part.odometry.extend(one for one in self.odometry if from_s <= one.at_s <= to_s)
        part.scans.extend(one for one in self.scans if from_s <= one.at_s <= to_s)
        part.commands.extend(one for one in self.commands if from_s <= one.at_s <= to_s)
        return part

    def mean_wall(self) -> Wall | None:
        """Return the mean of the walls of these scans, of a robot at rest."""
        walls = [scan.wall for scan in self.scans if scan.wall is not None]
        if not walls:
            return None
        first = walls[0]
        turns = [wrap(wall.bearing_rad - first.bearing_rad) for wall in walls]
        return first._replace(
            distance_m=float(np.mean([wall.distance_m for wall in walls])),
            bearing_rad=first.bearing_rad + float(np.mean(turns)),
        )

    def same_beams(self) -> Floats:
        """Return the readings (scans, beams) of the scans with as many beams as the first."""
        if not self.scans:
            return np.empty((0, 0))
        beams = len(self.scans[0].ranges_m)
        return np.array([scan.ranges_m for scan in self.scans if len(scan.ranges_m) == beams])

    def toward(self, start: Pose) -> Floats:
        """Return odometry (n, 3): arrival [s], distance ahead of a pose [m], speed [m/s]."""
        rows = [(one.at_s, ahead_m(start, one.pose), one.linear_m_s) for one in self.odometry]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def turning(self, start: Pose) -> Floats:
        """Return odometry (n, 3): arrival [s], counter-clockwise turn since a pose [rad], rate [rad/s]."""
        rows = [
            (one.at_s, wrap(one.pose.yaw_rad - start.yaw_rad), one.angular_rad_s) for one in self.odometry
        ]
        found = np.array(rows, dtype=np.float64).reshape(-1, 3)
        found[:, 1] = np.unwrap(found[:, 1])
        return found

    def bearings(self) -> Floats:
        """Return (n, 2): arrival [s] and bearing of the wall [rad], without jumps at ±π."""
        rows = [(scan.at_s, scan.wall.bearing_rad) for scan in self.scans if scan.wall is not None]
        found = np.array(rows, dtype=np.float64).reshape(-1, 2)
        found[:, 1] = np.unwrap(found[:, 1])
        return found

    def walls(self) -> Floats:
        """Return (n, 2): arrival [s] and distance of the wall [m]."""
        rows = [(scan.at_s, scan.wall.distance_m) for scan in self.scans if scan.wall is not None]
        return np.array(rows, dtype=np.float64).reshape(-1, 2)


class Driven(NamedTuple):
    """The samples of one drive, from rest to rest."""

    trace: Trace
    """From before the start to the rest."""
    start: Pose
    speed: float
    """The commanded speed, in m/s or rad/s; positive."""
    before: Wall
    after: Wall
    stopped_s: float
    """When the supervisor commanded zero to the base."""
    rest_s: float
    is_stopped: bool
    """Whether an expected stop of the supervisor ended it."""

    def motion(self, *, is_turn: bool) -> Motion:
        odometry = self.trace.odometry
        end = odometry[-1].pose
        change = wrap(end.yaw_rad - self.start.yaw_rad) if is_turn else ahead_m(self.start, end)
        speeds = [one.angular_rad_s if is_turn else one.linear_m_s for one in odometry]
        by_speed = float(np.trapezoid(speeds, [one.at_s for one in odometry]))
        return Motion(change, by_speed, self.before, self.after)


def ahead_m(start: Pose, end: Pose) -> float:
    """Return the distance from one pose to another, along the heading of the first."""
    return float(seen_from(np.array([end]), start)[0, 0])
