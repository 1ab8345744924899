"""What a laser scan proves: points around the robot, or nothing at all.

Readings follow REP 117: −Inf, or anything below `range_min`, is too close to measure (an obstacle);
+Inf, or anything beyond `range_max`, is free; NaN is invalid. A scan with too few valid readings in any
direction proves nothing: a sensor half covered must not read as half free.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from supervisor.clearance import Floats, Hull, Surroundings, survey

SECTORS = 12
"""The view is judged in this many equal runs of beams."""


@dataclass(frozen=True)
class ScanReading:
    """The newest scan, as the law uses it."""

    arrival_s: float
    period_s: float
    """Between it and the one before; the configured timeout for the first one."""
    surroundings: Surroundings
    problem: str | None
    """Why it proves nothing; None for a valid scan."""


def read_scan(
    ranges: npt.NDArray[np.float32],
    *,
    angle_min: float,
    angle_increment: float,
    range_min: float,
    range_max: float,
    lidar_pose: tuple[float, float, float],
    hull: Hull,
    min_beams: int,
    min_valid_share: float,
) -> tuple[Surroundings, str | None]:
    """The surroundings that a scan shows, and what is wrong with it (None: nothing).

    Args:
        ranges: (n,) readings [m].
        angle_min: of the first beam [rad], counter-clockwise from the lidar's x axis.
        angle_increment: from beam to beam [rad]; negative for a clockwise scan.
        range_min: the shortest measurable distance [m].
        range_max: the longest [m].
        lidar_pose: x [m], y [m], yaw [rad] of the lidar in the base frame.
        hull: the robot's outline.
        min_beams: fewer than these are no scan.
        min_valid_share: of the readings in each sector, 0 to 1.
    """
    nothing = survey(hull, np.empty((0, 2)))
    problem = _geometry_problem(len(ranges), angle_min, angle_increment, range_min, range_max, min_beams)
    if problem is not None:
        return nothing, problem
    readings = np.asarray(ranges, dtype=np.float64)
    valid = ~np.isnan(readings)
    shares = [float(part.mean()) for part in np.array_split(valid, SECTORS)]
    if min(shares) < min_valid_share:
        sector = shares.index(min(shares))
        return nothing, f"{shares[sector]:.0%} valid readings in sector {sector + 1} of {SECTORS}"
    hits = valid & (readings <= range_max)
    distance = np.maximum(readings[hits], range_min)
    x_m, y_m, yaw_rad = lidar_pose
    direction = yaw_rad + angle_min + angle_increment * np.nonzero(hits)[0]
    points: Floats = np.stack(
        [x_m + distance * np.cos(direction), y_m + distance * np.sin(direction)], axis=1
    )
    return survey(hull, points), None


def _geometry_problem(
    beams: int, angle_min: float, angle_increment: float, range_min: float, range_max: float, min_beams: int
) -> str | None:
    """Why numbers that do not fit together describe no scan."""
    if beams < min_beams:
        return f"{beams} beams, fewer than {min_beams}"
    if not all(map(math.isfinite, (angle_min, angle_increment, range_min, range_max))):
        return "geometry that is not finite"
    if angle_increment == 0.0 or abs(angle_increment) * (beams - 1) > 2 * math.pi + 1e-3:
        return f"{beams} beams of {angle_increment:g} rad are more than a turn, or none"
    if not 0.0 <= range_min < range_max:
        return f"range_min {range_min:g} m and range_max {range_max:g} m contradict each other"
    return None
