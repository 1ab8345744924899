"""A base and a lidar that react late, brake weakly, or lose everything above them: the law drives straight at a wall."""

import math
from collections import deque
from dataclasses import dataclass, replace

import pytest

from supervisor.config import UNMEASURED_M_S
from supervisor.law import permission
from supervisor.law.base_braking import KEPT, Braking
from supervisor.law.decision import Mode
from supervisor.law.model import LawConfig, Odometry
from supervisor.law.permission import TOUCH_M
from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    CONFIG,
    NEUTRAL,
    TICK_S,
    Law,
    ring,
    with_lidar,
)

HULL_M = 0.25
FULL = Velocity(1.0, 0.0)


@dataclass(frozen=True)
class Robot:
    """What the base and the lidar really do."""

    braking_m_s2: float = 1.5
    dead_s: float = 0.0
    latency_s: float = 0.0
    timeout_s: float = 0.15


class Drive:
    """The law drives a robot straight ahead: at a wall, or in free space."""

    def __init__(self, config: LawConfig, robot: Robot, clearance_m: float = math.inf) -> None:
        self.law = Law(replace(config, blind_budget_m=math.inf), room_m=9.0)
        self.robot, self.clearance_m, self.speed_m_s = robot, clearance_m, 0.0
        self._seen = deque([clearance_m] * (1 + round(robot.latency_s / TICK_S)))
        self._pending = deque([STANDSTILL] * round(robot.dead_s / TICK_S))

    def decide(self, wanted: Velocity) -> Velocity:
        """The decision of the next tick."""
        law, ahead_m = self.law, self._seen[0] + HULL_M
        law.ranges = ring(9.0, ahead_m=min(9.0, ahead_m))
        law.tick(("teleop", wanted), odometry=Odometry(Velocity(self.speed_m_s, 0.0), law.now_s + TICK_S))
        return law.decision.output

    def move(self, sent: Velocity) -> None:
        """The base moves for a tick."""
        self._pending.append(sent)
        target_m_s = self._pending.popleft().linear_m_s
        before_m_s = self.speed_m_s
        slowest_m_s = before_m_s - self.robot.braking_m_s2 * TICK_S
        self.speed_m_s = (
            max(target_m_s, slowest_m_s, 0.0)
            if target_m_s < before_m_s
            else min(target_m_s, before_m_s + TICK_S)
        )
        self.clearance_m -= (before_m_s + self.speed_m_s) / 2.0 * TICK_S
        self._seen.append(self.clearance_m)
        self._seen.popleft()


def shown_by(robot: Robot, *, stops: int, config: LawConfig = CONFIG, speed_m_s: float = 1.0) -> Braking:
    """What some stops in free space show."""
    drive = Drive(config, robot)
    for wanted, seconds in [(NEUTRAL, 0.2), *[(Velocity(speed_m_s, 0.0), 2.0), (NEUTRAL, 4.0)] * stops]:
        for _ in range(round(seconds / TICK_S)):
            drive.move(drive.decide(wanted))
    return drive.law.state.base.braking


def nearest_m(
    config: LawConfig,
    robot: Robot,
    *,
    start_m: float = 2.5,
    dies_at_m: float = -math.inf,
    braking: Braking | None = None,
) -> float:
    """Drive straight at a wall, and return the least clearance [m].

    Args:
        config: the configuration of the law.
        robot: the robot.
        start_m: the clearance at the start.
        dies_at_m: the clearance at which everything above the base dies; by default, nothing dies.
        braking: what earlier stops have shown.
    """
    drive = Drive(config, robot, start_m)
    law = drive.law
    if braking is not None:
        law.state = law.state._replace(base=law.state.base._replace(braking=braking))
    sent, dead_s, ticks = STANDSTILL, -math.inf, 0
    while ticks < 20 or drive.speed_m_s > 0.0:
        ticks += 1
        assert ticks < 2000, "the robot never stops"
        if dead_s == -math.inf and drive.clearance_m <= dies_at_m:
            dead_s = ticks * TICK_S
        if dead_s == -math.inf:
            sent = drive.decide(NEUTRAL if ticks < 10 or law.decision.reasons else FULL)
        elif ticks * TICK_S - dead_s >= robot.timeout_s - 1e-9:
            sent = STANDSTILL
        drive.move(sent)
    return drive.clearance_m


def test_a_base_as_configured_keeps_the_stop_distance() -> None:
    assert nearest_m(CONFIG, Robot()) >= 0.29


@pytest.mark.parametrize("braking_m_s2", [1.1, 0.75])
def test_the_base_brakes_worse_than_configured_and_the_law_has_seen_it(braking_m_s2: float) -> None:
    robot = Robot(braking_m_s2=braking_m_s2)
    assert nearest_m(CONFIG, robot) < 0.285
    shown = Braking(shown_m_s2=(braking_m_s2,) * KEPT)
    assert nearest_m(CONFIG, robot, braking=shown) >= 0.285


@pytest.mark.parametrize("dead_s", [0.1, 0.2])
def test_a_command_acts_late_and_the_configuration_says_so(dead_s: float) -> None:
    robot = Robot(dead_s=dead_s)
    assert nearest_m(CONFIG, robot) < 0.285
    assert nearest_m(replace(CONFIG, base_dead_time_s=dead_s), robot) >= 0.285


@pytest.mark.parametrize("dead_s", [0.1, 0.15, 0.2])
@pytest.mark.parametrize("speed_m_s", [0.5, 1.0])
def test_a_command_acts_late_and_two_stops_have_shown_it(dead_s: float, speed_m_s: float) -> None:
    robot = Robot(dead_s=dead_s)
    shown = shown_by(robot, stops=2, speed_m_s=speed_m_s)
    acts_s = round(dead_s / TICK_S) * TICK_S
    assert shown.shown_dead_s == pytest.approx((acts_s, acts_s), abs=1e-3)
    assert nearest_m(CONFIG, robot) < 0.285
    assert nearest_m(CONFIG, robot, braking=shown) >= 0.285


@pytest.mark.parametrize("start_m", [0.4, 0.5, 0.6, 0.7, 0.85, 1.0, 1.5, 2.5])
def test_a_base_of_which_nothing_is_known_does_not_touch(start_m: float) -> None:
    """It brakes with a third of the default, after a dead time of 0.2 s."""
    robot = Robot(braking_m_s2=0.5, dead_s=0.2)
    assert nearest_m(replace(CONFIG, unmeasured_m_s=UNMEASURED_M_S), robot, start_m=start_m) >= 0.05
    if start_m > 1.0:
        assert nearest_m(CONFIG, robot, start_m=start_m) < 0.0


@pytest.mark.parametrize("braking_m_s2", [0.75, 1.5, 2.0])
def test_a_base_without_dead_time_drives_as_before_its_stops(braking_m_s2: float) -> None:
    robot = Robot(braking_m_s2=braking_m_s2)
    shown = shown_by(robot, stops=3)
    assert shown.shown_dead_s == (0.0, 0.0, 0.0)
    if braking_m_s2 >= 1.5:
        assert nearest_m(CONFIG, robot, braking=shown) == nearest_m(CONFIG, robot)


@pytest.mark.parametrize("start_m", [0.5, 0.7, 0.9])
def test_without_odometry_the_dead_time_of_an_accelerating_base_is_counted_twice(start_m: float) -> None:
    late = replace(CONFIG, odometry=False, base_dead_time_s=0.2)
    assert nearest_m(late, Robot(dead_s=0.2), start_m=start_m) >= 0.285
    assert late.late_s - late.transport_s == pytest.approx(0.4)
    assert replace(late, odometry=True).late_s - late.transport_s == pytest.approx(0.2)


@pytest.mark.parametrize("latency_s", [0.1, 0.16])
def test_scans_come_late_and_the_configuration_says_so(latency_s: float) -> None:
    robot = Robot(latency_s=latency_s)
    assert nearest_m(CONFIG, robot) < 0.285
    assert nearest_m(with_lidar(CONFIG, latency_s=latency_s), robot) >= 0.285


@pytest.mark.parametrize("timeout_s", [0.15, 0.3, 0.5])
@pytest.mark.parametrize("dies_at_m", [0.4, 0.5, 0.7, 1.0])
def test_the_hull_does_not_touch_if_everything_above_the_base_dies(
    timeout_s: float, dies_at_m: float
) -> None:
    robot = Robot(timeout_s=timeout_s)
    assert nearest_m(replace(CONFIG, base_timeout_s=timeout_s), robot, dies_at_m=dies_at_m) >= TOUCH_M - 0.005


def test_with_a_timeout_that_the_law_does_not_know_the_hull_may_touch() -> None:
    assert nearest_m(CONFIG, Robot(timeout_s=0.5), dies_at_m=0.75) < 0.0


def permitted_m_s(timeout_s: float, clearance_m: float) -> float:
    law = Law(replace(ANY_AGE, base_timeout_s=timeout_s), room_m=9.0)
    law.ranges = ring(9.0, ahead_m=clearance_m + HULL_M)
    law.drive(FULL)
    return law.decision.output.linear_m_s


def test_a_long_base_timeout_costs_speed_only_where_the_hull_would_touch() -> None:
    lost_m_s = 1.5 * (0.5 + CONFIG.transport_s)
    touch_m_s = math.sqrt(lost_m_s**2 + 2 * 1.5 * (0.7 - TOUCH_M)) - lost_m_s
    assert permitted_m_s(0.5, 0.7) == pytest.approx(touch_m_s, rel=0.01)
    assert permitted_m_s(0.15, 0.7) == pytest.approx(1.0)
    assert permitted_m_s(0.5, 0.4) == permitted_m_s(0.15, 0.4), "the stop distance limits more"


def test_the_latency_of_a_lidar_is_part_of_the_age_of_its_scans() -> None:
    law = Law(with_lidar(CONFIG, latency_s=0.1))
    law.hold(0.5, ("teleop", NEUTRAL))
    assert law.decision.scan_age_s == pytest.approx(0.1)
    law.scanning = False
    assert law.hold(0.12, ("teleop", FULL)).mode is Mode.DRIVING
    assert law.hold(0.06, ("teleop", FULL)).mode is Mode.STOPPED


def test_a_base_with_a_dead_time_runs_away_only_after_it() -> None:
    assert CONFIG.base_dead_time_s == 0.0
    alarms_s: list[float] = []
    for dead_s in (0.0, 0.2):
        law = Law(replace(CONFIG, base_dead_time_s=dead_s))
        began_s = law.now_s
        while not law.decision.alarm:
            law.tick(("teleop", NEUTRAL), odometry=Odometry(Velocity(0.2, 0.0), law.now_s + TICK_S))
        alarms_s.append(law.now_s - began_s)
    assert alarms_s[1] - alarms_s[0] == pytest.approx(0.2, abs=TICK_S / 2)


@pytest.mark.parametrize(("farther_m", "bounds"), [(0.2499, 1), (0.2501, 2), (0.3, 2)])
def test_the_bound_of_a_base_that_is_left_alone_is_computed_where_it_may_be_lower(
    farther_m: float, bounds: int
) -> None:
    """At 1 m/s, it allows 0.25 m more than the stop distance."""
    config = replace(CONFIG, base_timeout_s=farther_m + 0.05, base_dead_time_s=0.1)
    found = permission.barriers(config, 0.0, 0.05, 1.0)  # pyright: ignore[reportPrivateUsage]
    assert len(found) == bounds
    assert {barrier.dead_time_s for barrier in found} == {0.1}
    assert found[-1].stop_distance_m == (config.stop_distance_m if bounds == 1 else permission.TOUCH_M)
