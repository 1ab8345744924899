"""Writes and reads the stored measurements, one JSON object a line: the run, then each round and its conditions."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.link.conditions import Condition, Link
from bench.link.stops import upper_rate
from bench.rig.stored import Row, read_rows, write_rows

STORED = Path(__file__).resolve().parents[2] / "docs/campaign/bench_link.jsonl"
HOUR_S = 3600.0


@dataclass(frozen=True)
class Round:
    """One round; its lateness is the bench's own."""

    date: str
    seconds: float
    seed: int
    flows: int
    busy_percent: float
    """Of all cores of the machine."""
    disturbed_s: float
    """Time near moments at which a part of the bench was more than 20 ms late: not counted."""
    packets: int
    lost: int
    router_late_p99_ms: float
    router_late_max_ms: float
    sender_late_p99_ms: float
    sender_late_max_ms: float
    receiver_late_p99_ms: float
    receiver_late_max_ms: float

    def rejection(self, limit_ms: float) -> str | None:
        """Return why this round proves nothing, in one sentence; None if no part was later than the limit (p99)."""
        parts = (
            ("router", self.router_late_p99_ms),
            ("sender", self.sender_late_p99_ms),
            ("receiver", self.receiver_late_p99_ms),
        )
        late = [
            f"the {name} was {late_ms:.1f} ms late (p99)" for name, late_ms in parts if late_ms > limit_ms
        ]
        if not late:
            return None
        return f"{', '.join(late)}; at most {limit_ms:g} ms are permitted: choose fewer flows"


@dataclass(frozen=True)
class Measured:
    """The flows of one condition, in one round or in several."""

    link: Link
    loss: float
    round_trip_s: float
    lease_s: float
    flows: int
    flow_s: float
    """Measured time of all flows together, without disturbed time [s]."""
    stops: int
    """Number of false stops: the age of the commands exceeded 0.2 s."""
    disturbed_stops: int
    """Number of stops in disturbed time; they are not counted."""
    worst_age_s: float
    """Largest age of the newest fresh command, also in disturbed time."""
    arrived: int
    refused: int
    links_lost: int
    """How often a liveliness token was deleted although its process lived."""

    @property
    def condition(self) -> Condition:
        return Condition(self.link, self.loss, self.round_trip_s, self.lease_s)

    @property
    def per_hour(self) -> float:
        """False stops an hour; NaN without measured time."""
        return HOUR_S * self.stops / self.flow_s if self.flow_s > 0.0 else math.nan

    @property
    def upper_per_hour(self) -> float:
        """Upper bound of the rate, 95 %."""
        return upper_rate(self.stops, self.flow_s / HOUR_S) if self.flow_s > 0.0 else math.inf


@dataclass(frozen=True)
class Results:
    """The measurements of one or more invocations."""

    run: dict[str, str]
    """Command, date, machine and commit of the last one."""
    rounds: tuple[Round, ...]
    measured: tuple[Measured, ...]

    def together(self) -> dict[Condition, Measured]:
        """Return the sums over all rounds."""
        groups: dict[Condition, list[Measured]] = {}
        for one in self.measured:
            groups.setdefault(one.condition, []).append(one)
        return {condition: _sum(group) for condition, group in sorted(groups.items())}


def _sum(group: Sequence[Measured]) -> Measured:
    first = group[0]
    return Measured(
        link=first.link,
        loss=first.loss,
        round_trip_s=first.round_trip_s,
        lease_s=first.lease_s,
        flows=sum(one.flows for one in group),
        flow_s=sum(one.flow_s for one in group),
        stops=sum(one.stops for one in group),
        disturbed_stops=sum(one.disturbed_stops for one in group),
        worst_age_s=max(one.worst_age_s for one in group),
        arrived=sum(one.arrived for one in group),
        refused=sum(one.refused for one in group),
        links_lost=sum(one.links_lost for one in group),
    )


def write(results: Results, path: Path) -> None:
    rows: list[Row] = [("round", _short(asdict(one))) for one in results.rounds]
    rows += [("condition", _short(asdict(one))) for one in results.measured]
    write_rows(path, results.run, rows)


def read(path: Path = STORED) -> Results | None:
    """Return the stored measurements; None if there are none."""
    stored = read_rows(path)
    if stored is None:
        return None
    run, rows = stored
    return Results(
        run,
        tuple(Round(**row) for kind, row in rows if kind == "round"),
        tuple(_measured(row) for kind, row in rows if kind == "condition"),
    )


def _measured(row: dict[str, Any]) -> Measured:
    return Measured(link=Link(row.pop("link")), **row)


def _short(row: dict[str, Any]) -> dict[str, Any]:
    """Round figures: a tenth of a millisecond is enough."""
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}
