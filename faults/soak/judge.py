"""Judge whether anything grew, and whether the robot stopped without a cause."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from faults.soak.sample import Sample
from faults.soak.usage import Usage

Floats = npt.NDArray[np.float64]

GROWTH_LIMIT_PERCENT = 1.0
WARM_UP_LEAST_S, WARM_UP_S = 90.0, 600.0
"""The black box fills within a minute, during which memory grows as expected. Heap fragmentation is stable after about ten
minutes (measured over 25 minutes: 80 MB after three, 83 to 84 MB from the thirteenth on)."""
WARM_UP_SHARE = 1.0 / 6.0
FEWEST_SAMPLES = 6
JUDGED_S = 600.0
"""Minimum time for a verdict: over a shorter time, a single block of an allocator is one percent."""
MOST_POINTS = 600
"""Maximum number of samples for a slope over all pairs; of more samples, medians of groups are used."""

MEASURES: dict[str, Callable[[Usage], int]] = {
    "memory": lambda usage: usage.rss_bytes,
    "descriptors": lambda usage: usage.descriptors,
    "threads": lambda usage: usage.threads,
}


class Growth(NamedTuple):
    """Growth of one measure of one process after the warm-up."""

    process: str
    measure: str
    level: float
    """Its median."""
    percent: float
    """Slope times the observed time; NaN with too few samples."""
    watched_s: float = 0.0

    @property
    def is_measured(self) -> bool:
        return not math.isnan(self.percent)

    @property
    def is_judged(self) -> bool:
        return self.is_measured and self.watched_s >= JUDGED_S

    @property
    def is_too_much(self) -> bool:
        return self.is_judged and self.percent > GROWTH_LIMIT_PERCENT


@dataclass(frozen=True, slots=True)
class Judgement:
    """The verdict on a soak."""

    growths: tuple[Growth, ...]
    faults: tuple[str, ...]
    """The faults as sentences; empty if the soak passed."""

    @property
    def passed(self) -> bool:
        return not self.faults


def warm_up_s(duration_s: float) -> float:
    """Return the duration of the warm-up: a sixth of the soak, at most ten minutes; up to half of a short soak."""
    wanted_s = max(min(WARM_UP_SHARE * duration_s, WARM_UP_S), WARM_UP_LEAST_S)
    return min(wanted_s, duration_s / 2.0)


def judge(samples: Sequence[Sample]) -> Judgement:
    """Judge a soak by its samples, at least one."""
    begins_s = warm_up_s(samples[-1].time_s)
    kept = [sample for sample in samples if sample.time_s >= begins_s]
    names = dict.fromkeys(name for sample in samples for name in sample.processes)
    growths = tuple(_growth(kept, name, measure) for name in names for measure in MEASURES)
    faults = [
        f"{g.process}: {g.measure} grew by {g.percent:.2f} %, more than {GROWTH_LIMIT_PERCENT:g} %"
        for g in growths
        if g.is_too_much
    ]
    false = [reason for sample in samples for reason in sample.false_stops]
    if false:
        counts = ", ".join(f"{reason} {false.count(reason)}×" for reason in dict.fromkeys(false))
        faults.append(f"false stops: {counts}")
    faults += [f"{name} ended or was restarted" for name in names if _is_interrupted(samples, name)]
    if samples[-1].driven_m <= 0.0:
        faults.append("the robot never moved")
    return Judgement(growths, tuple(faults))


def theil_sen(times_s: Floats, values: Floats) -> float:
    """Return the median slope of all pairs of points; spikes, and steps at either end, hardly affect it.

    Args:
        times_s: (n,) rising; at least two.
        values: (n,).
    """
    if len(times_s) > MOST_POINTS:
        groups = np.array_split(np.arange(len(times_s)), MOST_POINTS)
        times_s = np.array([np.median(times_s[group]) for group in groups])
        values = np.array([np.median(values[group]) for group in groups])
    first, second = np.triu_indices(len(times_s), 1)
    return float(np.median((values[second] - values[first]) / (times_s[second] - times_s[first])))


def _growth(kept: Sequence[Sample], name: str, measure: str) -> Growth:
    points = [
        (sample.time_s, MEASURES[measure](sample.processes[name]))
        for sample in kept
        if name in sample.processes
    ]
    times_s, values = np.array(points, dtype=np.float64).reshape(-1, 2).T
    level = float(np.median(values)) if len(values) else math.nan
    if len(points) < FEWEST_SAMPLES:
        return Growth(name, measure, level, math.nan)
    watched_s = float(times_s[-1] - times_s[0])
    percent = 100.0 * theil_sen(times_s, values) * watched_s / level
    return Growth(name, measure, level, percent, watched_s)


def _is_interrupted(samples: Sequence[Sample], name: str) -> bool:
    pids = [sample.processes[name].pid if name in sample.processes else None for sample in samples]
    return any(a != b for a, b in itertools.pairwise(pids))
