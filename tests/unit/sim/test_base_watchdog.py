"""The base's own watchdog: what it obeys, for how long, and what ends it."""

import math

import pytest

from sim.watchdog import COMMAND_TIMEOUT_S, BaseReason, Target, Watchdog


def _obeying(at_s: float = 0.0) -> Watchdog:
    watchdog = Watchdog()
    watchdog.supervisor_alive(alive=True)
    assert watchdog.command(at_s, 0.5, -0.2)
    return watchdog


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
    watchdog.command(1.0, 0.1, 0.0)
    assert watchdog.target(1.0) == (0.1, 0.0, BaseReason.OK)


def test_a_time_that_is_not_a_number_is_too_late() -> None:
    _assert_stopped(_obeying().target(math.nan), BaseReason.COMMAND_TIMEOUT)
    _assert_stopped(_obeying(at_s=math.nan).target(0.0), BaseReason.COMMAND_TIMEOUT)


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
    assert watchdog.refused_count == 0


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)])
def test_a_command_that_is_not_finite_stops_until_a_good_one_comes(bad: tuple[float, float]) -> None:
    watchdog = _obeying()
    assert not watchdog.command(0.01, *bad)
    assert watchdog.refused_count == 1
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
