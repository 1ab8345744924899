"""Stationary objects as capsules, and the exact clearance of a hull to them.

A capsule is a segment with a radius, or a disc if both ends are the same point. Every object has a thickness.
Lengths are in m, poses (x, y, yaw) in m and rad.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Circle, ConvexPolygon

Floats = npt.NDArray[np.float64]
Shape = Circle | ConvexPolygon


@dataclass(frozen=True)
class World:
    """Capsules: discs and walls."""

    starts: Floats
    """(m, 2) [m]"""
    ends: Floats
    """(m, 2) [m]"""
    radii: Floats
    """(m,) [m]"""

    def __len__(self) -> int:
        return len(self.radii)

    def seen_from(self, x_m: float, y_m: float, yaw_rad: float) -> "World":
        """Return the objects in the frame of a pose."""
        turn = np.array(((math.cos(yaw_rad), -math.sin(yaw_rad)), (math.sin(yaw_rad), math.cos(yaw_rad))))
        here = (x_m, y_m)
        return World((self.starts - here) @ turn, (self.ends - here) @ turn, self.radii)

    def within(self, x_m: float, y_m: float, distance_m: float) -> "World":
        """Return the objects within a distance of a point."""
        (near,) = (self.nearest_to(x_m, y_m)[0] <= distance_m).nonzero()
        return World(self.starts[near], self.ends[near], self.radii[near])

    def nearest_to(self, x_m: float, y_m: float) -> tuple[Floats, Floats]:
        """Return distances (m,) from a point to the surfaces, and the nearest points (m, 2) on the centre lines."""
        side = self.ends - self.starts
        offset = np.array((x_m, y_m)) - self.starts
        length = np.maximum((side * side).sum(axis=1), 1e-12)
        along = np.clip((offset * side).sum(axis=1) / length, 0.0, 1.0)
        points: Floats = self.starts + along[:, None] * side
        distances: Floats = np.hypot(x_m - points[:, 0], y_m - points[:, 1]) - self.radii
        return distances, points


class Measure:
    """Computes the clearance of one hull."""

    def __init__(self, hull: Shape) -> None:
        self._radius_m = hull.radius_m
        self._corners: Floats | None = None
        if isinstance(hull, ConvexPolygon):
            self._corners = np.array(hull.corners, dtype=np.float64)
            self._sides = np.roll(self._corners, -1, axis=0) - self._corners
            self._squares: Floats = (self._sides**2).sum(axis=1)
            self._outward: Floats = (
                np.stack((self._sides[:, 1], -self._sides[:, 0]), axis=1) / np.sqrt(self._squares)[:, None]
            )

    def clearances_m(self, world: World, x_m: float, y_m: float, yaw_rad: float) -> Floats:
        """Return the clearances (m,) from the hull at a pose to each object; zero or negative on contact."""
        if self._corners is None:
            return world.nearest_to(x_m, y_m)[0] - self._radius_m
        # Only objects near the polygon's circumscribed circle need more than a lower bound.
        bound: Floats = world.nearest_to(x_m, y_m)[0] - self._radius_m
        (near,) = (bound < max(0.0, bound.min()) + self._radius_m).nonzero()
        close = World(world.starts[near], world.ends[near], world.radii[near])
        clearances = bound.copy()
        clearances[near] = self._from_polygon(close.seen_from(x_m, y_m, yaw_rad))
        return clearances

    def _from_polygon(self, world: World) -> Floats:
        corners = self._corners
        assert corners is not None
        gap = np.minimum(
            _to_segments(corners, world.starts, world.ends - world.starts).min(axis=0),
            np.minimum(
                _to_segments(world.starts, corners, self._sides).min(axis=1),
                _to_segments(world.ends, corners, self._sides).min(axis=1),
            ),
        )
        # Clip each segment by the half-planes of all sides: what remains is inside the hull.
        first = ((world.starts[:, None, :] - corners) * self._outward).sum(axis=2)
        last = ((world.ends[:, None, :] - corners) * self._outward).sum(axis=2)
        change = last - first
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -first / change
        enters = np.where(change < 0.0, crossing, 0.0).max(axis=1)
        leaves = np.where(change > 0.0, crossing, 1.0).min(axis=1)
        parallel_outside = ((change == 0.0) & (first > 0.0)).any(axis=1)
        inside = (enters.clip(0.0) <= leaves.clip(None, 1.0)) & ~parallel_outside
        return np.where(inside, 0.0, gap) - world.radii


def _to_segments(points: Floats, starts: Floats, sides: Floats) -> Floats:
    """Return distances (n, w) from points (n, 2) to segments (w, 2)."""
    squares = np.maximum((sides * sides).sum(axis=1), 1e-12)
    offset = points[:, None, :] - starts
    along = np.clip((offset * sides).sum(axis=2) / squares, 0.0, 1.0)
    away = offset - along[:, :, None] * sides
    distances: Floats = np.hypot(away[:, :, 0], away[:, :, 1])
    return distances
