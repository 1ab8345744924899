"""The pure parts of `python -m bench.soak`: growth, verdict, reception, operator and file."""

import gzip
import json
import math
import os
from dataclasses import replace
from pathlib import Path
from random import Random
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.rig.sheet import Times
from bench.rig.stored import read_appended
from bench.soak import (
    JUDGED_S,
    LET_GO_S,
    SAMPLE,
    WEDGED_STOPS,
    Operator,
    Sample,
    Usage,
    Watch,
    gaps,
    judge,
    lost,
    theil_sen,
    usage,
    warm_up_s,
)
from deploy.stack.statedir import StateDir
from faults.trial import Provenance
from wire import topics
from wire.bus import Arrival, Subscription
from wire.messages import SafetyStatus, encode, header
from wire.stamp import Stamp

MB = 1_000_000


def status(mode: int, *reasons: str) -> SafetyStatus:
    return SafetyStatus(header(""), mode=mode, reasons=list(reasons))


READY, STOPPED = status(SafetyStatus.READY), status(SafetyStatus.STOPPED, "OBSTACLE")
GAPS = Times(500, 20.0, 21.0, 25.0)


def sample(
    time_s: float, *, rss_bytes: float = 50 * MB, pid: int = 7, false_stops: tuple[str, ...] = ()
) -> Sample:
    used = Usage(pid, int(rss_bytes), 20, 9)
    return Sample(time_s, {"supervisor": used}, GAPS, GAPS, {"cmd_vel": 0}, false_stops, 1, 1, time_s)


def samples(growth_percent: float, duration_s: float = 3600.0) -> list[Sample]:
    times_s = np.arange(10.0, duration_s + 1.0, 10.0)
    return [sample(t, rss_bytes=50 * MB * (1 + growth_percent / 100 * t / duration_s)) for t in times_s]


def line_of(one: Sample) -> str:
    return SAMPLE.dump_json(one).decode()


# --- growth and verdict


@given(st.floats(-1e3, 1e3), st.floats(-1e6, 1e6), st.integers(2, 40))
def test_the_slope_of_a_line_is_its_own(slope: float, offset: float, count: int) -> None:
    times_s = np.arange(count, dtype=np.float64)
    assert theil_sen(times_s, offset + slope * times_s) == pytest.approx(slope, abs=1e-6)


def test_a_quarter_of_spikes_does_not_move_the_slope() -> None:
    times_s = np.arange(0.0, 1000.0)
    values = 2.0 * times_s
    values[::4] += 1e6 * np.random.default_rng(0).random(250)
    assert theil_sen(times_s, values) == pytest.approx(2.0, rel=0.2)


def test_the_slope_of_very_many_samples_is_that_of_evenly_spaced_ones() -> None:
    times_s = np.arange(0.0, 50_000.0)
    assert theil_sen(times_s, 3.0 * times_s + 1.0) == pytest.approx(3.0)


@pytest.mark.parametrize(("growth_percent", "passed"), [(0.0, True), (-5.0, True), (0.9, True), (1.3, False)])
def test_growth_of_more_than_one_percent_fails(growth_percent: float, passed: bool) -> None:  # noqa: FBT001
    _, faults = judge(samples(growth_percent))
    assert (not faults) is passed
    assert passed or faults[0].startswith("supervisor: memory grew by 1.")


def test_what_grows_during_the_warm_up_alone_does_not_count() -> None:
    warm_s = warm_up_s(3600.0)
    grown = [sample(t, rss_bytes=MB * (50 + min(t, warm_s) / 10)) for t in range(10, 3601, 10)]
    assert judge(grown)[1] == []


@pytest.mark.parametrize(
    ("duration_s", "expected_s"),
    [(30.0, 5.0), (1800.0, 300.0), (3600.0, 600.0), (86400.0, 600.0)],
)
def test_the_warm_up_is_a_sixth_of_the_soak_but_at_most_ten_minutes(
    duration_s: float, expected_s: float
) -> None:
    assert warm_up_s(duration_s) == expected_s


def test_growth_is_judged_only_over_ten_minutes_after_the_warm_up() -> None:
    growths, faults = judge(samples(50.0, duration_s=JUDGED_S * 6 / 5 - 10.0))
    assert faults == []
    assert all(math.isnan(growth.percent) for growth in growths)
    growths, faults = judge(samples(50.0, duration_s=JUDGED_S * 6 / 5))
    assert growths[0].percent > 30.0
    assert len(faults) == 1


def test_a_false_stop_a_new_process_and_a_robot_at_rest_fail() -> None:
    good = samples(0.0)
    stopped = [*good, sample(3610.0, false_stops=("SCAN_STALE", "SCAN_STALE"))]
    assert judge(stopped)[1] == ["false stops: SCAN_STALE 2×"]
    assert judge([*good, sample(3610.0, pid=8)])[1] == ["supervisor ended or was restarted"]
    assert judge([replace(one, driven_m=0.0) for one in good])[1] == ["the robot never moved"]


# --- reception


def heard(*arrivals: tuple[float, Stamp | None]) -> list[Arrival[None]]:
    return [Arrival(None, arrival_s, stamp) for arrival_s, stamp in arrivals]


def test_gaps_and_losses_begin_at_the_last_message_of_the_previous_sample() -> None:
    arrivals = heard(*((0.02 * n, Stamp(n, 0, b"a" * 16)) for n in (1, 2, 5, 6)))
    found = gaps(arrivals)
    assert (found.samples, lost(arrivals)) == (3, 2)
    assert found.max_ms == pytest.approx(60.0)
    assert math.isnan(gaps(heard((0.1, None))).p50_ms)


def test_a_new_epoch_loses_nothing_and_no_stamp_reports_nothing() -> None:
    assert lost(heard((0.1, Stamp(100, 0, b"a" * 16)), (0.1, Stamp(1, 0, b"b" * 16)), (0.2, None))) == 0


def test_lateness_is_what_a_gap_is_longer_than_its_period() -> None:
    found = gaps(heard(*((arrival_s, None) for arrival_s in (0.0, 0.03, 0.08, 0.14))), beyond_s=0.05)
    assert found.p50_ms == pytest.approx(0.0, abs=1e-6)
    assert found.max_ms == pytest.approx(10.0)


async def test_a_stop_counts_once_as_false_unless_the_operator_provoked_it(tmp_path: Path) -> None:
    inbox = Subscription(topics.STATUS.key, SafetyStatus, depth=8, wake=None)
    bus = Mock()
    bus.subscribe.return_value.take.return_value = []
    watch = Watch(bus, StateDir(tmp_path))
    watch.inboxes[topics.STATUS.key] = inbox

    def hear(*statuses: SafetyStatus) -> Sample:
        for one in statuses:
            inbox.push(encode(one), None, 0.0)
            assert watch.look().reasons == one.reasons
        return watch.sample(10.0)

    stale = status(SafetyStatus.STOPPED, "SCAN_STALE", "OBSTACLE")
    first = hear(READY, stale, stale, READY)
    assert (first.false_stops, first.obstacle_stops) == (("SCAN_STALE",), 1)
    second = hear(STOPPED)
    assert (second.false_stops, second.obstacle_stops) == ((), 2)


# --- the operator


def test_the_operator_sends_neutral_at_a_stop_and_then_drives_again() -> None:
    operator = Operator(Random(1))
    assert operator.keys(0.0, READY)
    assert operator.keys(0.2, STOPPED) == "s"
    assert operator.keys(0.2 + LET_GO_S / 2, READY) == ""
    typed = "".join(operator.keys(t / 10, READY) for t in range(10, 200))
    assert "w" in typed
    assert operator.stops == 0


def test_each_setpoint_begins_at_neutral_and_stays_within_full_speed() -> None:
    operator = Operator(Random(2))
    for tick in range(5000):
        keys = operator.keys(tick / 10, STOPPED if tick % 97 == 0 else READY)
        assert keys[:1] in ("", "s")
        assert keys.count("w") <= 10


def test_stops_in_a_row_are_counted_until_the_robot_drives_forward() -> None:
    operator = Operator(Random(3))
    for number in range(1, WEDGED_STOPS + 1):
        operator.keys(10.0 * number, STOPPED)
        operator.keys(10.0 * number + 0.1, STOPPED)
        assert operator.stops == number
        operator.keys(10.0 * number + 5.0, READY)


# --- the machine


def test_the_usage_of_this_process_is_plausible_and_of_none_is_none() -> None:
    used = usage(os.getpid())
    assert used is not None
    assert used.rss_bytes > MB
    assert used.threads >= 1
    with open(os.devnull) as _:  # noqa: PTH123 - one descriptor more
        more = usage(os.getpid())
    assert more is not None
    assert more.descriptors == used.descriptors + 1
    assert usage(2**22 + 1) is None


def test_a_sample_is_one_line_of_json() -> None:
    line = line_of(replace(sample(10.0), heartbeat=Times(0, math.nan, math.nan, math.nan)))
    assert "\n" not in line
    told = json.loads(line)
    assert told["processes"]["supervisor"]["rss_bytes"] == 50 * MB
    assert (told["ticks"]["p99_ms"], told["heartbeat"]["p99_ms"]) == (21.0, None)


# --- the file


@pytest.mark.parametrize("suffix", [".jsonl", ".jsonl.gz"])
def test_a_file_is_read_as_it_was_written_with_where_it_comes_from(tmp_path: Path, suffix: str) -> None:
    written = [
        sample(10.0),
        replace(sample(20.0, false_stops=("OVERRUN",)), ticks=replace(GAPS, p50_ms=math.nan)),
    ]
    provenance = Provenance(command="python -m bench.soak", commit="abc")
    text = "".join(f"{line}\n" for line in (*map(line_of, written), provenance.line()))
    path = tmp_path / f"soak{suffix}"
    path.write_bytes(gzip.compress(text.encode()) if suffix.endswith("gz") else text.encode())
    found, origins = read_appended(path, Sample)
    assert list(map(line_of, found)) == list(map(line_of, written))
    assert (found[0], origins) == (written[0], [provenance])
    assert math.isnan(found[1].ticks.p50_ms)


@pytest.mark.parametrize(
    "line", ['{"kind": "sample"}', "{}", '{"kind": "sample", "processes": {"a": {"b": 1}}}']
)
def test_a_line_that_is_no_sample_is_refused(tmp_path: Path, line: str) -> None:
    path = tmp_path / "soak.jsonl"
    path.write_text(line + "\n")
    with pytest.raises(ValueError, match="Sample"):
        read_appended(path, Sample)
