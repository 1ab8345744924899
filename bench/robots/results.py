"""Writes and reads the stored measurements, one JSON object a line: the run, then each number of robots."""

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, cast

from bench.rig.stored import read_rows, write_rows

STORED = Path(__file__).resolve().parents[2] / "docs/campaign/bench_robots.jsonl"


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
    stolen_percent: float
    """Part of `busy_percent` that the host of a virtual machine took."""
    other_percent: float
    """Of one core: all other processes. A high value means that other work disturbed the measurement."""
    gap_p50_ms: float
    gap_p99_ms: float
    gap_max_ms: float
    decided_gap_p99_ms: float
    """Time between the decisions in the supervisors, without the delays of transport and of this bench."""
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


@dataclass(frozen=True)
class Robots:
    """One run of `python -m bench.robots`."""

    run: dict[str, str]
    """Command, date, machine and commit."""
    crowds: tuple[Crowd, ...]


def write(robots: Robots, path: Path) -> None:
    rows = [{name: _short(value) for name, value in asdict(crowd).items()} for crowd in robots.crowds]
    write_rows(path, robots.run, (("robots", row) for row in rows))


def read(path: Path = STORED) -> Robots | None:
    """Return the stored run; None if there is none."""
    stored = read_rows(path)
    if stored is None:
        return None
    run, rows = stored
    tuples = [field.name for field in fields(Crowd) if field.type == tuple[float, ...]]
    for _, row in rows:
        row |= {name: tuple(row[name]) for name in tuples}
    crowds = (Crowd(**row) for _, row in rows)
    return Robots(run, tuple(crowds))


def _short(value: Any) -> object:  # noqa: ANN401 - any field
    """Round figures: microseconds are enough."""
    if isinstance(value, float):
        return round(value, 3)
    return [round(one, 3) for one in cast("tuple[float, ...]", value)] if isinstance(value, tuple) else value
