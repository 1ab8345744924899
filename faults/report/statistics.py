"""Statistics of many trials: quantiles and their upper limits, upper bound of a rate, bins on a log axis. Pure."""

import math
from bisect import bisect_left
from collections.abc import Sequence

CONFIDENCE = 0.95


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return the smallest value that at least this share of the values does not exceed; NaN without values.

    Args:
        ordered: values in ascending order.
        share: 0 to 1.
    """
    if not ordered:
        return math.nan
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def upper_rate(count: int, events: int = 0) -> float:
    """Return the one-sided upper bound of an event's rate (Clopper and Pearson), with `CONFIDENCE`.

    Without events this is 1 - (1 - CONFIDENCE)^(1/count): about 3/count, the rule of three.

    Args:
        count: number of independent trials.
        events: number of trials with the event.

    Returns:
        0 to 1; 1 without trials.
    """
    if events >= count:
        return 1.0
    doubt = 1.0 - CONFIDENCE
    if events == 0:
        return -math.expm1(math.log(doubt) / count)
    low, high = events / count, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _at_most(events, count, middle) > doubt:
            low = middle
        else:
            high = middle
    return high


def upper_quantile(ordered: Sequence[float], share: float) -> float:
    """Return the one-sided upper limit of a quantile, from order statistics alone; infinity if there are too few values.

    The k-th of n values is the limit if at most k - 1 of n independent values are below the quantile with `CONFIDENCE`.

    Args:
        ordered: independent values in ascending order.
        share: of the quantile, between 0 and 1.
    """
    count = len(ordered)
    first = bisect_left(range(count), CONFIDENCE, key=lambda below: _at_most(below, count, share))
    return ordered[first] if first < count else math.inf


def _at_most(events: int, count: int, rate: float) -> float:
    """Return the probability of at most this number of events."""
    hit, miss = math.log(rate), math.log1p(-rate)
    whole = math.lgamma(count + 1)
    return math.fsum(
        math.exp(whole - math.lgamma(k + 1) - math.lgamma(count - k + 1) + k * hit + (count - k) * miss)
        for k in range(events + 1)
    )


def log_bins(values: Sequence[float], first: float, decades: int, per_decade: int) -> list[int]:
    """Return the number of values in each bin of a log axis; values beyond it count in its end bins.

    Args:
        values: not negative.
        first: begin of the axis; positive.
        decades: length of the axis.
        per_decade: bins per decade.
    """
    counts = [0] * (decades * per_decade)
    for value in values:
        place = math.floor(per_decade * math.log10(value / first)) if value > first else 0
        counts[min(place, len(counts) - 1)] += 1
    return counts
