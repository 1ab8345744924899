"""Requests that may have waited while the process was stopped."""

from wire.host.stall import BACKLOG_S, STALL_S, StallMeter

PAUSE_S = STALL_S + 0.01


def test_requests_are_new_while_the_loop_turns() -> None:
    meter = StallMeter(10.0)
    assert not meter.may_be_old(10.0 + STALL_S)
    meter.turn(10.0 + STALL_S)
    assert not meter.may_be_old(10.0 + STALL_S)


def test_a_request_that_is_read_before_the_first_turn_after_a_stall_may_be_old() -> None:
    assert StallMeter(10.0).may_be_old(10.0 + PAUSE_S)


def test_requests_may_be_old_until_the_backlog_has_arrived() -> None:
    meter = StallMeter(10.0)
    resumed_s = 10.0 + PAUSE_S
    end_s = resumed_s + BACKLOG_S
    for now_s in [resumed_s + 0.09 * number for number in range(12)]:
        meter.turn(now_s)
        assert meter.may_be_old(now_s)
    meter.turn(end_s)
    assert not meter.may_be_old(end_s)
