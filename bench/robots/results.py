"""Gaps, stops and their reasons from the recorded messages; the stored measurements, their table and promises (pure)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from bench.rig.sheet import Column, Sheet, Verdict, percentile
from bench.rig.stored import FOLDER, origin, read_rows, rows_of, write_rows

STORED, ROUTER, SOAK = (FOLDER / f"bench_{name}.jsonl" for name in ("robots", "fleet", "fleet_soak"))
"""Stored runs: robots that are driven directly, through a router, and through a router for ten minutes."""
DIGITS = 3
"""Decimal places of stored figures: microseconds are enough."""

Heard = tuple[float, float, bool]
"""A command to the base: its arrival and decision time [s], and whether it moves the robot."""
Status = tuple[float, str, Sequence[str]]
"""A status: its arrival time [s], the mode, and the reasons."""
Window = tuple[float, float]
"""Begin and end of an interval [s]."""


def within(window: Window, commands: Iterable[Heard]) -> list[Heard]:
    """Return the commands that arrived within a window."""
    begin_s, end_s = window
    return [command for command in commands if begin_s <= command[0] < end_s]


def gaps_ms(window: Window, commands: Iterable[Heard]) -> list[float]:
    """Return the times between the arrival of one command of a robot within a window and the next one [ms]."""
    return [1000.0 * (later[0] - earlier[0]) for earlier, later in pairwise(within(window, commands))]


def transits_ms(window: Window, commands: Iterable[Heard]) -> list[float]:
    """Return the time from the decision of each command to its arrival [ms]; both times are by one clock."""
    return [1000.0 * (arrival_s - decided_s) for arrival_s, decided_s, _ in within(window, commands)]


def stood(window: Window, commands: Iterable[Heard]) -> bool:
    """Return whether a robot that should drive throughout the window got a zero command, or no command at all."""
    found = within(window, commands)
    return not found or not all(moves for _, _, moves in found)


def reasons(window: Window, statuses: Iterable[Status]) -> set[str]:
    """Return the reasons of all stops in a window."""
    begin_s, end_s = window
    return {
        reason
        for at_s, mode, found in statuses
        if mode == "STOPPED" and begin_s <= at_s < end_s
        for reason in found
    }


def stop_ms(killed_s: float, commands: Sequence[Heard]) -> float | None:
    """Return the time from a kill to the first zero command [ms].

    None if the robot did not move when its operator was killed, or never stopped.
    """
    before = [moves for arrival_s, _, moves in commands if arrival_s < killed_s]
    if not before or not before[-1]:
        return None
    return next(
        (
            1000.0 * (arrival_s - killed_s)
            for arrival_s, _, moves in commands
            if arrival_s >= killed_s and not moves
        ),
        None,
    )


@dataclass(frozen=True)
class Crowd:
    """The measurement with one number of robots; the percentiles are of all robots together."""

    robots: int
    seconds: float
    """Duration of the drive; the kills follow."""
    cpu_percent: tuple[float, ...]
    """Of one core: each supervisor."""
    delay_percent: float
    """Time that a supervisor's threads were ready to run but waited for a core, mean, of the duration."""
    feeder_percent: float
    """Of one core: the process that feeds all robots."""
    busy_percent: float
    """Of all cores of the machine, during the drive."""
    kills_busy_percent: float
    """The same during the kills, when the killed operators also use processor time."""
    other_percent: float
    """Of one core: all other processes. A high value means that other work disturbed the measurement."""
    gap_p50_ms: float
    gap_p99_ms: float
    gap_max_ms: float
    transit_p99_ms: float
    """From the decision to the arrival in this bench."""
    late_p99_ms: float
    """Lateness at which the feeder sends its samples."""
    garbled: int
    """Number of messages that their key does not permit."""
    stood: int
    """Number of robots that stopped during the drive without cause."""
    reasons: dict[str, int]
    """Number of robots for each reason of such a stop."""
    kills: int
    stop_ms: tuple[float, ...]
    """From the SIGKILL of the operator to zero on cmd_vel; without the kills before which the robot never drove."""
    missed: int = 0
    """Kills of an operator that had begun to drive, without a stop of a robot that moved."""
    kills_seconds: float = 0.0
    """Duration of the kills."""
    stood_in_kills: int = 0
    """Number of the other robots, whose operators lived, that stopped meanwhile."""
    router_percent: float = 0.0
    """Of one core: the router, if the operators reach the robots through one."""
    crossing_bytes_s: float = 0.0
    """What the router sends and receives for each robot and its operator."""

    def stop_percentile(self, percent: float) -> str:
        """Return a percentile of the stops [ms] as a cell; a dash if no killed operator had driven."""
        return f"{percentile(self.stop_ms, percent):.1f}" if self.stop_ms else "–"

    def stood_for(self) -> str:
        """Return the number of robots that stopped without cause as a cell, with their number for each reason."""
        reasons = ", ".join(f"{name} {count}" for name, count in self.reasons.items())
        return f"{self.stood} ({reasons})" if reasons else f"{self.stood}"


@dataclass(frozen=True)
class Robots:
    """One run of `python -m bench.robots`."""

    run: dict[str, str]
    """Command, date, machine and commit."""
    crowds: tuple[Crowd, ...]


def write(robots: Robots, path: Path) -> None:
    write_rows(path, robots.run, rows_of("robots", robots.crowds, DIGITS))


def read(path: Path = STORED) -> Robots:
    """Return the stored run; raises as `read_rows`."""
    stored = read_rows(path)
    return Robots(stored.run, stored.of("robots", Crowd))


COLUMNS: tuple[Column[Crowd], ...] = (
    ("robots", lambda one: f"{one.robots}"),
    ("CPU of each", lambda one: f"{np.mean(one.cpu_percent):.1f}"),
    ("of all", lambda one: f"{sum(one.cpu_percent):.0f}"),
    ("feeder", lambda one: f"{one.feeder_percent:.0f}"),
    ("others", lambda one: f"{one.other_percent:.0f}"),
    ("busy", lambda one: f"{one.busy_percent:.0f} / {one.kills_busy_percent:.0f}"),
    ("waiting", lambda one: f"{one.delay_percent:.1f}"),
    ("gap p50", lambda one: f"{one.gap_p50_ms:.1f}"),
    ("p99", lambda one: f"{one.gap_p99_ms:.1f}"),
    ("max", lambda one: f"{one.gap_max_ms:.0f}"),
    ("stood", Crowd.stood_for),
    ("stops", lambda one: f"{len(one.stop_ms)} of {one.kills}"),
    ("stop p50", lambda one: one.stop_percentile(50)),
    ("p99", lambda one: one.stop_percentile(99)),
    ("max", lambda one: one.stop_percentile(100)),
    ("late p99", lambda one: f"{one.late_p99_ms:.1f}"),
)
ROUTER_COLUMNS: tuple[Column[Crowd], ...] = (
    ("CPU of the router", lambda one: f"{one.router_percent:.1f}"),
    ("KB/s of each", lambda one: f"{one.crossing_bytes_s / 1000:.1f}"),
)


def sheet(robots: Robots) -> Sheet:
    """Return one row for each number of robots."""
    crowds = robots.crowds
    transit_ms = max((one.transit_p99_ms for one in crowds), default=math.nan)
    has_router = any(one.router_percent for one in crowds)
    notes = [
        "CPU of each supervisor, of all, of the feeder and of everything else, in % of one core.",
        "busy: the machine, in % of all cores, during the drive / the kills.",
        "stood: number of robots that stopped without cause while driving, with their number for each reason.",
        "waiting: time that a supervisor's threads were ready to run but waited for a core, in % of the duration.",
        f"gap: between two messages on cmd_vel. From the decision to its arrival, p99: at most {transit_ms:.1f} ms.",
        f"{sum(one.garbled for one in crowds)} messages had content that their key does not permit.",
        "stop: from the SIGKILL of the operator to zero on cmd_vel, while the other robots drive.",
        "stops: of the kills, those before which the robot drove. On a saturated machine, no further operator begins to drive.",
        "feeder: one process that plays sensors, operators and bases of all robots; late: the lateness of its samples.",
    ]
    if has_router:
        notes.append("The operators and the hubs connect to the router over TLS.")
        notes.append(
            "KB/s of each: what the router sends and receives for one robot and its operator, without odometry and scans."
        )
    title = "Robots behind one router, all on one machine" if has_router else "Robots on one machine"
    columns = (*COLUMNS, *(ROUTER_COLUMNS if has_router else ()))
    what = f"{title}, a supervisor process for each: CPU in %, times in ms"
    return Sheet.of(what, columns, crowds, *notes, origin(robots.run))


def promises(one: Crowd) -> list[Verdict]:
    """Return whether every promise was kept: a stop after each kill, and no stop of a robot whose operator lives."""
    what = f"{one.robots} robots for {one.seconds + one.kills_seconds:.0f} s,"
    return [
        Verdict(f"{what} kills of a driving operator without a stop,", one.missed, 0.0, "kills"),
        Verdict(f"{what} robots that stopped without cause,", one.stood + one.stood_in_kills, 0.0, "robots"),
    ]
