"""The distance that counts for each beam: that of a surface, shown by neighbours and earlier scans, minus two standard errors.

One reading is noisy, and beside a wall, the nearest of many readings is always too near. A pair of neighbours, at the angles kδ to
both sides of a beam and with the ranges a and b, says where a straight surface crosses the beam:

    2·a·b·cos(kδ) / (a + b)

The pairs from the inside outward agree with the beam until one differs from its reading by more than noise explains: there the
surface ends. While the robot rests, the mean of a beam's last readings replaces its reading, so that waiting brings no new sample.
With the noise σ of one reading, n scans and the m beams of the surface, the distance that counts is

    min(mean of the m beams - 2σ/√(n·m), mean of the three middle beams)

The second term keeps a post of four beams in front of a wall. If no pair agrees, the beam shows an edge, a thin object or an outlier.
Then its reading counts as it is while the robot moves, and its own mean minus 2σ/√n while the robot rests.

σ is measured. Noise puts as many pairs before their beams as behind them, but convex objects and edges do not: the smaller side
counts. Below `LEAST_NOISE_M`, all readings count as they are.
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
"""Largest noise that is believed: more is clutter."""

PAIRS = 3
PAIR_RAD = math.radians(1.0)
"""Number of neighbours to each side, and the angle δ between them: the next beam, or every second or third one of a denser lidar.
They span 6 cm at a distance of 0.6 m."""

ERRORS = 2.0
"""Standard errors that are subtracted."""

PAIR_SHARE = math.sqrt(1.5)
"""Standard deviation of the difference between a reading and a pair, in σ."""

EXPLAINED = 4.0 * PAIR_SHARE
"""Noise explains a difference of up to this many σ."""

WEIGHTS: Floats = 2.0 / (2.0 * np.arange(PAIRS + 1.0) + 1.0)
"""Weight of a pair in the mean of a surface, by the number of agreeing pairs."""

AT_REST: Floats = ERRORS / np.sqrt(2.0 * np.arange(PAIRS + 1.0) + 1.0)
IN_MOTION: Floats = np.append(0.0, AT_REST[1:])
"""Standard errors of one beam that are subtracted, by the number of agreeing pairs."""

TAIL = 0.375
TAIL_AT = 0.3186 * PAIR_SHARE
"""Noise alone puts this share of the pairs more than so many σ before their beams, and as many behind."""

FEWEST = 20
"""The noise is not measured with fewer beams."""

MEASURED_EVERY = 4
"""The noise is measured in one of this many scans."""

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
    scans: int = 0
    """Number of scans."""
    pose: Pose = Pose(0.0, 0.0, 0.0)
    """The odometer pose at which the lidar has rested since."""
    mean_m: Floats = NOTHING
    """(n,): mean of the readings since then; NaN without a return. Empty if the noise is negligible."""
    seen: Floats = NOTHING
    """(n,): number of these readings."""


def surfaces(
    before: Surfaces,
    distance_m: Floats,
    hit: Mask,
    step_rad: float,
    pose: Pose,
    near_m: float,
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
        is_round: whether the last beam is the first beam's neighbour.
    """
    raw_m = np.where(hit, distance_m, math.nan)
    noise_m = before.noise_m
    if before.scans % MEASURED_EVERY == 0:
        noise_m = _measured(before, raw_m, step_rad, near_m, is_round=is_round)
    if noise_m < LEAST_NOISE_M:
        return Surfaces(noise_m, before.scans + 1), distance_m
    if len(before.mean_m) and max(map(abs, between(before.pose, pose))) < REST:
        mean_m, seen = _mean(before, raw_m, EXPLAINED * noise_m)
        counts_m = _counts(mean_m, noise_m / np.sqrt(seen), AT_REST, step_rad, is_round=is_round)
        return Surfaces(noise_m, before.scans + 1, before.pose, mean_m, seen), counts_m
    counts_m = _counts(raw_m, noise_m, IN_MOTION, step_rad, is_round=is_round)
    return Surfaces(noise_m, before.scans + 1, pose, raw_m, np.ones(len(raw_m))), counts_m


def _mean(before: Surfaces, raw_m: Floats, explained_m: float) -> tuple[Floats, Floats]:
    """Return mean (n,) [m] and number (n,) of each beam's readings; both begin anew at a reading that noise does not explain."""
    change_m = raw_m - before.mean_m
    fits = np.abs(change_m) <= explained_m
    seen = np.minimum(before.seen, MOST_SCANS - 1.0) * fits + 1.0
    return np.where(fits, before.mean_m + change_m / seen, raw_m), seen


def _counts(
    mean_m: Floats, error_m: Floats | float, errors: Floats, step_rad: float, *, is_round: bool
) -> Floats:
    """Return the distances (n,) [m] that count.

    Args:
        mean_m: (n,) mean of each beam's readings [m].
        error_m: (n,) its standard error [m].
        errors: (PAIRS + 1,) the standard errors that are subtracted, by the number of agreeing pairs.
        step_rad: angle between two beams.
        is_round: whether the last beam is the first beam's neighbour.
    """
    off_m = _pairs(mean_m, PAIRS, step_rad, is_round=is_round) - mean_m
    agree = np.abs(off_m) <= EXPLAINED * error_m
    for outer in range(1, PAIRS):
        agree[outer] &= agree[outer - 1]
    off_m = np.where(agree, off_m, 0.0)
    pairs: Counts = np.add.reduce(agree.view(np.int8), dtype=np.int8)
    total_m: Floats = np.add.reduce(off_m)
    surface_m = total_m * WEIGHTS.take(pairs) - error_m * errors.take(pairs)
    return mean_m + np.minimum(surface_m, off_m[0] * WEIGHTS.item(1))


def _pairs(range_m: Floats, count: int, step_rad: float, *, is_round: bool) -> Floats:
    """Return where the lines through the pairs cross each beam: (count, n) [m], innermost first; NaN if a neighbour is missing."""
    stride, scales = _spacing(count, step_rad)
    beams, beside = len(range_m), count * stride
    padded = np.full(beams + 2 * beside, math.nan)
    padded[beside : beside + beams] = range_m
    if is_round:
        padded[:beside] = range_m[-beside:]
        padded[beside + beams :] = range_m[:beside]
    shifted = np.ndarray((2 * count + 1, beams), buffer=padded, strides=(8 * stride, 8))
    one, other = shifted[count - 1 :: -1], shifted[count + 1 :]
    pairs_m = one * other
    pairs_m /= one + other
    pairs_m *= scales
    return pairs_m


@lru_cache(maxsize=16)
def _spacing(count: int, step_rad: float) -> tuple[int, Floats]:
    """Return the number of beams between two neighbours, and 2·cos(kδ), (count, 1), for the pairs from the inside outward."""
    stride = max(1, round(PAIR_RAD / abs(step_rad)))
    return stride, 2.0 * np.cos(stride * step_rad * np.arange(1.0, count + 1.0))[:, None]


def _measured(before: Surfaces, raw_m: Floats, step_rad: float, near_m: float, *, is_round: bool) -> float:
    """Return the mean of the noise so far and that of this scan; the former if the scan has too few returns."""
    off_m = _pairs(raw_m, 1, step_rad, is_round=is_round)[0] - raw_m
    known = ~np.isnan(off_m)
    near = known & (raw_m < near_m)
    off_m = off_m[near if np.count_nonzero(near) >= FEWEST else known]
    if len(off_m) < FEWEST:
        return before.noise_m
    below = int(TAIL * len(off_m))
    sides_m = np.sort(off_m)
    spread_m = max(0.0, min(-sides_m.item(below), sides_m.item(-1 - below)))
    number = min(before.scans // MEASURED_EVERY + 1, MEASUREMENTS)
    return before.noise_m + (min(spread_m / TAIL_AT, MOST_NOISE_M) - before.noise_m) / number
