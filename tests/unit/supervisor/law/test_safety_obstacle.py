"""The speed barrier in the law: slow down, stop at 30 cm, and permit leaving."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.decision import Mode
from supervisor.law.model import Odometry
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.scan import BLANK_SHARE
from tests.unit.supervisor.law.law_harness import (
    BACK,
    CONFIG,
    CONFIRMED_S,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    SPIN,
    STANDING_S,
    TICK_S,
    UNSEEN_S,
    Law,
    odometry,
    ring,
)
from wire.reasons import StopReason

HULL_M = 0.25
STOP_M = 0.30


def test_something_inside_30_cm_ahead_stops_a_closing_command_at_once() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=HULL_M + STOP_M - 0.01)
    decision = law.tick(("teleop", FORWARD))
    assert decision.output == STANDSTILL
    assert decision.causes == (StopReason.OBSTACLE,)
    assert law.tick(("teleop", FORWARD)).reasons == (StopReason.OBSTACLE,)


def test_what_is_not_worth_moving_for_is_zero_from_the_first_scan_that_shows_it() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=HULL_M + STOP_M + 0.001)
    decision = law.tick(("teleop", FORWARD))
    assert (decision.mode, decision.output) == (Mode.LIMITED, STANDSTILL)


def test_it_stays_stopped_when_the_obstacle_walks_away_until_neutral() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=0.5)
    law.hold(CONFIRMED_S, ("teleop", FORWARD))
    law.ranges = ring()
    assert law.hold(3.0, ("teleop", FORWARD)).reasons == (StopReason.OBSTACLE,)
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


@pytest.mark.parametrize("escape", [BACK, SPIN, Velocity(-0.2, 0.7)])
def test_a_motion_that_does_not_close_on_it_needs_no_neutral(escape: Velocity) -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=0.5)
    assert law.hold(STANDING_S, ("teleop", FORWARD)).mode is Mode.STOPPED
    decision = law.tick(("teleop", escape))
    assert decision.output == escape
    assert decision.mode is Mode.DRIVING


def test_when_the_owner_is_stopped_nobody_else_drives_elsewhere_without_neutral() -> None:
    """Found by the model check: the constant command of another source was taken for an escape."""
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    law.hold(0.2, ("teleop", FORWARD), ("path", BACK))
    law.ranges = ring(ahead_m=0.5)
    assert law.hold(1.0, ("teleop", FORWARD), ("path", BACK)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    assert law.tick(("teleop", NEUTRAL), ("path", BACK)).output == BACK


def test_an_arc_that_was_stopped_for_what_lies_ahead_of_it_stays_stopped_until_neutral() -> None:
    """What stops an arc need not be closed on yet; the same command must not pass for an escape from it."""
    arc, stopped = Velocity(0.5, 2.0), 0
    for bearing in range(180, 300, 2):
        for distance_m in np.arange(0.551, 0.6, 0.004):
            law = Law()
            law.drive(arc)
            law.ranges[bearing] = distance_m
            if law.hold(CONFIRMED_S, ("teleop", arc)).mode is not Mode.STOPPED:
                continue
            stopped += 1
            law.ranges = ring()
            assert law.tick(("teleop", arc)).output == STANDSTILL, (bearing, distance_m)
    assert stopped > 50


def test_the_escape_is_itself_guarded() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(0.5)  # boxed in on all sides
    assert law.hold(STANDING_S, ("teleop", FORWARD)).mode is Mode.STOPPED
    assert law.tick(("teleop", BACK)).output == STANDSTILL
    assert law.tick(("teleop", SPIN)).output == SPIN


def test_near_something_it_slows_down_and_keeps_the_arc() -> None:
    law = Law()
    law.ranges = ring(ahead_m=0.75)
    decision = law.drive(Velocity(1.0, 0.4))
    assert decision.mode is Mode.LIMITED
    assert 0.0 < decision.scale < 1.0
    assert math.isclose(decision.output.angular_rad_s / decision.output.linear_m_s, 0.4)


def test_it_warns_inside_50_cm_without_stopping() -> None:
    law = Law()
    law.ranges = ring(ahead_m=HULL_M + 0.49)
    assert law.tick(("teleop", NEUTRAL)).warning
    assert law.decision.mode is Mode.READY
    law.ranges = ring(ahead_m=HULL_M + 0.51)
    assert not law.tick(("teleop", NEUTRAL)).warning


def test_it_says_where_the_nearest_point_is() -> None:
    law = Law()
    law.ranges[270] = 0.85
    law.tick()
    assert law.decision.nearest_m == pytest.approx(0.6, abs=2e-4)
    assert law.decision.nearest_bearing_rad == pytest.approx(math.pi / 2)


def test_a_reading_too_close_to_measure_is_an_obstacle() -> None:
    for reading in (-math.inf, 0.0, 0.01):
        law = Law()
        law.drive()
        law.ranges = ring(ahead_m=reading)
        assert law.tick(("teleop", FORWARD)).output == STANDSTILL
        assert law.tick(("teleop", FORWARD)).reasons == (StopReason.OBSTACLE,)


def test_a_lidar_on_which_nothing_has_ever_returned_proves_nothing() -> None:
    law = Law(room_m=math.inf)
    assert law.drive().reasons == (StopReason.SCAN_INVALID, StopReason.NO_COMMAND)
    assert "works_in_the_open" in law.decision.scan_problem
    law.ranges[180] = 5.0
    assert law.drive().output == FORWARD


def test_a_lidar_that_has_seen_something_may_see_nothing_from_then_on() -> None:
    law = Law(room_m=math.inf)
    law.ranges[180] = 5.0
    law.drive()
    law.ranges = ring(math.inf)
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_in_the_open_a_scan_that_sees_nothing_within_range_is_free() -> None:
    law = Law(config=replace(CONFIG, works_in_the_open=True), room_m=math.inf)
    assert law.drive().output == FORWARD
    assert math.isinf(law.decision.nearest_m)


def test_a_scan_that_is_all_nan_proves_nothing() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(math.nan)
    assert law.hold(BLANK_SHARE * SCAN_TIMEOUT_S + TICK_S, ("teleop", FORWARD)).reasons == (
        StopReason.SCAN_INVALID,
    )


def test_no_motion_into_a_blocked_sector_and_any_other_stays_free() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=math.nan)
    assert law.hold(UNSEEN_S, ("teleop", FORWARD)).reasons == (StopReason.SCAN_BLIND,)
    law.hold(STANDING_S, ("teleop", FORWARD))
    assert law.tick(("teleop", BACK)).output == BACK
    law.hold(STANDING_S, ("teleop", NEUTRAL))
    assert law.tick(("teleop", SPIN)).output == SPIN


def test_a_blocked_sector_is_filled_by_earlier_scans_for_one_timeout_and_no_longer() -> None:
    law = Law(now_s=0.0)
    law.drive()
    law.ranges = ring(ahead_m=math.nan)
    seen_s = law.now_s
    while law.tick(("teleop", FORWARD)).output == FORWARD:
        assert law.now_s - seen_s < 1.0
    assert law.now_s - TICK_S - seen_s <= SCAN_TIMEOUT_S < law.now_s - seen_s
    assert law.decision.reasons == (StopReason.SCAN_BLIND,), "latched at once"


def test_a_sector_that_is_seen_again_does_not_set_the_robot_going() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=math.nan)
    law.hold(UNSEEN_S, ("teleop", FORWARD))
    law.ranges = ring()
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_configured_creep_is_permitted_into_the_blind() -> None:
    law = Law(config=replace(CONFIG, blind_creep_m_s=0.1))
    law.ranges = ring(ahead_m=math.nan)
    law.hold(UNSEEN_S)
    decision = law.drive()
    assert decision.mode is Mode.LIMITED
    assert decision.output.linear_m_s == pytest.approx(0.1)


def test_an_empty_scan_proves_nothing() -> None:
    law = Law()
    law.drive()
    law.ranges = np.empty(0, dtype=np.float32)
    assert law.tick(("teleop", FORWARD)).reasons == (StopReason.SCAN_INVALID,)


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3, 0.57, 1.0])
def test_driven_straight_at_a_wall_it_comes_to_rest_at_30_cm(speed_m_s: float) -> None:
    """In plain kinematics with the base's own ramp: 1.0 m/s² up, 2.0 m/s² down, one tick late."""
    law = Law()
    law.tick(("teleop", NEUTRAL))
    distance_m, actual_m_s, nearest_m = 2.0, 0.0, math.inf
    for tick in range(1500):
        law.scanning = tick % 3 == 0  # 16.7 Hz: slower than the real one
        law.ranges = ring(ahead_m=HULL_M + distance_m)
        asked_m_s = law.tick(("teleop", Velocity(speed_m_s, 0.0))).output.linear_m_s
        actual_m_s = (
            max(asked_m_s, actual_m_s - 2.0 * TICK_S)
            if asked_m_s < actual_m_s
            else min(asked_m_s, actual_m_s + 1.0 * TICK_S)
        )
        distance_m -= actual_m_s * TICK_S
        nearest_m = min(nearest_m, distance_m)
    assert law.decision.reasons == (StopReason.OBSTACLE,)
    assert actual_m_s == 0.0
    assert STOP_M - 0.01 <= nearest_m <= STOP_M + 0.02


@pytest.mark.parametrize("velocity", [Velocity(0.0, 5e-324), Velocity(5e-324, 0.0), Velocity(5e-324, 5e-324)])
def test_the_least_motion_that_a_float_can_say_is_decided_as_any_other(velocity: Velocity) -> None:
    law = Law()
    law.drive()
    assert law.tick(("teleop", velocity)).output == velocity


def test_what_one_scan_showed_stays_while_later_ones_show_nothing_at_all_in_its_direction() -> None:
    """For longer than a timeout, so that no scan is filled from the one before it."""
    law = Law()
    law.hold(0.2, ("teleop", NEUTRAL))
    law.ranges = ring(ahead_m=1.0)
    law.hold(2 * TICK_S, ("teleop", NEUTRAL))
    law.ranges = ring(ahead_m=math.nan)
    for _ in range(20):
        law.hold(UNSEEN_S, ("teleop", NEUTRAL))
        assert law.decision.nearest_m == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize("twist", [Velocity(0.1, 0.0), Velocity(0.08, 0.05)])
def test_a_creep_into_the_blind_goes_on_while_the_robot_moves_between_two_scans(twist: Velocity) -> None:
    law = Law(config=replace(CONFIG, blind_creep_m_s=0.1))
    law.ranges = ring(ahead_m=math.nan)
    law.hold(UNSEEN_S)
    law.drive(twist)
    law.scanning = False
    for _ in range(5):
        assert law.tick(("teleop", twist), odometry=Odometry(twist, law.now_s + TICK_S)).output == twist


def test_what_is_remembered_comes_nearer_as_the_robot_drives() -> None:
    law = Law()
    law.ranges = ring(ahead_m=1.2)
    law.tick(odometry=odometry(0.0, law.now_s + TICK_S))
    law.ranges = ring(ahead_m=math.nan)
    for _ in range(50):
        law.tick(odometry=odometry(0.5, law.now_s + TICK_S))
    assert law.decision.nearest_m == pytest.approx(0.45, abs=0.03)
