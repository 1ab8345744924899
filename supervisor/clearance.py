"""The speed barrier: one formula for stop zone, slow-down zone and escape.

For a point p in the robot's frame [m], its distance c from the hull [m], the outward unit normal n at the
hull's nearest point, and a commanded twist (v [m/s], ω [rad/s]):

    closing speed    k = -n · (-v + ω·p_y, -ω·p_x)  =  n_x·v + (n_y·p_x - n_x·p_y)·ω
    permitted speed  κ(c) = 0                                          for c <= d
                     κ(c) = -a·T + sqrt((a·T)² + 2·a·(c - d))          beyond
    scale            s = min(1, min over points with k > k_tol of κ(c)/k)

with the stop distance d, the deceleration a that the base is trusted with, and the reaction time T: κ is
the speed from which reacting for T and then braking with a ends exactly at d (v·T + v²/2a = c - d). The
twist is scaled as a whole, so that an arc keeps its shape; what closes on nothing near is not slowed.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

CLOSING_TOLERANCE_M_S = 0.01
"""Closing more slowly than this is not closing: readings are noisy."""


class Hull(Protocol):
    """The robot's outline in its base frame."""

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        """Distances (n,) [m], negative inside, and outward unit normals (n, 2), for points (n, 2) [m]."""
        ...

    @property
    def radius_m(self) -> float:
        """The farthest that any part of the hull is from the base frame's origin."""
        ...


@dataclass(frozen=True)
class Circle:
    """A round hull about the base frame's origin."""

    radius_m: float

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        distances: Floats = np.hypot(points[:, 0], points[:, 1])
        safe = np.where(distances > 0.0, distances, 1.0)
        normals = np.where(distances[:, None] > 0.0, points / safe[:, None], (1.0, 0.0))
        return distances - self.radius_m, normals


@dataclass(frozen=True)
class ConvexPolygon:
    """A hull with straight sides; corners (m, 2) [m] counter-clockwise, strictly convex."""

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        corners = np.array(self.corners, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[0] < 3 or not np.isfinite(corners).all():
            raise ValueError("a polygon needs at least three finite corners (x, y)")
        sides = np.roll(corners, -1, axis=0) - corners
        after = np.roll(sides, -1, axis=0)
        turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
        winding = np.arctan2(turns, (sides * after).sum(axis=1)).sum()
        if (turns <= 0.0).any() or winding > 3.0 * np.pi:
            raise ValueError("the polygon must be convex, its corners counter-clockwise")

    @property
    def radius_m(self) -> float:
        return max(float(np.hypot(x, y)) for x, y in self.corners)

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        start = np.array(self.corners, dtype=np.float64)
        side = np.roll(start, -1, axis=0) - start
        length = np.hypot(side[:, 0], side[:, 1])
        outward = np.stack([side[:, 1], -side[:, 0]], axis=1) / length[:, None]
        offset = points[:, None, :] - start[None, :, :]
        height: Floats = (offset * outward).sum(axis=2)  # (n, m): signed distance from each side's line
        rows = np.arange(len(points))
        inside_side = height.argmax(axis=1)
        along = np.clip((offset * side).sum(axis=2) / (length**2), 0.0, 1.0)
        away = offset - along[:, :, None] * side  # (n, m, 2): from the nearest point of each side
        gaps: Floats = np.hypot(away[:, :, 0], away[:, :, 1])
        outside_side = gaps.argmin(axis=1)
        gap: Floats = gaps[rows, outside_side]
        inside = height[rows, inside_side] <= 0.0
        distances: Floats = np.where(inside, height[rows, inside_side], gap)
        safe = np.where(gap > 0.0, gap, 1.0)
        normals = np.where(
            (inside | (gap == 0.0))[:, None], outward[inside_side], away[rows, outside_side] / safe[:, None]
        )
        return distances, normals


@dataclass(frozen=True)
class Surroundings:
    """Points around the hull, with what the closing speed needs, computed once for each scan."""

    clearance_m: Floats
    """(n,): hull to point."""
    per_linear: Floats
    """(n,): closing speed [m/s] for each m/s of forward velocity."""
    per_angular: Floats
    """(n,): closing speed [m/s] for each rad/s of turn rate."""
    nearest_m: float
    """Infinity where there is no point."""
    nearest_bearing_rad: float
    """Direction of the nearest point from the base frame's origin; NaN where there is none."""


def survey(hull: Hull, points: Floats) -> Surroundings:
    """What points (n, 2) [m] in the base frame mean for motions of the hull."""
    if len(points) == 0:
        none = np.empty(0)
        return Surroundings(none, none, none, float("inf"), float("nan"))
    clearance, normal = hull.nearest(points)
    first = int(clearance.argmin())
    return Surroundings(
        clearance,
        normal[:, 0],
        normal[:, 1] * points[:, 0] - normal[:, 0] * points[:, 1],
        float(clearance[first]),
        float(np.arctan2(points[first, 1], points[first, 0])),
    )


@dataclass(frozen=True, slots=True)
class Block:
    """The point that limits a motion, by its closing speed per unit of each velocity."""

    per_linear: float
    per_angular: float

    def is_approached_by(self, linear_m_s: float, angular_rad_s: float) -> bool:
        closing = self.per_linear * linear_m_s + self.per_angular * angular_rad_s
        return closing > CLOSING_TOLERANCE_M_S


def permitted_closing_speed(
    clearance_m: Floats, *, stop_distance_m: float, deceleration_m_s2: float, reaction_s: float
) -> Floats:
    """κ(c) for each clearance (n,): the closing speed [m/s] that still comes to rest at the stop distance."""
    margin = np.maximum(clearance_m - stop_distance_m, 0.0)
    lost = deceleration_m_s2 * reaction_s
    return np.sqrt(lost * lost + 2.0 * deceleration_m_s2 * margin) - lost


def permitted_scale(
    surroundings: Surroundings,
    linear_m_s: float,
    angular_rad_s: float,
    *,
    stop_distance_m: float,
    deceleration_m_s2: float,
    reaction_s: float,
) -> tuple[float, Block | None]:
    """The share of a twist that is permitted, 0 to 1, and the point that limits it; (1, None) where none does."""
    closing = surroundings.per_linear * linear_m_s + surroundings.per_angular * angular_rad_s
    (closed_on,) = np.nonzero(closing > CLOSING_TOLERANCE_M_S)
    if len(closed_on) == 0:
        return 1.0, None
    permitted = permitted_closing_speed(
        surroundings.clearance_m[closed_on],
        stop_distance_m=stop_distance_m,
        deceleration_m_s2=deceleration_m_s2,
        reaction_s=reaction_s,
    )
    scales = permitted / closing[closed_on]
    tightest = int(scales.argmin())
    if scales[tightest] >= 1.0:
        return 1.0, None
    point = int(closed_on[tightest])
    block = Block(float(surroundings.per_linear[point]), float(surroundings.per_angular[point]))
    return float(scales[tightest]), block
