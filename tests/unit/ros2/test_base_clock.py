"""The base's clock, from the stamps of its odometry, and which stamps its commands get."""

from collections.abc import Callable

import pytest

from ros2.base_clock import (
    OFFSET_LIMIT_S,
    REPORTED_S,
    SILENT_S,
    STABLE_S,
    BaseClock,
)
from ros2.config import StampChoice
from ros2.samples import Sample
from wire import cdr

WALL_S = 1_700_000_000.0
PERIOD_S = 0.02
WALL_NS = round((WALL_S + 100.0) * 1e9)


def odometry(stamp_s: float, arrival_s: float, wall_s: float = WALL_S) -> Sample:
    """Return an Odometry, of which only the header is read, that arrives at once."""
    writer = cdr.Writer()
    writer.header(round(stamp_s * 1e9), "odom")
    return Sample(writer.payload(), arrival_s, round(arrival_s * 1e9), 1, clock_ns=round(wall_s * 1e9))


class Base:
    """A base at 50 Hz, whose clock is a function of the real time."""

    def __init__(self, choice: StampChoice | None = None) -> None:
        self.clock = BaseClock(choice)
        self.now_s = 10.0

    def run(self, seconds: float, clock_s: Callable[[float], float], late_s: float = 0.0) -> "Base":
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.clock.hear(odometry(clock_s(self.now_s - late_s), self.now_s))
        return self

    @property
    def is_proven(self) -> bool:
        return self.clock.is_proven(self.now_s)

    @property
    def problem(self) -> str:
        return self.clock.problem(self.now_s) or ""


def ahead_by(seconds: float) -> Callable[[float], float]:
    return lambda now_s: WALL_S + now_s + seconds


@pytest.mark.parametrize("ahead_s", [-3600.0, -5.0, 0.0, 0.3, 5.0])
def test_commands_are_stamped_in_the_clock_of_the_base(ahead_s: float) -> None:
    base = Base().run(1.0, ahead_by(ahead_s), late_s=0.005)
    assert base.clock.choice == "base"
    assert base.is_proven
    assert base.clock.may_move(base.now_s)
    assert base.problem == ""
    # A delay of odometry makes the stamp older, never newer.
    stamp_s = (base.clock.stamp_ns(WALL_NS) - WALL_NS) * 1e-9
    assert stamp_s == pytest.approx(ahead_s - 0.005, abs=1e-4)


def test_the_offset_is_proven_once_it_has_been_stable() -> None:
    base = Base().run(STABLE_S - PERIOD_S, ahead_by(5.0))
    assert not base.clock.may_move(base.now_s)
    assert "only zero is commanded" in base.problem
    assert base.run(3 * PERIOD_S, ahead_by(5.0)).clock.may_move(base.now_s)


def test_without_stamped_odometry_commands_have_the_time_of_this_computer() -> None:
    base = Base()
    assert (base.clock.choice, base.clock.stamp_ns(WALL_NS)) == ("now", WALL_NS)
    base.run(1.0, lambda _: 0.0)
    assert (base.clock.choice, base.clock.stamp_ns(WALL_NS)) == ("now", WALL_NS)
    assert base.clock.may_move(base.now_s)
    assert base.clock.shown(base.now_s) == "unknown: no stamped odometry"
    assert base.problem == ""


def test_with_the_clock_of_the_base_chosen_nothing_moves_before_stamped_odometry() -> None:
    base = Base("base")
    assert not base.clock.may_move(base.now_s)
    assert base.problem.startswith("the base's clock is unknown (no stamped odometry")


def test_a_stamp_of_zero_needs_no_clock() -> None:
    base = Base("zero").run(1.0, ahead_by(5.0))
    assert base.clock.stamp_ns(WALL_NS) == 0
    assert base.clock.may_move(base.now_s)
    assert base.problem == ""


@pytest.mark.parametrize(("ahead_s", "effect"), [(5.0, "ignores each"), (-5.0, "keeps its last command")])
def test_with_now_an_offset_is_reported_with_what_it_does(ahead_s: float, effect: str) -> None:
    base = Base("now").run(1.0, ahead_by(ahead_s))
    assert base.clock.stamp_ns(WALL_NS) == WALL_NS
    assert base.clock.may_move(base.now_s)
    assert effect in base.problem
    assert "5.00 s" in base.problem
    assert Base("now").run(1.0, ahead_by(OFFSET_LIMIT_S * 0.99)).problem == ""


@pytest.mark.parametrize("step_s", [0.1, 5.0, -0.1, -5.0])
def test_a_step_of_the_clock_is_unproven_at_once_until_the_offset_is_stable_again(step_s: float) -> None:
    base = Base().run(5.0, ahead_by(0.0))
    base.run(PERIOD_S, ahead_by(step_s))
    assert not base.clock.may_move(base.now_s)
    assert "a step" in base.problem
    base.run(1.0, ahead_by(step_s))
    assert base.clock.may_move(base.now_s)
    assert base.clock.ahead_s == pytest.approx(step_s, abs=1e-4)
    assert f"it has changed by {step_s:+.2f} s" in base.problem
    assert base.run(REPORTED_S, ahead_by(step_s)).problem == ""


def test_a_stamp_fits_into_a_message_whatever_the_odometry_contains() -> None:
    base = Base().run(1.0, lambda _: 2.0**31 - 1.0)
    stamp_ns = base.clock.stamp_ns(WALL_NS + 10**12)
    assert cdr.header_ns_of(cdr.twist_stamped(cdr.STANDSTILL, stamp_ns, "")) == stamp_ns == cdr.MAX_TIME_NS
    base = Base().run(1.0, lambda _: -(2.0**31))
    assert base.clock.stamp_ns(WALL_NS) == 0


def test_while_the_clock_is_unproven_zero_gets_the_newest_offset() -> None:
    base = Base().run(5.0, ahead_by(0.0)).run(PERIOD_S, ahead_by(5.0))
    assert base.clock.stamp_ns(WALL_NS) == pytest.approx(WALL_NS + 5e9, abs=1e5)


def test_a_step_of_the_clock_that_both_share_changes_nothing() -> None:
    base = Base().run(5.0, ahead_by(0.0))
    for _ in range(50):
        base.now_s += PERIOD_S
        base.clock.hear(odometry(WALL_S + 60.0 + base.now_s, base.now_s, wall_s=WALL_S + 60.0))
        assert base.clock.may_move(base.now_s)


def test_a_pause_of_odometry_does_not_stop_the_robot_but_a_long_silence_does() -> None:
    base = Base().run(5.0, ahead_by(0.0))
    began_s = base.now_s
    base.now_s += 0.35
    assert base.clock.may_move(base.now_s)
    for n in range(1, 18):  # the backlog, in a burst
        base.clock.hear(odometry(WALL_S + began_s + n * PERIOD_S, base.now_s))
        assert base.clock.may_move(base.now_s)
    assert base.clock.ahead_s == pytest.approx(0.0, abs=1e-3)
    assert base.clock.may_move(base.now_s + SILENT_S - 1e-6)
    assert not base.clock.may_move(base.now_s + SILENT_S + 1e-6)


@pytest.mark.parametrize("burst_s", [0.1, 0.3, 0.4])
def test_odometry_in_bursts_that_are_shorter_than_a_silence_shows_the_clock(burst_s: float) -> None:
    base = Base()
    for _ in range(5):
        began_s, base.now_s = base.now_s, base.now_s + burst_s
        for n in range(1, round(burst_s / PERIOD_S) + 1):
            base.clock.hear(odometry(WALL_S + 5.0 + began_s + n * PERIOD_S, base.now_s))
    assert base.clock.may_move(base.now_s)
    assert base.clock.ahead_s == pytest.approx(5.0, abs=1e-4)
    base.now_s += burst_s
    assert base.clock.may_move(base.now_s)


def test_after_a_silence_the_offset_is_proven_anew() -> None:
    base = Base().run(5.0, ahead_by(0.0))
    base.now_s += SILENT_S + 1.0
    base.run(PERIOD_S, ahead_by(-3.0))
    assert not base.clock.may_move(base.now_s)
    base.run(1.0, ahead_by(-3.0))
    assert base.clock.ahead_s == pytest.approx(-3.0, abs=1e-4)
    base.now_s += SILENT_S + 1.0
    assert base.run(1.0, ahead_by(-3.0)).problem.startswith("the base's clock was unknown for a moment")
    assert base.clock.may_move(base.now_s)


def test_a_base_in_simulated_time_that_runs_slowly_does_not_move_and_the_cause_is_named() -> None:
    base = Base().run(5.0, lambda now_s: now_s * 0.9)
    assert not base.clock.may_move(base.now_s)
    assert "run at 0.90 of real time, or their delay grows (simulated time)" in base.problem
    assert 'stamp = "zero"' in base.problem


def test_a_clock_that_runs_slow_by_less_than_the_headers_show_is_named_when_it_stops_the_robot() -> None:
    base = Base()
    while base.is_proven or not base.now_s > 11.0:
        assert base.now_s < 60.0
        base.run(PERIOD_S, lambda now_s: WALL_S + 0.995 * now_s)
    base.run(2.0 * STABLE_S, lambda now_s: WALL_S + 0.995 * now_s)
    assert base.is_proven
    assert "it has changed by -0.20 s" in base.problem
    assert "its clock runs slow" in base.problem


def test_a_step_of_the_clock_is_not_named_as_a_slow_one() -> None:
    base = Base().run(1.0, ahead_by(0.0)).run(1.0, ahead_by(-5.0))
    assert "it has changed by -5.00 s" in base.problem
    assert "runs slow" not in base.problem


def test_a_base_in_simulated_time_at_real_time_moves() -> None:
    base = Base().run(5.0, lambda now_s: now_s)
    assert base.clock.may_move(base.now_s)
    assert base.clock.stamp_ns(round((WALL_S + base.now_s) * 1e9)) == pytest.approx(base.now_s * 1e9, abs=1e5)


def test_the_report_shows_the_offset() -> None:
    base = Base().run(1.0, ahead_by(0.25))
    assert base.clock.shown(base.now_s) == "0.25 s ahead of this computer's clock"
    assert base.clock.shown(base.now_s + 1.0).endswith("unproven")
    assert "behind" in Base().run(1.0, ahead_by(-0.25)).clock.shown(11.0)
