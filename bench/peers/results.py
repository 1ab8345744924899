"""The stored measurements, their tables and targets (pure)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.rig.sheet import Column, Sheet, Verdict, percentile
from bench.rig.stored import FOLDER, origin, read_rows, rows_of, write_rows

STORED = FOLDER / "bench_peers.jsonl"
RATES_HZ = (20.0, 100.0, 500.0)
REFERENCE = 1
"""Index of the kind to which the others are compared."""
TARGET_TRIP_RATIOS, TARGET_TRIP_MORE_MS = (1.25, 1.25, 1.4), 0.7
"""Limits of the round trip, as of `RATES_HZ`: of the p50 relative to the reference, and of the p99 above it."""
TARGET_DEATH_RATIO = 1.3


@dataclass(frozen=True)
class RoundTrip:
    """The times of one kind at one rate in one round."""

    kind: str
    rate_hz: float
    round: int
    sent: int
    times_ms: tuple[float, ...]
    """Of the commands that arrived."""


@dataclass(frozen=True)
class Death:
    """The times of one kind in one round, from a SIGKILL to its detection."""

    kind: str
    round: int
    times_ms: tuple[float, ...]


@dataclass(frozen=True)
class Peers:
    """One run of `python -m bench.peers`."""

    run: dict[str, str]
    """Command, date, machine and commit."""
    trips: tuple[RoundTrip, ...]
    deaths: tuple[Death, ...]

    @property
    def names(self) -> list[str]:
        """The kinds in their order."""
        return list(dict.fromkeys(trip.kind for trip in self.trips))


def write(peers: Peers, path: Path) -> None:
    write_rows(path, peers.run, [*rows_of("trip", peers.trips), *rows_of("death", peers.deaths)])


def read(path: Path = STORED) -> Peers:
    """Return the stored run; raises as `read_rows`."""
    stored = read_rows(path)
    return Peers(stored.run, stored.of("trip", RoundTrip), stored.of("death", Death))


def pooled(kind: str, rate_hz: float, trips: Iterable[RoundTrip]) -> list[float]:
    """Return the times of a kind at a rate in all rounds [ms]."""
    return [ms for trip in trips if (trip.kind, trip.rate_hz) == (kind, rate_hz) for ms in trip.times_ms]


def ratios(kind: str, reference: str, rate_hz: float, trips: Sequence[RoundTrip]) -> list[float]:
    """Return the ratio of the two medians in each round."""
    found = [trip for trip in trips if trip.rate_hz == rate_hz and trip.times_ms]
    own, others = (
        {trip.round: percentile(trip.times_ms, 50) for trip in found if trip.kind == name}
        for name in (kind, reference)
    )
    return [own[number] / others[number] for number in sorted(own.keys() & others.keys())]


def _deaths_ms(kind: str, deaths: Iterable[Death]) -> list[float]:
    return [ms for death in deaths if death.kind == kind for ms in death.times_ms]


def verdicts(peers: Peers) -> list[Verdict]:
    own, reference = peers.names[0], peers.names[REFERENCE]
    found: list[Verdict] = []
    for rate_hz, target in zip(RATES_HZ, TARGET_TRIP_RATIOS, strict=True):
        ratio = float(np.median(ratios(own, reference, rate_hz, peers.trips)))
        own_ms, bare_ms = (percentile(pooled(name, rate_hz, peers.trips), 99) for name in (own, reference))
        what = f"round trip at {rate_hz:.0f} Hz,"
        found += [
            Verdict(f"{what} p50 through the supervisor", ratio, target, "× the relay's"),
            Verdict(f"{what} p99 above the relay's", own_ms - bare_ms, TARGET_TRIP_MORE_MS, "ms"),
        ]
    own_ms, bare_ms = _deaths_ms(own, peers.deaths), _deaths_ms(reference, peers.deaths)
    ratio = percentile(own_ms, 50) / percentile(bare_ms, 50)
    return [*found, Verdict("SIGKILL to zero, p50", ratio, TARGET_DEATH_RATIO, "× a bare token's")]


def sheets(peers: Peers) -> list[Sheet]:
    """Return the round trips, each compared with the reference, and the deaths."""
    return [sheet.with_note(origin(peers.run)) for sheet in (_trip_sheet(peers), _death_sheet(peers))]


def _trip_sheet(peers: Peers) -> Sheet:
    reference = peers.names[REFERENCE]

    def cells(kind: str, rate_hz: float) -> tuple[str, str, str]:
        times_ms = pooled(kind, rate_hz, peers.trips)
        if not times_ms:
            return "–", "–", "–"
        found = ratios(kind, reference, rate_hz, peers.trips)
        spread = f"{np.median(found):.2f} ({min(found):.2f} to {max(found):.2f})"
        return f"{percentile(times_ms, 50):.2f}", f"{percentile(times_ms, 99):.2f}", spread

    sent = sum(trip.sent for trip in peers.trips)
    heard = sum(len(trip.times_ms) for trip in peers.trips)
    rows = [(name, f"{rate:.0f} Hz", *cells(name, rate)) for rate in RATES_HZ for name in peers.names]
    return Sheet(
        "Round trip of a command, in ms",
        ("through", "rate", "p50", "p99", "ratio"),
        tuple(rows),
        (
            "A driver sends commands that all differ, at a fixed rate, through a process that passes them on.",
            f"ratio: of the medians of the same round to those of the {reference}; median (least to greatest).",
            f"{heard} of {sent} commands arrived; the supervisor passes only the last one of a burst.",
        ),
    )


def _death_sheet(peers: Peers) -> Sheet:
    times_ms = {name: _deaths_ms(name, peers.deaths) for name in peers.names}
    columns: list[Column[str]] = [
        ("by", lambda name: name),
        ("n", lambda name: f"{len(times_ms[name])}"),
        ("p50", lambda name: f"{percentile(times_ms[name], 50):.1f}"),
        ("p99", lambda name: f"{percentile(times_ms[name], 99):.1f}"),
        ("max", lambda name: f"{max(times_ms[name]):.1f}"),
    ]
    return Sheet.of(
        "SIGKILL of a process to the knowledge of another one, in ms",
        columns,
        [name for name in peers.names if times_ms[name]],
        "Lifeline's supervisor: until zero is on cmd_vel. Zenoh: a liveliness token. MQTT: the will.",
    )
