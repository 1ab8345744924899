"""Seen space: what the scans rule out is free, and everything else counts as occupied.

Between two neighbouring rays that are free, δ apart, a disc of the smallest diameter w fits from

    r(δ) = w/2 · (1 / sin(δ/2) - 1)

outward from the lidar: it touches both rays. A hole in the view (dirt, a sector without beams) is such a gap
too, only wider: δ is then the angle between the rays at its two edges. From half a turn on, r is zero. Beyond
`range_max` nothing is proven either.

The *hidden places* are points of such discs: the nearest place on each ray, and places along both edges of
each hole. No other places need checking: the closing speed is the same for all points on one normal of the
hull, and these are the first that a normal meets. The barrier treats a hidden place as it treats a return, so
the less is seen, the lower the permitted speed.

Other lidars, and scans of the last `unseen_memory_s`, may have seen what this one does not: each hidden place
is followed outward along its ray to the first point that none of them has seen free.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import NO_POINTS, NOTHING_M, Crossing, Floats, Hull
from supervisor.reckoning import Pose, between
from supervisor.scan import Geometry, Mount, Rays, View, is_full_turn, rays_of, unit_vectors

OUTSIDE_SPACING_RAD = math.radians(2.0)
"""Between two rays where no beam looks: 3.5 cm apart at one metre, less than the smallest obstacle by default."""

OUTWARD_M: Floats = np.array(
    [0.0, 0.04, 0.08, 0.12, 0.17, 0.22, 0.3, 0.38, 0.48, 0.6, 0.75, 0.95, 1.2, 1.5, 2.0]
)
"""How far behind the nearest hidden place another view is asked."""

ALONG_EDGE_M: Floats = np.concatenate((np.arange(0.0, 1.0, 0.04), np.arange(1.0, 20.0, 0.1)))
"""Distances along an edge of a hole at which discs are placed, counted from where the first disc fits."""

SEEN_MARGIN_M = 0.02
"""A ray that ends nearer than this behind a point does not prove it free: readings are noisy."""


class Lookout(NamedTuple):
    """A view, and where its lidar was, in the base frame of the view that it helps."""

    geometry: Geometry
    free_m: Floats
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True)
class _Gaps:
    """The rays along which something may hide, for one geometry on the robot."""

    is_round: bool
    """The beams go all around."""
    nearest_m: float
    """From where something fits between two neighbouring beams."""
    between_m: Floats
    """(n or n - 1,): where a hidden place is nearest between two neighbouring beams."""
    between: Floats
    """(2, n or n - 1): its direction."""
    outside: Floats
    """(2, o): directions between the last beam and the first."""
    beams_hull: Crossing
    """Where the beams enter and leave the hull."""
    outside_hull: Crossing
    """Where the directions outside of the view do."""


class _Holes(NamedTuple):
    """The gaps between neighbouring beams that see (m,); the last one is from the last beam to the first."""

    seeing: npt.NDArray[np.intp]
    """(m,): the beams that see; gap i begins at beam i of these."""
    width_rad: Floats
    """(m,): the angle of each gap."""
    hides_m: Floats
    """(m,): distance from the lidar from which a disc fits into the gap; infinite where none does."""


def hiding_distance_m(gap_rad: Floats, smallest_m: float) -> Floats:
    """Distance [m] from which a disc of diameter `smallest_m` fits between two rays, for each of their angles (n,)."""
    half = np.minimum(gap_rad, math.pi) / 2.0
    return smallest_m / 2.0 * (1.0 / np.sin(half) - 1.0)


def hidden_places(
    view: View,
    mount: Mount,
    hull: Hull,
    smallest_m: float,
    reach_m: float,
    others: Callable[[], Sequence[Lookout]] = tuple,
) -> Floats:
    """Find hidden places (m, 2) [m], which no view rules out, in the base frame of the view's scan.

    Args:
        view: of the lidar that is asked first.
        mount: where it is.
        hull: the robot's outline.
        smallest_m: the diameter of the smallest obstacle.
        reach_m: what is farther than this from the hull limits no motion.
        others: gives the views that may have seen what this one does not; asked only where that matters.
    """
    gaps = _gaps(view.geometry, mount, hull, smallest_m)
    far_m = hull.radius_m + reach_m + math.hypot(mount.x_m, mount.y_m)
    if view.is_whole and gaps.is_round and gaps.nearest_m >= far_m and view.range_max_m >= far_m:
        return NO_POINTS
    rays = rays_of(view.geometry, mount, hull)
    parts: list[tuple[Floats, Floats]] = []  # directions (2, m) and distances (m,)
    known = view.free_m > 0.0
    if gaps.nearest_m < far_m:
        reaches_m = np.maximum(view.free_m, np.roll(view.free_m, -1))[: len(gaps.between_m)]
        both = (known & np.roll(known, -1))[: len(gaps.between_m)]
        (open_,) = (both & (gaps.between_m < np.minimum(reaches_m, far_m))).nonzero()
        parts.append((gaps.between[:, open_], gaps.between_m[open_]))
    if view.range_max_m < far_m:
        (silent,) = (known & ~view.hit).nonzero()
        ends_m, enters_m = view.free_m[silent], gaps.beams_hull.enters_m[silent]
        outside_m = np.where(ends_m > enters_m, np.maximum(ends_m, gaps.beams_hull.leaves_m[silent]), ends_m)
        parts.append((rays.direction[:, silent], outside_m))
    if not (view.is_whole and gaps.is_round):
        holes = _holes(view, smallest_m, far_m)
        parts.extend(_into_the_holes(holes, view, rays.direction, gaps, smallest_m))
        parts.append(_along_the_edges(holes, view, rays, hull, smallest_m, far_m))
    direction = np.concatenate([part[0] for part in parts], axis=1)
    distance_m = np.concatenate([part[1] for part in parts])
    lookouts = others()
    if lookouts:
        seen = _behind_what_others_see(direction, distance_m, mount, lookouts, smallest_m, far_m)
        direction, distance_m = seen
    places: Floats = (direction * distance_m + rays.origin_m).T
    return places


def _holes(view: View, smallest_m: float, far_m: float) -> _Holes:
    step_rad = abs(view.geometry.increment)
    (seeing,) = (view.free_m > 0.0).nonzero()
    width_rad = np.empty(len(seeing))
    width_rad[:-1] = (seeing[1:] - seeing[:-1]) * step_rad
    width_rad[-1] = max(2 * math.pi - (seeing[-1] - seeing[0]) * step_rad, 0.0)
    edge_m = np.maximum(view.free_m[seeing], np.roll(view.free_m[seeing], -1))
    hides_m = hiding_distance_m(np.maximum(width_rad, step_rad), smallest_m)
    # What is seen on both sides of a gap is nearer than anything that could hide in it.
    hides_m[hides_m >= np.minimum(edge_m, far_m)] = math.inf
    return _Holes(seeing, width_rad, hides_m)


def _into_the_holes(
    holes: _Holes, view: View, direction: Floats, gaps: _Gaps, smallest_m: float
) -> list[tuple[Floats, Floats]]:
    """Hidden places on rays into the holes: parts of directions (2, n) and distances (n,) from the lidar."""
    (missing,) = (view.free_m <= 0.0).nonzero()
    gap = np.searchsorted(holes.seeing, missing) - 1  # -1, before the first beam that sees: the last gap
    crossing = Crossing(gaps.beams_hull.enters_m[missing], gaps.beams_hull.leaves_m[missing])
    outside_m: Floats = np.full(len(gaps.outside[0]), holes.hides_m.item(-1), dtype=np.float64)
    return [
        *_beside_the_hull(direction[:, missing], holes.hides_m[gap], crossing, smallest_m),
        *_beside_the_hull(gaps.outside, outside_m, gaps.outside_hull, smallest_m),
    ]


def _along_the_edges(
    holes: _Holes, view: View, rays: Rays, hull: Hull, smallest_m: float, far_m: float
) -> tuple[Floats, Floats]:
    """Hidden places along both edges of each hole: directions (2, n), distances (n,) from the lidar.

    Discs are placed inside the hole so that they touch its edge. Of each disc, the point nearest to the
    hull is a hidden place. The nearest place on a ray is not enough: it may lie beside the hull, where
    no straight motion closes on it, while a place farther out on the same ray lies ahead of a corner of
    the hull.
    """
    step_rad, radius_m = abs(view.geometry.increment), smallest_m / 2.0
    (wide,) = ((holes.hides_m < math.inf) & (holes.width_rad > 1.5 * step_rad)).nonzero()
    first, last = holes.seeing[wide], holes.seeing[(wide + 1) % len(holes.seeing)]
    edge = rays.direction[:, np.concatenate((first, last))]
    turn = math.copysign(1.0, view.geometry.increment) * np.repeat((1.0, -1.0), len(wide))
    inward = turn * np.array((-edge[1], edge[0]))
    half_rad = np.minimum(holes.width_rad[wide], math.pi) / 2.0
    begins_m = radius_m / np.tan(half_rad)  # where the disc touches both edges
    along_m = np.tile(begins_m, 2)[:, None] + ALONG_EDGE_M
    ray, step = (along_m < far_m).nonzero()
    centre: Floats = (edge[:, ray] * along_m[ray, step] + inward[:, ray] * radius_m + rays.origin_m).T
    away_m, normal = hull.nearest(centre)
    fits = away_m > radius_m / 2.0  # a disc that overlaps the hull by more than half its radius is not placed
    toward_hull_m = np.minimum(away_m[fits], radius_m)
    offset = (centre[fits] - toward_hull_m[:, None] * normal[fits]).T - rays.origin_m
    distance_m: Floats = np.hypot(offset[0], offset[1])
    return offset / np.maximum(distance_m, NOTHING_M), distance_m


def _beside_the_hull(
    direction: Floats, hides_m: Floats, crossing: Crossing, smallest_m: float
) -> list[tuple[Floats, Floats]]:
    """Where something may hide on rays on which it may from `hides_m` on: behind the hull, and before it if it fits."""
    before = (hides_m < math.inf) & (crossing.enters_m >= np.maximum(hides_m, smallest_m))
    behind = (hides_m < math.inf) & (crossing.enters_m < math.inf)
    behind_m = np.maximum(hides_m, crossing.leaves_m)
    return [(direction[:, before], hides_m[before]), (direction[:, behind], behind_m[behind])]


def _behind_what_others_see(
    direction: Floats,
    distance_m: Floats,
    mount: Mount,
    others: Sequence[Lookout],
    smallest_m: float,
    far_m: float,
) -> tuple[Floats, Floats]:
    """Each ray from the last point that others have seen free; those that are free as far as `far_m` are left out."""
    along_m = distance_m[:, None] + OUTWARD_M
    x_m, y_m = mount.x_m + direction[0][:, None] * along_m, mount.y_m + direction[1][:, None] * along_m
    free = np.zeros(along_m.shape, dtype=np.bool_)
    free[:, 1:] = along_m[:, :-1] > far_m
    for lookout in others:
        free |= _sees_free(lookout, x_m, y_m, smallest_m)
    hides = ~free.all(axis=1)
    first = free[hides].argmin(axis=1)
    before = np.maximum(first - 1, 0)
    return direction[:, hides], along_m[hides][np.arange(len(before)), before]


def _sees_free(
    lookout: Lookout, x_m: Floats, y_m: Floats, smallest_m: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Whether a view proves each point free: both beams beside it end behind it, and nothing fits between them."""
    count, angle_min, increment = lookout.geometry
    away_x, away_y = x_m - lookout.x_m, y_m - lookout.y_m
    distance_m = np.hypot(away_x, away_y)
    turn = 2 * math.pi / abs(increment)
    beam = ((np.arctan2(away_y, away_x) - lookout.yaw_rad - angle_min) / increment) % turn
    first = np.floor(beam).astype(np.int64)
    second = first + 1
    fits_m: Floats = np.full(first.shape, hiding_distance_m(np.array(abs(increment)), smallest_m))
    if is_full_turn(lookout.geometry):
        seam = second >= count
        second[seam] = 0
        fits_m[seam] = hiding_distance_m(
            np.array(_seam_rad(lookout.geometry)).clip(abs(increment)), smallest_m
        )
    inside = second < count
    ends_m = np.minimum(
        lookout.free_m[np.minimum(first, count - 1)], lookout.free_m[np.minimum(second, count - 1)]
    )
    return inside & (ends_m > distance_m + SEEN_MARGIN_M) & (distance_m < fits_m)


def lookout(view: View, mount: Mount, pose: Pose, from_pose: Pose) -> Lookout:
    """A view, as it helps another one.

    Args:
        view: the one that helps.
        mount: of its lidar.
        pose: the odometer's when its scan was taken.
        from_pose: the odometer's when the scan of the view that is helped was taken.
    """
    base = between(from_pose, pose)
    cos, sin = math.cos(base.yaw_rad), math.sin(base.yaw_rad)
    return Lookout(
        view.geometry,
        view.free_m,
        base.x_m + cos * mount.x_m - sin * mount.y_m,
        base.y_m + sin * mount.x_m + cos * mount.y_m,
        base.yaw_rad + mount.yaw_rad,
    )


def _seam_rad(geometry: Geometry) -> float:
    """Between the last beam and the first; of a full turn up to half an increment more than between two others."""
    return 2 * math.pi - abs(geometry.increment) * (geometry.beams - 1)


@lru_cache(maxsize=16)
def _gaps(geometry: Geometry, mount: Mount, hull: Hull, smallest_m: float) -> _Gaps:
    count, angle_min, increment = geometry
    full = is_full_turn(geometry)
    middle: Floats = (
        mount.yaw_rad
        + angle_min
        + increment * (np.arange(count if full else count - 1, dtype=np.float64) + 0.5)
    )
    width = np.full(len(middle), abs(increment))
    if full:
        middle[-1] += math.copysign(_seam_rad(geometry) - abs(increment), increment) / 2.0
        width[-1] = max(_seam_rad(geometry), abs(increment))
    between = unit_vectors(middle)
    fits_m = hiding_distance_m(width, smallest_m)
    rest_rad = 0.0 if full else _seam_rad(geometry)
    number = max(1, math.ceil(rest_rad / OUTSIDE_SPACING_RAD)) - 1 if rest_rad else 0
    last = mount.yaw_rad + angle_min + increment * (count - 1)
    sign = math.copysign(1.0, increment)
    ahead: Floats = last + sign * rest_rad * (np.arange(number, dtype=np.float64) + 1.0) / (number + 1)
    outside = unit_vectors(ahead)
    return _Gaps(
        full,
        float(fits_m.min()),
        np.maximum(fits_m, hull.crossing(mount.x_m, mount.y_m, between).leaves_m),
        between,
        outside,
        hull.crossing(mount.x_m, mount.y_m, rays_of(geometry, mount, hull).direction),
        hull.crossing(mount.x_m, mount.y_m, outside),
    )
