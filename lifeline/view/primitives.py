"""The primitives of a view: shapes in metres in named frames, values over time, states and log lines. Pure.

The first part of a path is the frame: `odom` is the odometry's frame, `base_link` the robot, `<lidar>_scan` the robot at the
time of the last scan of this lidar. z is up; everything that the robot measures lies in the plane.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

Colour = tuple[int, int, int, int]
"""Red, green, blue and opacity, each 0 to 255."""


class Level(StrEnum):
    """Severity of a log line."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


@dataclass(frozen=True, slots=True)
class Frame:
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
    radius_m: float


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


@dataclass(frozen=True, slots=True)
class Value:
    """A number over time; NaN: unknown."""

    path: str
    value: float


@dataclass(frozen=True, slots=True)
class State:
    """A named state, valid until the next one of this path; an empty text: none."""

    path: str
    text: str


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line of the log."""

    path: str
    text: str
    level: Level


Primitive = Frame | Points | Line | Area | Value | State | LogLine
