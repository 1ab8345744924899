"""The distance that counts for each beam: that of a surface, shown by neighbours and earlier scans, minus two standard errors.

One reading is noisy, and beside a wall, the nearest of many readings is always too near. A pair of neighbours, at the angles kδ to
both sides of a beam and with the ranges a and b, says where a straight surface crosses the beam:

    2·a·b·cos(kδ) / (a + b)

The pairs from the inside outward agree with the beam until one differs from its reading by more than noise explains: there the
surface ends. Farther away than the smallest obstacle spans three of these beams, no pair counts: a post in front of a wall would
be taken for noise of the wall. While the robot rests, the mean of a beam's last readings replaces its reading, so that waiting
brings no new sample. With the noise σ of one reading, n scans and the m beams of the surface, the distance that counts is

    min(mean of the m beams - 2σ/√(n·m), mean of the three middle beams - 2·max(0, σ/√n - `TOLERATED_M`)/√3)

The second term keeps a post of four beams in front of a wall. If no pair agrees, the beam shows an edge, a thin object or an outlier.
Then its reading counts minus 2·max(0, σ - `TOLERATED_M`) while the robot moves, and its own mean minus 2σ/√n while the robot rests.

σ is measured at rest, by the change of a reading against the mean of those before, compared with the changes of two neighbours.
What stands still is no noise, however jagged it is, nor is a smooth change, as when the robot moves and odometry does not show it. The
median leaves out edges that move. Below `LEAST_NOISE_M`, and until the robot has rested, all readings count as they are.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Floats, Mask
from supervisor.law.reckoning import Pose, between

LEAST_NOISE_M = 0.0025
"""Noise that changes no stop: the barrier's own tolerances are as large."""

MOST_NOISE_M = 0.03
"""Largest noise that is believed."""

PAIRS = 3
PAIR_RAD = math.radians(1.0)
"""Number of neighbours to each side, and the angle δ between them: the next beam, or every second or third one of a denser lidar.
They span 6 cm at a distance of 0.6 m."""

ERRORS = 2.0
"""Standard errors that are subtracted."""

TOLERATED_M = 0.011
"""Noise that is not subtracted from a post and from a beam alone: beside a wall, the robot would stop. About the 1 cm by which the
hull may be nearer than the stop distance."""

PAIR_SHARE = math.sqrt(1.5)
"""Standard deviation of the difference between a reading and the mean of its two neighbours, in σ."""

EXPLAINED = 4.0 * PAIR_SHARE
"""Noise explains a difference of up to this many σ."""

WEIGHTS: Floats = 2.0 / (2.0 * np.arange(PAIRS + 1.0) + 1.0)
"""Weight of a pair in the mean of a surface, by the number of agreeing pairs."""

AT_REST: Floats = ERRORS / np.sqrt(2.0 * np.arange(PAIRS + 1.0) + 1.0)
IN_MOTION: Floats = np.append(0.0, AT_REST[1:])
"""Standard errors of one beam that are subtracted, by the number of agreeing pairs."""

MEDIAN_SHARE = 0.6745
"""Half of all values are within this many standard deviations of their mean."""

FEWEST = 20
"""The noise is not measured with fewer beams."""

MEASUREMENTS = 25
"""The measured noise is the mean of about this many measurements."""

REST = 0.003
"""[m, rad] A lidar that has moved less than this on every axis rests."""

MOST_SCANS = 50.0
"""The mean of a resting lidar forgets older readings."""

NOTHING: Floats = np.empty(0)

Counts = npt.NDArray[np.int8]


class Surfaces(NamedTuple):
    """What the scans of one lidar have shown so far, over its n beams."""

    noise_m: float = 0.0
    """Standard deviation of one reading, as measured."""
    measurements: int = 0
    """Number of scans at rest that measured it."""
    pose: Pose = Pose(0.0, 0.0, 0.0)
    """The odometer pose at which the lidar has rested since."""
    mean_m: Floats = NOTHING
    """(n,): mean of the readings since then; NaN without a return."""
    seen: Floats = NOTHING
    """(n,): number of these readings."""


def surfaces(
    before: Surfaces,
    distance_m: Floats,
    hit: Mask,
    step_rad: float,
    pose: Pose,
    near_m: float,
    smallest_m: float,
    *,
    is_round: bool,
) -> tuple[Surfaces, Floats]:
    """Return what is known after a scan, and the distances (n,) [m] that count; undefined for beams without a return.

    Args:
        before: what was known before it; without `mean_m` if the beams of the two scans have different directions.
        distance_m: (n,) the readings [m].
        hit: (n,) which of them are returns.
        step_rad: angle between two beams.
        pose: the odometer pose at which the scan was taken.
        near_m: the noise is measured on returns nearer than this, if they suffice.
        smallest_m: diameter of the smallest obstacle.
        is_round: whether the last beam is the first beam's neighbour.
    """
    raw_m = np.where(hit, distance_m, math.nan)
    if len(before.mean_m) and max(map(abs, between(before.pose, pose))) < REST:
        change_m = raw_m - before.mean_m
        noise_m, measurements = _measured(before, change_m, raw_m < near_m, step_rad)
        fits = np.abs(change_m) <= EXPLAINED * noise_m
        seen = np.minimum(before.seen, MOST_SCANS - 1.0) * fits + 1.0
        mean_m = np.where(fits, before.mean_m + change_m / seen, raw_m)
        known, errors = Surfaces(noise_m, measurements, before.pose, mean_m, seen), AT_REST
    else:
        known = Surfaces(before.noise_m, before.measurements, pose, raw_m, np.ones(len(raw_m)))
        errors = IN_MOTION
    if known.noise_m < LEAST_NOISE_M:
        return known, distance_m
    error_m = known.noise_m / np.sqrt(known.seen)
    return known, _counts(known.mean_m, error_m, errors, step_rad, smallest_m, is_round=is_round)


def _measured(before: Surfaces, change_m: Floats, near: Mask, step_rad: float) -> tuple[float, int]:
    """Return the mean of the noise so far and that of a scan at rest [m], and the number of measurements.

    Args:
        before: what was known before the scan.
        change_m: (n,) difference between each reading and the mean of those before [m]; NaN if either has no return.
        near: (n,) the beams with a near return.
        step_rad: angle between two beams.
    """
    beside, _ = _spacing(step_rad)
    middle = slice(beside, -beside)
    off_m = np.abs(change_m[middle] - 0.5 * (change_m[: -2 * beside] + change_m[2 * beside :]))
    off_m /= np.sqrt(1.0 + 1.0 / before.seen[middle])
    known = ~np.isnan(off_m)
    close = known & near[middle]
    sorted_m = np.sort(off_m[close if np.count_nonzero(close) >= FEWEST else known])
    if len(sorted_m) < FEWEST:
        return before.noise_m, before.measurements
    noise_m = min(sorted_m.item(len(sorted_m) // 2) / (MEDIAN_SHARE * PAIR_SHARE), MOST_NOISE_M)
    number = before.measurements + 1
    return before.noise_m + (noise_m - before.noise_m) / min(number, MEASUREMENTS), number


def _counts(
    mean_m: Floats, error_m: Floats, errors: Floats, step_rad: float, smallest_m: float, *, is_round: bool
) -> Floats:
    """Return the distances (n,) [m] that count.

    Args:
        mean_m: (n,) mean of each beam's readings [m].
        error_m: (n,) its standard error [m].
        errors: (PAIRS + 1,) the standard errors that are subtracted, by the number of agreeing pairs.
        step_rad: angle between two beams.
        smallest_m: diameter of the smallest obstacle.
        is_round: whether the last beam is the first beam's neighbour.
    """
    stride, scales = _spacing(step_rad)
    off_m = _pairs(mean_m, stride, is_round=is_round) * scales - mean_m
    agree = np.abs(off_m) <= EXPLAINED * error_m
    agree[0] &= mean_m <= smallest_m / (3.0 * stride * abs(step_rad))
    for outer in range(1, PAIRS):
        agree[outer] &= agree[outer - 1]
    off_m = np.where(agree, off_m, 0.0)
    pairs: Counts = np.add.reduce(agree.view(np.int8), dtype=np.int8)
    total_m: Floats = np.add.reduce(off_m)
    surface_m = total_m * WEIGHTS.take(pairs) - error_m * errors.take(pairs)
    excess_m = np.maximum(error_m - TOLERATED_M, 0.0)
    post_m = off_m[0] * WEIGHTS.item(1) - excess_m * AT_REST.take(np.minimum(pairs, 1))
    return mean_m + np.minimum(surface_m, post_m)


def _pairs(range_m: Floats, stride: int, *, is_round: bool) -> Floats:
    """Return a·b / (a + b) of the pairs beside each beam: (PAIRS, n) [m], innermost first; NaN if a neighbour is missing."""
    beams, beside = len(range_m), PAIRS * stride
    padded = np.full(beams + 2 * beside, math.nan)
    padded[beside : beside + beams] = range_m
    if is_round:
        padded[:beside] = range_m[-beside:]
        padded[beside + beams :] = range_m[:beside]
    shifted = np.ndarray((2 * PAIRS + 1, beams), buffer=padded, strides=(8 * stride, 8))
    one, other = shifted[PAIRS - 1 :: -1], shifted[PAIRS + 1 :]
    pairs_m: Floats = one * other
    pairs_m /= one + other
    return pairs_m


@lru_cache(maxsize=16)
def _spacing(step_rad: float) -> tuple[int, Floats]:
    """Return the number of beams between two neighbours, and 2·cos(kδ), (PAIRS, 1), for the pairs from the inside outward."""
    stride = max(1, round(PAIR_RAD / abs(step_rad)))
    return stride, 2.0 * np.cos(stride * step_rad * np.arange(1.0, PAIRS + 1.0))[:, None]
