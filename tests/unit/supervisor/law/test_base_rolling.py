"""A base that rolls slowly at zero command."""

import math

import pytest

from supervisor.law.base_rolling import ROLLED_M, STOOD_S, WINDOW_S, watch
from supervisor.law.model import Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from tests.unit.supervisor.law.law_harness import FORWARD, NEUTRAL, TICK_S, Law
from wire.reasons import StopReason

ORIGIN = Pose(0.0, 0.0, 0.0)
RADIUS_M = 0.25


@pytest.mark.parametrize(
    "pose", [Pose(ROLLED_M, 0.0, 0.0), Pose(0.0, -ROLLED_M, 0.0), Pose(0.0, 0.0, -ROLLED_M / RADIUS_M)]
)
def test_a_base_rolls_just_beyond_three_centimetres_in_any_direction(pose: Pose) -> None:
    rest = watch(None, ORIGIN, 0.0, RADIUS_M)
    assert not watch(rest, pose, WINDOW_S, RADIUS_M).rolls
    beyond = Pose(*(math.nextafter(value, 2.0 * value) if value else 0.0 for value in pose))
    assert watch(rest, beyond, WINDOW_S, RADIUS_M).rolls


def test_the_window_begins_again_after_ten_seconds() -> None:
    rest = watch(None, ORIGIN, 0.0, RADIUS_M)
    near = Pose(0.02, 0.0, 0.0)
    assert watch(rest, near, WINDOW_S, RADIUS_M) == rest
    later = watch(rest, near, math.nextafter(WINDOW_S, 11.0), RADIUS_M)
    assert later.pose == near
    assert not watch(later, Pose(0.04, 0.0, 0.0), 15.0, RADIUS_M).rolls


def test_a_base_that_rolled_stands_after_two_seconds() -> None:
    rolling = watch(watch(None, ORIGIN, 0.0, RADIUS_M), Pose(0.04, 0.0, 0.0), 5.0, RADIUS_M)
    assert watch(rolling, rolling.pose, 5.0 + STOOD_S, RADIUS_M).rolls
    assert not watch(rolling, rolling.pose, math.nextafter(5.0 + STOOD_S, 8.0), RADIUS_M).rolls


def ticks_until_runaway(rolling: Velocity, seconds: float) -> int | None:
    law = Law()
    for tick in range(round(seconds / TICK_S)):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(rolling, law.now_s + TICK_S))
        if StopReason.BASE_RUNAWAY in law.decision.causes:
            return tick
    return None


@pytest.mark.parametrize("rolling", [Velocity(0.045, 0.0), Velocity(-0.005, 0.0), Velocity(0.0, 0.09)])
def test_a_base_that_rolls_slowly_at_zero_command_runs_away(rolling: Velocity) -> None:
    assert ticks_until_runaway(rolling, 15.0) is not None


def test_a_base_that_stands_or_drifts_by_two_millimetres_per_second_does_not_run_away() -> None:
    assert ticks_until_runaway(Velocity(0.002, 0.0), 60.0) is None


def test_it_drives_again_after_it_stood_still_and_a_neutral_command() -> None:
    law = Law()
    while StopReason.BASE_RUNAWAY not in law.decision.causes:
        law.tick(("teleop", NEUTRAL), odometry=Odometry(Velocity(0.045, 0.0), law.now_s + TICK_S))
    for _ in range(round(STOOD_S / TICK_S) + 3):
        law.tick(("teleop", FORWARD), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
        assert law.decision.output == STANDSTILL
    assert StopReason.BASE_RUNAWAY not in law.decision.causes
    law.tick(("teleop", NEUTRAL), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
    assert law.tick(("teleop", FORWARD), odometry=Odometry(STANDSTILL, law.now_s + TICK_S)).output == FORWARD
