"""What a laser scan proves: where something is, where nothing is, and where nobody looks.

The view is judged in equal sectors around the lidar: a sector with too few explained readings is *blind*,
be it outside the fan, behind the robot's own mount, or covered by a hand. A scan that proves no sector,
whose numbers contradict each other, that repeats itself while the robot moves, or that goes blank from one
to the next, proves nothing at all.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import Floats, Hull, Mask, Surroundings, survey
from supervisor.lidar import LidarProfile, explain

SECTORS = 24
SECTOR_RAD = 2 * math.pi / SECTORS

FROZEN_REPEATS = 3
FROZEN_TRAVEL_M = 0.02
"""So many identical scans in a row while the hull has moved so far: the sensor repeats itself."""

BLANK_AFTER_SHARE = 0.1
BLANK_DROP = 0.1
"""A scan with less than a tenth of the returns, right after one with returns on a tenth of its beams, is no
scan. It stays so until returns come back: a lidar that has lost its light looks just the same."""

HALVINGS = 40
"""Of a few metres: to far below a micrometre."""

ANGLE_SLACK_BEAMS = 2.0
"""Drivers count the last beam, the one after it, or round."""

Ranges = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a lidar sits on the robot, and what it sees of the robot itself."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    masked_rad: tuple[tuple[float, float], ...] = ()
    """Sectors (from, to) in the lidar's frame, counter-clockwise, that show the robot: they are blind."""


class ScanReading(NamedTuple):
    """The newest scan, as the law uses it."""

    taken_s: float
    """When, by our clock: its arrival less its time on the way."""
    period_s: float
    """Between it and the one before; the scan timeout for the first one."""
    surroundings: Surroundings
    problem: str | None
    """Why it proves nothing; None for a valid scan."""
    ranges: Ranges
    repeats: int
    """How many scans right before it were the same to the bit."""
    travelled_m: float
    """The odometer at the first of those."""
    return_share: float
    """Of the beams; of the last scan that was not blank, if this one is."""


@dataclass(frozen=True)
class _Beams:
    """What depends on a scan's geometry alone."""

    origin_m: Floats
    """(2, 1): of the lidar in the base frame."""
    direction: Floats
    """(2, n): unit vectors in the base frame."""
    sector: npt.NDArray[np.int64]
    looking: Mask
    hull_m: Floats
    """How far each beam runs inside the hull [m]; zero where the lidar is outside of it."""
    needed: float
    """Explained readings that prove a sector."""


def read_scan(
    ranges: Ranges,
    *,
    angle_min: float,
    angle_max: float | None = None,
    angle_increment: float,
    range_min: float,
    range_max: float,
    mount: Mount,
    profile: LidarProfile,
    hull: Hull,
    stop_distance_m: float,
    min_beams: int,
    min_valid_share: float,
) -> tuple[Surroundings, str | None, float]:
    """The surroundings that one scan shows, what is wrong with it (None: nothing), and its share of returns.

    Args:
        ranges: (n,) readings [m].
        angle_min: of the first beam [rad], counter-clockwise from the lidar's x axis.
        angle_max: of the last beam [rad], as the sender has it; None where it does not say.
        angle_increment: from beam to beam [rad]; negative for a clockwise scan.
        range_min: the shortest measurable distance [m].
        range_max: the longest [m].
        mount: the lidar's pose in the base frame.
        profile: what its readings mean.
        hull: the robot's outline.
        stop_distance_m: how far beyond the hull it must be seen.
        min_beams: fewer than these are no scan.
        min_valid_share: of the readings in a sector that must be explained, above 0, at most 1.
    """
    problem = _contradiction(
        len(ranges), angle_min, angle_max, angle_increment, range_min, range_max, min_beams
    )
    if problem is not None:
        return survey(hull, np.empty((0, 2))), problem, 0.0
    beams = _beams(len(ranges), angle_min, angle_increment, mount, hull, min_valid_share)
    readings = explain(ranges, range_min, range_max, profile)
    explained = np.bincount(beams.sector[readings.explained & beams.looking], minlength=SECTORS)
    proven = explained >= beams.needed
    if np.count_nonzero(proven) == 0:
        return survey(hull, np.empty((0, 2))), "no sector with enough valid readings", 0.0
    (hit,) = (readings.hit & beams.looking).nonzero()
    if len(hit) == 0 and not (ranges > range_max).any():
        return survey(hull, np.empty((0, 2))), "nothing but codes for no return", 0.0
    # Nothing can be inside the hull: what reads so is at its outline, in the direction of its beam.
    distance = np.maximum(readings.distance_m, beams.hull_m).take(hit)
    points: Floats = (beams.direction.take(hit, axis=1) * distance + beams.origin_m).T
    outline_sector = _outline_sectors(hull, mount, stop_distance_m)
    return survey(hull, points, blind=~proven[outline_sector]), None, len(points) / len(ranges)


def continue_reading(previous: ScanReading | None, reading: ScanReading) -> ScanReading:
    """The reading in the light of the one before: frozen, blank, or as it is.

    Args:
        previous: the last accepted scan.
        reading: the new one, by itself, with the odometer as it is now.
    """
    if previous is None:
        return reading
    repeats, since_m = 0, reading.travelled_m
    if previous.ranges.tobytes() == reading.ranges.tobytes():
        repeats, since_m = previous.repeats + 1, previous.travelled_m
    problem, share = reading.problem, reading.return_share
    if (
        problem is None
        and share > 0.0
        and repeats >= FROZEN_REPEATS
        and reading.travelled_m - since_m > FROZEN_TRAVEL_M
    ):
        problem = f"the same {repeats + 1} times while the robot moves"
    if (
        problem is None
        and previous.return_share >= BLANK_AFTER_SHARE
        and share < BLANK_DROP * previous.return_share
    ):
        problem, share = "blank from one scan to the next", previous.return_share
    return ScanReading(
        reading.taken_s,
        reading.period_s,
        reading.surroundings,
        problem,
        reading.ranges,
        repeats,
        since_m,
        share if reading.problem is None else previous.return_share,
    )


def _contradiction(
    beams: int,
    angle_min: float,
    angle_max: float | None,
    angle_increment: float,
    range_min: float,
    range_max: float,
    min_beams: int,
) -> str | None:
    """Why numbers that do not fit together describe no scan."""
    if beams < min_beams:
        return f"{beams} beams, fewer than {min_beams}"
    if not all(map(math.isfinite, (angle_min, angle_increment, range_min, range_max))):
        return "geometry that is not finite"
    if angle_increment == 0.0 or abs(angle_increment) * (beams - 1) > 2 * math.pi + 1e-3:
        return f"{beams} beams of {angle_increment:g} rad are more than a turn, or none"
    last = angle_min + angle_increment * (beams - 1)
    if angle_max is not None and not abs(angle_max - last) <= ANGLE_SLACK_BEAMS * abs(angle_increment):
        return f"{beams} beams of {angle_increment:g} rad end at {last:g} rad, not at {angle_max:g}"
    if not 0.0 <= range_min < range_max:
        return f"range_min {range_min:g} m and range_max {range_max:g} m contradict each other"
    return None


@lru_cache(maxsize=8)
def _beams(
    count: int, angle_min: float, angle_increment: float, mount: Mount, hull: Hull, min_valid_share: float
) -> _Beams:
    angle: Floats = angle_min + angle_increment * np.arange(count, dtype=np.float64)
    looking = np.ones(count, dtype=np.bool_)
    for start, end in mount.masked_rad:
        looking &= (angle - start) % (2 * math.pi) > (end - start) % (2 * math.pi)
    cos: Floats = np.cos(mount.yaw_rad + angle)
    sin: Floats = np.sin(mount.yaw_rad + angle)
    return _Beams(
        origin_m=np.array([[mount.x_m], [mount.y_m]]),
        direction=np.array([cos, sin]),
        hull_m=_run_inside(hull, mount, cos, sin),
        sector=_sector(angle),
        looking=looking,
        needed=max(1.0, min_valid_share * SECTOR_RAD / abs(angle_increment)),
    )


def _run_inside(hull: Hull, mount: Mount, cos: Floats, sin: Floats) -> Floats:
    """How far each beam runs inside the hull, by halving: a convex hull is left but once."""
    inside, outside = np.zeros(len(cos)), np.full(len(cos), 2.0 * hull.radius_m)
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2.0
        points = np.array([mount.x_m + middle * cos, mount.y_m + middle * sin]).T
        within = hull.nearest(points)[0] < 0.0
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return outside if hull.nearest(np.array([[mount.x_m, mount.y_m]]))[0][0] < 0.0 else np.zeros(len(cos))


@lru_cache(maxsize=8)
def _outline_sectors(hull: Hull, mount: Mount, stop_distance_m: float) -> npt.NDArray[np.int64]:
    """For each point of the hull's outline, the lidar's sector that sees what it would run into."""
    points, normals = hull.outline()
    ahead = points + stop_distance_m * normals
    direction: Floats = np.arctan2(ahead[:, 1] - mount.y_m, ahead[:, 0] - mount.x_m)
    return _sector(direction - mount.yaw_rad)


def _sector(angle_rad: Floats) -> npt.NDArray[np.int64]:
    """Which sector a direction in the lidar's frame is in; a beam on the edge belongs to the next one."""
    turn = (angle_rad % (2 * math.pi)) / SECTOR_RAD
    return np.floor(turn + 1e-6).astype(np.int64) % SECTORS
