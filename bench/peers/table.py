"""The statistics of the measurements, as tables and verdicts (pure)."""

from collections.abc import Iterable, Sequence

import numpy as np

from bench.peers.death import Death
from bench.peers.kinds import REFERENCE
from bench.peers.results import Peers
from bench.peers.round_trip import RATES_HZ, RoundTrip
from bench.rig.sheet import Sheet, Verdict
from bench.rig.stored import origin

TARGET_TRIP_RATIO, TARGET_TRIP_MORE_MS = 1.3, 1.0
TARGET_DEATH_RATIO, TARGET_DEATH_P99_MS = 1.3, 8.0


def sheets(peers: Peers) -> list[Sheet]:
    reference = peers.names[REFERENCE]
    both = trip_sheet(peers.names, reference, peers.trips), death_sheet(peers.names, peers.deaths)
    return [sheet.with_note(origin(peers.run)) for sheet in both]


def verdicts(peers: Peers) -> list[Verdict]:
    own, reference = peers.names[0], peers.names[REFERENCE]
    return [*trip_verdicts(own, reference, peers.trips), *death_verdicts(own, reference, peers.deaths)]


def percentile(times_ms: Iterable[float], percent: float) -> float:
    return float(np.percentile(np.fromiter(times_ms, float), percent))


def pooled(kind: str, rate_hz: float, trips: Iterable[RoundTrip]) -> list[float]:
    """Return the times of a kind at a rate in all rounds [ms]."""
    return [ms for trip in trips if (trip.kind, trip.rate_hz) == (kind, rate_hz) for ms in trip.times_ms]


def ratios(kind: str, reference: str, rate_hz: float, trips: Sequence[RoundTrip]) -> list[float]:
    """Return the ratio of the two medians in each round."""
    medians = {
        (trip.kind, trip.round): trip.median_ms for trip in trips if trip.rate_hz == rate_hz and trip.times_ms
    }
    rounds = sorted({number for _, number in medians})
    return [
        medians[kind, number] / medians[reference, number]
        for number in rounds
        if (kind, number) in medians and (reference, number) in medians
    ]


def trip_verdicts(own: str, reference: str, trips: Sequence[RoundTrip]) -> list[Verdict]:
    found: list[Verdict] = []
    for rate_hz in RATES_HZ:
        ratio = float(np.median(ratios(own, reference, rate_hz, trips)))
        more_ms = percentile(pooled(own, rate_hz, trips), 99) - percentile(
            pooled(reference, rate_hz, trips), 99
        )
        what = f"round trip at {rate_hz:.0f} Hz,"
        found += [
            Verdict(f"{what} p50 through the supervisor", ratio, TARGET_TRIP_RATIO, "× the relay's"),
            Verdict(f"{what} p99 above the relay's", more_ms, TARGET_TRIP_MORE_MS, "ms"),
        ]
    return found


def trip_sheet(names: Sequence[str], reference: str, trips: Sequence[RoundTrip]) -> Sheet:
    """Return one row for each kind and rate; the last column compares it with the reference."""

    def cells(kind: str, rate_hz: float) -> tuple[str, str, str]:
        times_ms = pooled(kind, rate_hz, trips)
        if not times_ms:
            return "–", "–", "–"
        found = ratios(kind, reference, rate_hz, trips)
        spread = f"{np.median(found):.2f} ({min(found):.2f} to {max(found):.2f})"
        return f"{percentile(times_ms, 50):.2f}", f"{percentile(times_ms, 99):.2f}", spread

    sent = sum(trip.sent for trip in trips)
    heard = sum(len(trip.times_ms) for trip in trips)
    return Sheet(
        "Round trip of a command, in ms",
        ("through", "rate", "p50", "p99", "ratio"),
        tuple((name, f"{rate_hz:.0f} Hz", *cells(name, rate_hz)) for rate_hz in RATES_HZ for name in names),
        (
            "A driver sends commands that all differ, at a fixed rate, through a process that passes them on.",
            f"ratio: of the medians of the same round to those of the {reference}; median (least to greatest).",
            f"{heard} of {sent} commands arrived; the supervisor passes only the last one of a burst.",
        ),
    )


def death_verdicts(own: str, reference: str, deaths: Sequence[Death]) -> list[Verdict]:
    own_ms, reference_ms = _of(own, deaths), _of(reference, deaths)
    ratio = percentile(own_ms, 50) / percentile(reference_ms, 50)
    return [
        Verdict("SIGKILL to zero, p50", ratio, TARGET_DEATH_RATIO, "× a bare token's"),
        Verdict("SIGKILL to zero, p99", percentile(own_ms, 99), TARGET_DEATH_P99_MS, "ms"),
    ]


def death_sheet(names: Sequence[str], deaths: Sequence[Death]) -> Sheet:
    def row(name: str) -> tuple[str, ...]:
        times_ms = _of(name, deaths)
        figures = [f"{percentile(times_ms, percent):.1f}" for percent in (50, 99, 100)]
        return name, str(len(times_ms)), *figures

    return Sheet(
        "SIGKILL of a process to the knowledge of another one, in ms",
        ("by", "n", "p50", "p99", "max"),
        tuple(row(name) for name in names if _of(name, deaths)),
        (
            "Lifeline's supervisor: until zero is on cmd_vel. Zenoh: a liveliness token. MQTT: the will.",
            "TCP: the end of the stream.",
        ),
    )


def _of(kind: str, deaths: Iterable[Death]) -> list[float]:
    return [ms for death in deaths if death.kind == kind for ms in death.times_ms]
