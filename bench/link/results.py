"""The conditions under which the links are measured, the stored measurements, and their tables and targets (pure)."""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path as File

from bench.link.relay import Path
from bench.link.stops import upper_rate
from bench.rig.sheet import Column, Sheet, Verdict
from bench.rig.stored import FOLDER, origin, read_rows, rows_of, write_rows

LOSSES = (0.0, 0.01, 0.02, 0.03, 0.05, 0.10)
ROUND_TRIPS_S = (0.0, 0.02, 0.1, 0.3)
JITTER = 0.1
"""Standard deviation of the delay, as a share of the delay."""
MAX_CONDITIONS = 254
"""A condition has a number in one byte of its addresses; 0 and 255 are not used."""
STORED = FOLDER / "bench_link.jsonl"
DIGITS = 4
"""Decimal places of stored figures: a tenth of a millisecond is enough."""
HOUR_S = 3600.0
TARGETS = {0.02: 1.0, 0.05: 10.0}
"""Maximum number of false stops an hour over QUIC, by loss, at `TARGET_ROUND_TRIP_S`."""
TARGET_ROUND_TRIP_S = 0.02
MANY = 10


class Link(StrEnum):
    """What carries the commands."""

    TCP = "tcp"
    QUIC = "quic"
    """With mutual TLS: best effort as datagrams, reliable as streams."""
    UDP = "udp"
    """Without TLS, and nothing is repeated: a reference."""


@dataclass(frozen=True, order=True)
class Condition:
    """A link with its loss, each way, its round trip without jitter, and the lease of the session."""

    link: Link
    loss: float
    round_trip_s: float
    lease_s: float
    """How long a silent link counts as alive; Zenoh sends a keep-alive four times in a lease."""

    @property
    def path(self) -> Path:
        delay_s = self.round_trip_s / 2
        return Path(self.loss, delay_s, JITTER * delay_s)

    def __str__(self) -> str:
        return f"{self.link} at {100 * self.loss:g} % and {1000 * self.round_trip_s:g} ms"


def grid(
    links: Iterable[Link], losses: Iterable[float], round_trips_s: Iterable[float], leases_s: Iterable[float]
) -> list[Condition]:
    """Return all combinations."""
    return [Condition(*one) for one in itertools.product(links, losses, round_trips_s, leases_s)]


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
        parts = {name: getattr(self, f"{name}_late_p99_ms") for name in ("router", "sender", "receiver")}
        late = [f"the {name} was {ms:.1f} ms late (p99)" for name, ms in parts.items() if ms > limit_ms]
        if not late:
            return None
        return f"{', '.join(late)}; at most {limit_ms:g} ms are permitted: choose fewer flows"


@dataclass(frozen=True)
class Measured(Condition):
    """The flows of one condition, in one round or in several."""

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
    added = ("flows", "flow_s", "stops", "disturbed_stops", "arrived", "refused", "links_lost")
    sums = {name: sum(getattr(one, name) for one in group) for name in added}
    return replace(group[0], worst_age_s=max(one.worst_age_s for one in group), **sums)


def write(results: Results, path: File) -> None:
    rounds = rows_of("round", results.rounds, DIGITS)
    write_rows(path, results.run, [*rounds, *rows_of("condition", results.measured, DIGITS)])


def read(path: File = STORED) -> Results:
    """Return the stored measurements; raises as `read_rows`."""
    stored = read_rows(path)
    return Results(stored.run, stored.of("round", Round), stored.of("condition", Measured))


def sheets(results: Results) -> list[Sheet]:
    """Return the rates and the ages for each lease, then the rounds."""
    found: list[Sheet] = []
    for lease_s, together in by_lease(results).items():
        found += [stops(together, lease_s), ages(together, lease_s)]
    return [*found, effort(results).with_note(origin(results.run))]


def by_lease(results: Results) -> dict[float, dict[Condition, Measured]]:
    """Return the sums over all rounds, by the lease of the sessions [s]."""
    found: dict[float, dict[Condition, Measured]] = {}
    for condition, one in results.together().items():
        found.setdefault(condition.lease_s, {})[condition] = one
    return dict(sorted(found.items()))


Place = tuple[float, float]
"""Round trip [s] and loss: a row."""


def stops(together: Mapping[Condition, Measured], lease_s: float) -> Sheet:
    """Return the rates of false stops: a row for each loss and round trip, a column for each link."""
    columns = _columns(together, lease_s, _rate)
    hours = _columns(together, lease_s, lambda one: f"{one.flow_s / HOUR_S:.2f}")
    columns.append(
        ("measured hours", lambda row: ", ".join(filter(None, (cell(row) for _, cell in hours[2:]))))
    )
    return Sheet.of(
        f"False stops an hour of one operator's commands at 20 Hz, lease {lease_s:g} s",
        columns,
        _places(together),
        "A false stop: the age of the newest fresh command exceeds 0.2 s.",
        f"In brackets: the 95 % upper bound of rates with fewer than {MANY} stops.",
        "loss: share of packets lost, each way.",
        f"round trip: mean; the standard deviation of each delay is {100 * JITTER:g} %, so packets overtake each other.",
        "QUIC: mutual TLS, commands as datagrams. UDP: without TLS, as a reference.",
        "measured hours: of all flows of a link together, in the order of the columns.",
    )


def ages(together: Mapping[Condition, Measured], lease_s: float) -> Sheet:
    """Return the worst age and the lost links, in the order of `stops`."""
    return Sheet.of(
        f"Worst age of the newest fresh command in s, and (links lost), lease {lease_s:g} s",
        _columns(together, lease_s, lambda one: f"{one.worst_age_s:.2f} ({one.links_lost})"),
        _places(together),
        "The age does not contain the smallest delay of the link, because the clocks of two hosts are not compared.",
        "links lost: how often the liveliness token of a living operator was deleted, because the lease ended.",
    )


def _places(together: Iterable[Condition]) -> list[Place]:
    return sorted({(one.round_trip_s, one.loss) for one in together})


def _columns(
    together: Mapping[Condition, Measured], lease_s: float, show: Callable[[Measured], str]
) -> list[Column[Place]]:
    """Return the columns of the place, and one for each link: what `show` returns for its measurement, if there is one."""

    def cell(link: Link, place: Place) -> str:
        round_trip_s, loss = place
        found = together.get(Condition(link, loss, round_trip_s, lease_s))
        return "" if found is None else show(found)

    links = [link for link in Link if any(one.link == link for one in together)]
    return [
        ("round trip", lambda place: f"{1000 * place[0]:g} ms"),
        ("loss", lambda place: f"{100 * place[1]:g} %"),
        *((link.upper(), partial(cell, link)) for link in links),
    ]


def _rate(one: Measured) -> str:
    if math.isnan(one.per_hour):
        return ""
    rate = f"{one.per_hour:.0f}" if one.per_hour >= 10 else f"{one.per_hour:.2g}"
    return rate if one.stops >= MANY else f"{rate} (≤ {one.upper_per_hour:.2g})"


EFFORT: tuple[Column[Round], ...] = (
    ("date", lambda one: one.date),
    ("flows", lambda one: f"{one.flows}"),
    ("seconds", lambda one: f"{one.seconds:.0f}"),
    ("busy", lambda one: f"{one.busy_percent:.0f} %"),
    ("disturbed [s]", lambda one: f"{one.disturbed_s:.1f}"),
    ("packets", lambda one: f"{one.packets:,}"),
    ("router p99", lambda one: f"{one.router_late_p99_ms:.2f}"),
    ("max", lambda one: f"{one.router_late_max_ms:.0f}"),
    ("sender p99", lambda one: f"{one.sender_late_p99_ms:.2f}"),
    ("max", lambda one: f"{one.sender_late_max_ms:.0f}"),
    ("receiver p99", lambda one: f"{one.receiver_late_p99_ms:.2f}"),
    ("max", lambda one: f"{one.receiver_late_max_ms:.0f}"),
)


def effort(results: Results) -> Sheet:
    """Return one row for each round: its size, and the lateness of the bench itself."""
    return Sheet.of(
        "Rounds, and the lateness of the bench itself [ms]",
        EFFORT,
        results.rounds,
        "disturbed: time near moments at which a part of the bench was more than 20 ms late; its stops are not counted.",
    )


def verdicts(results: Results) -> list[Verdict]:
    """Return the verdicts on QUIC, for each lease."""
    verdicts: list[Verdict] = []
    for lease_s, together in by_lease(results).items():
        for loss, target in TARGETS.items():
            found = together.get(Condition(Link.QUIC, loss, TARGET_ROUND_TRIP_S, lease_s))
            if found is not None:
                hours = found.flow_s / HOUR_S
                where = f"{100 * loss:g} % loss, {1000 * TARGET_ROUND_TRIP_S:g} ms, lease {lease_s:g} s"
                what = f"QUIC, {where}, {hours:.1f} flow-hours: false stops"
                verdicts.append(Verdict(what, found.per_hour, target, "an hour"))
    return verdicts
