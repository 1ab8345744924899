"""The speed barrier: one formula for stop zone, slow-down zone and escape.

For a point p in the robot's frame [m], its distance c from the hull [m], the outward unit normal n at the
hull's nearest point, and a commanded twist (v [m/s], ω [rad/s]):

    closing speed    k = -n · (-v + ω·p_y, -ω·p_x)  =  n_x·v + (n_y·p_x - n_x·p_y)·ω
    permitted speed  κ(c) = 0                                          for c <= d
                     κ(c) = -a·T + sqrt((a·T)² + 2·a·(c - d))          beyond
    scale            s = min(1, min over points with k > k_tol of κ(c)/k)

with the stop distance d, the trusted deceleration a of the base, and the reaction time T. κ is the speed from
which the base, after reacting for T and braking with a, stops exactly at d (v·T + v²/2a = c - d).

The present closing speed is not enough. On an arc, it grows while the hull turns. The base also brakes with a
along its path, not along n, so it closes on a slanted wall for longer than κ assumes. Therefore the path ahead
is checked too: if the hull at the full twist would come within d of a point after the time τ, then the robot at
the share s of the twist must stop before that point, with reaction and braking along the same path:

    s·T + s²·V/2a <= τ        with V = max(|v|, |ω|·radius), the speed that the base has to brake

Straight toward a wall, this equals the formula above. The twist is scaled as a whole, so that an arc keeps its
shape. A twist that closes on no near point is not slowed.

A base that is still faster than its command has its own bound. It closes with v, and the command permits u < v. Until it has
slowed down to u it drives farther than u·T: with the distance that it brakes from v to u, then at u, and at last to
standstill,

    u·T + (v - u)²/2a + u²/2a <= c - d      that is      u² + u·(a·T - v) + v²/2 <= a·(c - d)

κ lacks the term (v - u)²/2a. A base with a dead time D keeps v for D, and u for what remains of T:

    u² + u·(a·(T - D) - v) + v²/2 + a·D·v <= a·(c - d)

The left side is convex in u. At u = 0 it says v·D + v²/2a <= c - d: the base can still stop. If that holds, the larger root
is the permitted speed, and every lower speed is permitted too; if not, nothing is. At u = v it is κ's own condition.
Then a zero command at the next decision still stops the base at d or before. Without a dead time, v²/2a <= c - d holds at
every moment until then, and by induction always (tests/unit/supervisor/law/test_slowing.py). A base that brakes with more
than a only leaves more distance. The same bound holds along the path ahead, for shares of the twist: there τ is the
distance, and |V|/a the inverse of the deceleration.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache
from operator import itemgetter
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

CLOSING_TOLERANCE_M_S = 0.01
"""A slower closing speed counts as zero: readings are noisy."""

DEEP_M = 0.005
DEEP_TOLERANCE_M_S = 0.001
"""For a point deeper than this inside the stop distance, closing counts above this lower speed: many slow steps must
not add up."""

POSES = 6
"""The path ahead is checked at this many evenly spaced poses: 8 cm apart at 1 m/s, where an arc deviates from its chord
by 1 mm."""

MOMENTS = 8
"""Substeps per pose for the closing speed: a corner may sweep past a point between two poses."""

STRAY_M = 0.01
"""Extra distance for the path ahead on an arc: a base that changes from one arc to another follows neither exactly."""

GRAZE_M = 0.001
"""Minimum decrease of a distance that counts as coming nearer; a wall beside the robot stays below it. A point that
closes no faster than `DEEP_TOLERANCE_M_S` does not count either."""

ON_HULL_M = 1e-9
"""A point nearer to the hull than this gets the normal of the hull's side: over so short a distance, rounding errors
would determine the direction."""

NOTHING_M = 1e-300
"""Smallest permitted divisor, smaller than any real distance."""


class Hull(Protocol):
    """The robot's outline in its base frame."""

    def clearance(self, points: Floats) -> Floats:
        """Return the distances (n,) [m] of points (n, 2) [m] from the hull, negative inside."""
        ...

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the distances (n,) [m] of points (n, 2) [m], negative inside, and the hull's outward unit normals (n, 2)."""
        ...

    def approach(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distances and closing speeds of points (n, 2) [m].

        Returns:
            distances (n,) [m], negative inside; closing speeds (n,) [m/s] for each m/s of forward velocity; closing
            speeds (n,) [m/s] for each rad/s of turn rate.
        """
        ...

    def clearance_along(self, points: Floats, poses: Floats) -> Floats:
        """Return the distances (m, n) [m] of points (n, 2) from the hull at each pose (m, 3): x [m], y [m], yaw [rad]."""
        ...

    def covers_along(self, points: Floats, poses: Floats) -> Mask:
        """Return whether the hull at each pose (m, 3), x [m], y [m], yaw [rad], covers each of the points (n, 2): (m, n)."""
        ...

    def crossing(self, x_m: float, y_m: float, direction: Floats) -> "Crossing":
        """Return where the rays from a point along unit vectors (2, n) meet the hull; the point may be inside it."""
        ...

    @property
    def radius_m(self) -> float:
        """Largest distance of any part of the hull from the base frame's origin."""
        ...


class Crossing(NamedTuple):
    """Distances at which n rays meet the hull, from their origin."""

    enters_m: Floats
    """(n,): zero if the ray begins inside the hull, infinite if it misses the hull."""
    leaves_m: Floats
    """(n,): zero if the ray misses the hull."""


def _between(enters_m: Floats, leaves_m: Floats) -> Crossing:
    """Return the crossing of rays, given where their lines enter and leave; parts behind the origin are cut off."""
    enters_m = np.maximum(enters_m, 0.0)
    meets = enters_m < leaves_m
    return Crossing(np.where(meets, enters_m, math.inf), np.where(meets, leaves_m, 0.0))


@dataclass(frozen=True)
class Circle:
    """A circular hull around the base frame's origin."""

    radius_m: float

    def clearance(self, points: Floats) -> Floats:
        return np.hypot(points[:, 0], points[:, 1]) - self.radius_m

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        distances: Floats = np.hypot(points[:, 0], points[:, 1])
        # A point at the centre gets a normal in the forward direction: driving forward closes on it.
        normals = (points + np.array((NOTHING_M, 0.0))) / (distances + NOTHING_M)[:, None]
        return distances - self.radius_m, normals

    def approach(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        distances: Floats = np.hypot(points[:, 0], points[:, 1])
        normal_x = (points[:, 0] + NOTHING_M) / (distances + NOTHING_M)  # of `nearest`
        # Turning a circle closes on no point.
        return distances - self.radius_m, normal_x, np.zeros(len(points))

    def clearance_along(self, points: Floats, poses: Floats) -> Floats:
        offset_x, offset_y = points[:, 0] - poses[:, :1], points[:, 1] - poses[:, 1:2]
        return np.hypot(offset_x, offset_y) - self.radius_m

    def covers_along(self, points: Floats, poses: Floats) -> Mask:
        return self.clearance_along(points, poses) <= 0.0

    def crossing(self, x_m: float, y_m: float, direction: Floats) -> Crossing:
        middle_m: Floats = -(x_m * direction[0] + y_m * direction[1])  # of the chord
        aside_m = x_m * direction[1] - y_m * direction[0]
        half_m = np.sqrt(np.maximum(self.radius_m**2 - aside_m**2, 0.0))
        return _between(middle_m - half_m, middle_m + half_m)


@dataclass(frozen=True)
class ConvexPolygon:
    """A hull with straight sides; corners (m, 2) [m] counter-clockwise, strictly convex."""

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        corners = np.array(self.corners)
        if corners.ndim != 2 or corners.shape[0] < 3 or not np.isfinite(corners).all():
            raise ValueError("a polygon needs at least three finite corners (x, y)")
        start, side = self._sides()
        offset = start[:, None, :] - start[None, :, :]
        outside = offset[:, :, 0] * side[:, 1] - offset[:, :, 1] * side[:, 0]  # (corners, sides)
        # Only the two ends of a side lie on its line, and no corner lies beyond it.
        ends = np.eye(len(start), dtype=np.bool_)
        if not np.array_equal(outside.round(9) >= 0.0, ends | np.roll(ends, 1, axis=0)):
            raise ValueError("the polygon must be convex, its corners counter-clockwise")

    @property
    def radius_m(self) -> float:
        return self._radius_m

    @cached_property
    def _radius_m(self) -> float:
        return max(math.hypot(x, y) for x, y in self.corners)

    def clearance(self, points: Floats) -> Floats:
        return self.nearest(points)[0]

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        start, side, outward, squared = self._geometry
        x, y = points[:, 0, None] - start[:, 0], points[:, 1, None] - start[:, 1]  # (n, m)
        height: Floats = x * outward[:, 0] + y * outward[:, 1]  # signed distance from each side's line
        along = np.clip((x * side[:, 0] + y * side[:, 1]) / squared, 0.0, 1.0)
        x, y = x - along * side[:, 0], y - along * side[:, 1]  # from the nearest point of each side
        gaps: Floats = np.hypot(x, y)
        rows, inside_side, outside_side = np.arange(len(points)), height.argmax(axis=1), gaps.argmin(axis=1)
        gap: Floats = gaps[rows, outside_side]
        depth: Floats = height[rows, inside_side]  # below zero inside
        inside = (depth < 0.0) | (gap < ON_HULL_M)
        normals = outward[inside_side]
        (beyond,) = (~inside).nonzero()
        nearest_side, away_m = outside_side[beyond], gap[beyond]
        normals[beyond, 0] = x[beyond, nearest_side] / away_m
        normals[beyond, 1] = y[beyond, nearest_side] / away_m
        return np.where(inside, depth, gap), normals

    def approach(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        clearance, normals = self.nearest(points)
        return clearance, *_rates(points, normals)

    def clearance_along(self, points: Floats, poses: Floats) -> Floats:
        seen = _seen_from(points, poses)
        return self.clearance(seen.reshape(seen.size // 2, 2)).reshape(len(poses), len(points))

    def covers_along(self, points: Floats, poses: Floats) -> Mask:
        start, _, outward, _ = self._geometry
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        normal_x, normal_y = (
            cos * outward[:, 0] - sin * outward[:, 1],
            sin * outward[:, 0] + cos * outward[:, 1],
        )
        limit_m = (
            (start * outward).sum(axis=1) + normal_x * poses[:, :1] + normal_y * poses[:, 1:2]
        )  # (m, sides)
        along_m = points @ np.array((normal_x.ravel(), normal_y.ravel()))  # (n, m x sides)
        within: Mask = (along_m <= limit_m.ravel()).reshape(len(points), *limit_m.shape).all(axis=2).T
        return within

    def crossing(self, x_m: float, y_m: float, direction: Floats) -> Crossing:
        start, _, outward, _ = self._geometry
        depth_m = outward[:, 0] * (start[:, 0] - x_m) + outward[:, 1] * (start[:, 1] - y_m)  # (m,)
        outwards: Floats = outward @ direction  # (m, n)
        leaving, entering = outwards > NOTHING_M, outwards < -NOTHING_M
        # A ray parallel to a side stays on one side of the side's line.
        ends = np.broadcast_to(np.where(depth_m < 0.0, math.inf, -math.inf)[:, None], outwards.shape).copy()
        np.divide(depth_m[:, None], outwards, out=ends, where=leaving | entering)
        leaves_m: Floats = np.where(leaving, ends, math.inf).min(axis=0)
        enters_m: Floats = np.where(leaving, -math.inf, ends).max(axis=0)
        return _between(enters_m, leaves_m)

    @cached_property
    def _geometry(self) -> tuple[Floats, Floats, Floats, Floats]:
        """For each side: start (m, 2), vector to its end (m, 2), outward unit normal (m, 2), squared length (m,)."""
        start, side = self._sides()
        length = np.hypot(side[:, 0], side[:, 1])
        return start, side, np.array([side[:, 1], -side[:, 0]]).T / length[:, None], length**2

    def _sides(self) -> tuple[Floats, Floats]:
        """Return the start (m, 2) of each side and the vector to its end (m, 2)."""
        start: Floats = np.array(self.corners)
        return start, np.roll(start, -1, axis=0) - start


class Kind(Enum):
    """Why a point counts as occupied."""

    SEEN = "seen"
    """A return in the newest scan."""
    REMEMBERED = "remembered"
    """A return in an earlier scan that no later scan has disproved."""
    HIDDEN = "hidden"
    """A place that no scan proves free: an obstacle may stand there."""


class Surroundings(NamedTuple):
    """Points of one kind around the hull, with their clearances and closing rates; computed once for each scan."""

    hull: Hull
    kind: Kind
    points: Floats
    """(n, 2) [m], base frame."""
    clearance_m: Floats
    """(n,) [m]: distance from the hull, negative inside."""
    per_linear: Floats
    """(n,): closing speed [m/s] for each m/s of forward velocity."""
    per_angular: Floats
    """(n,): closing speed [m/s] for each rad/s of turn rate."""

    def nearest(self) -> tuple[float, float]:
        """Return the clearance of the nearest point [m] and its bearing from the base frame's origin [rad]."""
        first = int(self.clearance_m.argmin())
        x_m, y_m = self.points[first].tolist()
        return self.clearance_m.item(first), math.atan2(y_m, x_m)


NO_POINTS: Floats = np.empty((0, 2))


def survey(hull: Hull, points: Floats, kind: Kind = Kind.SEEN) -> Surroundings:
    """Return points (n, 2) [m] in the base frame as surroundings, with their clearances and closing rates."""
    return Surroundings(hull, kind, points, *hull.approach(points))


@lru_cache(maxsize=16)
def nothing_around(hull: Hull) -> Surroundings:
    """Return the surroundings of a hull without any points."""
    return survey(hull, NO_POINTS)


def _rates(points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return the closing speeds (n,) for each unit of forward velocity and of turn rate."""
    return normals[:, 0], normals[:, 1] * points[:, 0] - normals[:, 0] * points[:, 1]


def moved(points: Floats, displacement: tuple[float, float, float]) -> Floats:
    """Transform points (n, 2) [m] into the base frame after the robot has moved.

    Args:
        points: in the old base frame.
        displacement: of the robot in the old base frame: x [m], y [m], yaw [rad].
    """
    x_m, y_m, yaw_rad = displacement
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    there: Floats = (points - (x_m, y_m)) @ np.array(((cos, -sin), (sin, cos)))
    return there


class Block(NamedTuple):
    """The point that limits a motion, and its closing speed per unit of each velocity."""

    per_linear: float
    per_angular: float
    kind: Kind
    x_m: float
    """Position of the point in the base frame."""
    y_m: float

    def is_approached_by(self, linear_m_s: float, angular_rad_s: float) -> bool:
        closing = self.per_linear * linear_m_s + self.per_angular * angular_rad_s
        return closing > DEEP_TOLERANCE_M_S


class Barrier(NamedTuple):
    """Parameters of the barrier for one step."""

    stop_distance_m: float
    deceleration_m_s2: float
    reaction_s: float
    hidden_creep_m_s: float
    """Closing speed that is always permitted toward a hidden place, whatever its distance."""
    dead_time_s: float = 0.0
    """Part of `reaction_s` for which the base keeps its present speed."""


def permitted_closing_speed(
    clearance_m: Floats, barrier: Barrier, present_m_s: Floats | None = None
) -> Floats:
    """Return the highest closing speed [m/s] from which the base stops in time: κ(c), or less while it slows down.

    Args:
        clearance_m: (n,) [m].
        barrier: the parameters of this step.
        present_m_s: (n,) [m/s]: closing speeds of the base at present; None: it is not faster than commanded.
    """
    margin = np.maximum(clearance_m - barrier.stop_distance_m, 0.0)
    a = barrier.deceleration_m_s2
    lost = a * barrier.reaction_s
    steady = np.sqrt(lost * lost + 2.0 * a * margin) - lost
    if present_m_s is None:
        return steady
    return np.where(present_m_s > steady, permitted_while_slowing(margin, present_m_s, barrier), steady)


def permitted_while_slowing(margin: Floats, present: Floats, barrier: Barrier) -> Floats:
    """Return the larger root u of the bound of a base that is faster than its command; zero if it can no longer stop.

    Args:
        margin: (n,) [m]: distances in which it must stop.
        present: (n,) [m/s]: its present speeds.
        barrier: the parameters of this step.
    """
    a, dead_s = barrier.deceleration_m_s2, barrier.dead_time_s
    spare = a * (margin - dead_s * present) - present * present / 2.0  # the bound at u = 0
    excess = present - a * (barrier.reaction_s - dead_s)
    root = (excess + np.sqrt(excess * excess + 4.0 * np.maximum(spare, 0.0))) / 2.0
    return np.where(spare < 0.0, 0.0, np.maximum(root, 0.0))


def permitted_scale(
    around: Surroundings,
    linear_m_s: float,
    angular_rad_s: float,
    barrier: Barrier,
    here: Surroundings | None = None,
    *,
    worth: float = math.inf,
    present: float = 0.0,
) -> tuple[float, Block | None]:
    """Return the permitted share of a twist, 0 to 1, and the point that limits it; None if no point does.

    Args:
        around: the points in the base frame in which they were seen.
        linear_m_s: the requested forward velocity.
        angular_rad_s: the requested turn rate, counter-clockwise.
        barrier: the parameters of this step.
        here: the same points in the present base frame by odometry; None if the robot has hardly moved.
        worth: the minimum useful share; the point is returned only if the permitted share is lower.
        present: the base's present speed along the twist, as a share of it; it counts where it is more than permitted.
    """
    limit = _limit_of_closing(around, linear_m_s, angular_rad_s, barrier, present)
    if here is not None:
        limit = _tighter(limit, _limit_of_closing(here, linear_m_s, angular_rad_s, barrier, present))
    if linear_m_s or angular_rad_s:
        limit = _limit_of_the_way_ahead(here or around, linear_m_s, angular_rad_s, barrier, limit, present)
    scale, block = limit
    return scale, block() if block is not None and scale < worth else None


Limit = tuple[float, Callable[[], Block] | None]
"""A share of the twist, 0 to 1, and a function that returns the limiting point; None if no point limits."""

FREE: Limit = (1.0, None)


def _tighter(one: Limit, other: Limit) -> Limit:
    return min(one, other, key=itemgetter(0))


def _limit_of_closing(
    around: Surroundings, linear_m_s: float, angular_rad_s: float, barrier: Barrier, present: float
) -> Limit:
    closing = around.per_linear * linear_m_s + around.per_angular * angular_rad_s
    tolerance: float | Floats
    if around.kind is Kind.HIDDEN:
        tolerance = max(CLOSING_TOLERANCE_M_S, barrier.hidden_creep_m_s)
    else:
        deep = around.clearance_m < barrier.stop_distance_m - DEEP_M
        tolerance = np.where(deep, DEEP_TOLERANCE_M_S, CLOSING_TOLERANCE_M_S)
    (closed_on,) = (closing > tolerance).nonzero()
    if len(closed_on) == 0:
        return FREE
    closing = closing.take(closed_on)
    permitted = permitted_closing_speed(
        around.clearance_m.take(closed_on), barrier, present * closing if present > 0.0 else None
    )
    if around.kind is Kind.HIDDEN:
        permitted = np.maximum(permitted, barrier.hidden_creep_m_s)
    scales = permitted / closing
    tightest = int(scales.argmin())
    scale = scales.item(tightest)
    if scale >= 1.0:
        return FREE
    point = closed_on.item(tightest)
    return scale, lambda: _block(around, point, around.per_linear.item(point), around.per_angular.item(point))


def _block(around: Surroundings, point: int, per_linear: float, per_angular: float) -> Block:
    x_m, y_m = around.points[point].tolist()
    return Block(per_linear, per_angular, around.kind, x_m, y_m)


def _limit_of_the_way_ahead(
    around: Surroundings,
    linear_m_s: float,
    angular_rad_s: float,
    barrier: Barrier,
    limit: Limit,
    present: float,
) -> Limit:
    """Return the limit from braking along the path ahead, or `limit` if that is lower."""
    hull, lost_s = around.hull, barrier.reaction_s
    braking_s = max(abs(linear_m_s), abs(angular_rad_s) * hull.radius_m) / barrier.deceleration_m_s2
    horizon_s = limit[0] * (lost_s + limit[0] * braking_s / 2.0)
    if present > limit[0]:  # the bound is convex: its left side is largest at an end
        dead_s, slowed = barrier.dead_time_s, present - limit[0]
        horizon_s += slowed * (dead_s + slowed * braking_s / 2.0)
        horizon_s = max(horizon_s, present * (dead_s + present * braking_s / 2.0))
    fastest_m_s = abs(linear_m_s) + abs(angular_rad_s) * hull.radius_m
    keep_m = barrier.stop_distance_m + (STRAY_M if angular_rad_s else 0.0)
    (near,) = (around.clearance_m < keep_m + fastest_m_s * horizon_s).nonzero()
    if len(near) == 0:
        return limit
    points, now = around.points.take(near, axis=0), around.clearance_m.take(near)
    step_s = horizon_s / POSES
    poses = _along_arc(linear_m_s, angular_rad_s, step_s, POSES)
    clearance = hull.clearance_along(points, poses)
    keep = np.minimum(now, keep_m)
    entered = clearance < keep - GRAZE_M - DEEP_TOLERANCE_M_S * horizon_s
    soonest = int(entered.argmax())  # in the order of the poses
    if not entered.item(soonest):
        return limit
    first = soonest // len(near)
    before = now if first == 0 else clearance[first - 1]
    # The distance is assumed to fall linearly between two poses.
    share = (before - keep) / np.maximum(before - clearance[first], GRAZE_M)
    share = np.where(entered[first], share, np.inf)
    nearest = int(share.argmin())
    # A point within the tolerance at the previous pose counts as entered there, but never before the present.
    tau_s = step_s * max(0.0, first + share.item(nearest))
    scale = (math.sqrt(lost_s * lost_s + 2.0 * braking_s * tau_s) - lost_s) / braking_s
    if present > scale:
        along = barrier._replace(deceleration_m_s2=1.0 / braking_s)
        scale = permitted_while_slowing(np.array(tau_s), np.array(present), along).item()
    if around.kind is Kind.HIDDEN:
        scale = max(scale, barrier.hidden_creep_m_s / fastest_m_s)

    def block() -> Block:
        """Return the point with the rates at which the hull closes on it fastest along the path."""
        count = MOMENTS * (first + 1)
        moments = _seen_from(
            points[[nearest]], _along_arc(linear_m_s, angular_rad_s, step_s / MOMENTS, count)
        )
        _, per_linear, per_angular = hull.approach(np.vstack((points[nearest], moments[:, 0])))
        worst = int((per_linear * linear_m_s + per_angular * angular_rad_s).argmax())
        return _block(around, near.item(nearest), per_linear.item(worst), per_angular.item(worst))

    return _tighter(limit, (scale, block))


def _along_arc(linear_m_s: float, angular_rad_s: float, step_s: float, count: int) -> Floats:
    """Return the poses (count, 3) after each time step at a constant twist: x [m], y [m], yaw [rad]."""
    poses: list[tuple[float, float, float]] = []
    for number in range(1, count + 1):
        time_s = number * step_s
        half = angular_rad_s * time_s / 2.0
        chord = linear_m_s * time_s * (math.sin(half) / half if half else 1.0)
        poses.append((chord * math.cos(half), chord * math.sin(half), 2.0 * half))
    return np.array(poses)


def _seen_from(points: Floats, poses: Floats) -> Floats:
    """Transform points (n, 2) into the frame of each pose (m, 3); returns (m, n, 2)."""
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    offset_x, offset_y = points[:, 0] - poses[:, :1], points[:, 1] - poses[:, 1:2]
    return np.stack([cos * offset_x + sin * offset_y, cos * offset_y - sin * offset_x], axis=2)
