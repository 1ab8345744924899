"""The displayed state of the robot, and the overlay around it in the scene: stop zone, warning ring, and lidar points.

The stop zone has the shape of the hull and the colour of the mode: green while the robot drives, amber while it is
slowed, red while it is stopped. A thin ring around it shows the warning distance.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from sim import mj
from sim.floorplan import Circle, Floats, Outline
from sim.lidar import Ranges
from sim.lidar_config import LidarConfig
from wire.message_types import MODES, SafetyStatus
from wire.outline import line_around
from wire.reasons import words_of

STOP_DISTANCE_M = 0.30
WARNING_DISTANCE_M = 0.50
"""The supervisor's default; its configuration may differ, but the status does not contain it."""
STATUS_SILENT_S = 0.5
"""Maximum age of a valid supervisor status."""

Rgb = tuple[float, float, float]


class Mode(StrEnum):
    """Modes of SafetyStatus, and one for a missing status."""

    STOPPED = "STOPPED"
    READY = "READY"
    DRIVING = "DRIVING"
    LIMITED = "LIMITED"
    ALONE = "NO SUPERVISOR"

    @classmethod
    def of(cls, number: int) -> "Mode":
        """Return the mode for a number in SafetyStatus; an unknown number counts as stopped."""
        return cls(MODES[number]) if number in range(len(MODES)) else cls.STOPPED


COLOURS: dict[Mode, Rgb] = {
    Mode.STOPPED: (0.95, 0.16, 0.12),
    Mode.READY: (0.25, 0.60, 0.95),
    Mode.DRIVING: (0.10, 0.80, 0.30),
    Mode.LIMITED: (1.00, 0.58, 0.05),
    Mode.ALONE: (0.60, 0.64, 0.68),
}


class Shown(NamedTuple):
    """The values to display at one time.

    Attributes:
        mode: The supervisor's mode.
        reasons: The names of the stop reasons, most severe first.
        speed_m_s: Forward speed of the robot.
        nearest_m: Distance from the hull to the nearest object by the supervisor's status; NaN if unknown.
        ranges: Last scan of each lidar in m, shape (beams,); empty before the first scan.
        over: The reasons whose causes have ended, and that still require a neutral command.
    """

    mode: Mode = Mode.ALONE
    reasons: tuple[str, ...] = ()
    speed_m_s: float = 0.0
    nearest_m: float = math.nan
    ranges: Sequence[Ranges] = ()
    over: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, status: SafetyStatus | None, age_s: float, speed_m_s: float, ranges: Sequence[Ranges]
    ) -> "Shown":
        """Return the values for the supervisor's last status; one that is too old counts as missing."""
        if status is None or age_s > STATUS_SILENT_S:
            return cls(speed_m_s=speed_m_s, ranges=ranges)
        over = tuple(status.causes_and_latched()[1])
        return cls(Mode.of(status.mode), tuple(status.reasons), speed_m_s, status.nearest_m, ranges, over)

    @property
    def why(self) -> str:
        """Text of the reasons that hold; if all are over, of those; empty without reasons."""
        holding = [reason for reason in self.reasons if reason not in self.over]
        if holding or not self.over:
            return in_words(holding)
        return f"over, waits for neutral: {in_words(self.over)}"

    @property
    def speed(self) -> str:
        return f"{self.speed_m_s + 0.0:.2f} m/s" if abs(self.speed_m_s) >= 0.005 else "0.00 m/s"

    @property
    def nearest(self) -> str:
        return f"{self.nearest_m:.2f} m" if math.isfinite(self.nearest_m) else "-"


def in_words(reasons: Sequence[str]) -> str:
    """Return the reasons as text in ASCII: names from the network must not draw other characters."""
    known = [(reason, words_of(reason)) for reason in reasons]
    said = [reason.lower().replace("_", " ") if words is None else words.caption for reason, words in known]
    return ", ".join(said).encode("ascii", "replace").decode()[:120]


SEGMENTS = 64
_ZONE_Z_M, _RING_Z_M = 0.0035, 0.0045
"""Heights of zone and ring, above the paint on the floor, which is 2 mm thick."""
_RING_HALF_M, _THIN_HALF_M, _HEIGHT_HALF_M = 0.011, 0.006, 0.0005
_ZONE_ALPHA, _THIN_SHARE = 0.18, 0.8
_LIT = 0.65
"""Share of the colour that the hall's lamps add."""
_POINT_M = 0.016
_FAR_RGB = (0.20, 0.95, 1.00)
_NEAR_RGB = (1.00, 0.58, 0.05)
_TOUCHING_RGB = (1.00, 0.10, 0.10)
MAX_POINTS = 1024
"""Maximum number of points drawn for a lidar; with more beams, every second or third beam is drawn, and so on."""
_TOLERANCE_M = 0.02
"""A point beyond the stop distance by less than this is drawn as inside, because a stopped robot rests there."""


def offset_outline(hull: Outline, distance_m: float) -> Floats:
    """Return `SEGMENTS` points (n, 2) [m] at a distance from a hull, counter-clockwise, in the hull's frame; its pose is ignored."""
    if isinstance(hull, Circle):
        return line_around([(0.0, 0.0)], hull.radius_m + distance_m, SEGMENTS)
    x_m, y_m = hull.half_x_m, hull.half_y_m
    return line_around([(x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m)], distance_m, SEGMENTS)


def gaps_m(hull: Outline, points_m: Floats) -> Floats:
    """Return the distances (n,) [m] of points (n, 2) in the hull's frame from the hull; the points must be outside it."""
    if isinstance(hull, Circle):
        return np.hypot(points_m[:, 0], points_m[:, 1]) - hull.radius_m
    beyond_m = np.maximum(np.abs(points_m) - (hull.half_x_m, hull.half_y_m), 0.0)
    return np.hypot(beyond_m[:, 0], beyond_m[:, 1])


class Overlay:
    """Geoms appended to a MuJoCo scene.

    They are created once and moved with array operations, which takes 0.1 ms per frame and does not slow the physics.

    Args:
        scene: An `MjvScene` with room for `geoms_needed` more geoms.
        hull: The robot's hull; its pose is ignored.
        lidars: The lidars whose ranges are shown.
    """

    def __init__(self, scene: Any, hull: Outline, lidars: Sequence[LidarConfig]) -> None:  # noqa: ANN401 - untyped there
        self._scene, self._hull = scene, hull
        self._fans = [_fan(lidar) for lidar in lidars]
        most = sum(len(fan.beams) for fan in self._fans)

        stop_m = offset_outline(hull, STOP_DISTANCE_M)
        places, turns, sizes = zip(
            _zone(stop_m),
            _ring(stop_m, _RING_HALF_M),
            _ring(offset_outline(hull, WARNING_DISTANCE_M), _THIN_HALF_M),
            strict=True,
        )
        self._places, self._turns = np.concatenate(places), np.concatenate(turns)
        shapes = [mj.Shape.TRIANGLE] * SEGMENTS + [mj.Shape.BOX] * (2 * SEGMENTS)
        first, marks = int(scene.ngeom), len(shapes)
        half_sizes: Floats = np.concatenate(sizes)
        for shape, size in zip(shapes, half_sizes, strict=True):
            mj.add_geom(scene, shape, size, emission=0.7)
        for _ in range(most):
            mj.add_geom(scene, mj.Shape.SPHERE, np.full(3, _POINT_M), emission=1.0)
        self._marks = mj.GeomArrays(scene, first, marks)
        self._points = mj.GeomArrays(scene, first + marks, most)
        self._before_points = first + marks

    def update(self, x_m: float, y_m: float, yaw_rad: float, shown: Shown) -> None:
        """Update the geoms for a pose of the robot in the world."""
        cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
        turn = np.array(((cos_yaw, -sin_yaw, 0.0), (sin_yaw, cos_yaw, 0.0), (0.0, 0.0, 1.0)))
        here_m = np.array((x_m, y_m, 0.0))
        marks, colour = self._marks, COLOURS[shown.mode]
        marks.pos[:] = self._places @ turn.T + here_m
        marks.mat[:] = turn @ self._turns
        marks.rgba[:, :3] = _LIT * np.array(colour)
        marks.rgba[:SEGMENTS, 3] = _ZONE_ALPHA
        marks.rgba[2 * SEGMENTS :, :3] *= _THIN_SHARE
        hits = 0
        for fan, ranges in zip(self._fans, shown.ranges, strict=False):
            hits += self._draw_points(hits, fan, ranges, turn, here_m)
        self._scene.ngeom = self._before_points + hits

    def _draw_points(self, first: int, fan: "_Fan", ranges: Ranges, turn: Floats, here_m: Floats) -> int:
        """Place a point at each return of a lidar, starting with the geom `first`; return the number of points."""
        ranges = ranges[:: fan.every]
        seen = np.flatnonzero(np.isfinite(ranges))
        own_m = fan.at_m[:2] + ranges[seen, None].astype(np.float64) * fan.beams[seen]
        points = slice(first, first + len(seen))
        self._points.pos[points, :2] = own_m @ turn[:2, :2].T + here_m[:2]
        self._points.pos[points, 2] = fan.at_m[2]
        away_m = gaps_m(self._hull, own_m)
        colours = np.empty((len(seen), 4))
        colours[:] = (*_FAR_RGB, 1.0)
        colours[away_m < WARNING_DISTANCE_M] = (*_NEAR_RGB, 1.0)
        colours[away_m < STOP_DISTANCE_M + _TOLERANCE_M] = (*_TOUCHING_RGB, 1.0)
        self._points.rgba[points] = colours
        return len(seen)


class _Fan(NamedTuple):
    """The beams of a lidar that are drawn, in the robot's frame."""

    every: int
    beams: Floats
    """(n, 2) unit vectors."""
    at_m: Floats
    """(3,): position of the lidar."""


def _fan(lidar: LidarConfig) -> _Fan:
    every = math.ceil(lidar.beams / MAX_POINTS)
    angles_rad = lidar.angles_rad[::every] + lidar.yaw_rad
    beams = np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
    return _Fan(every, beams, np.array((lidar.x_m, lidar.y_m, lidar.height_m)))


def geoms_needed(lidars: Sequence[LidarConfig]) -> int:
    """Return the number of geoms that an overlay needs."""
    return 3 * SEGMENTS + sum(min(lidar.beams, MAX_POINTS) for lidar in lidars)


def _zone(outline_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Return a fan of triangles around the centre: positions, frames, sizes. Two sides of a triangle are its x and y axes."""
    ahead_m = np.roll(outline_m, -1, axis=0)
    turns = np.zeros((SEGMENTS, 3, 3))
    turns[:, :2, 0], turns[:, :2, 1], turns[:, 2, 2] = outline_m, ahead_m, 1.0
    return np.tile((0.0, 0.0, _ZONE_Z_M), (SEGMENTS, 1)), turns, np.ones((SEGMENTS, 3))


def _ring(outline_m: Floats, half_width_m: float) -> tuple[Floats, Floats, Floats]:
    """Return straight pieces from point to point: positions, frames and half sizes."""
    ahead_m = np.roll(outline_m, -1, axis=0)
    along_m = ahead_m - outline_m
    lengths_m = np.hypot(along_m[:, 0], along_m[:, 1])
    cos, sin = (along_m / lengths_m[:, None]).T
    places = np.column_stack((0.5 * (outline_m + ahead_m), np.full(SEGMENTS, _RING_Z_M)))
    turns = np.zeros((SEGMENTS, 3, 3))
    turns[:, 0, 0], turns[:, 0, 1], turns[:, 1, 0], turns[:, 1, 1] = cos, -sin, sin, cos
    turns[:, 2, 2] = 1.0
    # A little longer than the gap, so that the outer corners of two pieces meet.
    halves_m = 0.5 * lengths_m + half_width_m * math.tan(math.pi / SEGMENTS)
    sizes = np.column_stack((halves_m, np.full(SEGMENTS, half_width_m), np.full(SEGMENTS, _HEIGHT_HALF_M)))
    return places, turns, sizes
