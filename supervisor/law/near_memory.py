"""Memory of near points: a return near the robot is remembered until a later scan disproves it.

A point is dropped when every beam around its position has a return farther away, or when `MISSES` scans have
covered its position without a return there. A new return at its position replaces it. A point that no beam covers
is kept, so that a dropout does not permit motion toward an obstacle that was just seen.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import NO_POINTS, Floats
from supervisor.law.scan import Mount, View, is_full_turn

MISSES = 8
"""A point is dropped after this many scans without a return there. With 30 % dropouts, 1 point in 15,000 is dropped
wrongly."""

MOST_POINTS = 256
"""Maximum number of remembered points; the nearest are kept."""

BESIDE_RAD = 0.03
"""The beams within this angle to both sides of a point are checked, 3 cm at one metre: odometry is not exact."""

SAME_M = 0.06
"""A return within this distance of a point is the same point; covers noise, odometry error and slanted surfaces."""

ONE_SURFACE_M = 0.4
"""Returns around a point whose ranges differ by less than this belong to one slanted surface."""

CHECKED_BEAMS: Floats = np.linspace(-1.0, 1.0, 5)
"""The beams that are checked, as shares of `BESIDE_RAD`."""

Counts = npt.NDArray[np.int64]


class Remembered(NamedTuple):
    """Points of earlier scans."""

    points: Floats = NO_POINTS
    """(n, 2) [m], in the base frame of the newest scan."""
    misses: Floats = np.empty(0)
    """(n,): number of scans that covered the point's position without a return there."""


def remember(earlier: Remembered, view: View, mount: Mount) -> Remembered:
    """Return the earlier points that a new scan neither replaces nor disproves.

    Args:
        earlier: points of all earlier scans, in the base frame of the new scan.
        view: the view of the new scan.
        mount: the mount of its lidar.
    """
    points, misses = earlier
    if len(points) == 0:
        return earlier
    away_x, away_y = points[:, 0] - mount.x_m, points[:, 1] - mount.y_m
    distance_m = np.hypot(away_x, away_y)
    beam = _beam_of(view, np.arctan2(away_y, away_x) - mount.yaw_rad)
    returning_m = np.where(view.hit, view.free_m, math.inf)
    # Fast path: the new scan shows nearly all points again, most of them with the beam in their direction.
    ahead_m = _values_at(view, returning_m, np.rint(beam).astype(np.int64), beside=math.inf)
    (left,) = (np.abs(ahead_m - distance_m) > SAME_M).nonzero()
    if len(left) == 0:
        return Remembered()
    beams_beside = BESIDE_RAD / abs(view.geometry.increment) * CHECKED_BEAMS
    asked = np.rint(beam[left, None] + beams_beside).astype(np.int64)
    returns_m = _values_at(view, returning_m, asked, beside=math.inf)
    (other,) = (np.abs(returns_m - distance_m[left, None]).min(axis=1) > SAME_M).nonzero()
    if len(other) == 0:
        return Remembered()
    left, asked, returns_m = left[other], asked[other], returns_m[other]
    distance_m, misses = distance_m[left], misses[left]
    hit = returns_m < math.inf
    nearest_m, farthest_m = returns_m.min(axis=1), np.where(hit, returns_m, -math.inf).max(axis=1)
    again = (nearest_m < distance_m) & (farthest_m > distance_m) & (farthest_m - nearest_m < ONE_SURFACE_M)
    # Directions filled in from earlier scans are no new evidence.
    proven_m = np.where(view.explained_s < view.taken_s, 0.0, view.free_m)
    free_m = _values_at(view, proven_m, asked, beside=0.0)
    covered = (free_m >= distance_m[:, None]).all(axis=1)
    misses = np.where(covered, misses + 1, misses)
    (kept,) = (~again & ~(covered & hit.all(axis=1)) & (misses < MISSES)).nonzero()
    if len(kept) > MOST_POINTS:
        kept = kept[np.argpartition(distance_m[kept], MOST_POINTS)[:MOST_POINTS]]
    return Remembered(points[left[kept]], misses[kept])


def _beam_of(view: View, bearing_rad: Floats) -> Floats:
    """Return the fractional beam index (n,) of each bearing (n,) [rad] in the lidar's frame."""
    _, angle_min, increment = view.geometry
    return ((bearing_rad - angle_min) % math.copysign(2 * math.pi, increment)) / increment


def _values_at(view: View, values: Floats, beams: Counts, *, beside: float) -> Floats:
    """Return the values at the given beam indices; an index outside the view gives `beside`."""
    if is_full_turn(view.geometry):
        return values.take(beams, mode="wrap")
    return np.append(values, beside).take(beams, mode="clip")
