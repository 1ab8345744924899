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
  period. A slip below this, `LEAST_M` and three standard errors counts as zero.
* Only stops straight ahead or back are judged. A latency of the lidar that is not configured looks like slip, and takes the same distance.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np

from supervisor.law.agreement import beams_at, directions, ranges_at, shift_of, tolerances_m
from supervisor.law.clearance import Floats
from supervisor.law.reckoning import between
from supervisor.law.scan import Complex, Mount, View

STRAIGHT_RAD = 0.03
"""A stop during which the robot turned by more is not judged: on slanted walls, an error of the heading looks like slip."""

REST_S = 0.3
"""A person who walks at 0.1 m/s or more moves by more than `SAME_M` meanwhile."""

SAME_M = 0.03

MOST_S = 5.0
"""A stop after which the scans do not come to rest within this time is not judged."""

LEAST_SHARE = 0.5
"""A surface shows slip if slip changes its range by at least this share."""

SLOPE_RAD = 0.035
"""Angle to both sides of a return over which the slope ρ' is measured."""

LEAST_SURFACE_M = 2.0
"""Least length of the surfaces that must agree: more than three people side by side."""

AGREEING_SHARE = 0.7
"""Least share of the surfaces that must agree."""

PASSES = 3
"""The formula is repeated from its result, because surfaces have edges."""

LEAST_M = 0.02

ERRORS = 3.0
ERROR_SHARE = 1.2533 / 0.6745
"""Standard error of the median of n normal values times √n, in median absolute deviations."""


class Slide(NamedTuple):
    """What one lidar shows of the present stop."""

    stopped_s: float | None = None
    """Since when zero has been commanded; None if no stop is measured."""
    before: View | None = None
    """The last view before."""
    tolerance_m: float = 0.0
    """Uncertainty of the robot's place in it."""
    seen_s: float = -math.inf
    """Time of the last view that was compared."""
    seen_m: float = math.nan
    """What it showed."""
    slip_m: float | None = None
    """The result: zero without slip, NaN if nothing can be concluded; None if it is not known yet."""


NO_SLIDE = Slide()


def watch(
    slide: Slide,
    before: View | None,
    view: View,
    mount: Mount,
    *,
    stopped_s: float | None,
    speed_m_s: float,
    stands: bool,
) -> Slide:
    """Process a new view during a stop, or at the standstill after it.

    Args:
        slide: the result of the last call.
        before: the view before the new one.
        view: the new view.
        mount: the mount of its lidar.
        stopped_s: since when zero has been commanded; None if the present stop is not measured.
        speed_m_s: mean speed before the stop.
        stands: whether odometry shows standstill.
    """
    if stopped_s is None:
        return NO_SLIDE
    if slide.stopped_s != stopped_s:
        if before is None:
            return NO_SLIDE
        slide = Slide(stopped_s, before, speed_m_s * (view.taken_s - before.taken_s))
    assert slide.before is not None  # a stop has one
    if not stands or slide.slip_m is not None or view.taken_s - slide.seen_s < REST_S:
        return slide
    if view.taken_s - slide.before.taken_s > MOST_S:
        return slide._replace(slip_m=math.nan)
    slip_m, error_m = beyond(slide.before, view, mount)
    if math.isnan(slip_m):
        return slide._replace(slip_m=math.nan)
    if not abs(slip_m - slide.seen_m) <= SAME_M:
        return slide._replace(seen_s=view.taken_s, seen_m=slip_m)
    explained_m = slide.tolerance_m + LEAST_M + ERRORS * error_m
    return slide._replace(slip_m=slip_m if slip_m > explained_m else 0.0)


def beyond(before: View, view: View, mount: Mount) -> tuple[float, float]:
    """Return how much farther a lidar has moved between two views than their poses show, and the standard error [m].

    Both are NaN if nothing can be concluded.

    Args:
        before: the earlier view.
        view: the later one.
        mount: the mount of the lidar.
    """
    way = between(before.pose, view.pose)
    if abs(way.yaw_rad) > STRAIGHT_RAD:
        return math.nan, math.nan
    shift = shift_of(complex(way.x_m, way.y_m), way.yaw_rad, mount)
    travel = cmath.rect(math.copysign(1.0, way.x_m), -mount.yaw_rad)
    points = view.free_m[view.hit] * directions(view.geometry)[view.hit]
    points = shift.to + cmath.rect(1.0, shift.turn_rad) * points
    slip_m, off_m, surface_m = 0.0, np.empty(0), np.empty(0)
    for _ in range(PASSES):
        off_m, surface_m = _apart(before, points + slip_m * travel, travel)
        if surface_m.sum() < LEAST_SURFACE_M:
            return math.nan, math.nan
        median_m = _median(off_m, surface_m)
        slip_m, off_m = slip_m + median_m, np.abs(off_m - median_m)
    agreeing_m = surface_m[off_m <= tolerances_m(surface_m / abs(before.geometry.increment))].sum()
    if agreeing_m < max(LEAST_SURFACE_M, AGREEING_SHARE * surface_m.sum()):
        return math.nan, math.nan
    return slip_m, ERROR_SHARE * float(np.median(off_m)) / math.sqrt(len(off_m))


def _apart(before: View, points: Complex, travel: complex) -> tuple[Floats, Floats]:
    """Return how far along the travel the points are before the surfaces of a view, and the length of surface that each shows [m].

    Points that show nothing are left out, and those at an edge of a surface.

    Args:
        before: the view.
        points: (n,) places of later returns in its lidar's frame.
        travel: unit vector of the travel in this frame.
    """
    increment = before.geometry.increment
    beam = beams_at(before.geometry, points)
    low = np.floor(beam).astype(np.int64)
    beside = max(1, round(SLOPE_RAD / abs(increment)))
    first_m, one_m, other_m, last_m = ranges_at(before, np.add.outer((-beside, 0, 1, 1 + beside), low))
    old_m = one_m + (beam - low) * (other_m - one_m)
    slope_m = (last_m - first_m) / ((2 * beside + 1) * increment)
    off_rad, away_m = np.angle(points / travel), np.abs(points)
    share = np.cos(off_rad) + slope_m / old_m * np.sin(off_rad)
    is_edge = np.abs(first_m + last_m - 2.0 * old_m) > 2.0 * tolerances_m(old_m)
    shows = (np.abs(share) >= LEAST_SHARE) & ~is_edge
    return ((old_m - away_m) / share)[shows], away_m[shows] * abs(increment)


def _median(values: Floats, weights: Floats) -> float:
    """Return the weighted median of values (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return values.item(order[np.searchsorted(total, total[-1] / 2.0)])
