"""Returns of the robot's own posts, cables and mounts, which a lidar sees at the hull, and the sector that masks them.

A return cannot show whether it is a part of the robot. The sector is only advice to the person who configures the lidar.
"""

import math

import numpy as np

from supervisor.law.clearance import Hull
from supervisor.law.scan import Mount, View, rays_of

AT_HULL_M = 0.05
"""A part of the robot is inside the hull, or outside by less than this."""

SAME_PLACE_M = 0.1
"""A return within this distance of a place is from the object there."""

WIDEST_RAD = math.radians(20.0)
"""A wider object at the hull is no post: to mask it would blind the lidar."""

MARGIN_BEAMS = 1
"""A sector is wider than the object by this number of beams at both sides: readings at an edge come and go."""


def own_sector(
    view: View, mount: Mount, hull: Hull, place: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the sector [rad] that masks the object at the hull around a place; None if there is none.

    Args:
        view: the view of the lidar.
        mount: its mount.
        hull: the robot's outline.
        place: x [m], y [m] in the base frame of the view.

    Returns:
        the first and the last angle of the sector, counter-clockwise, as the driver sends them.
    """
    count, angle_min, increment = view.geometry
    points = rays_of(view.geometry, mount, hull).points(np.arange(count), view.free_m)
    at_hull = view.hit & (hull.clearance(points) < AT_HULL_M)
    away_m = np.where(at_hull, np.hypot(points[:, 0] - place[0], points[:, 1] - place[1]), math.inf)
    middle = int(away_m.argmin())
    if away_m.item(middle) > SAME_PLACE_M:
        return None
    gone = ~np.roll(at_hull, -middle)
    after, before = (
        int(gone.argmax()),
        int(gone[::-1].argmax()),
    )  # beams of the object from the middle on, and before it
    if not gone.any() or (after + before) * abs(increment) > WIDEST_RAD:
        return None
    sign = -1.0 if mount.flip else 1.0
    first, last = middle - before - MARGIN_BEAMS, middle + after - 1 + MARGIN_BEAMS
    ends = [sign * (angle_min + increment * beam) for beam in (first, last)]
    low, high = ends if sign * increment > 0.0 else reversed(ends)
    return math.remainder(low, 2 * math.pi), math.remainder(high, 2 * math.pi)
