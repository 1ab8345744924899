"""Upper limits of stops without an assumption about their distribution: the r-th largest of n runs. Pure.

The r-th largest of n independent runs is at least the quantile p with the confidence P(Bin(n, 1 - p) >= r) (Wilks, 1941). For the
quantile of 95 % with 95 % confidence, r = 1, 2, 3, 4 needs n = 59, 93, 124, 153 runs.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

SHARE = 0.95
"""Share of all stops that a limit covers."""
CONFIDENCE = 0.95
"""Of all limits of one sentence together."""

NOISE = 1e-6
"""Of a sum in floating point, in units of the last digit that is printed."""


class Limit(NamedTuple):
    """The upper limit of a quantity in one cell, with the uncertainty of the instrument added."""

    value: float
    runs: int
    proven: bool
    """Whether it covers `SHARE` of all stops; otherwise it is the largest of the runs, and says nothing of others."""


def confidence(runs: int, rank: int, share: float = SHARE) -> float:
    """Return the confidence with which the rank-th largest of the runs is at least the quantile.

    Args:
        runs: number of independent runs.
        rank: 1 is the largest.
        share: of the quantile.
    """
    below = math.fsum(
        math.comb(runs, k) * (1.0 - share) ** k * share ** (runs - k) for k in range(min(rank, runs + 1))
    )
    return 1.0 - below


def rank(runs: int, least: float, share: float = SHARE) -> int:
    """Return the largest rank that has at least this confidence; 0 if even the largest run has less."""
    found = 0
    while found < runs and confidence(runs, found + 1, share) >= least:
        found += 1
    return found


def limit(values: Sequence[float], uncertainty: float, sentences: int) -> Limit:
    """Return the limit of a quantity.

    Args:
        values: one for each run, at least one.
        uncertainty: of the instrument, in the unit of the values.
        sentences: number of cells about which one sentence speaks: each has its share of the doubt (Bonferroni).
    """
    found = rank(len(values), 1.0 - (1.0 - CONFIDENCE) / sentences)
    value = sorted(values)[-max(1, found)]
    return Limit(value + uncertainty, len(values), proven=found > 0)


def rounded_up(value: float, digits: int = 2) -> str:
    """Return an upper limit as text that is not below it, but for the noise of floating point."""
    return f"{math.ceil(value * 10**digits - NOISE) / 10**digits:.{digits}f}"


def upper_rate(runs: int) -> float:
    """Return the upper limit of the rate of a failure that none of the runs had: 1 - 0.05^(1/n)."""
    return -math.expm1(math.log1p(-CONFIDENCE) / runs) if runs else 1.0
