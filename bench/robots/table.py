"""Renders the measurements as a table and verdicts (pure)."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from bench.rig.sheet import Sheet, Verdict
from bench.rig.stored import origin
from bench.robots.results import Crowd, Robots
from bench.robots.stats import percentile

TARGET_ROBOTS = 25
TARGET_GAP_P99_MS, TARGET_STOP_P99_MS = 30.0, 15.0
COLUMNS = (
    "robots",
    "CPU of each",
    "of all",
    "feeder",
    "others",
    "busy",
    "waiting",
    "gap p50",
    "p99",
    "max",
    "stood",
    "stops",
    "stop p50",
    "p99",
    "late p99",
)


def sheets(robots: Robots) -> list[Sheet]:
    return [
        sheet(robots.crowds)
        .with_note("The curve: [robots.svg](images/robots.svg).")
        .with_note(origin(robots.run))
    ]


def sheet(crowds: Sequence[Crowd]) -> Sheet:
    """Return one row for each number of robots."""
    transit_ms = max((one.transit_p99_ms for one in crowds), default=math.nan)
    return Sheet(
        "Robots on one machine, a supervisor process for each: CPU in %, times in ms",
        COLUMNS,
        tuple(_row(one) for one in crowds),
        (
            "CPU of each supervisor, of all, of the feeder and of everything else, in % of one core.",
            "busy: the machine, in % of all cores, during the drive / the kills.",
            "stood: number of robots that stopped without cause while driving, with their number for each reason.",
            "waiting: time that a supervisor's threads were ready to run but waited for a core, in % of the duration.",
            f"gap: between two messages on cmd_vel. From the decision to its arrival, p99: at most {transit_ms:.1f} ms.",
            f"{sum(one.garbled for one in crowds)} messages had content that their key does not permit.",
            "stop: from the SIGKILL of the operator to zero on cmd_vel, while the other robots drive.",
            "feeder: one process that plays sensors, operators and bases of all robots; late: the lateness of its samples.",
        ),
    )


def gaps_and_stops(one: Crowd) -> tuple[str, ...]:
    """Return the cells of the gaps (p50, p99, max), the robots that stood, the kills, and the stops (p50, p99)."""
    reasons = ", ".join(f"{name} {count}" for name, count in one.reasons.items())
    return (
        f"{one.gap_p50_ms:.1f}",
        f"{one.gap_p99_ms:.1f}",
        f"{one.gap_max_ms:.0f}",
        f"{one.stood} ({reasons})" if reasons else str(one.stood),
        f"{len(one.stop_ms)} of {one.kills}",
        stops_ms(one, 50),
        stops_ms(one, 99),
    )


def stops_ms(one: Crowd, percent: float) -> str:
    """Return a percentile of the stops [ms]; a dash if no killed operator had driven."""
    return f"{percentile(one.stop_ms, percent):.1f}" if one.stop_ms else "–"


def _row(one: Crowd) -> tuple[str, ...]:
    return (
        str(one.robots),
        f"{np.mean(one.cpu_percent):.1f}",
        f"{sum(one.cpu_percent):.0f}",
        f"{one.feeder_percent:.0f}",
        f"{one.other_percent:.0f}",
        f"{one.busy_percent:.0f} / {one.kills_busy_percent:.0f}",
        f"{one.delay_percent:.1f}",
        *gaps_and_stops(one),
        f"{one.late_p99_ms:.1f}",
    )


def verdicts(robots: Robots) -> list[Verdict]:
    """Return the verdicts at `TARGET_ROBOTS`, interpolated if it was not measured; none outside the measured numbers."""
    crowds = sorted(robots.crowds, key=lambda one: one.robots)
    if not crowds or not crowds[0].robots <= TARGET_ROBOTS <= crowds[-1].robots:
        return []

    def at_target(of: Callable[[Crowd], float]) -> float:
        return float(np.interp(TARGET_ROBOTS, [one.robots for one in crowds], [of(one) for one in crowds]))

    what = f"{TARGET_ROBOTS} robots on one machine,"
    return [
        Verdict(
            f"{what} gaps of cmd_vel, p99", at_target(lambda one: one.gap_p99_ms), TARGET_GAP_P99_MS, "ms"
        ),
        Verdict(
            f"{what} SIGKILL to zero, p99",
            at_target(lambda one: percentile(one.stop_ms, 99)),
            TARGET_STOP_P99_MS,
            "ms",
        ),
        Verdict(f"{what} stopped without cause", at_target(lambda one: one.stood), 0.0, "robots"),
    ]
