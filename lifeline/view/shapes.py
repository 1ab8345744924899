"""The robot's hull, lines at a distance from it, and the free space of a scan, as shapes in the base frame. Pure."""

import numpy as np

from lifeline.view.primitives import Floats, Indices
from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.scan import Mount, View, is_full_turn, rays_of
from wire.outline import line_around

SEGMENTS = 96
"""Points of a full turn."""


def outline(hull: Hull, away_m: float = 0.0) -> Floats:
    """Return the closed line (n, 2) [m] at a distance from a hull; its last point is its first.

    Args:
        hull: a circle or a convex polygon.
        away_m: the distance of each point of the line from the hull.
    """
    if isinstance(hull, Circle):
        line = line_around([(0.0, 0.0)], hull.radius_m + away_m, SEGMENTS)
    else:
        assert isinstance(hull, ConvexPolygon)  # the configuration has no other shape
        line = line_around(hull.corners, away_m, SEGMENTS)
    return np.vstack([line, line[:1]])


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
