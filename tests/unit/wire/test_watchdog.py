"""The base's own watchdog: what it obeys, for how long, and what ends it."""

import math
from typing import Any

import pytest

from wire.freshness import Sent
from wire.watchdog import COMMAND_TIMEOUT_S, BaseReason, Target, Watchdog

TICK_S = 0.02
CLOCK_AHEAD_S = 1e6
"""The supervisor may run on another machine, by another clock."""


def _obeying(at_s: float = 0.0) -> Watchdog:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    _prove(watchdog, at_s)
    assert watchdog.command(at_s, 0.5, -0.2)
    return watchdog


def _prove(watchdog: Watchdog, at_s: float) -> None:
    """Send commands without stamps for one timeout, so that the next one at `at_s` is obeyed."""
    for early_s in (COMMAND_TIMEOUT_S + 0.001, 0.1, 0.05):
        assert not watchdog.command(at_s - early_s, 0.9, 0.9)


def _assert_stopped(target: Target, reason: BaseReason) -> None:
    assert target == (0.0, 0.0, reason)


def test_a_base_that_never_saw_a_supervisor_stands() -> None:
    _assert_stopped(Watchdog().target(0.0), BaseReason.SUPERVISOR_LOST)


def test_a_base_that_never_heard_a_command_stands() -> None:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    _assert_stopped(watchdog.target(0.0), BaseReason.NO_COMMAND)


def test_a_fresh_command_under_a_living_supervisor_is_obeyed() -> None:
    assert _obeying().target(0.01) == (0.5, -0.2, BaseReason.OK)


def test_a_command_ends_just_after_its_timeout() -> None:
    watchdog = _obeying()
    assert watchdog.target(COMMAND_TIMEOUT_S).reason is BaseReason.OK
    _assert_stopped(watchdog.target(math.nextafter(COMMAND_TIMEOUT_S, math.inf)), BaseReason.COMMAND_TIMEOUT)


def test_a_command_after_a_timeout_is_obeyed_again() -> None:
    watchdog = _obeying()
    watchdog.target(1.0)
    _prove(watchdog, 1.0)
    watchdog.command(1.0, 0.1, 0.0)
    assert watchdog.target(1.0) == (0.1, 0.0, BaseReason.OK)


def test_a_time_that_is_not_a_number_is_too_late() -> None:
    _assert_stopped(_obeying().target(math.nan), BaseReason.COMMAND_TIMEOUT)
    watchdog = _obeying()
    assert not watchdog.command(math.nan, 0.5, -0.2)
    _assert_stopped(watchdog.target(0.0), BaseReason.COMMAND_STALE)


def test_a_lost_token_stops_at_once_however_fresh_the_command() -> None:
    watchdog = _obeying()
    watchdog.supervisor_alive(alive=False)
    _assert_stopped(watchdog.target(0.0), BaseReason.SUPERVISOR_LOST)


def test_a_returned_token_alone_moves_nothing() -> None:
    watchdog = _obeying()
    watchdog.supervisor_alive(alive=False)
    watchdog.supervisor_alive(alive=True)
    _assert_stopped(watchdog.target(0.001), BaseReason.NO_COMMAND)
    watchdog.command(0.002, 0.3, 0.0)
    assert watchdog.target(0.002) == (0.3, 0.0, BaseReason.OK)


def test_a_command_that_came_without_the_token_does_not_count_after_its_return() -> None:
    watchdog = _obeying()
    watchdog.supervisor_alive(alive=False)
    assert not watchdog.command(0.01, 0.4, 0.0)
    watchdog.supervisor_alive(alive=True)
    _assert_stopped(watchdog.target(0.011), BaseReason.NO_COMMAND)


def test_a_command_from_before_a_suspend_does_not_drive_after_it() -> None:
    watchdog = _obeying()
    watchdog.resumed(0.01)
    _assert_stopped(watchdog.target(0.01), BaseReason.NO_COMMAND)


def test_a_command_that_was_still_on_its_way_during_a_suspend_does_not_count() -> None:
    watchdog = _obeying()
    watchdog.resumed(1.0)
    _prove(watchdog, 1.0 + watchdog.command_timeout_s)
    assert not watchdog.command(1.0 + watchdog.command_timeout_s, 0.3, 0.0)
    _assert_stopped(watchdog.target(1.0 + watchdog.command_timeout_s), BaseReason.NO_COMMAND)
    later_s = math.nextafter(1.0 + watchdog.command_timeout_s, 2.0)
    assert watchdog.command(later_s, 0.3, 0.0)
    assert watchdog.target(later_s) == (0.3, 0.0, BaseReason.OK)


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)])
def test_a_command_that_is_not_finite_stops_until_a_good_one_comes(bad: tuple[float, float]) -> None:
    watchdog = _obeying()
    assert not watchdog.command(0.01, *bad)
    _assert_stopped(watchdog.target(0.02), BaseReason.COMMAND_INVALID)
    watchdog.command(0.03, 0.1, 0.1)
    assert watchdog.target(0.03) == (0.1, 0.1, BaseReason.OK)


def test_a_refused_command_never_refreshes_the_age() -> None:
    watchdog = _obeying()
    watchdog.command(0.149, math.nan, 0.0)
    _assert_stopped(watchdog.target(0.151), BaseReason.COMMAND_TIMEOUT)


def test_a_refused_first_command_counts_as_none() -> None:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    watchdog.command(0.0, math.nan, 0.0)
    _assert_stopped(watchdog.target(0.0), BaseReason.NO_COMMAND)


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf])
def test_a_timeout_that_is_not_positive_and_finite_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match=r"command_timeout_s must be positive and finite"):
        Watchdog(command_timeout_s=bad)


# --- commands that say when they were decided


class Driven:
    """A base that hears a stamped command at each tick, and obeys by now."""

    def __init__(self) -> None:
        self.watchdog = Watchdog()
        self.watchdog.supervisor_alive(alive=True)
        self.now_s = 100.0
        self.sequence = 0
        self.taken = [self.hear() for _ in range(20)]

    def hear(self, *, late_s: float = 0.0, epoch: bytes = b"A", sequence: int | None = None) -> bool:
        self.now_s += TICK_S + late_s
        self.sequence += 1
        sent = Sent(epoch, sequence or self.sequence, self.now_s - late_s + CLOCK_AHEAD_S)
        return self.watchdog.command(self.now_s, 0.5, 0.0, sent)

    def reason(self) -> BaseReason:
        return self.watchdog.target(self.now_s).reason


def test_an_epoch_moves_the_base_once_it_has_been_heard_for_a_timeout() -> None:
    base = Driven()
    assert base.taken == [False] * 8 + [True] * 12
    assert base.reason() is BaseReason.OK


def test_an_epoch_that_is_not_proven_counts_as_no_command() -> None:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    assert not watchdog.command(0.0, 0.5, 0.0, Sent(b"A", 1, 0.0))
    _assert_stopped(watchdog.target(0.0), BaseReason.NO_COMMAND)


def test_what_a_stopped_supervisor_says_when_it_wakes_moves_nothing() -> None:
    base = Driven()
    _assert_stopped(base.watchdog.target(base.now_s + 0.5), BaseReason.COMMAND_TIMEOUT)
    assert not base.hear(late_s=0.5)
    _assert_stopped(base.watchdog.target(base.now_s), BaseReason.COMMAND_TIMEOUT)
    assert base.hear()
    assert base.reason() is BaseReason.OK


def test_a_command_counts_from_when_it_was_decided() -> None:
    base = Driven()
    assert base.hear(late_s=0.1)
    assert base.reason() is BaseReason.OK
    _assert_stopped(base.watchdog.target(base.now_s + 0.051), BaseReason.COMMAND_TIMEOUT)


def test_a_command_without_a_stamp_stops_while_somebody_who_stamps_is_heard() -> None:
    base = Driven()
    assert not base.watchdog.command(base.now_s + COMMAND_TIMEOUT_S / 2, 0.9, 0.0)
    _assert_stopped(base.watchdog.target(base.now_s), BaseReason.COMMAND_STALE)
    _prove(base.watchdog, base.now_s + 3 * COMMAND_TIMEOUT_S)
    assert base.watchdog.command(base.now_s + 3 * COMMAND_TIMEOUT_S, 0.9, 0.0)


# --- commands without stamps


def test_a_backlog_without_stamps_does_not_move_the_base() -> None:
    """A ROS 2 bridge whose link stalls delivers everything at once."""
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    for number in range(30):
        assert not watchdog.command(1.0 + number * 1e-4, 0.5, 0.0)
    _assert_stopped(watchdog.target(1.003), BaseReason.NO_COMMAND)


def test_a_backlog_without_stamps_does_not_move_a_base_that_obeyed_before_the_stall() -> None:
    watchdog = _obeying()
    for number in range(30):
        assert not watchdog.command(3.0 + number * 1e-4, 0.5, 0.0)
    _assert_stopped(watchdog.target(3.003), BaseReason.COMMAND_TIMEOUT)


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 50.0])
def test_a_plain_ros_2_node_drives_the_base_after_one_timeout(rate_hz: float) -> None:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    for number in range(100):
        at_s = number / rate_hz
        assert watchdog.command(at_s, 0.5, 0.0) is (at_s >= COMMAND_TIMEOUT_S)


@pytest.mark.parametrize("bad", [{"sequence": 1}, {"epoch": b"B"}], ids=["out of order", "of another epoch"])
def test_a_stale_command_stops_until_a_fresh_one_comes(bad: dict[str, Any]) -> None:
    base = Driven()
    assert not base.hear(**bad)
    _assert_stopped(base.watchdog.target(base.now_s), BaseReason.COMMAND_STALE)
    assert base.hear()
    assert base.reason() is BaseReason.OK
