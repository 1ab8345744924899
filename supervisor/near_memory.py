"""Memory of near points: what a scan showed near the robot stays there until a later scan disproves it.

A point is dropped when every beam around its position returns from farther away, or when `MISSES`
scans that cover its position have found nothing there. A scan that shows it again replaces it. While no beam covers
it, it stays: so no dropout opens the way to what was seen a moment ago.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import NO_POINTS, Floats
from supervisor.scan import Mount, View, is_full_turn

MISSES = 8
"""Scans that find nothing at a point before it is dropped. With 30 % dropouts, 1 point in 15,000 is dropped wrongly."""

MOST_POINTS = 256
"""The nearest of them are kept."""

BESIDE_RAD = 0.03
"""The beams to both sides of a point within this are asked about it, 3 cm at one metre: odometry is not exact."""

SAME_M = 0.06
"""A return so near to a point is that point: noise, odometry, and a surface that is met at a slant."""

ONE_SURFACE_M = 0.4
"""Returns around a point that differ by less are one surface, met at a slant."""

ASKED: Floats = np.linspace(-1.0, 1.0, 5)
"""Which beams are asked, as shares of that angle."""

Counts = npt.NDArray[np.int64]


class Remembered(NamedTuple):
    """Points of earlier scans."""

    points: Floats = NO_POINTS
    """(n, 2) [m], in the base frame of the newest scan."""
    misses: Floats = np.empty(0)
    """(n,): scans that covered its position and found nothing there."""


def remember(earlier: Remembered, view: View, mount: Mount) -> Remembered:
    """What is left of earlier points after a new scan.

    Args:
        earlier: points of all earlier scans, in the base frame of the new one.
        view: the new scan's.
        mount: of its lidar.
    """
    points, misses = earlier
    if len(points) == 0:
        return earlier
    away_x, away_y = points[:, 0] - mount.x_m, points[:, 1] - mount.y_m
    distance_m = np.hypot(away_x, away_y)
    beam = _beam_of(view, np.arctan2(away_y, away_x) - mount.yaw_rad)
    returning_m = np.where(view.hit, view.free_m, math.inf)
    # Nearly all of them are shown again, most of them by their own beam.
    ahead_m = _ask(view, returning_m, np.rint(beam).astype(np.int64), beside=math.inf)
    (left,) = (np.abs(ahead_m - distance_m) > SAME_M).nonzero()
    if len(left) == 0:
        return Remembered()
    beams_beside = BESIDE_RAD / abs(view.geometry.increment) * ASKED
    asked = np.rint(beam[left, None] + beams_beside).astype(np.int64)
    returns_m = _ask(view, returning_m, asked, beside=math.inf)
    (other,) = (np.abs(returns_m - distance_m[left, None]).min(axis=1) > SAME_M).nonzero()
    if len(other) == 0:
        return Remembered()
    left, asked, returns_m = left[other], asked[other], returns_m[other]
    distance_m, misses = distance_m[left], misses[left]
    hit = returns_m < math.inf
    nearest_m, farthest_m = returns_m.min(axis=1), np.where(hit, returns_m, -math.inf).max(axis=1)
    again = (nearest_m < distance_m) & (farthest_m > distance_m) & (farthest_m - nearest_m < ONE_SURFACE_M)
    # What is filled in from earlier scans says nothing new.
    proven_m = np.where(view.explained_s < view.taken_s, 0.0, view.free_m)
    free_m = _ask(view, proven_m, asked, beside=0.0)
    covered = (free_m >= distance_m[:, None]).all(axis=1)
    misses = np.where(covered, misses + 1, misses)
    (kept,) = (~again & ~(covered & hit.all(axis=1)) & (misses < MISSES)).nonzero()
    if len(kept) > MOST_POINTS:
        kept = kept[np.argpartition(distance_m[kept], MOST_POINTS)[:MOST_POINTS]]
    return Remembered(points[left[kept]], misses[kept])


def _beam_of(view: View, bearing_rad: Floats) -> Floats:
    """The beam, and the part of the way to the next one, in which each bearing (n,) in the lidar's frame lies."""
    _, angle_min, increment = view.geometry
    return ((bearing_rad - angle_min) % math.copysign(2 * math.pi, increment)) / increment


def _ask(view: View, values: Floats, beams: Counts, *, beside: float) -> Floats:
    """What each of these beams says; one beside the view says `beside`."""
    if is_full_turn(view.geometry):
        return values.take(beams, mode="wrap")
    return np.append(values, beside).take(beams, mode="clip")
