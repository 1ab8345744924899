"""The uncertainty of the instrument: the wall in the scans of a robot at rest, and the rate of odometry."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from commission.estimate import Floats
from passport.record import Instrument
from teleop.pilots.pilot import Velocity

WALL_FIT = "robust line through the returns of {lidar} at the wall ahead: RANSAC, then total least squares"
LEAST_SCANS = 10
LARGEST = 1.0
"""Of an uncertainty; with a larger one, nothing is measured."""


def instrument(
    lidar: str,
    walls: Floats,
    bearings: Floats,
    odometry_s: Sequence[float],
    *,
    top: Velocity,
    latency_s: float | None,
) -> Instrument | None:
    """Return the instrument; None if the robot at rest was not seen well enough.

    A distance is the difference of two distances of the wall, so it has √2 times the noise of one (95 %: twice that). To this is added
    the distance that the robot drives at its top speed during the uncertainty of the latency. The same holds for the angle of a turn.

    Args:
        lidar: its name.
        walls: (n, 2) arrival [s], distance of the wall at rest [m].
        bearings: (n, 2) arrival [s], bearing of the wall at rest [rad].
        odometry_s: arrival [s].
        top: the top speed, and the top rate of a turn.
        latency_s: the uncertainty of the latency of the scans; None: it was not measured, and one period of the scans is assumed.
    """
    if min(len(walls), len(odometry_s)) < LEAST_SCANS:
        return None
    apart_s = max(after - before for before, after in itertools.pairwise(odometry_s))
    if latency_s is None:
        latency_s = float(np.median(np.diff(walls[:, 0])))
    found_m, found_rad = (
        2.0 * math.sqrt(2.0) * float(np.std(seen[:, 1], ddof=1)) + most * latency_s
        for seen, most in zip((walls, bearings), top, strict=True)
    )
    if max(found_m, found_rad, apart_s) > LARGEST:
        return None
    return Instrument(
        wall_fit=WALL_FIT.format(lidar=lidar),
        uncertainty_m=found_m,
        uncertainty_rad=found_rad,
        uncertainty_s=apart_s,
    )
