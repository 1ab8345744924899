"""Split a path into legs that are driven without a stop, with turns on the spot between them."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from teleop.path.pose import PathError, Pose, Poses, wrap

CORNER_RAD = 0.5
"""A sharper bend between two pieces is a corner. A curve with poses 2 cm apart has no corner down to a radius of 4 cm."""
SAME_PLACE_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A polyline without corners, driven forwards or backwards."""

    points_m: npt.NDArray[np.float64]
    """Shape (n, 2), n > 1, without equal neighbours."""
    along_m: npt.NDArray[np.float64]
    """Shape (n,): distance of each point from the first, along the leg."""
    headings_rad: npt.NDArray[np.float64]
    """Shape (n - 1,): heading of the robot on each piece."""
    backwards: bool

    @property
    def length_m(self) -> float:
        return float(self.along_m[-1])

    def point_at(self, along_m: float) -> tuple[float, float]:
        """Return the point at a distance along the leg; beyond both ends, the leg is extended straight."""
        piece = self._piece(along_m)
        (x0, y0), (x1, y1) = self.points_m[piece : piece + 2].tolist()
        start_m, end_m = self.along_m[piece : piece + 2].tolist()
        share = (along_m - start_m) / (end_m - start_m)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    def heading_at(self, along_m: float) -> float:
        """Return the robot's heading [rad] at a distance along the leg."""
        return float(self.headings_rad[self._piece(along_m)])

    def _piece(self, along_m: float) -> int:
        index = int(np.searchsorted(self.along_m, along_m, side="right")) - 1
        return min(max(index, 0), len(self.headings_rad) - 1)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A path as its legs and the robot's final heading."""

    legs: tuple[Leg, ...]
    end: Pose

    @property
    def start(self) -> Pose:
        """Pose of the robot at the start of the first leg."""
        x_m, y_m = self.legs[0].points_m[0].tolist()
        return Pose(x_m, y_m, self.legs[0].heading_at(0.0))

    @property
    def length_m(self) -> float:
        return sum(leg.length_m for leg in self.legs)


def to_path(poses: Poses) -> Path:
    """Split a path at corners and at changes between forward and backward.

    Raises:
        PathError: the path has numbers that are not finite, or has no length.
    """
    if not np.isfinite(poses).all():
        raise PathError("the path has a pose that is not of finite numbers")
    legs: list[Leg] = []
    points: list[tuple[float, float]] = []
    headings: list[float] = []
    backwards = False

    def finish() -> None:
        if headings:
            array = np.array(points)
            steps = np.hypot(*np.diff(array, axis=0).T)
            along_m = np.concatenate(([0.0], np.cumsum(steps)))
            legs.append(Leg(array, along_m, np.array(headings), backwards))

    rows: list[list[float]] = poses.tolist()
    for (x0, y0, yaw0), (x1, y1, yaw1) in pairwise(rows):
        if math.hypot(x1 - x0, y1 - y0) < SAME_PLACE_M:
            continue
        bearing_rad = math.atan2(y1 - y0, x1 - x0)
        back = math.cos(bearing_rad - (yaw0 + wrap(yaw1 - yaw0) / 2)) < 0.0
        heading_rad = wrap(bearing_rad + math.pi) if back else bearing_rad
        if not headings or back != backwards or abs(wrap(heading_rad - headings[-1])) > CORNER_RAD:
            finish()
            points, headings, backwards = [(x0, y0)], [], back
        points.append((x1, y1))
        headings.append(heading_rad)
    finish()
    if not legs:
        raise PathError("the path goes nowhere: it has no length")
    x_m, y_m = legs[-1].points_m[-1].tolist()
    return Path(tuple(legs), Pose(x_m, y_m, wrap(rows[-1][2])))
