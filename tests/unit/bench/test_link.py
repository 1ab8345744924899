"""The pure parts of `python -m bench.link`: the router, the count of stops, the statistics and the tables."""

import math
import random
from dataclasses import replace
from pathlib import Path as File

import pytest

from bench.link.relay import Path, Router
from bench.link.results import (
    Condition,
    Link,
    Measured,
    Results,
    Round,
    grid,
    read,
    sheets,
    stops,
    verdicts,
    write,
)
from bench.link.stops import LATE_S, TIMEOUT_S, Flow, Lateness, disturbed, length_s, outside, upper_rate
from wire.freshness import Sent

PERIOD_S = 0.05
CLEAN = Path(loss=0.0, delay_s=0.0, jitter_s=0.0)


def packet(path: int, number: int = 0) -> bytes:
    """Return an IPv4 packet from an address of a path."""
    return bytes([0x45, *bytes(11), 10, 98, path, 1, 10, 98, path, 2, *number.to_bytes(4, "big")])


# --- the router


def test_a_packet_leaves_after_its_delay_and_not_before() -> None:
    router = Router({3: replace(CLEAN, delay_s=0.25)}, seed=1)
    router.take(packet(3), 1, 10.0)
    assert router.next_s == 10.25
    assert router.due(math.nextafter(10.25, 0.0)) == []
    [due] = router.due(10.25)
    assert (due.to, due.packet, due.due_s) == (1, packet(3), 10.25)
    assert router.next_s is None


def test_packets_of_one_moment_keep_their_order() -> None:
    router = Router({3: CLEAN}, seed=1)
    for number in range(50):
        router.take(packet(3, number), 1, 10.0)
    assert [due.packet for due in router.due(10.0)] == [packet(3, number) for number in range(50)]


def test_jitter_lets_packets_overtake_each_other_and_never_leave_before_they_came() -> None:
    router = Router({3: Path(loss=0.0, delay_s=0.01, jitter_s=0.02)}, seed=1)
    for number in range(200):
        router.take(packet(3, number), 0, 10.0 + number * 0.001)
    due = router.due(20.0)
    numbers = [int.from_bytes(one.packet[-4:], "big") for one in due]
    assert sorted(numbers) == list(range(200))
    assert numbers != sorted(numbers)
    assert [one.due_s for one in due] == sorted(one.due_s for one in due)
    assert all(one.due_s >= 10.0 + number * 0.001 for one, number in zip(due, numbers, strict=True))


def test_the_share_of_lost_packets_is_that_of_their_path() -> None:
    router = Router({1: replace(CLEAN, loss=0.05), 2: CLEAN}, seed=1)
    for _ in range(20_000):
        router.take(packet(1), 1, 0.0)
        router.take(packet(2), 1, 0.0)
    paths = [due.packet[14] for due in router.due(0.0)]
    assert paths.count(2) == 20_000
    assert router.counts.lost == pytest.approx(1000, abs=5 * math.sqrt(1000))
    assert paths.count(1) == 20_000 - router.counts.lost
    assert router.counts.passed == len(paths)


def test_the_same_seed_loses_and_delays_the_same_packets() -> None:
    def left(seed: int) -> list[tuple[float, bytes]]:
        router = Router({1: Path(loss=0.3, delay_s=0.1, jitter_s=0.01)}, seed)
        for number in range(100):
            router.take(packet(1, number), 1, 0.0)
        return [(due.due_s, due.packet) for due in router.due(1.0)]

    assert left(1) == left(1)
    assert left(1) != left(2)


def test_a_calm_router_neither_loses_nor_reorders() -> None:
    router = Router({1: Path(loss=1.0, delay_s=0.5, jitter_s=0.2), 2: Path(0.0, 0.5, 0.2)}, seed=1)
    router.is_calm = True
    router.take(packet(1), 1, 0.0)
    assert [due.due_s for due in router.due(1.0)] == [0.5]
    router.is_calm = False
    router.take(packet(1), 1, 0.0)
    assert router.due(9.0) == []
    router.take(packet(2), 1, 0.0)
    assert router.next_s != 0.5


def test_a_cut_stops_new_packets_and_lets_those_in_transit_arrive() -> None:
    router = Router({1: replace(CLEAN, delay_s=1.0)}, seed=1)
    router.take(packet(1, 1), 1, 0.0)
    router.is_cut = True
    router.take(packet(1, 2), 1, 0.5)
    router.is_cut = False
    router.take(packet(1, 3), 1, 0.6)
    assert [due.packet for due in router.due(9.0)] == [packet(1, 1), packet(1, 3)]
    assert router.counts.cut == 1


@pytest.mark.parametrize("foreign", [b"", bytes(60), packet(9), b"\x60" + packet(1)[1:], packet(1)[:19]])
def test_a_packet_that_belongs_to_no_path_is_dropped(foreign: bytes) -> None:
    router = Router({1: CLEAN}, seed=1)
    router.take(foreign, 1, 0.0)
    assert router.due(0.0) == []
    assert router.counts.foreign == 1


# --- the stops


def heard(arrivals: dict[int, float], epoch: bytes = b"e") -> Flow:
    """Return a flow that counts from 1 s; its commands have the numbers of 20 Hz and arrive at these times [s]."""
    flow = Flow()
    for number in sorted(arrivals, key=lambda one: arrivals[one]):
        if arrivals[number] >= 1.0 and math.isinf(flow.begin_s):
            flow.begin(1.0)
        flow.hear(Sent(epoch, number, number * PERIOD_S), arrivals[number])
    return flow


def on_time(numbers: range, delay_s: float = 0.0) -> dict[int, float]:
    return {number: number * PERIOD_S + delay_s for number in numbers}


def test_a_flow_without_losses_never_stops() -> None:
    flow = heard(on_time(range(100), delay_s=0.3))
    flow.end(99 * PERIOD_S + 0.3)
    assert flow.stops_s == []
    assert flow.worst_age_s == pytest.approx(PERIOD_S)
    assert flow.arrived == 86
    assert flow.refused == 0


def test_a_command_may_be_as_old_as_the_timeout_and_no_older() -> None:
    before, after = on_time(range(40)), on_time(range(44, 60))
    last_s = 39 * PERIOD_S
    for age_s, stops_s in ((TIMEOUT_S - 1e-9, []), (TIMEOUT_S + 1e-9, [pytest.approx(last_s + TIMEOUT_S)])):
        flow = heard(before | {43: last_s + age_s} | after)
        flow.end(59 * PERIOD_S)
        assert flow.stops_s == stops_s
        assert flow.worst_age_s == pytest.approx(age_s)


def test_a_long_gap_is_one_stop_and_the_next_gap_another() -> None:
    flow = heard(on_time(range(40)) | on_time(range(100, 140)) | on_time(range(200, 240)))
    flow.end(239 * PERIOD_S)
    assert flow.stops_s == [pytest.approx(39 * PERIOD_S + 0.2), pytest.approx(139 * PERIOD_S + 0.2)]
    assert flow.worst_age_s == pytest.approx(61 * PERIOD_S)


def test_a_backlog_that_arrives_in_a_burst_is_late_and_does_not_end_a_stop() -> None:
    burst_s = 59 * PERIOD_S
    flow = heard(on_time(range(40)) | dict.fromkeys(range(40, 60), burst_s) | on_time(range(60, 80)))
    flow.end(79 * PERIOD_S)
    assert flow.stops_s == [pytest.approx(39 * PERIOD_S + TIMEOUT_S)]
    assert flow.refused == 15  # those that were older than 0.2 s when they arrived
    assert flow.worst_age_s == pytest.approx(burst_s - 39 * PERIOD_S)


def test_a_command_that_was_overtaken_is_refused() -> None:
    arrivals = on_time(range(60))
    arrivals[50] = arrivals[51] + 0.001
    flow = heard(arrivals)
    flow.end(59 * PERIOD_S)
    assert flow.refused == 1
    assert flow.stops_s == []


def test_a_flow_that_ends_is_a_stop_too() -> None:
    flow = heard(on_time(range(40)))
    flow.end(10.0)
    assert len(flow.stops_s) == 1
    assert flow.worst_age_s == pytest.approx(10.0 - 39 * PERIOD_S)


def test_a_flow_that_never_had_a_fresh_command_is_a_stop() -> None:
    flow = Flow()
    assert not flow.is_fresh
    flow.begin(5.0)
    flow.end(6.0)
    assert flow.stops_s == [pytest.approx(5.2)]


def test_stops_in_disturbed_time_are_set_aside() -> None:
    spans = disturbed([(10.0, 0.03), (10.1, 0.03), (50.0, 0.1), (99.9, 0.5), (200.0, 1.0)], (0.0, 100.0))
    assert spans == [
        (pytest.approx(9.95), pytest.approx(10.38)),
        (pytest.approx(49.95), pytest.approx(50.35)),
        (pytest.approx(99.85), 100.0),
    ]
    assert length_s(spans) == pytest.approx(0.98)
    assert outside([1.0, 10.2, 50.36, 99.9], spans) == [1.0, 50.36]


def test_the_upper_bound_of_a_rate_is_that_of_poisson() -> None:
    # Chi-square quantiles: half of 5.991, 9.488 and 124.342 with 2, 4 and 100 degrees of freedom.
    assert upper_rate(0, 1.0) == pytest.approx(2.996, rel=1e-3)
    assert upper_rate(1, 2.0) == pytest.approx(4.744 / 2, rel=1e-3)
    assert upper_rate(49, 1.0) == pytest.approx(62.171, rel=1e-3)
    assert 3000 < upper_rate(3000, 1.0) < 3100


def test_the_lateness_knows_its_p99_and_its_late_moments() -> None:
    late = Lateness()
    assert late.percentile(99) == 0.0
    chance = random.Random(1)
    delays = [number / 1e4 for number in range(100)] + [LATE_S + 0.01]
    chance.shuffle(delays)
    for delay_s in delays:
        late.add(5.0, 5.0 + delay_s)
    assert late.percentile(99) == pytest.approx(0.0099)
    assert late.moments == [(5.0, pytest.approx(LATE_S + 0.01))]
    assert late.report()["acts"] == 101


# --- the conditions, the results and the tables

ROUND = Round(
    date="2026-11-25 02:00 UTC",
    seconds=200.0,
    seed=1,
    flows=6,
    busy_percent=40.0,
    disturbed_s=1.0,
    packets=100,
    lost=2,
    router_late_p99_ms=0.5,
    router_late_max_ms=9.0,
    sender_late_p99_ms=0.6,
    sender_late_max_ms=8.0,
    receiver_late_p99_ms=0.7,
    receiver_late_max_ms=7.0,
)
QUIC = Measured(
    link=Link.QUIC,
    loss=0.02,
    round_trip_s=0.02,
    lease_s=0.4,
    flows=10,
    flow_s=3600.0,
    stops=1,
    disturbed_stops=0,
    worst_age_s=0.21,
    arrived=70_000,
    refused=3,
    links_lost=0,
)
TCP = replace(QUIC, link=Link.TCP, stops=90, worst_age_s=0.9)
RUN = {
    "command": "python -m bench.link",
    "date": "today",
    "machine": "2 cores, load average 1.0",
    "commit": "abc",
}


def test_the_grid_contains_each_combination_once() -> None:
    found = grid(Link, (0.0, 0.1), (0.0, 0.3), (0.4,))
    assert len(set(found)) == len(found) == 12
    assert found[-1].path == Path(loss=0.1, delay_s=0.15, jitter_s=0.1 * 0.15)
    assert str(found[-1]) == "udp at 10 % and 300 ms"


def test_results_are_read_as_they_were_written(tmp_path: File) -> None:
    results = Results(RUN, (ROUND,), (QUIC, TCP))
    write(results, tmp_path / "link.jsonl")
    assert read(tmp_path / "link.jsonl") == results


def test_rounds_are_added_up() -> None:
    [one] = Results(RUN, (ROUND, ROUND), (QUIC, replace(QUIC, stops=3, worst_age_s=0.3))).together().values()
    assert (one.stops, one.flow_s, one.flows, one.worst_age_s) == (4, 7200.0, 20, 0.3)
    assert one.per_hour == 2.0
    assert one.upper_per_hour == pytest.approx(upper_rate(4, 2.0))


def test_a_condition_without_measured_time_has_no_rate() -> None:
    one = replace(QUIC, flow_s=0.0, stops=0)
    assert math.isnan(one.per_hour)
    assert math.isinf(one.upper_per_hour)
    assert stops({one.condition: one}, 0.4).rows[0][2] == ""


@pytest.mark.parametrize("part", ["router", "sender", "receiver"])
def test_a_round_is_rejected_if_a_part_of_the_bench_was_late(part: str) -> None:
    assert replace(ROUND, **{f"{part}_late_p99_ms": 5.0}).rejection(5.0) is None
    rejection = replace(ROUND, **{f"{part}_late_p99_ms": 5.1}).rejection(5.0)
    assert rejection is not None
    assert part in rejection


def test_the_table_shows_the_links_beside_each_other_and_few_stops_with_their_upper_bound() -> None:
    [table, ages, effort] = sheets(Results(RUN, (ROUND,), (QUIC, TCP)))
    assert table.columns == ("round trip", "loss", "TCP", "QUIC", "measured hours")
    assert table.rows == (("20 ms", "2 %", "90", "1 (≤ 4.7)", "1.00, 1.00"),)
    assert ages.rows == (("20 ms", "2 %", "0.90 (0)", "0.21 (0)"),)
    assert len(effort.rows) == 1


def test_a_condition_that_was_not_measured_leaves_its_place_empty() -> None:
    udp = replace(QUIC, link=Link.UDP, loss=0.1)
    together = {one.condition: one for one in (QUIC, udp)}
    assert [row[2:4] for row in stops(together, 0.4).rows] == [("1 (≤ 4.7)", ""), ("", "1 (≤ 4.7)")]


def test_the_targets_are_those_of_quic_at_a_round_trip_of_20_ms() -> None:
    at_5 = replace(QUIC, loss=0.05, stops=11)
    found = verdicts(Results(RUN, (ROUND,), (QUIC, TCP, at_5, replace(at_5, round_trip_s=0.1, stops=99))))
    assert [one.sentence(is_judged=True).split(":")[0] for one in found] == [
        "on target",
        "OVER TARGET by 10 %",
    ]


def test_conditions_sort_by_link_loss_and_round_trip() -> None:
    assert Condition(Link.QUIC, 0.1, 0.0, 0.4) < Condition(Link.TCP, 0.0, 0.0, 0.4)
