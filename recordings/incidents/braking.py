"""How a robot comes to rest after a stop: its motion, and the time and distance to its standstill. Pure."""

import itertools
import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

from wire.standstill import is_still

BRAKES_WITHIN_S = 4.0
"""A standstill that begins later is not a consequence of the stop."""
STILL_S = 0.1
"""Minimum duration of a standstill; shorter ones are part of the rocking."""


class Motion(NamedTuple):
    """The true pose of the robot and its clearance."""

    time_s: float
    x_m: float
    y_m: float
    linear_m_s: float
    angular_rad_s: float
    clearance_m: float = math.inf
    """Distance from the hull to the nearest object; at most 0 on contact."""
    own_approach_m: float = 0.0
    """How much nearer it came since the sample before by its own motion alone: the clearance that the pose
    of before has in the world of now, less the clearance now."""
    is_touching: bool = False
    appeared_m: float = math.inf
    """Distance from the hull to an object that was placed since the previous sample."""

    @property
    def is_still(self) -> bool:
        return is_still(self.linear_m_s, self.angular_rad_s)


class Braking(NamedTuple):
    """Time and distance to a standstill."""

    to_standstill_s: float
    distance_m: float


def braking(motions: Sequence[Motion], from_s: float) -> Braking | None:
    """Return time and distance from a moment to the standstill.

    Returns:
        None if there is no sample before the moment, or no lasting standstill within `BRAKES_WITHIN_S`.
    """
    start = bisect_left(motions, from_s, key=lambda motion: motion.time_s)
    rest = _rest(motions[start:])
    if start == 0 or rest is None or rest.time_s - from_s > BRAKES_WITHIN_S:
        return None
    way = [motions[start - 1], *itertools.takewhile(lambda m: m.time_s <= rest.time_s, motions[start:])]
    distance_m = sum(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in itertools.pairwise(way))
    return Braking(rest.time_s - from_s, distance_m)


def _rest(motions: Sequence[Motion]) -> Motion | None:
    """Return the first sample of a lasting standstill."""
    first: Motion | None = None
    for motion in motions:
        if not motion.is_still:
            first = None
        elif first is None:
            first = motion
        elif motion.time_s - first.time_s >= STILL_S:
            return first
    return None
