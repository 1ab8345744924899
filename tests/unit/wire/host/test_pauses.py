"""Suspends by the clocks, without a false or a missed one, and requests that waited while the process was stopped."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wire.host import pauses
from wire.host.pauses import (
    BACKLOG_S,
    STALL_S,
    Clocks,
    StallMeter,
    SuspendMeter,
    never_suspended,
    read_clocks,
    wall_ahead_ns,
)

MS = 1_000_000
PAUSE_S = STALL_S + 0.01
SLOW = st.integers(0, 500 * MS)


class Machine:
    """Two clocks, and a process that may be descheduled between any two readings."""

    def __init__(self) -> None:
        self.monotonic_ns = 1000 * MS
        self.asleep_ns = 77 * MS
        self.delays_ns: tuple[int, int] = (0, 0)

    def read(self) -> Clocks:
        before_ns = self.monotonic_ns
        self.monotonic_ns += self.delays_ns[0]
        boottime_ns = self.monotonic_ns + self.asleep_ns
        self.monotonic_ns += self.delays_ns[1]
        return Clocks(before_ns, boottime_ns, self.monotonic_ns)


def test_a_suspend_is_measured_once() -> None:
    machine = Machine()
    meter = SuspendMeter(machine.read)
    assert meter.suspended_s() == 0.0
    machine.asleep_ns += 2500 * MS
    assert meter.suspended_s() == pytest.approx(2.5)
    assert meter.suspended_s() == 0.0
    machine.asleep_ns += 100 * MS
    assert meter.suspended_s() == pytest.approx(0.1)


@given(st.lists(st.tuples(SLOW, SLOW), max_size=50))
def test_a_process_that_is_descheduled_while_it_reads_shows_no_suspend(
    delays: list[tuple[int, int]],
) -> None:
    machine = Machine()
    meter = SuspendMeter(machine.read)
    for delay in delays:
        machine.delays_ns = delay
        machine.monotonic_ns += 20 * MS
        assert meter.suspended_s() == 0.0


@given(st.lists(st.tuples(SLOW, SLOW, st.integers(0, 5000 * MS)), min_size=1, max_size=20))
def test_no_more_than_all_suspends_is_measured_and_all_of_the_next_once_a_reading_was_quick(
    readings: list[tuple[int, int, int]],
) -> None:
    machine = Machine()
    meter = SuspendMeter(machine.read)
    slept_s = measured_s = 0.0
    for before_ns, after_ns, asleep_ns in readings:
        machine.delays_ns = (before_ns, after_ns)
        machine.asleep_ns += asleep_ns
        slept_s += asleep_ns * 1e-9
        measured_s += meter.suspended_s()
        assert measured_s <= slept_s + 1e-6
    machine.delays_ns = (0, 0)
    measured_s += meter.suspended_s()
    machine.asleep_ns += 10_000 * MS
    assert meter.suspended_s() == pytest.approx(10.0), (
        "after one quick reading, the next suspend shows in full"
    )


def test_the_clocks_of_this_machine_show_no_suspend_while_it_runs() -> None:
    meter = SuspendMeter()
    assert [meter.suspended_s() for _ in range(1000)] == [0.0] * 1000


def test_boottime_is_never_behind_the_monotonic_clock() -> None:
    clocks = read_clocks()
    assert clocks.before_ns <= clocks.after_ns
    assert clocks.boottime_ns >= clocks.before_ns


def test_where_there_is_no_boottime_no_suspend_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pauses, "BOOTTIME", None)
    meter = SuspendMeter()
    assert meter.suspended_s() == 0.0
    assert never_suspended() == 0.0


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


@pytest.mark.parametrize("read", range(9))
def test_a_thread_that_is_descheduled_between_two_clocks_sees_no_step(
    read: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, now_ns = itertools.count(), 10**12

    def now() -> int:
        nonlocal now_ns
        now_ns += 30_000_000 if next(count) == read else 100
        return now_ns

    monkeypatch.setattr("time.monotonic_ns", now)
    monkeypatch.setattr("time.time_ns", lambda: now() + 5 * 10**9)
    assert abs(wall_ahead_ns() - 5 * 10**9) <= 200
