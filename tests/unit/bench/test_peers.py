"""The statistics of `bench.peers`: ratios round by round, verdicts and the stored file."""

from pathlib import Path

import pytest

from bench.peers.results import RATES_HZ, Death, Peers, RoundTrip, ratios, read, sheets, verdicts, write

OWN, RELAY, OTHER = "supervisor", "relay", "other"
RUN = {
    "command": "python -m bench.peers",
    "date": "today",
    "machine": "2 cores, load average 1.0",
    "commit": "abc",
}


def trips(kind: str, *medians_ms: float) -> list[RoundTrip]:
    """Return trips with these medians, one for each round, at every rate."""
    return [
        RoundTrip(kind, rate_hz, number, 3, (median_ms / 2, median_ms, 2 * median_ms))
        for number, median_ms in enumerate(medians_ms)
        for rate_hz in RATES_HZ
    ]


PEERS = Peers(
    RUN,
    (*trips(OWN, 1.0, 6.0), *trips(RELAY, 1.0, 3.0), *trips(OTHER, 0.5, 1.5)),
    (Death(OWN, 0, (2.0, 4.0, 9.0)), Death(RELAY, 0, (2.0, 2.5, 3.0))),
)


def test_a_ratio_compares_medians_of_the_same_round() -> None:
    assert ratios(OWN, RELAY, 20.0, PEERS.trips) == [1.0, 2.0]


def test_a_round_in_which_nothing_arrived_has_no_ratio() -> None:
    lost = RoundTrip(OWN, 20.0, 0, 3, ())
    kept = [trip for trip in PEERS.trips if (trip.kind, trip.rate_hz, trip.round) != (OWN, 20.0, 0)]
    assert ratios(OWN, RELAY, 20.0, [lost, *kept]) == [2.0]


def test_the_verdicts_are_ratios_to_the_relay_and_differences_of_tails() -> None:
    measured = [verdict.measured for verdict in verdicts(PEERS)]
    tail_ms = pytest.approx(5.85)  # 11.7 against 5.85, interpolated
    assert measured[:2] == [pytest.approx(1.5), tail_ms]
    assert measured[-1] == pytest.approx(1.6)


def test_the_tables_have_a_row_for_each_kind_and_rate_and_report_the_run() -> None:
    trip, death = sheets(PEERS)
    assert [row[0] for row in trip.rows] == [OWN, RELAY, OTHER] * len(RATES_HZ)
    assert [row[1] for row in trip.rows[::3]] == [f"{rate_hz:.0f} Hz" for rate_hz in RATES_HZ]
    assert trip.rows[0][4] == "1.50 (1.00 to 2.00)"
    assert [row[:2] for row in death.rows] == [(OWN, "3"), (RELAY, "3")]
    assert trip.notes[-1] == "Run of today by `python -m bench.peers`: 2 cores, load average 1.0; commit abc."
    assert trip.notes[-2] == "54 of 54 commands arrived; the supervisor passes only the last one of a burst."


def test_a_stored_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "peers.jsonl"
    write(PEERS, file)
    assert read(file) == PEERS
