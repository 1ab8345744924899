"""`lifeline metrics`: what it counts, also across a restart of the supervisor, and its text for Prometheus."""

import math
import socket
from dataclasses import replace
from typing import Any

import pytest
from prometheus_client import CollectorRegistry, generate_latest

from deploy.stack.errors import DeployError
from deploy.stack.formatting import HEARD_LIMIT_S
from lifeline.watch.metrics import Ledger, metrics_at, serve
from lifeline.watch.metrics_account import MAX_SOURCES, UNKNOWN, Account, Histogram, Timing
from tests.unit.teleop import views
from wire.messages import SafetyStatus, SourceStatus, header, planar_twist
from wire.stamp import Stamp

RUN, NEXT_RUN = b"a" * 16, b"b" * 16


def status(mode: int = SafetyStatus.STOPPED, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - any field
    return SafetyStatus(header("", 0), mode=mode, **fields)


def source(name: str = "teleop", accepted: int = 0, refused_epoch: int = 0) -> SourceStatus:
    return replace(views.source(name), accepted=accepted, refused_epoch=refused_epoch)


def stamp(gid: bytes = RUN, source_time_s: float = 0.0) -> Stamp:
    return Stamp(1, round(source_time_s * 1e9), gid)


def text_of(account: Account, now_s: float, timings: dict[str, Timing] | None = None) -> str:
    class Once(Ledger):
        def collect(self) -> Any:  # noqa: ANN401 - an iterator of metrics
            return metrics_at(account, timings or {}, now_s)

    registry = CollectorRegistry()
    registry.register(Once())
    return generate_latest(registry).decode()


def test_a_reason_counts_once_when_it_appears_and_again_after_it_was_gone() -> None:
    account = Account()
    for at_s, reasons in enumerate([[], ["ESTOP"], ["ESTOP", "OBSTACLE"], [], ["ESTOP"]]):
        account.hear_status(status(reasons=reasons), float(at_s), stamp())
    assert account.stops["ESTOP"] == 2
    assert account.stops["OBSTACLE"] == 1
    assert account.stops["OVERRUN"] == 0


def test_the_reasons_of_the_first_status_are_not_counted() -> None:
    account = Account()
    account.hear_status(status(reasons=["ESTOP"]), 1.0, stamp())
    assert account.stops["ESTOP"] == 0


def test_reasons_that_this_version_does_not_know_share_one_series() -> None:
    account = Account()
    account.hear_status(status(), 1.0, stamp())
    account.hear_status(status(reasons=["NEW_ONE", 'x"\n']), 1.1, stamp())
    assert account.stops[UNKNOWN] == 2
    assert "NEW_ONE" not in account.stops


def test_time_counts_for_the_mode_in_which_it_passed() -> None:
    account = Account()
    account.hear_status(status(SafetyStatus.STOPPED), 10.0, stamp())
    account.hear_status(status(SafetyStatus.DRIVING), 10.25, stamp())
    account.advance(10.75)
    account.advance(10.5)
    assert account.mode_s["STOPPED"] == 0.25
    assert account.mode_s["DRIVING"] == 0.5


def test_silence_beyond_the_limit_counts_for_no_mode() -> None:
    account = Account()
    account.hear_status(status(SafetyStatus.READY), 10.0, stamp())
    account.advance(60.0)
    assert account.mode_s["READY"] == HEARD_LIMIT_S
    account.hear_status(status(SafetyStatus.READY), 100.0, stamp())
    account.advance(100.5)
    assert account.mode_s["READY"] == HEARD_LIMIT_S + 0.5


@pytest.mark.parametrize("after", [2, 9])
def test_a_restarted_supervisor_adds_to_the_counts(after: int) -> None:
    """The new run is known by its epoch, also if its count already exceeds the old one."""
    account = Account()
    account.hear_status(status(sources=[source(accepted=5, refused_epoch=1)]), 1.0, stamp())
    account.hear_status(status(sources=[source(accepted=7, refused_epoch=1)]), 1.1, stamp())
    account.hear_status(status(sources=[source(accepted=after)]), 9.0, stamp(NEXT_RUN))
    assert account.accepted.totals["teleop",] == 7 + after
    assert account.refused.totals["teleop", "epoch"] == 1


def test_without_stamps_a_smaller_count_shows_the_restart() -> None:
    account = Account()
    for at_s, accepted in enumerate([5, 7, 2, 3]):
        account.hear_status(status(sources=[source(accepted=accepted)]), float(at_s), None)
    assert account.accepted.totals["teleop",] == 10


def test_the_number_of_counted_sources_is_bounded() -> None:
    account = Account()
    account.hear_status(status(sources=[source(f"s{n}", 1) for n in range(MAX_SOURCES + 9)]), 1.0, stamp())
    assert len(account.accepted.totals) == MAX_SOURCES


def test_a_value_on_a_bound_is_in_the_lower_bucket() -> None:
    histogram = Histogram((0.1, 0.2))
    for value in (0.1, math.nextafter(0.1, 1.0), 0.2, 5.0):
        histogram.observe(value)
    assert histogram.cumulative() == [("0.1", 1), ("0.2", 3), ("+Inf", 4)]
    assert histogram.sum == pytest.approx(5.4)


def test_the_age_is_the_excess_over_the_fastest_sample_whatever_the_clocks_say() -> None:
    timing = Timing()
    for sent_s, arrival_s in ((500.0, 10.0), (500.1, 10.1), (500.2, 10.5)):
        timing.arrive(arrival_s, stamp(source_time_s=sent_s))
    assert timing.ages.sum == pytest.approx(0.3, abs=1e-3)
    assert timing.gaps.sum == pytest.approx(0.5)


def test_each_run_of_a_sender_has_its_own_baseline() -> None:
    timing = Timing()
    timing.arrive(10.0, stamp(RUN, 500.0))
    timing.arrive(11.0, stamp(NEXT_RUN, 3.0))
    timing.arrive(12.0, stamp(NEXT_RUN, 1.0))
    assert timing.ages.sum == 0.0
    assert sum(timing.ages.counts) == 3


def test_a_sample_without_a_stamp_has_a_gap_and_no_age() -> None:
    timing = Timing()
    timing.arrive(1.0, None)
    timing.arrive(1.5, None)
    assert sum(timing.ages.counts) == 0
    assert timing.gaps.sum == 0.5


def test_the_text_names_units_and_totals_and_leaves_out_what_is_not_known() -> None:
    account, timing = Account(), Timing()
    account.hear_status(status(), 1.0, stamp())
    account.hear_status(status(reasons=["ESTOP"], nearest_m=0.8, sources=[source(accepted=3)]), 1.5, stamp())
    account.hear_odometry(planar_twist(0.5, -0.25), 1.5)
    timing.arrive(1.0, stamp())
    text = text_of(account, 1.5, {"status": timing})
    for line in (
        'lifeline_stops_total{reason="ESTOP"} 1.0',
        'lifeline_mode_seconds_total{mode="STOPPED"} 0.5',
        'lifeline_commands_accepted_total{source="teleop"} 3.0',
        'lifeline_commands_refused_total{kind="epoch",source="teleop"} 0.0',
        "lifeline_up 1.0",
        "lifeline_alarm 0.0",
        "lifeline_nearest_meters 0.8",
        "lifeline_linear_velocity_meters_per_second 0.5",
        "lifeline_angular_velocity_radians_per_second -0.25",
        'lifeline_message_age_seconds_count{topic="status"} 1.0',
    ):
        assert line in text.splitlines()
    silent = text_of(account, 9.0)
    assert "lifeline_up 0.0" in silent
    assert "lifeline_nearest_meters" not in silent
    assert "velocity" not in silent
    assert 'lifeline_stops_total{reason="ESTOP"} 1.0' in silent


def test_a_port_in_use_and_an_address_that_cannot_exist_are_refused_in_one_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        listen = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(DeployError, match="is in use by another program: choose another port"):
            serve(Ledger(), listen)
    with pytest.raises(DeployError, match="is not an address"):
        serve(Ledger(), f"{'a' * 70}:0")
    with pytest.raises(DeployError, match=r"cannot listen on 192\.0\.2\.1:0"):
        serve(Ledger(), "192.0.2.1:0")
