"""The uncertainty of the instrument: the wall in the scans of a robot at rest, and the rate of odometry."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from commission.estimate import Floats
from passport.record import Instrument

WALL_FIT = (
    "robust line through the returns of the lidar {lidar} at the wall ahead: RANSAC, then total least squares"
)
LEAST_SCANS = 10
LARGEST = 1.0
"""Of an uncertainty; with a larger one, nothing is measured."""


def instrument(
    lidar: str, walls: Floats, odometry_s: Sequence[float], *, top_m_s: float, latency_s: float | None
) -> Instrument | None:
    """Return the instrument; None if the robot at rest was not seen well enough.

    A distance is the difference of two distances of the wall, so it has √2 times the noise of one (95 %: twice that). To this is added
    the distance that the robot drives at its top speed while the latency of the scans is unknown.

    Args:
        lidar: its name.
        walls: (n, 2) arrival [s], distance of the wall at rest [m].
        odometry_s: arrival [s].
        top_m_s: the top speed.
        latency_s: the uncertainty of the latency of the scans; None: it was not measured, and one period of the scans is assumed.
    """
    if min(len(walls), len(odometry_s)) < LEAST_SCANS:
        return None
    noise_m = float(np.std(walls[:, 1], ddof=1))
    apart_s = max(after - before for before, after in itertools.pairwise(odometry_s))
    if latency_s is None:
        latency_s = float(np.median(np.diff(walls[:, 0])))
    found = 2.0 * math.sqrt(2.0) * noise_m + top_m_s * latency_s
    if max(found, apart_s) > LARGEST:
        return None
    return Instrument(wall_fit=WALL_FIT.format(lidar=lidar), uncertainty_m=found, uncertainty_s=apart_s)
