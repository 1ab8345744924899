"""The noise and the latency of a lidar."""

import math
from collections.abc import Sequence

import numpy as np

from commission.estimate import UNKNOWN, Estimate, Floats, least_squares, of_repeats

LEAST_SCANS = 10
STEP_S = 0.005
DELAYS_S = np.arange(-0.1, 0.5, STEP_S)
"""The latencies that are tried, up to the longest that can be configured."""
LEAST_BEND_M = 0.02
"""A motion whose distance over time is nearer to a straight line does not show a latency."""


def noise(ranges_m: Floats) -> Estimate:
    """Return the standard deviation of one reading at rest [m]: the median of the beams that returned in every scan.

    Args:
        ranges_m: (scans, beams); a reading without a return is not finite.
    """
    scans = len(ranges_m)
    if scans < LEAST_SCANS:
        return UNKNOWN
    always = np.isfinite(ranges_m).all(axis=0)
    beams = int(np.count_nonzero(always))
    if beams < LEAST_SCANS:
        return UNKNOWN
    freedom = scans - 1
    variances = np.var(ranges_m[:, always], axis=0, ddof=1)
    # The median of the chi-squared distribution, by Wilson and Hilferty.
    sigma_m = math.sqrt(float(np.median(variances)) / (1.0 - 2.0 / (9.0 * freedom)) ** 3)
    # A median has a 1.25 times larger standard error than a mean.
    return Estimate(sigma_m, 1.96 * 1.2533 * sigma_m / math.sqrt(2.0 * freedom * beams), scans * beams)


def latency(scans_s: Floats, distances_m: Floats, odometry_s: Floats, ways_m: Floats) -> float:
    """Return how much later than odometry the scans show a motion toward the wall [s]; NaN if it is not seen.

    The delay between the distance of the wall and the way by odometry, by least squares: d(t) = d0 - k·x(t - τ). Only a motion
    of which the speed changes shows it. The latency of odometry itself is not part of it.

    Args:
        scans_s: (n,) times at which the scans arrived.
        distances_m: (n,) distances of the wall.
        odometry_s: (m,) times at which odometry arrived.
        ways_m: (m,) way toward the wall by odometry.
    """
    if min(len(scans_s), len(odometry_s)) < LEAST_SCANS:
        return math.nan
    steadily = np.stack((np.ones_like(odometry_s), odometry_s - odometry_s[0]), axis=1)
    line: Floats = steadily @ least_squares(steadily, ways_m).parameters
    if np.ptp(ways_m - line) < LEAST_BEND_M:
        return math.nan

    def misfit(tau_s: float) -> float:
        ways = np.interp(scans_s - tau_s, odometry_s, ways_m)
        design = np.stack((np.ones_like(ways), ways), axis=1)
        residuals = distances_m - design @ np.linalg.lstsq(design, distances_m, rcond=None)[0]
        return float(residuals @ residuals)

    misfits = [misfit(tau_s) for tau_s in DELAYS_S.tolist()]
    best = misfits.index(min(misfits))
    if not 0 < best < len(misfits) - 1:
        return math.nan
    # The lowest point of the parabola through the best delay and its neighbours.
    before, at, after = misfits[best - 1 : best + 2]
    return float(DELAYS_S[best]) + 0.5 * STEP_S * (before - after) / (before - 2.0 * at + after)


def latency_of(speeds_m_s: Sequence[float], latencies_s: Sequence[float]) -> Estimate:
    """Return the latency from drives at several speeds.

    If the wheels slip while the speed changes, the distance to the wall is delayed further, in proportion to the speed. If the
    delays of the drives grow with the speed, the latency is their value extrapolated to speed zero.

    Args:
        speeds_m_s: (n,) speeds of the drives.
        latencies_s: (n,) the result of `latency` of each; not NaN.
    """
    speeds = np.array(speeds_m_s)
    line = least_squares(np.stack((np.ones_like(speeds), speeds), axis=1), np.array(latencies_s))
    at_zero_s, rise = line.parameters.tolist()
    if line.estimate(rise, np.array([0.0, 1.0])).low > 0.0:
        # A scan cannot show a motion before it begins, so a negative value is an error of the line and is added to the interval.
        return line.estimate(at_zero_s, np.array([1.0, 0.0])).with_errors(min(0.0, at_zero_s))
    return of_repeats(latencies_s)
