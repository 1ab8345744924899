"""Renders the measurements as tables and verdicts (pure)."""

from collections.abc import Sequence

import numpy as np

from bench.rig.sheet import Sheet, Verdict
from bench.robots.results import Crowd
from bench.robots.stats import percentile
from bench.robots.table import gaps_and_stops, stops_ms

COLUMNS = (
    "robots",
    "CPU of the router",
    "of each hub",
    "busy",
    "gap p50",
    "p99",
    "max",
    "stood",
    "kills",
    "stop p50",
    "p99",
    "max",
    "KB/s of each",
)
STOP_LIMIT_MS = 220.0
"""The command timeout and a tick: what holds for each stop, even if every token were late."""


def sheet(crowds: Sequence[Crowd]) -> Sheet:
    """Return one row for each number of robots."""
    return Sheet(
        "Robots behind one router, all on one machine: CPU in % of one core, times in ms",
        COLUMNS,
        tuple(_row(one) for one in crowds),
        (
            "All robots drive. Their operators and their hubs connect to the router over TLS.",
            "busy: the machine, in % of all cores, during the drive / the kills.",
            "gap: between two messages on cmd_vel at the robot.",
            "stood: number of robots that stopped without cause, with their number for each reason.",
            "kills: those before which the robot drove. On a saturated machine, no further operator begins to drive.",
            "stop: from the SIGKILL of an operator behind the router to zero on cmd_vel, while the other robots drive.",
            "KB/s of each: what the router sends and receives for one robot and its operator, without odometry and scans.",
        ),
    )


def _row(one: Crowd) -> tuple[str, ...]:
    return (
        str(one.robots),
        f"{one.router_percent:.1f}",
        f"{np.mean(one.cpu_percent):.1f}",
        f"{one.busy_percent:.0f} / {one.kills_busy_percent:.0f}",
        *gaps_and_stops(one),
        stops_ms(one, 100),
        f"{one.crossing_bytes_s / 1000:.1f}",
    )


def soak_verdicts(one: Crowd) -> list[Verdict]:
    """Return whether every promise was kept: each stop in time, and no stop of a robot whose operator lives."""
    what = f"{one.robots} robots behind one router for {one.seconds + one.kills_seconds:.0f} s,"
    return [
        Verdict(
            f"{what} SIGKILL to zero, longest of {len(one.stop_ms)}",
            percentile(one.stop_ms, 100),
            STOP_LIMIT_MS,
            "ms",
        ),
        Verdict(f"{what} kills of a driving operator without a stop", one.missed, 0.0, "kills"),
        Verdict(f"{what} robots that stopped without cause", one.stood + one.stood_in_kills, 0.0, "robots"),
    ]
