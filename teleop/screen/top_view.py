"""Top view of the robot and the lidar points, in characters.

Forward is up, left is left, and the origin of the base frame is in the middle. Each character has 2 x 4 dots (braille),
so that dots are square; on terminals without braille, the same picture is drawn in ASCII. Each character shows only the
most important of its contents: points close to the hull, the hull, other points, the rings.
"""

import itertools
import math
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from teleop.screen.view import Line, Robot, Segment, Tone
from wire import topics
from wire.messages import LaserScan

Floats = npt.NDArray[np.float64]
Cells = npt.NDArray[np.uint8]

NEAR_M = 1.5
"""Minimum visible distance around the hull."""
FINEST_M, COARSEST_M = 0.03, 1.0
"""Minimum and maximum size of a dot; a larger terminal shows a larger area instead of smaller dots."""

_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
"""Bit of each of the 4 x 2 dots of a character."""
_BRAILLE = 0x2800

# Contents of a character, by rank.
_NOTHING, _OUTER_RING, _INNER_RING, _POINT, _HULL, _WARNING, _STOP = range(7)
_TONES = (Tone.DIM, Tone.DIM, Tone.DIM, Tone.PLAIN, Tone.STRONG, Tone.CAUTION, Tone.STOP)
_STALE_TONES = (Tone.DIM,) * 4 + (Tone.STRONG,) + (Tone.DIM,) * 2
_ASCII = np.array([ord(char) for char in " .:o+X#"], dtype=np.uint8)


class Scale(NamedTuple):
    """Scale and size of the picture."""

    columns: int
    rows: int
    dot_m: float


def scale_of(robot: Robot, columns: int, rows: int) -> Scale:
    """Return the scale at which NEAR_M around the hull fits into this number of characters."""
    dot_m = 2.0 * (_farthest_m(robot) + NEAR_M) / max(1, min(2 * columns, 4 * rows))
    return Scale(columns, rows, dot_m if FINEST_M <= dot_m <= COARSEST_M else FINEST_M)


def draw_top_view(
    scan: LaserScan | None,
    robot: Robot,
    columns: int,
    rows: int,
    *,
    is_stale: bool = False,
    unicode: bool = True,
) -> list[Line]:
    """Return `rows` lines of `columns` characters.

    Args:
        scan: the scan; None: draw only the hull and its rings.
        robot: the hull, with rings at the stop distance and the warning distance.
        columns: at least 1.
        rows: at least 1.
        is_stale: whether the scan is too old; its points are then grey.
        unicode: False: only ASCII.
    """
    scale = scale_of(robot, columns, rows)
    with np.errstate(all="ignore"):  # draw any numbers in scans and configurations
        dots, ranks = _background(robot, scale)
        if scan is not None:
            dots, ranks = _with_points(dots, ranks, scan, robot, scale)
    if unicode:
        codes = dots.astype("<u4") + np.uint32(_BRAILLE)
        codes[dots == 0] = ord(" ")
    else:
        codes = _ASCII[ranks].astype("<u4")
    return _lines(codes, ranks, _STALE_TONES if is_stale else _TONES)


def clearance_m(points: Floats, robot: Robot) -> Floats:
    """Return the distances (n,) [m] of points (n, 2) [m] in the base frame from the hull; zero inside."""
    if len(robot.corners_m) < 3:
        return np.maximum(np.hypot(points[:, 0], points[:, 1]) - robot.radius_m, 0.0)
    starts = np.array(robot.corners_m, dtype=np.float64)
    sides = np.roll(starts, -1, axis=0) - starts
    lengths2 = np.maximum((sides * sides).sum(axis=1), 1e-12)
    offsets = points[:, None, :] - starts
    along = np.clip((offsets * sides).sum(axis=2) / lengths2, 0.0, 1.0)
    gaps = offsets - along[:, :, None] * sides
    turns = sides[:, 0] * offsets[:, :, 1] - sides[:, 1] * offsets[:, :, 0]
    inside = (turns >= 0.0).all(axis=1) | (turns <= 0.0).all(axis=1)  # corners in either direction
    return np.where(inside, 0.0, np.sqrt((gaps * gaps).sum(axis=2).min(axis=1)))


def _with_points(
    dots: Cells, ranks: Cells, scan: LaserScan, robot: Robot, scale: Scale
) -> tuple[Cells, Cells]:
    """Return the picture with the scan's points added."""
    points = _points(scan, robot, scale)
    down, right = _places(points, scale)
    seen = (down >= 0) & (down < 4 * scale.rows) & (right >= 0) & (right < 2 * scale.columns)
    points, down, right = points[seen], down[seen], right[seen]
    gaps = clearance_m(points, robot)
    close = np.where(gaps <= robot.warning_distance_m, np.uint8(_WARNING), np.uint8(_POINT))
    rank = np.where(gaps <= robot.stop_distance_m, np.uint8(_STOP), close)
    at = (down // 4) * scale.columns + right // 2
    over = np.zeros(dots.size, dtype=np.uint8)
    over_rank = np.zeros(dots.size, dtype=np.uint8)
    np.bitwise_or.at(over, at, _DOTS[down % 4, right % 2])
    np.maximum.at(over_rank, at, rank)
    over, over_rank = over.reshape(dots.shape), over_rank.reshape(dots.shape)
    on_top = over_rank > ranks
    return np.where(on_top, over, dots), np.where(on_top, over_rank, ranks)


def _points(scan: LaserScan, robot: Robot, scale: Scale) -> Floats:
    """Return the points (n, 2) [m] in the base frame that may be in the picture."""
    ranges = scan.ranges
    farthest_m = scale.dot_m * math.hypot(scale.columns, 2 * scale.rows) + math.hypot(
        robot.lidar_x_m, robot.lidar_y_m
    )
    # NaN and infinity give no point: comparisons with NaN are false, and infinity exceeds every limit.
    at = np.flatnonzero((ranges >= max(0.0, scan.range_min)) & (ranges <= min(scan.range_max, farthest_m)))
    sign = -1.0 if robot.lidar_flip else 1.0
    first_rad = robot.lidar_yaw_rad + sign * scan.angle_min
    beams = _beams(len(ranges), first_rad, sign * scan.angle_increment)[at]
    points = beams * ranges[at, None] + np.array([robot.lidar_x_m, robot.lidar_y_m])
    return points[np.isfinite(points).all(axis=1)]


@lru_cache(maxsize=4)
def _beams(count: int, first_rad: float, increment_rad: float) -> Floats:
    """Return unit vectors (count, 2) of the beams; NaN for angles that are not finite."""
    angles = first_rad + increment_rad * np.arange(count)
    return np.column_stack((np.cos(angles), np.sin(angles)))


def _places(points: Floats, scale: Scale) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the rows and columns of the dots of points, which may be outside the picture."""
    down = np.floor(2.0 * scale.rows - points[:, 0] / scale.dot_m).astype(np.int64)
    right = np.floor(scale.columns - points[:, 1] / scale.dot_m).astype(np.int64)
    return down, right


@lru_cache(maxsize=4)
def _background(robot: Robot, scale: Scale) -> tuple[Cells, Cells]:
    """Return dots and ranks (rows, columns) of the hull, its nose and its rings."""
    x_m = (2.0 * scale.rows - 0.5 - np.arange(4 * scale.rows)) * scale.dot_m
    y_m = (scale.columns - 0.5 - np.arange(2 * scale.columns)) * scale.dot_m
    points = np.empty((len(x_m), len(y_m), 2))
    points[:, :, 0], points[:, :, 1] = x_m[:, None], y_m
    points = points.reshape(-1, 2)
    reach_m = _farthest_m(robot) + max(robot.stop_distance_m, robot.warning_distance_m) + scale.dot_m
    near = np.abs(points).max(axis=1) <= reach_m
    gaps = np.full(len(points), math.inf)
    gaps[near] = clearance_m(points[near], robot)
    half = scale.dot_m / 2
    around_dots = math.tau * (_farthest_m(robot) + robot.warning_distance_m) / scale.dot_m
    outer = (np.abs(gaps - robot.warning_distance_m) <= half) & _dashes(points, around_dots / 6)
    inner = np.abs(gaps - robot.stop_distance_m) <= half
    nose = (np.abs(points[:, 1]) <= half) & (points[:, 0] >= 0.0) & (gaps == 0.0)
    # The hull's edge consists of dots inside with a neighbour outside.
    within = np.pad((gaps == 0.0).reshape(len(x_m), len(y_m)), 1)
    core = within[:-2, 1:-1] & within[2:, 1:-1] & within[1:-1, :-2] & within[1:-1, 2:]
    hull = (within[1:-1, 1:-1] & ~core).ravel() | nose
    dots = np.zeros((scale.rows, scale.columns), dtype=np.uint8)
    ranks = np.zeros_like(dots)
    for rank, layer in ((_OUTER_RING, outer), (_INNER_RING, inner), (_HULL, hull)):
        here = _packed(layer.reshape(scale.rows, 4, scale.columns, 2))
        dots, ranks = np.where(here, here, dots), np.where(here, np.uint8(rank), ranks)
    return dots, ranks


def _dashes(points: Floats, count: float) -> npt.NDArray[np.bool_]:
    """Return a mask that divides a ring into `count` dashes with equal gaps, to distinguish it from walls and other rings."""
    turns = np.arctan2(points[:, 1], points[:, 0]) / math.tau
    return np.floor(turns * 2 * np.round(count)) % 2 == 0


def _packed(layer: npt.NDArray[np.bool_]) -> Cells:
    """Pack dots (rows, 4, columns, 2) into the bits of characters (rows, columns)."""
    return (layer * _DOTS[None, :, None, :]).sum(axis=(1, 3), dtype=np.uint8)


def _lines(codes: npt.NDArray[np.uint32], ranks: Cells, tones: tuple[Tone, ...]) -> list[Line]:
    """Return the lines; successive characters of equal rank form one segment."""
    lines: list[Line] = []
    columns = codes.shape[1]
    text = codes.tobytes().decode("utf-32-le")
    for row, row_ranks in enumerate(ranks):
        cuts = [0, *(np.flatnonzero(np.diff(row_ranks)) + 1).tolist(), columns]
        line = text[row * columns : (row + 1) * columns]
        # A tuple of a list: one of a generator begins with room for ten, and CPython keeps two thousand of each
        # length that it is cut to. Drawn ten times a second, that was megabytes.
        segments = [
            Segment(line[begin:end], tones[int(row_ranks[begin])]) for begin, end in itertools.pairwise(cuts)
        ]
        lines.append(tuple(segments))
    return lines


def _farthest_m(robot: Robot) -> float:
    """Return the largest distance of the hull from the base frame's origin."""
    return max((math.hypot(x, y) for x, y in robot.corners_m), default=robot.radius_m)


# --- the robot in the picture

_DEFAULT = Robot()


def robot_of(document: dict[str, Any]) -> Robot:
    """Return the hull, the lidar's mount, and the stop and warning distances in a robot.toml, for the picture.

    They are used only for drawing: missing or invalid values are replaced by defaults. The supervisor checks the
    configuration itself and refuses to start with invalid values.
    """
    supervisor = _table(document, "supervisor")
    hull, lidar = _table(supervisor, "footprint"), _lidar_on_scan(supervisor)
    return Robot(
        radius_m=_number(hull, "radius_m", _DEFAULT.radius_m),
        corners_m=_corners(hull),
        lidar_x_m=_number(lidar, "x_m", 0.0),
        lidar_y_m=_number(lidar, "y_m", 0.0),
        lidar_yaw_rad=_number(lidar, "yaw_rad", 0.0),
        lidar_flip=lidar.get("flip") is True,
        stop_distance_m=_number(supervisor, "stop_distance_m", _DEFAULT.stop_distance_m),
        warning_distance_m=_number(supervisor, "warning_distance_m", _DEFAULT.warning_distance_m),
    )


def _table(document: dict[str, Any], name: str) -> dict[str, Any]:
    value = document.get(name)
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _lidar_on_scan(supervisor: dict[str, Any]) -> dict[str, Any]:
    """Return the section of the lidar whose scan is drawn: the only one, or the one on the topic `scan`."""
    lidars = supervisor.get("lidars")
    if not isinstance(lidars, list):
        return _table(supervisor, "lidar")
    for entry in cast("list[object]", lidars):
        if isinstance(entry, dict):
            table = cast("dict[str, Any]", entry)
            if table.get("topic") == topics.SCAN.key:
                return table
    return {}


def _number(table: dict[str, Any], name: str, default: float) -> float:
    value = table.get(name)
    return float(value) if isinstance(value, int | float) else default


def _corners(hull: dict[str, Any]) -> tuple[tuple[float, float], ...]:
    try:
        return tuple((float(x_m), float(y_m)) for x_m, y_m in hull.get("corners_m", ()))
    except (TypeError, ValueError):
        return ()
