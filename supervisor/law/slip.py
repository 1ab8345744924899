"""How much farther than odometry shows the robot moved while it stopped.

Wheels that lock on a wet floor show standstill while the robot slides. The scans show it. The last scan before the stop is
compared with one at standstill: odometry and the mount place each return of the new scan in the frame of the old one. In a static world, it
lies on a surface that the old scan has shown, except for the slip s along the direction of travel. With the old range ρ(θ) in the
direction θ of a placed return p, and the angle φ from the direction of travel to θ:

    s = (ρ(θ) - |p|) / (cos φ + ρ'(θ)/ρ(θ)·sin φ)

This is exact for a straight wall. Where the denominator is small, the surface is nearly parallel to the travel and shows nothing.

* Each return counts by the length of the surface that it shows: a wall counts more than a person who is near. The weighted median counts,
  if most of the surface agrees with it. Where the scans show too little surface ahead or behind, nothing is concluded.
* The robot may still slide when odometry shows standstill, and what moves in front of it is not the robot's motion. Two scans at
  standstill, `REST_S` apart, must therefore show the same.
* A scan is up to a period old before any latency that is configured, so the place of a moving robot is uncertain by its speed times this
  period. A slip below this, `LEAST_SLIP_M` and three standard errors counts as zero.
* Only stops straight ahead or back are judged. A latency of the lidar that is not configured looks like slip, and takes the same distance.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np

from supervisor.law.agreement import beams_at, directions, ranges_at, returns_m, shift_of, tolerances_m
from supervisor.law.base_braking import Stop
from supervisor.law.clearance import Floats
from supervisor.law.reckoning import Pose, between
from supervisor.law.scan import Complex, Geometry, Mount, View

MOST_TURN_RAD = 0.03
"""A stop during which the robot turned by more is not judged: on slanted walls, an error of the heading looks like slip."""

REST_S = 0.3
"""A person who walks at 0.1 m/s or more moves by more than `SAME_M` meanwhile."""

SAME_M = 0.03

MOST_S = 5.0
"""A stop after which the scans do not come to rest within this time is not judged."""

LEAST_SENSITIVITY = 0.5
"""A surface shows slip if slip changes its range by at least this share."""

SLOPE_RAD = 0.035
"""Angle to both sides of a return over which the slope ρ' is measured."""

LEAST_SURFACE_M = 2.0
"""Least length of the surfaces that must agree: more than three people side by side."""

AGREEING_SHARE = 0.7
"""Least share of the surfaces that must agree."""

ITERATIONS = 3
"""The formula is repeated from its result, because surfaces have edges."""

LEAST_SLIP_M = 0.02

STANDARD_ERRORS = 3.0
MEDIAN_ERROR = 1.2533 / 0.6745
"""Standard error of the median of n normal values times √n, in median absolute deviations."""


class ReferenceScan(NamedTuple):
    """The last scan before a stop: only what the comparison needs, because it is part of each recorded state."""

    geometry: Geometry
    taken_s: float
    pose: Pose
    """The odometer pose at which it was taken."""
    ranges_m: Floats
    """(n,): range of each beam; NaN without a return."""

    @classmethod
    def of(cls, view: View) -> "ReferenceScan":
        return cls(view.geometry, view.taken_s, view.pose, returns_m(view))


class SlipMeasurement(NamedTuple):
    """What one lidar shows of the present stop."""

    stopped_s: float | None = None
    """Since when zero has been commanded; None if no stop is measured."""
    reference: ReferenceScan | None = None
    """None if no stop is measured."""
    tolerance_m: float = 0.0
    """Uncertainty of the robot's place at the reference."""
    compared_s: float = -math.inf
    """Time of the last scan that was compared with the reference."""
    compared_m: float = math.nan
    """The slip that it showed."""
    slip_m: float | None = None
    """The result: zero without slip, NaN if nothing can be concluded; None if it is not known yet."""


NO_MEASUREMENT = SlipMeasurement()


def measure_slip(
    measurement: SlipMeasurement,
    before: View | None,
    view: View,
    mount: Mount,
    stop: Stop | None,
    *,
    stands: bool,
) -> SlipMeasurement:
    """Process a new view during a stop, or at the standstill after it.

    Args:
        measurement: the result of the last call.
        before: the view before the new one.
        view: the new view.
        mount: the mount of its lidar.
        stop: the present stop; None if it is not measured.
        stands: whether odometry shows standstill.
    """
    if stop is None:
        return NO_MEASUREMENT
    reference = measurement.reference
    if reference is None or measurement.stopped_s != stop.began_s:
        if before is None:
            return NO_MEASUREMENT
        reference = ReferenceScan.of(before)
        tolerance_m = stop.speed_m_s * (view.taken_s - before.taken_s)
        measurement = SlipMeasurement(stop.began_s, reference, tolerance_m)
    if not stands or measurement.slip_m is not None or view.taken_s - measurement.compared_s < REST_S:
        return measurement
    if view.taken_s - reference.taken_s > MOST_S:
        return measurement._replace(slip_m=math.nan)
    slip_m, error_m = slip_between(reference, view, mount)
    if math.isnan(slip_m):
        return measurement._replace(slip_m=math.nan)
    if not abs(slip_m - measurement.compared_m) <= SAME_M:
        return measurement._replace(compared_s=view.taken_s, compared_m=slip_m)
    explained_m = measurement.tolerance_m + LEAST_SLIP_M + STANDARD_ERRORS * error_m
    return measurement._replace(slip_m=slip_m if slip_m > explained_m else 0.0)


def slip_between(reference: ReferenceScan, view: View, mount: Mount) -> tuple[float, float]:
    """Return how much farther a lidar has moved between two scans than their poses show, and the standard error [m].

    Both are NaN if nothing can be concluded.

    Args:
        reference: the earlier scan.
        view: the view of the later one.
        mount: the mount of the lidar.
    """
    way = between(reference.pose, view.pose)
    if abs(way.yaw_rad) > MOST_TURN_RAD:
        return math.nan, math.nan
    shift = shift_of(complex(way.x_m, way.y_m), way.yaw_rad, mount)
    travel = cmath.rect(math.copysign(1.0, way.x_m), -mount.yaw_rad)
    points = view.free_m[view.hit] * directions(view.geometry)[view.hit]
    points = shift.to + cmath.rect(1.0, shift.turn_rad) * points
    slip_m, off_m, surface_m = 0.0, np.empty(0), np.empty(0)
    for _ in range(ITERATIONS):
        off_m, surface_m = _offsets(reference, points + slip_m * travel, travel)
        if surface_m.sum() < LEAST_SURFACE_M:
            return math.nan, math.nan
        median_m = _weighted_median(off_m, surface_m)
        slip_m, off_m = slip_m + median_m, np.abs(off_m - median_m)
    agreeing_m = surface_m[off_m <= tolerances_m(surface_m / abs(reference.geometry.increment))].sum()
    if agreeing_m < max(LEAST_SURFACE_M, AGREEING_SHARE * surface_m.sum()):
        return math.nan, math.nan
    return slip_m, MEDIAN_ERROR * float(np.median(off_m)) / math.sqrt(len(off_m))


def _offsets(reference: ReferenceScan, points: Complex, travel: complex) -> tuple[Floats, Floats]:
    """Return how far the points are before the surfaces of a scan, along the travel, and the length of surface that each shows [m].

    Points that show nothing are left out, and those at an edge of a surface.

    Args:
        reference: the scan.
        points: (n,) places of later returns in its lidar's frame.
        travel: unit vector of the travel in this frame.
    """
    geometry = reference.geometry
    increment = geometry.increment
    beam = beams_at(geometry, points)
    low = np.floor(beam).astype(np.int64)
    beside = max(1, round(SLOPE_RAD / abs(increment)))
    around = np.add.outer((-beside, 0, 1, 1 + beside), low)
    first_m, one_m, other_m, last_m = ranges_at(geometry, reference.ranges_m, around)
    old_m = one_m + (beam - low) * (other_m - one_m)
    slope_m = (last_m - first_m) / ((2 * beside + 1) * increment)
    bearing_rad, new_m = np.angle(points / travel), np.abs(points)
    sensitivity = np.cos(bearing_rad) + slope_m / old_m * np.sin(bearing_rad)
    is_edge = np.abs(first_m + last_m - 2.0 * old_m) > 2.0 * tolerances_m(old_m)
    shows = (np.abs(sensitivity) >= LEAST_SENSITIVITY) & ~is_edge
    return ((old_m - new_m) / sensitivity)[shows], new_m[shows] * abs(increment)


def _weighted_median(values: Floats, weights: Floats) -> float:
    """Return the weighted median of values (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return values.item(order[np.searchsorted(total, total[-1] / 2.0)])
