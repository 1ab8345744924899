"""The robot's hull, lines at a distance from it, and the free space of a scan, as shapes in the base frame. Pure."""

import math

import numpy as np

from lifeline.view.primitives import Floats, Indices
from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.scan import Mount, View, is_full_turn, rays_of

SEGMENTS = 96
"""Points of a full turn."""


def outline(hull: Hull, away_m: float = 0.0) -> Floats:
    """Return the closed line (n, 2) [m] at a distance from a hull; its last point is its first.

    Args:
        hull: a circle or a convex polygon.
        away_m: the distance of each point of the line from the hull.
    """
    if isinstance(hull, Circle):
        line = (hull.radius_m + away_m) * _arc(0.0, math.tau, SEGMENTS)
    else:
        assert isinstance(hull, ConvexPolygon)  # the configuration has no other shape
        line = _around(np.array(hull.corners), away_m)
    return np.vstack([line, line[:1]])


def _around(corners: Floats, away_m: float) -> Floats:
    """Return an arc around each corner, from the normal of the side before it to that of the side behind it."""
    sides = np.roll(corners, -1, axis=0) - corners
    normal_rad = np.arctan2(-sides[:, 0], sides[:, 1])
    arcs: list[Floats] = []
    for place, corner in enumerate(corners):
        turn_rad = (normal_rad[place] - normal_rad[place - 1]) % math.tau
        number = 2 + math.ceil(SEGMENTS * turn_rad / math.tau)
        arcs.append(corner + away_m * _arc(normal_rad[place - 1], turn_rad, number, ends=True))
    return np.concatenate(arcs)


def _arc(start_rad: float, turn_rad: float, number: int, *, ends: bool = False) -> Floats:
    """Return points (number, 2) on the unit circle."""
    angle = np.linspace(start_rad, start_rad + turn_rad, number, endpoint=ends)
    return np.column_stack((np.cos(angle), np.sin(angle)))


def fan(line_m: Floats) -> tuple[Floats, Indices]:
    """Return a closed line around the origin as an area: corners (n, 2) [m] and triangles (m, 3)."""
    corners = np.vstack([np.zeros((1, 2)), line_m])
    first = np.arange(1, len(line_m))
    return corners, np.column_stack((np.zeros_like(first), first, first + 1))


def free_space(view: View, mount: Mount, hull: Hull) -> tuple[Floats, Indices]:
    """Return the space between neighbouring rays that a scan proves free.

    Returns:
        the lidar's position and the ends of all rays as corners (n + 1, 2) [m] in the base frame, and the triangles
        (m, 3) between neighbouring rays that are both proven free.
    """
    rays = rays_of(view.geometry, mount, hull)
    corners = np.vstack([rays.origin_m.T, (rays.direction * view.free_m + rays.origin_m).T])
    count = view.geometry.beams
    first = np.arange(count if is_full_turn(view.geometry) else count - 1)
    second = (first + 1) % count
    known = (view.free_m[first] > 0.0) & (view.free_m[second] > 0.0)
    first, second = first[known] + 1, second[known] + 1
    return corners, np.column_stack((np.zeros_like(first), first, second))
