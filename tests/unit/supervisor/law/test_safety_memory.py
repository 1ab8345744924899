"""Memory of points whose scan has no successor: no observed point is lost."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.model import Inputs, Odometry
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, TICK_S, Law, laser_scan, ring
from tests.unit.supervisor.law.test_safety_lidars import TWO, Lidars
from wire.reasons import StopReason

AHEAD_M = 0.6
"""From the lidar to a wall of 21 beams."""

TWIST = Velocity(0.2, 0.4)


def watching() -> Law:
    """One scan with the wall ahead; from then on, odometry says that the base moves."""
    law = Law(scanning=False)
    tick(law, ring(ahead_m=AHEAD_M))
    return law


def tick(law: Law, *scans: np.ndarray, **inputs: object) -> None:
    law.now_s += TICK_S
    arrived = tuple(laser_scan(ranges, law.now_s) for ranges in scans)
    law.step(Inputs(scans=arrived, odometry=Odometry(TWIST, law.now_s), **inputs))  # type: ignore[arg-type]


def remembered_ahead(law: Law) -> list[tuple[float, float]]:
    """The remembered points of the wall, as the odometer has placed them."""
    pose = law.state.sight.memory_pose
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return [
        (pose.x_m + cos * x_m - sin * y_m, pose.y_m + sin * x_m + cos * y_m)
        for x_m, y_m in law.state.sight.memory.points.tolist()
        if math.hypot(x_m, y_m) < 1.0
    ]


def is_the_wall(points: list[tuple[float, float]]) -> bool:
    return len(points) == 21 and all(
        math.hypot(*point) == pytest.approx(AHEAD_M, abs=1e-6) and abs(math.atan2(point[1], point[0])) < 0.18
        for point in points
    )


def garbled() -> np.ndarray:
    return ring()[:10]


def test_a_scan_that_proves_nothing_leaves_what_the_one_before_showed() -> None:
    law = watching()
    assert remembered_ahead(law) == []
    for _ in range(3):
        tick(law, garbled())
        assert law.state.sight.lidars[0].scan is not None
        assert len(law.state.sight.lidars[0].scan.around.points) == 0
        assert is_the_wall(remembered_ahead(law)), "kept once, however many scans prove nothing"


def test_what_was_kept_stays_when_the_next_scan_shows_nothing_there() -> None:
    law = watching()
    for _ in range(5):
        tick(law, garbled())
    tick(law, np.where(ring(ahead_m=AHEAD_M) < 1.0, np.float32(math.inf), ring()))
    assert len(remembered_ahead(law)) > 15


def test_a_single_return_is_kept_in_its_place_while_the_base_moves_on() -> None:
    law = Law(scanning=False)
    nothing = np.full(360, math.inf, dtype=np.float32)
    tick(law, np.where(np.arange(360) == 180, np.float32(AHEAD_M), nothing))
    tick(law, garbled())
    for _ in range(3):
        tick(law, nothing)
        (kept,) = remembered_ahead(law)
        assert math.hypot(*kept) == pytest.approx(AHEAD_M, abs=1e-6)


def test_what_cannot_be_decoded_keeps_what_was_shown_as_well() -> None:
    law = watching()
    tick(law, undecodable_lidars=(0,))
    tick(law, garbled())
    assert is_the_wall(remembered_ahead(law))


def test_a_suspend_keeps_what_was_shown() -> None:
    law = watching()
    tick(law, suspended_s=60.0)
    assert law.state.sight.lidars[0].scan is None
    assert is_the_wall(remembered_ahead(law))


def test_a_lidar_that_falls_silent_keeps_what_it_showed_although_the_other_goes_on() -> None:
    lidars = Lidars(config=replace(TWO, blind_creep_m_s=0.2))
    lidars.ranges[0] = ring(ahead_m=0.5)
    lidars.hold(0.1)
    lidars.speaking = (1,)
    lidars.hold(0.5)
    assert len(lidars.state.sight.memory.points) >= 21
    lidars.hold(0.1, Velocity(0.1, 0.0))
    assert lidars.decision.output == STANDSTILL
    assert lidars.decision.causes == (StopReason.OBSTACLE,)
    lidars.speaking = (0, 1)
    lidars.ranges[0] = ring()
    lidars.hold(0.5)
    assert len(lidars.state.sight.memory.points) == 0, "the wall has gone, as the first lidar sees again"


def test_a_scan_that_repeats_itself_while_the_base_moves_makes_nothing_newer() -> None:
    state, frozen = initial_state(CONFIG), ring(ahead_m=AHEAD_M)
    for number in range(3):
        now_s = 1000.0 + 0.05 * number
        scan: LaserScan = laser_scan(frozen, now_s)
        state, _ = step(state, now_s, Inputs(scans=(scan,), odometry=Odometry(Velocity(0.5, 0.0), now_s)))
    (sight,) = state.sight.lidars
    assert sight.scan is not None
    assert (sight.scan.taken_s, sight.scan.repeats) == (1000.0, 2)
    assert len(sight.scan.around.points) > 0
    assert len(state.sight.memory.points) == 0
    state, _ = step(state, 1000.2, Inputs(scans=(laser_scan(ring(), 1000.2),)))
    assert state.sight.lidars[0].scan is not None
    assert state.sight.lidars[0].scan.period_s == pytest.approx(0.2)


@pytest.mark.parametrize(
    "command", [Velocity(0.001, 0.0), Velocity(1e-9, 0.0), Velocity(0.004, 0.02), FORWARD]
)
def test_a_command_slower_than_the_slowest_useful_one_is_judged_as_that(command: Velocity) -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), scans=(laser_scan(ring(ahead_m=0.54), law.now_s + TICK_S),))
    for number in range(3):
        scan = laser_scan(ring(ahead_m=0.54) + np.float32(1e-5 * number), law.now_s + TICK_S)
        law.tick(("teleop", command), scans=(scan,))
        assert law.decision.output == STANDSTILL
        assert law.decision.reasons == (StopReason.OBSTACLE,)


@pytest.mark.parametrize("command", [Velocity(0.001, 0.002), Velocity(-0.001, 0.0), Velocity(0.0, 1e-9)])
def test_a_slow_command_with_nothing_near_is_passed_on_as_it_is(command: Velocity) -> None:
    law = Law()
    assert law.drive(command).output == command
