"""Commands of a stamped source: their headers' stamps as their age, to the motion of the real law."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from ros2.header_age import HeaderAge
from ros2.samples import Sample
from tests.unit.ros2.programs import TIMEOUT_S, WALL_S, Robot, new_source
from tests.unit.supervisor.law.law_harness import TICK_S
from wire import cdr

LIMIT_S = 1.0
SPEED_M_S = 0.3
PERIOD_TICKS = 2
PLACES = HERE, ELSEWHERE = "this host", "another host"


def sample(stamp_s: float, arrival_s: float, sequence: int = 1, velocity_m_s: float = SPEED_M_S) -> Sample:
    """Return a TwistStamped that the middleware delivers without a delay.

    Args:
        stamp_s: the stamp of its header; 0: none.
        arrival_s: its arrival by the monotonic clock.
        sequence: its number.
        velocity_m_s: its forward velocity.
    """
    payload = cdr.twist_stamped(cdr.Planar(velocity_m_s, 0.0), round(stamp_s * 1e9), "base_link")
    return Sample(payload, arrival_s, round(arrival_s * 1e9), sequence, clock_ns=round(WALL_S * 1e9))


def header_age(limit_s: float | None = LIMIT_S, *, is_here: bool = False) -> HeaderAge:
    age = HeaderAge("joy", TIMEOUT_S, limit_s)
    age.attend(is_here=is_here)
    return age


@dataclass
class Driver:
    """A stamped program that arms its source and then requests motion."""

    age: HeaderAge
    is_here: bool = True

    def __post_init__(self) -> None:
        self.robot = Robot(new_source(headers=self.age), is_here=self.is_here)
        self.sequence = 0
        self.moved_m = 0.0

    def stream(self, velocity_m_s: float, seconds: float, made_s: Callable[[float], float]) -> None:
        """Publish at 25 Hz; the stamp by the program's clock is a function of the present time."""
        for tick in range(round(seconds / TICK_S)):
            if tick % PERIOD_TICKS == 0:
                self.sequence += 1
                now_s = self.robot.now_s
                message = sample(made_s(now_s), now_s, self.sequence, velocity_m_s)
                self.robot.pass_on(self.robot.source.heard(message))
            self.moved_m += self.robot.tick().output.linear_m_s * TICK_S


def by_clock(ahead_s: float, rate: float = 1.0) -> Callable[[float], float]:
    return lambda now_s: WALL_S + now_s * rate + ahead_s


def test_a_source_with_stamps_of_now_drives() -> None:
    for is_here in (True, False):
        driver = Driver(header_age(), is_here)
        driver.stream(0.0, 0.6, by_clock(0.0))
        driver.stream(SPEED_M_S, 1.0, by_clock(0.0))
        assert driver.robot.moves
        assert driver.age.problem is None


@pytest.mark.parametrize("place", PLACES)
def test_a_source_whose_stamps_are_10_s_old_moves_nothing_and_is_named(place: str) -> None:
    driver = Driver(header_age(), place == HERE)
    driver.stream(0.0, 0.6, by_clock(-10.0))
    driver.stream(SPEED_M_S, 2.0, by_clock(-10.0))
    assert driver.moved_m == 0.0
    assert "10.00 s behind this computer's clock" in (driver.age.problem or "")


@pytest.mark.parametrize("place", PLACES)
def test_a_trickling_backlog_with_old_headers_moves_the_robot_for_less_than_the_timeout(place: str) -> None:
    driver = Driver(header_age(), place == HERE)
    driver.stream(0.0, 0.6, by_clock(0.0))
    driver.stream(SPEED_M_S, 1.0, by_clock(0.0))
    assert driver.robot.moves
    driver.moved_m, began_s = 0.0, driver.robot.now_s
    # A relay delivers one old command for two periods: the age grows by half of the time.
    driver.stream(SPEED_M_S, 5.0, lambda now_s: WALL_S + began_s + (now_s - began_s) / 2)
    assert driver.moved_m < SPEED_M_S * 4 * TIMEOUT_S
    assert not driver.robot.moves
    driver.moved_m = 0.0
    driver.stream(SPEED_M_S, 2.0, lambda now_s: WALL_S + began_s + (now_s - began_s) / 2)
    assert driver.moved_m == 0.0


def test_on_one_host_a_stamp_may_differ_by_the_timeout_at_most() -> None:
    age = header_age(is_here=True)
    for ahead_s in (TIMEOUT_S, -TIMEOUT_S):
        inside, outside = ahead_s * 0.999, ahead_s * 1.001
        assert age.source_time_ns(sample(WALL_S + 5.0 + inside, 5.0)) == pytest.approx(
            (5.0 + inside) * 1e9, abs=1000
        )
        assert age.source_time_ns(sample(WALL_S + 5.0 + outside, 5.0)) is None


def test_on_another_host_a_stamp_may_differ_by_the_limit_at_most() -> None:
    age = header_age()
    for ahead_s in (LIMIT_S, -LIMIT_S):
        assert age.source_time_ns(sample(WALL_S + 5.0 + ahead_s * 0.999, 5.0)) is not None
        assert age.source_time_ns(sample(WALL_S + 5.0 + ahead_s * 1.001, 5.0)) is None
    assert "synchronise the clocks" in (age.problem or "")
    assert age.source_time_ns(sample(WALL_S + 6.0, 6.0)) is not None
    assert age.problem is None


def test_a_source_with_a_clock_of_its_own_is_judged_by_progress_and_reported_as_unproven() -> None:
    driver = Driver(header_age(None))
    driver.stream(0.0, 0.6, by_clock(-3600.0))
    driver.stream(SPEED_M_S, 1.0, by_clock(-3600.0))
    assert driver.robot.moves
    assert driver.age.shown.startswith("age unproven")
    assert driver.age.problem is None
    driver.stream(SPEED_M_S, 1.0, by_clock(-3601.0))  # all at once a second late
    assert not driver.robot.moves


def test_headers_without_a_stamp_leave_the_age_to_the_middleware() -> None:
    age = header_age(is_here=True)
    assert age.source_time_ns(sample(0.0, 5.0)) == round(5e9)
    assert age.shown.startswith("from the middleware")
    assert age.problem is None


def test_what_shows_the_age_is_reported() -> None:
    here, elsewhere = header_age(is_here=True), header_age()
    for age in (here, elsewhere):
        age.source_time_ns(sample(WALL_S + 5.0, 5.0))
    assert f"may differ by {TIMEOUT_S:g} s" in here.shown
    assert f"may differ by {LIMIT_S:g} s" in elsewhere.shown


def test_simulated_time_is_named_as_the_cause() -> None:
    age = header_age(is_here=True)
    assert age.source_time_ns(sample(12.5, 5.0)) is None
    assert "simulated time" in (age.problem or "")


@pytest.mark.parametrize("limit_s", [LIMIT_S, None])
def test_stamps_that_run_too_slowly_are_named_as_the_cause(limit_s: float | None) -> None:
    driver = Driver(header_age(limit_s))
    driver.stream(0.0, 5.0, by_clock(0.0, rate=0.9))
    assert "run at 0.90 of real time" in (driver.age.problem or "")


def test_another_program_begins_without_the_problem_of_the_first() -> None:
    age = header_age()
    age.source_time_ns(sample(WALL_S, 50.0))
    assert age.problem is not None
    age.attend(is_here=True)
    assert age.problem is None


def test_under_hold_an_old_command_is_no_silence_that_arms() -> None:
    source = new_source(hold_s=0.6, headers=header_age())
    source.attend(b"program", 0.0, is_here=True)
    for n in range(40):
        now_s = n * 0.05
        assert source.heard(sample(WALL_S + now_s - 10.0, now_s, n + 1)) == []
        assert source.repeat(now_s) == []
    assert source.due_s() == pytest.approx(39 * 0.05 + 0.6)
    assert not math.isinf(source.due_s())
