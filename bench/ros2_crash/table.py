"""The results of all trials as a markdown table. Pure."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from bench.ros2_crash.trial import LIMIT_S, Case, Fault, Teleop, Trial, cases
from faults.report.statistics import quantile


@dataclass(frozen=True)
class Row:
    """The trials of one case; quantiles over those that stopped, NaN if none did."""

    case: Case
    count: int
    stopped: int
    zero_p50_s: float
    """Median over the trials with a zero on /cmd_vel."""
    standstill_p50_s: float
    standstill_max_s: float
    distance_p50_m: float
    """Over all trials: a robot that did not stop counts with its distance in `LIMIT_S`."""
    distance_max_m: float


def rows(trials: Iterable[Trial]) -> list[Row]:
    """Return a row for each case; those without and with Lifeline follow each other."""
    by_case: dict[Case, list[Trial]] = defaultdict(list)
    for trial in trials:
        by_case[trial.case].append(trial)
    return [
        _row(case, by_case[case])
        for case in cases(list(Teleop), list(Fault), [False, True])
        if case in by_case
    ]


def _row(case: Case, trials: Sequence[Trial]) -> Row:
    times_s = sorted(trial.standstill_s for trial in trials if trial.standstill_s is not None)
    zeros_s = sorted(trial.zero_s for trial in trials if trial.zero_s is not None)
    distances_m = sorted(trial.distance_m for trial in trials)
    return Row(
        case,
        len(trials),
        len(times_s),
        quantile(zeros_s, 0.5),
        quantile(times_s, 0.5),
        quantile(times_s, 1.0),
        quantile(distances_m, 0.5),
        quantile(distances_m, 1.0),
    )


def markdown(found: Iterable[Row]) -> str:
    """Return the table as markdown."""
    lines = [
        "| teleop | fault | robot | Lifeline | n | stopped | zero p50 | standstill p50 (max) | distance p50 (max) |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in found:
        case = row.case
        stopped = "all" if row.stopped == row.count else f"{row.stopped} within {LIMIT_S:g} s"
        more = "" if row.stopped == row.count else "> "
        lines.append(
            f"| {case.teleop} | {case.fault} | {case.robot} | {'yes' if case.lifeline else 'no'} "
            f"| {row.count} | {stopped} | {_seconds(row.zero_p50_s)} "
            f"| {_spread(row.standstill_p50_s, row.standstill_max_s, 's')} "
            f"| {more}{_spread(row.distance_p50_m, row.distance_max_m, 'm')} |"
        )
    return "\n".join(lines) + "\n"


def _seconds(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.3f} s"


def _spread(middle: float, largest: float, unit: str) -> str:
    return "none" if math.isnan(middle) else f"{middle:.2f} ({largest:.2f}) {unit}"
