"""Seen space: space that the scans prove free is free; all other space counts as occupied.

A disc of the smallest obstacle diameter w fits between two neighbouring free rays at the angle δ, touching both,
at distances from the lidar of at least

    r(δ) = w/2 · (1 / sin(δ/2) - 1)

A hole in the view (dirt, a sector without beams) is a wider gap: δ is then the angle between the rays at its two
edges. For δ of half a turn or more, r is zero. No space beyond `range_max` is proven free.

The *hidden places* are points of such discs: the nearest place on each ray, and places along both edges of
each hole. No other places need checking: the closing speed is the same for all points on one normal of the
hull, and the hidden places are the first points that a normal meets. The barrier treats a hidden place like a
return. The permitted speed therefore falls as less space is seen.

Other lidars, and the scans of the last `unseen_memory_s`, may have seen places that are hidden from this lidar, and the hull
itself may have occupied them (own_way.py). Each hidden place is moved outward along its ray to the first point that none of
them has proven free.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import NO_POINTS, NOTHING_M, Crossing, Floats, Hull, Mask
from supervisor.law.reckoning import Pose, between
from supervisor.law.scan import Geometry, Mount, Rays, View, is_full_turn, rays_of, unit_vectors

OUTSIDE_SPACING_RAD = math.radians(2.0)
"""Angle between the rays that are checked outside the field of view: 3.5 cm at one metre, which is less than the
default smallest obstacle."""

OUTWARD_M: Floats = np.array(
    [0.0, 0.04, 0.08, 0.12, 0.17, 0.22, 0.3, 0.38, 0.48, 0.6, 0.75, 0.95, 1.2, 1.5, 2.0]
)
"""Distances behind the nearest hidden place at which the other views are checked."""

ALONG_EDGE_M: Floats = np.concatenate((np.arange(0.0, 1.0, 0.04), np.arange(1.0, 20.0, 0.1)))
"""Distances along an edge of a hole at which discs are placed, measured from the first disc that fits."""

BETWEEN_SHARES: Floats = np.array([0.25, 0.5, 0.75])
"""Shares of the distance from the last of these points that is free to the first that is not, at which the other views are
checked again."""

SEEN_MARGIN_M = 0.02
"""A ray proves a point free only if it ends more than this behind the point: readings are noisy."""


class Evidence(Protocol):
    """What may prove a view's hidden places free: another view, or the hull's own way."""

    def proves_free(self, points: Floats, smallest_m: float) -> Mask:
        """Return whether each of the points (n, 2) [m] of the base frame of the first view is proven free."""
        ...


class Lookout(NamedTuple):
    """Another view that may prove a hidden place free, with the pose of its lidar in the base frame of the first view."""

    geometry: Geometry
    free_m: Floats
    x_m: float
    y_m: float
    yaw_rad: float

    def proves_free(self, points: Floats, smallest_m: float) -> Mask:
        """Return whether both neighbouring beams end behind each point, and the smallest obstacle does not fit between them."""
        count, angle_min, increment = self.geometry
        away_x, away_y = points[:, 0] - self.x_m, points[:, 1] - self.y_m
        distance_m = np.hypot(away_x, away_y)
        turn = 2 * math.pi / abs(increment)
        beam = ((np.arctan2(away_y, away_x) - self.yaw_rad - angle_min) / increment) % turn
        first = np.floor(beam).astype(np.int64)
        second = first + 1
        fits_m: Floats = np.full(first.shape, hiding_distance_m(np.array(abs(increment)), smallest_m))
        if is_full_turn(self.geometry):
            seam = second >= count
            second[seam] = 0
            fits_m[seam] = hiding_distance_m(
                np.array(_seam_rad(self.geometry)).clip(abs(increment)), smallest_m
            )
        inside = second < count
        ends_m = np.minimum(
            self.free_m[np.minimum(first, count - 1)], self.free_m[np.minimum(second, count - 1)]
        )
        free: Mask = inside & (ends_m > distance_m + SEEN_MARGIN_M) & (distance_m < fits_m)
        return free


@dataclass(frozen=True)
class _Gaps:
    """Directions and distances of possible hidden places that depend only on scan geometry, mount and hull."""

    is_round: bool
    """Whether the beams cover a full turn."""
    nearest_m: float
    """Smallest distance from the lidar [m] at which the smallest obstacle fits between two neighbouring beams."""
    between_m: Floats
    """(n or n - 1,): distance [m] of the nearest hidden place between each pair of neighbouring beams."""
    between: Floats
    """(2, n or n - 1): unit vectors to these places in the base frame."""
    outside: Floats
    """(2, o): unit vectors in the sector between the last beam and the first, in the base frame."""
    beams_hull: Crossing
    """Distances at which the beams enter and leave the hull."""
    outside_hull: Crossing
    """Distances at which the rays along `outside` enter and leave the hull."""


class _Holes(NamedTuple):
    """The m gaps between successive beams that prove free space; the last gap runs from the last such beam to the first."""

    seeing: npt.NDArray[np.intp]
    """(m,): indices of the beams that prove free space; gap i begins at the i-th of them."""
    width_rad: Floats
    """(m,): the angle of each gap."""
    hides_m: Floats
    """(m,): smallest distance from the lidar [m] at which a disc fits into the gap; infinite where none fits."""


def hiding_distance_m(gap_rad: Floats, smallest_m: float) -> Floats:
    """Return the smallest distances (n,) [m] at which a disc of diameter `smallest_m` fits between two rays.

    Args:
        gap_rad: (n,) angles between the two rays.
        smallest_m: the disc's diameter.
    """
    half = np.minimum(gap_rad, math.pi) / 2.0
    return smallest_m / 2.0 * (1.0 / np.sin(half) - 1.0)


def hidden_places(
    view: View,
    mount: Mount,
    hull: Hull,
    smallest_m: float,
    reach_m: float,
    others: Callable[[], Sequence[Evidence]] = tuple,
) -> Floats:
    """Return the hidden places (m, 2) [m] that no view proves free, in the base frame of the view's scan.

    Args:
        view: the view of the lidar whose hidden places are wanted.
        mount: the mount of this lidar.
        hull: the robot's outline.
        smallest_m: the diameter of the smallest obstacle.
        reach_m: a place farther than this from the hull limits no motion.
        others: returns what else may prove these places free; called only if there may be such places.
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
        ends_m, enters_m = _before_ends_m(view, silent, smallest_m), gaps.beams_hull.enters_m[silent]
        outside_m = np.where(ends_m > enters_m, np.maximum(ends_m, gaps.beams_hull.leaves_m[silent]), ends_m)
        parts.append((rays.direction[:, silent], outside_m))
    if not (view.is_whole and gaps.is_round):
        holes = _holes(view, smallest_m, far_m)
        parts.extend(_into_the_holes(holes, view, rays.direction, gaps, smallest_m))
        parts.append(_along_the_edges(holes, view, rays, hull, smallest_m, far_m))
    direction = np.concatenate([part[0] for part in parts], axis=1)
    distance_m = np.concatenate([part[1] for part in parts])
    evidence = others()
    if evidence:
        direction, distance_m = _behind_evidence(direction, distance_m, mount, evidence, smallest_m, far_m)
    places: Floats = (direction * distance_m + rays.origin_m).T
    return places


def _before_ends_m(view: View, silent: npt.NDArray[np.intp], smallest_m: float) -> Floats:
    """Return the distances (n,) [m] at which a disc begins that touches the ends of two neighbouring silent rays."""
    radius_m, ends_m = smallest_m / 2.0, view.free_m[silent]
    half_m = np.minimum(ends_m * abs(view.geometry.increment) / 2.0, radius_m)
    return ends_m - (radius_m - np.sqrt(radius_m * radius_m - half_m * half_m))


def _holes(view: View, smallest_m: float, far_m: float) -> _Holes:
    step_rad = abs(view.geometry.increment)
    (seeing,) = (view.free_m > 0.0).nonzero()
    width_rad = np.empty(len(seeing))
    width_rad[:-1] = (seeing[1:] - seeing[:-1]) * step_rad
    width_rad[-1] = max(2 * math.pi - (seeing[-1] - seeing[0]) * step_rad, 0.0)
    edge_m = np.maximum(view.free_m[seeing], np.roll(view.free_m[seeing], -1))
    hides_m = hiding_distance_m(np.maximum(width_rad, step_rad), smallest_m)
    # A disc that fits only beyond both rays' ends, or out of reach, needs no check.
    hides_m[hides_m >= np.minimum(edge_m, far_m)] = math.inf
    return _Holes(seeing, width_rad, hides_m)


def _into_the_holes(
    holes: _Holes, view: View, direction: Floats, gaps: _Gaps, smallest_m: float
) -> list[tuple[Floats, Floats]]:
    """Return the hidden places on rays into the holes, as parts of directions (2, n) and distances (n,) [m]."""
    (missing,) = (view.free_m <= 0.0).nonzero()
    gap = np.searchsorted(holes.seeing, missing) - 1  # -1, before the first seeing beam, selects the last gap
    crossing = Crossing(gaps.beams_hull.enters_m[missing], gaps.beams_hull.leaves_m[missing])
    outside_m: Floats = np.full(len(gaps.outside[0]), holes.hides_m.item(-1), dtype=np.float64)
    return [
        *_before_and_behind_hull(direction[:, missing], holes.hides_m[gap], crossing, smallest_m),
        *_before_and_behind_hull(gaps.outside, outside_m, gaps.outside_hull, smallest_m),
    ]


def _along_the_edges(
    holes: _Holes, view: View, rays: Rays, hull: Hull, smallest_m: float, far_m: float
) -> tuple[Floats, Floats]:
    """Return the hidden places along both edges of each hole: directions (2, n) and distances (n,) [m] from the lidar.

    Discs are placed inside the hole so that they touch its edge. The point of each disc that is nearest to the
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
    begins_m = radius_m / np.tan(half_rad)  # here the disc touches both edges
    along_m = np.tile(begins_m, 2)[:, None] + ALONG_EDGE_M
    ray, step = (along_m < far_m).nonzero()
    centre: Floats = (edge[:, ray] * along_m[ray, step] + inward[:, ray] * radius_m + rays.origin_m).T
    away_m, normal = hull.nearest(centre)
    fits = away_m > radius_m / 2.0  # a disc that overlaps the hull by more than half its radius is not placed
    toward_hull_m = np.minimum(away_m[fits], radius_m)
    offset = (centre[fits] - toward_hull_m[:, None] * normal[fits]).T - rays.origin_m
    distance_m: Floats = np.hypot(offset[0], offset[1])
    return offset / np.maximum(distance_m, NOTHING_M), distance_m


def _before_and_behind_hull(
    direction: Floats, hides_m: Floats, crossing: Crossing, smallest_m: float
) -> list[tuple[Floats, Floats]]:
    """Return the nearest hidden places on rays, in front of the hull and behind it.

    A ray from a lidar outside the hull may cross the hull. An obstacle may stand between lidar and hull if it fits
    there, and behind the hull.

    Args:
        direction: (2, n) unit vectors of the rays.
        hides_m: (n,) distances from the lidar beyond which an obstacle may hide; infinite where none can.
        crossing: the rays' crossings of the hull.
        smallest_m: the diameter of the smallest obstacle.
    """
    before = (hides_m < math.inf) & (crossing.enters_m >= np.maximum(hides_m, smallest_m))
    behind = (hides_m < math.inf) & (crossing.enters_m < math.inf)
    behind_m = np.maximum(hides_m, crossing.leaves_m)
    return [(direction[:, before], hides_m[before]), (direction[:, behind], behind_m[behind])]


def _behind_evidence(
    direction: Floats,
    distance_m: Floats,
    mount: Mount,
    evidence: Sequence[Evidence],
    smallest_m: float,
    far_m: float,
) -> tuple[Floats, Floats]:
    """Move hidden places outward to the last point that the evidence proves free.

    Rays that the evidence proves free as far as `far_m` are dropped.

    Args:
        direction: (2, n) unit vectors from the lidar.
        distance_m: (n,) distances of the hidden places from the lidar.
        mount: the lidar's mount.
        evidence: other views, and the hull's own way.
        smallest_m: the diameter of the smallest obstacle.
        far_m: a place farther than this from the lidar limits no motion.

    Returns:
        the directions (2, k) and distances (k,) of the remaining hidden places.
    """

    def proven(direction: Floats, along_m: Floats, needed: Mask) -> Mask:
        """Return which points at these distances (n, k) [m] along each ray are proven free; one that is not needed counts."""
        (left,) = needed.ravel().nonzero()
        x_m, y_m = mount.x_m + direction[0][:, None] * along_m, mount.y_m + direction[1][:, None] * along_m
        points = np.stack((x_m.ravel(), y_m.ravel()), axis=1)[left]
        free = np.ones(along_m.size, dtype=np.bool_)
        free[left] = False
        for one in evidence:
            is_free = one.proves_free(points, smallest_m)
            free[left[is_free]] = True
            left, points = left[~is_free], points[~is_free]
        return free.reshape(along_m.shape)

    along_m = distance_m[:, None] + OUTWARD_M
    needed = np.ones(along_m.shape, dtype=np.bool_)
    needed[:, 1:] = along_m[:, :-1] <= far_m
    free = proven(direction, along_m, needed)
    hides = ~free.all(axis=1)
    direction, along_m = direction[:, hides], along_m[hides]
    first, last_m = free[hides].argmin(axis=1), along_m[:, 0].copy()
    (moves,) = first.nonzero()
    before_m, beyond_m = along_m[moves, first[moves] - 1], along_m[moves, first[moves]]
    between_m = before_m[:, None] + (beyond_m - before_m)[:, None] * BETWEEN_SHARES
    free = proven(direction[:, moves], between_m, np.ones(between_m.shape, dtype=np.bool_))
    free = np.column_stack((free, np.zeros(len(moves), dtype=np.bool_)))
    last_m[moves] = np.column_stack((before_m, between_m))[np.arange(len(moves)), free.argmin(axis=1)]
    return direction, last_m


def lookout(view: View, mount: Mount, pose: Pose, from_pose: Pose) -> Lookout:
    """Return a view as a `Lookout` for another view.

    Args:
        view: the view that may prove places free.
        mount: the mount of its lidar.
        pose: the odometer pose at which its scan was taken.
        from_pose: the odometer pose at which the scan of the other view was taken.
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
    """Return the angle between the last beam and the first; in a full turn at most 1.5 increments."""
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
