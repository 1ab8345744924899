"""Paths: poses, square and circle, legs that are driven without a stop, and the path of a recording."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wire.messages import Odometry, yaw_of

CORNER_RAD = 0.5
"""A sharper bend between two pieces is a corner. A curve with poses 2 cm apart has no corner down to a radius of 4 cm."""
SAME_PLACE_M = 1e-6
STEP_M = 0.02
"""Distance between two poses of a curve."""
MIN_STEPS = 72
"""Minimum number of steps of a full circle."""
WINDOW_M = 0.4
"""Progress is searched only this far ahead and never behind, so a crossing does not skip part of the path."""

Floats = npt.NDArray[np.float64]
Poses = Floats
"""A path: shape (n, 3), each row x [m], y [m], yaw [rad]. Two rows at one place are a turn on the spot. A row behind its
predecessor, in the frame of the latter, is reached backwards."""


class PathError(ValueError):
    """The path does not exist or cannot be driven; the message says why, and what to do."""


# --- poses


class Pose(NamedTuple):
    """Planar pose of the robot; yaw counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(message: Odometry) -> "Pose":
        """Return the pose in an odometry message."""
        pose = message.pose.pose
        return Pose(pose.position.x, pose.position.y, yaw_of(pose.orientation))

    @property
    def is_finite(self) -> bool:
        return all(map(math.isfinite, self))


def wrap(angle_rad: float) -> float:
    """Return the same angle in [-π, π]."""
    return math.remainder(angle_rad, math.tau)


def placed(poses: Poses, frame: Pose) -> Poses:
    """Transform poses (n, 3) from the frame `frame` to its parent frame."""
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    x, y, yaw = poses.T
    return np.stack(
        (frame.x_m + cos * x - sin * y, frame.y_m + sin * x + cos * y, yaw + frame.yaw_rad), axis=1
    )


def seen_from(poses: Poses, frame: Pose) -> Poses:
    """Transform poses (n, 3) to the frame `frame` from its parent frame."""
    centred = poses - np.array([frame.x_m, frame.y_m, 0.0])
    return placed(centred, Pose(0.0, 0.0, -frame.yaw_rad))


# --- shapes, in the robot's frame at the start: it stands at the origin and faces along x


def square(side_m: float, laps: int = 1, *, clockwise: bool = False) -> Poses:
    """Return a square: the first side is straight ahead, each corner a turn on the spot; it ends at the start pose."""
    left = -1 if clockwise else 1
    corners_m = side_m * np.array([(0, 0), (1, 0), (1, left), (0, left)])
    rows = [
        (*corners_m[(side + end) % 4], side * left * math.pi / 2)
        for side in range(4 * laps)
        for end in (0, 1)
    ]
    return np.array([*rows, (0.0, 0.0, 2 * laps * left * math.pi)])


def circle(radius_m: float, laps: int = 1, *, clockwise: bool = False) -> Poses:
    """Return a circle with its centre to the left, or to the right if clockwise; it ends at the start pose."""
    steps = max(MIN_STEPS, math.ceil(math.tau * radius_m / STEP_M))
    angle = np.linspace(0.0, laps * math.tau, laps * steps + 1)
    side = -1.0 if clockwise else 1.0
    return np.stack((radius_m * np.sin(angle), side * radius_m * (1.0 - np.cos(angle)), side * angle), axis=1)


# --- legs


class Station(NamedTuple):
    """The nearest point of a leg."""

    along_m: float
    off_m: float
    """Distance of the robot from this point."""


@dataclass(frozen=True, slots=True)
class TrackError:
    """Number, root mean square and maximum of the distances from a path [m]."""

    count: int
    rms_m: float
    max_m: float

    @classmethod
    def of(cls, distances_m: Sequence[float]) -> "TrackError | None":
        """Return the error of distances; None if there are none."""
        if not distances_m:
            return None
        rms_m = math.sqrt(math.fsum(d * d for d in distances_m) / len(distances_m))
        return cls(len(distances_m), rms_m, max(distances_m))


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A polyline without corners, driven forwards or backwards."""

    points_m: Floats
    """Shape (n, 2), n > 1, without equal neighbours."""
    along_m: Floats
    """Shape (n,): distance of each point from the first, along the leg."""
    headings_rad: Floats
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

    def nearest(self, x_m: float, y_m: float, from_m: float, window_m: float = WINDOW_M) -> Station:
        """Return the point nearest to (x, y) between `from_m` and `from_m + window_m` along the leg."""
        to_m = max(from_m, min(from_m + window_m, self.length_m))
        first, last = self._piece(from_m), self._piece(to_m) + 1
        x, y = self.points_m[first:last].T
        ahead_x, ahead_y = (self.points_m[first + 1 : last + 1] - self.points_m[first:last]).T
        starts_m, ends_m = self.along_m[first:last], self.along_m[first + 1 : last + 1]
        lengths_m = ends_m - starts_m
        projected_m = starts_m + ((x_m - x) * ahead_x + (y_m - y) * ahead_y) / lengths_m
        places_m = np.minimum(np.maximum(projected_m, np.maximum(starts_m, from_m)), np.minimum(ends_m, to_m))
        share = (places_m - starts_m) / lengths_m
        off_m = np.hypot(x_m - (x + ahead_x * share), y_m - (y + ahead_y * share))
        best = int(off_m.argmin())
        return Station(float(places_m[best]), float(off_m[best]))

    def _piece(self, along_m: float) -> int:
        index = int(self.along_m.searchsorted(along_m, side="right")) - 1
        return min(max(index, 0), len(self.headings_rad) - 1)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A path as its legs, with turns on the spot between them, and the robot's final pose."""

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


def is_backwards(here: Pose, there: Pose) -> bool:
    """Return whether a robot drives backwards from one pose to another."""
    bearing_rad = math.atan2(there.y_m - here.y_m, there.x_m - here.x_m)
    return math.cos(bearing_rad - (here.yaw_rad + wrap(there.yaw_rad - here.yaw_rad) / 2)) < 0.0


def to_path(poses: Poses) -> Path:
    """Split a path into legs, at corners and at changes between forward and backward.

    Raises:
        PathError: the path has numbers that are not finite, or has no length.
    """
    if not np.isfinite(poses).all():
        raise PathError("the path has a pose that is not of finite numbers")
    pieces: list[tuple[list[tuple[float, float]], list[float], bool]] = []
    for here, there in pairwise(Pose(*row) for row in poses.tolist()):
        if math.dist(here[:2], there[:2]) < SAME_PLACE_M:
            continue
        backwards = is_backwards(here, there)
        bearing_rad = math.atan2(there.y_m - here.y_m, there.x_m - here.x_m)
        heading_rad = wrap(bearing_rad + (math.pi if backwards else 0.0))
        _, headings, was_backwards = pieces[-1] if pieces else ([], [], False)
        if not headings or backwards != was_backwards or abs(wrap(heading_rad - headings[-1])) > CORNER_RAD:
            pieces.append(([here[:2]], [], backwards))
        pieces[-1][0].append(there[:2])
        pieces[-1][1].append(heading_rad)
    if not pieces:
        raise PathError("the path goes nowhere: it has no length")
    legs = tuple(_leg(np.array(points), np.array(headings), back) for points, headings, back in pieces)
    x_m, y_m = pieces[-1][0][-1]
    return Path(legs, Pose(x_m, y_m, wrap(float(poses[-1, 2]))))


def _leg(points_m: Floats, headings_rad: Floats, backwards: bool) -> Leg:  # noqa: FBT001
    steps_m = np.hypot(*np.diff(points_m, axis=0).T)
    return Leg(points_m, np.concatenate(([0.0], np.cumsum(steps_m))), headings_rad, backwards)


# --- the odometry of a recording -> a path


TURN_RAD = 0.35
"""A larger change of heading within one step is a turn on the spot."""
ON_THE_SPOT_M = 0.005
"""A shorter step has no direction."""
LEAST_M = 0.05
"""Minimum length of a path."""
JUMP_M, JUMP_M_S = 0.25, 2.0
"""A displacement between two samples beyond `JUMP_M` plus `JUMP_M_S` times their interval is a jump of the odometry."""


def to_poses(times_s: Floats, samples: Poses) -> Poses:
    """Return the path that a robot drove.

    Args:
        times_s: recording time of each pose, shape (n,).
        samples: the poses, shape (n, 3).

    Raises:
        PathError: the recording has no path, or one that cannot be driven.
    """
    if len(samples) < 2 or not np.isfinite(samples).all():
        raise PathError("the recording's odometry is empty, or has poses that are not of finite numbers")
    _check_steady(times_s, samples)
    poses = [Pose(*row) for row in samples.tolist()]
    kept = [poses[0]]
    was_backwards: bool | None = None
    farthest = poses[0]
    """The pose farthest from the last kept one: a robot that changes direction turned round there."""
    for pose in poses:
        last = kept[-1]
        away_m = math.dist(last[:2], pose[:2])
        if abs(wrap(pose.yaw_rad - last.yaw_rad)) > TURN_RAD:
            # The turn is placed at the robot's previous position if the step has no direction.
            kept.append(last._replace(yaw_rad=pose.yaw_rad) if away_m < ON_THE_SPOT_M else pose)
        elif away_m >= STEP_M:
            backwards = is_backwards(last, pose)
            if was_backwards is not None and backwards != was_backwards and farthest != last:
                kept.append(farthest)
            kept.append(pose)
            was_backwards = backwards
        if kept[-1] != last or away_m > math.dist(last[:2], farthest[:2]):
            farthest = pose
    if kept[-1] != poses[-1]:
        kept.append(poses[-1])
    if sum(math.dist(here[:2], there[:2]) for here, there in pairwise(kept)) < LEAST_M:
        raise PathError("the robot of this recording does not drive: record it while it does")
    return np.array(kept)


def _check_steady(times_s: Floats, samples: Poses) -> None:
    steps_m = np.hypot(*np.diff(samples[:, :2], axis=0).T)
    jumps = np.flatnonzero(steps_m > JUMP_M + JUMP_M_S * np.maximum(np.diff(times_s), 0.0))
    if len(jumps):
        at = int(jumps[0])
        raise PathError(
            f"the odometry jumps by {steps_m[at]:.2f} m, {times_s[at + 1] - times_s[0]:.1f} s after the recording's "
            "start (a reset?): such a path cannot be driven; record one without"
        )
