"""Where along a leg the robot is: searched only onwards, and only in a window ahead.

So a path that crosses itself, or goes the same way twice, does not make the robot leave anything out.
"""

from typing import NamedTuple

import numpy as np

from teleop.path.legs import Leg

WINDOW_M = 0.4


class Station(NamedTuple):
    """The nearest place of a leg."""

    along_m: float
    off_m: float
    """From there to the robot."""


def nearest(leg: Leg, x_m: float, y_m: float, from_m: float, window_m: float = WINDOW_M) -> Station:
    """The place between `from_m` and `window_m` further along that is nearest to (x, y)."""
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
