"""The rate, the noise and the latency of a lidar."""

import math
from collections.abc import Sequence

import numpy as np

from commission.estimate import UNKNOWN, Estimate, Floats, least_squares, of_repeats

LEAST_SCANS = 10
LONGEST_S = 0.5
"""The longest latency that can be configured."""
EARLIEST_S = -0.1
STEP_S = 0.005
LEAST_CHANGE_M_S = 0.05
"""A drive whose speed varies less does not show a latency."""
REFINEMENTS = 8


def period(arrivals_s: Sequence[float]) -> Estimate:
    """Return the time between two scans [s]."""
    return of_repeats(np.diff(np.asarray(arrivals_s, dtype=np.float64)).tolist())


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


def latency(scans_s: Floats, distances_m: Floats, odometry_s: Floats, ways_m: Floats) -> Estimate:
    """Return how much later than odometry the scans show a motion toward the wall [s].

    The delay between the distance of the wall and the way by odometry, by least squares: d(t) = d0 - k·x(t - τ). Only a motion
    of which the speed changes shows it. The latency of odometry itself is not part of it.

    Args:
        scans_s: (n,) times at which the scans arrived.
        distances_m: (n,) distances of the wall.
        odometry_s: (m,) times at which odometry arrived.
        ways_m: (m,) way toward the wall by odometry.
    """
    if len(scans_s) < LEAST_SCANS:
        return UNKNOWN
    later = np.diff(odometry_s, prepend=-math.inf) > 0.0
    odometry_s, ways_m = odometry_s[later], ways_m[later]
    if len(odometry_s) < LEAST_SCANS:
        return UNKNOWN
    speeds_m_s = np.gradient(ways_m, odometry_s)
    if float(np.ptp(speeds_m_s)) < LEAST_CHANGE_M_S:
        return UNKNOWN

    def design(tau_s: float) -> Floats:
        ways = np.interp(scans_s - tau_s, odometry_s, ways_m)
        return np.stack((np.ones_like(ways), -ways), axis=1)

    def misfit(tau_s: float) -> float:
        matrix = design(tau_s)
        residuals = distances_m - matrix @ np.linalg.lstsq(matrix, distances_m, rcond=None)[0]
        return float(residuals @ residuals)

    tau_s = min(np.arange(EARLIEST_S, LONGEST_S, STEP_S).tolist(), key=misfit)
    fit = least_squares(design(tau_s), distances_m)
    for _ in range(REFINEMENTS):
        scale = float(fit.parameters[1])
        change = scale * np.interp(scans_s - tau_s, odometry_s, speeds_m_s)  # of d by τ
        fit = least_squares(np.column_stack((design(tau_s), change)), distances_m)
        step_s = float(np.clip(fit.parameters[2], -STEP_S, STEP_S))
        tau_s += step_s
    if not EARLIEST_S <= tau_s <= LONGEST_S:
        return UNKNOWN
    return fit.estimate(tau_s, np.array([0.0, 0.0, 1.0]))
