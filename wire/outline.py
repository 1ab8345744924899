"""The line at a distance from a robot's hull, the same in every picture (pure)."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def line_around(corners_m: Sequence[tuple[float, float]], distance_m: float, segments: int) -> Floats:
    """Return points (n, 2) [m] at a distance from a convex polygon, counter-clockwise; the last is not the first again.

    Args:
        corners_m: counter-clockwise; a single one gives a circle.
        distance_m: the distance of each point from the polygon.
        segments: the number of points of a full turn, a multiple of 4; a rectangle and a circle have exactly as many.
    """
    corners = np.array(corners_m)
    if len(corners) == 1:
        return corners + distance_m * _arc(0.0, math.tau * (1.0 - 1.0 / segments), segments)
    sides = np.roll(corners, -1, axis=0) - corners
    # Outward, of the side that begins at each corner.
    normals_rad = np.arctan2(-sides[:, 0], sides[:, 1])
    arcs: list[Floats] = []
    for corner, before_rad, normal_rad in zip(corners, np.roll(normals_rad, 1), normals_rad, strict=True):
        turn_rad = (normal_rad - before_rad) % math.tau
        number = max(2, round(segments * turn_rad / math.tau))
        arcs.append(corner + distance_m * _arc(before_rad, turn_rad, number))
    return np.concatenate(arcs)


def _arc(start_rad: float, turn_rad: float, number: int) -> Floats:
    """Return points (number, 2) on the unit circle, with both ends."""
    angles_rad = np.linspace(start_rad, start_rad + turn_rad, number)
    return np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
