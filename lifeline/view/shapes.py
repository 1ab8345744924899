"""The primitives of a view: shapes in metres in named frames, values over time, states and log lines. Pure.

The first part of a path is the frame: `odom` is the odometry's frame, `base_link` the robot, `<lidar>_scan` the robot at the
time of the last scan of this lidar. z is up; everything that the robot measures lies in the plane. The robot's hull, lines at
a distance from it, and the free space of a scan are shapes in the base frame.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.scan import Mount, View, is_full_turn, rays_of
from wire.outline import line_around

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

Colour = tuple[int, int, int, int]
"""Red, green, blue and opacity, each 0 to 255."""


class Level(StrEnum):
    """Severity of a log line."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


class Frame(NamedTuple):
    """The pose of a frame in `odom`."""

    name: str
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points (n, 2) [m] with one colour for all, or one for each (n, 4)."""

    path: str
    points_m: Floats
    colours: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line through points (n, 2) [m]."""

    path: str
    points_m: Floats
    colour: Colour
    radius_m: float
    height_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """Triangles (m, 3) of corners (n, 2) [m], in one colour."""

    path: str
    corners_m: Floats
    triangles: Indices
    colour: Colour
    height_m: float = 0.0


class Value(NamedTuple):
    """A number over time; NaN: unknown."""

    path: str
    value: float


class State(NamedTuple):
    """A named state, valid until the next one of this path; an empty text: none."""

    path: str
    text: str


class LogLine(NamedTuple):
    """One line of the log."""

    path: str
    text: str
    level: Level


Primitive = Frame | Points | Line | Area | Value | State | LogLine


SEGMENTS = 96
"""Points of a full turn."""


def outline(hull: Hull, away_m: float = 0.0) -> Floats:
    """Return the closed line (n, 2) [m] at a distance from a hull; its last point is its first.

    Args:
        hull: a circle or a convex polygon.
        away_m: the distance of each point of the line from the hull.
    """
    if isinstance(hull, Circle):
        line = line_around([(0.0, 0.0)], hull.radius_m + away_m, SEGMENTS)
    else:
        assert isinstance(hull, ConvexPolygon)  # the configuration has no other shape
        line = line_around(hull.corners, away_m, SEGMENTS)
    return np.vstack([line, line[:1]])


def fan(line_m: Floats) -> tuple[Floats, Indices]:
    """Return a closed line around the origin as an area: corners (n, 2) [m] and triangles (m, 3)."""
    corners = np.vstack([np.zeros((1, 2)), line_m])
    first = np.arange(1, len(line_m))
    return corners, np.column_stack((np.zeros_like(first), first, first + 1))


def free_space(view: View, mount: Mount, hull: Hull) -> tuple[Floats, Indices]:
    """Return the space between neighbouring rays that a scan proves free.

    Returns:
        the lidar's position and the ends of all rays as corners (n + 1, 2) [m] in the base frame, and the triangles
        (m, 3) between neighbouring rays that are both proven free.
    """
    rays = rays_of(view.geometry, mount, hull)
    corners = np.vstack([rays.origin_m.T, (rays.direction * view.free_m + rays.origin_m).T])
    count = view.geometry.beams
    first = np.arange(count if is_full_turn(view.geometry) else count - 1)
    second = (first + 1) % count
    known = (view.free_m[first] > 0.0) & (view.free_m[second] > 0.0)
    first, second = first[known] + 1, second[known] + 1
    return corners, np.column_stack((np.zeros_like(first), first, second))
