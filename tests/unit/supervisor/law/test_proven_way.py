"""The way that odometry proves: a lidar is frozen only if its scans repeat although the base has moved."""

from collections import deque
from dataclasses import replace

import pytest

from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.model import Inputs, LawConfig, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.scan import FROZEN_TRAVEL_M
from tests.unit.supervisor.law.closed_loop import Base, World, advance
from tests.unit.supervisor.law.law_harness import (
    CONFIG,
    FORWARD,
    NEUTRAL,
    TICK_S,
    Law,
    laser_scan,
    on_time,
    ring,
)
from tests.unit.supervisor.law.test_silence import ROOM
from wire.reasons import StopReason

DEAD_S = 0.3
SLUGGISH = replace(CONFIG, base_dead_time_s=DEAD_S)
BLIND_BASE = replace(SLUGGISH, odometry=False)


def test_a_commanded_base_that_stands_by_odometry_has_proven_no_way_for_half_a_second() -> None:
    law = Law(SLUGGISH)
    for _ in range(20):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
    for number in range(30):
        law.tick(("teleop", FORWARD), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
        followed_s = max(0.0, number * TICK_S - PATIENCE_S)
        assert law.decision.output == FORWARD
        assert law.state.base.way_m == pytest.approx(number * TICK_S * 0.5)
        assert followed_s - 1e-9 <= law.state.base.proven_way_m / 0.5 < followed_s + PATIENCE_S + TICK_S
        assert (law.state.base.proven_way_m > 0.0) is (number > round(PATIENCE_S / TICK_S))


def test_the_patience_begins_again_with_each_command_after_a_stop() -> None:
    law = Law(SLUGGISH)
    for number in range(200):
        asked = NEUTRAL if number % 25 == 0 else FORWARD
        law.tick(("teleop", asked), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
    assert law.state.base.way_m > 1.0
    assert law.state.base.proven_way_m == 0.0


def test_a_base_that_moves_by_odometry_has_proven_its_way() -> None:
    law = Law(SLUGGISH)
    turning = Velocity(-0.2, 0.4)
    for _ in range(10):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(turning, law.now_s + TICK_S))
    assert law.state.base.proven_way_m == pytest.approx(10 * TICK_S * (0.2 + 0.4 * 0.25))


@pytest.mark.parametrize("dead_s", [0.0, 0.1, DEAD_S, 0.5])
def test_without_odometry_a_command_proves_a_way_a_dead_time_later(dead_s: float) -> None:
    law = Law(replace(BLIND_BASE, base_dead_time_s=dead_s))
    law.hold(0.1, ("teleop", NEUTRAL))
    for number in range(50):
        law.tick(("teleop", FORWARD))
        late_s = law.state.base.way_m / 0.5 - law.state.base.proven_way_m / 0.5
        assert late_s == pytest.approx(min(number * TICK_S, dead_s), abs=TICK_S + 1e-9)


def drive_at_the_wall(
    config: LawConfig, *, odometry: bool, freezes: bool = False, world: World = ROOM
) -> Law:
    """Drive a base with a dead time and a lidar without noise for 4 s; return the law, with the first stop if any."""
    law, base, pose = Law(config, scanning=False), Base(), Pose(0.0, 0.0, 0.0)
    outputs = deque([STANDSTILL] * round(DEAD_S / TICK_S))
    for tick in range(200):
        outputs.append(law.decision.output)
        twist = base.step(outputs.popleft(), TICK_S)
        pose = advance(pose, twist, TICK_S)
        law.now_s += TICK_S
        scan = laser_scan(world.ranges(*(Pose(0.0, 0.0, 0.0) if freezes else pose)), law.now_s)
        command = on_time("teleop", NEUTRAL if tick < 10 else FORWARD, law.now_s)
        moving = Odometry(twist, law.now_s) if odometry else None
        law.step(Inputs((command,), scans=(scan,) if tick % 2 == 0 else (), odometry=moving))
        if tick >= 10 and law.decision.reasons:
            break
    assert freezes or pose.x_m > 1.3
    return law


@pytest.mark.parametrize("odometry", [True, False])
def test_a_lidar_without_noise_is_not_frozen_while_the_base_has_not_moved_yet(*, odometry: bool) -> None:
    config = SLUGGISH if odometry else BLIND_BASE
    assert drive_at_the_wall(config, odometry=odometry).decision.reasons == ()


def test_a_dead_time_that_is_not_configured_freezes_no_lidar_either() -> None:
    assert drive_at_the_wall(CONFIG, odometry=True).decision.reasons == ()


@pytest.mark.parametrize("odometry", [True, False])
def test_a_frozen_lidar_stops_the_robot_after_two_centimetres(*, odometry: bool) -> None:
    law = drive_at_the_wall(SLUGGISH if odometry else BLIND_BASE, odometry=odometry, freezes=True)
    assert law.decision.reasons == (StopReason.SCAN_INVALID,)
    assert FROZEN_TRAVEL_M < law.state.base.proven_way_m < FROZEN_TRAVEL_M + 2 * TICK_S * 0.5


def test_a_frozen_lidar_stops_the_robot_although_odometry_is_stuck_at_zero() -> None:
    """Commands count once a base must have followed them: the base moves, and neither sensor shows it."""
    law = Law(SLUGGISH, scanning=False)
    for tick in range(100):
        asked = NEUTRAL if tick < 10 else FORWARD
        law.now_s += TICK_S
        command, still = on_time("teleop", asked, law.now_s), Odometry(STANDSTILL, law.now_s)
        law.step(Inputs((command,), scans=(laser_scan(ring(), law.now_s),), odometry=still))
        if tick >= 10 and law.decision.reasons:
            break
    assert law.decision.reasons == (StopReason.SCAN_INVALID,)
    assert law.state.base.way_m < 0.5 * (PATIENCE_S + 6 * TICK_S)


def test_a_lidar_that_is_frozen_at_rest_proves_no_way_by_the_noise_of_odometry() -> None:
    law = Law(scanning=False)
    for tick in range(1000):
        law.now_s += TICK_S
        noise = Odometry(Velocity(0.04 * (-1) ** tick if tick > 60 else 0.0, 0.0), law.now_s)
        law.step(
            Inputs(
                (on_time("teleop", NEUTRAL, law.now_s),),
                scans=(laser_scan(ring(), law.now_s),),
                odometry=noise,
            )
        )
    assert law.decision.reasons == ()
