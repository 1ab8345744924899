"""Progress of the robot along a leg, searched only forward and within a window.

On a path that crosses or repeats itself, the robot therefore does not skip any part.
"""

from typing import NamedTuple

import numpy as np

from teleop.path.legs import Leg

WINDOW_M = 0.4


class Station(NamedTuple):
    """The nearest point of a leg."""

    along_m: float
    off_m: float
    """Distance of the robot from this point."""


def nearest(leg: Leg, x_m: float, y_m: float, from_m: float, window_m: float = WINDOW_M) -> Station:
    """Return the point nearest to (x, y) between `from_m` and `from_m + window_m` along the leg."""
    to_m = min(from_m + window_m, leg.length_m)
    pieces = len(leg.headings_rad)
    first = min(max(int(np.searchsorted(leg.along_m, from_m, side="right")) - 1, 0), pieces - 1)
    last = min(max(int(np.searchsorted(leg.along_m, to_m, side="left")), first + 1), pieces)
    starts, along_m = leg.points_m[first:last], leg.along_m[first:last]
    ahead = leg.points_m[first + 1 : last + 1] - starts
    lengths_m = np.hypot(ahead[:, 0], ahead[:, 1])
    robot = np.array((x_m, y_m))
    projected_m = along_m + ((robot - starts) * ahead).sum(axis=1) / lengths_m
    places_m = np.clip(
        projected_m, np.maximum(along_m, from_m), np.minimum(along_m + lengths_m, max(to_m, from_m))
    )
    points = starts + ahead * ((places_m - along_m) / lengths_m)[:, None]
    off_m = np.hypot(*(robot - points).T)
    best = int(np.argmin(off_m))
    return Station(float(places_m[best]), float(off_m[best]))
