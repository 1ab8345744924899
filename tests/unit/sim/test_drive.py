"""The drive's ramp: how fast the wheels may follow a command, in both axes, at every boundary."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.drive import STANDSTILL, Drive, DriveLimits, Twist, WheelGeometry

DT_S = 0.002


def _drive_at(linear_m_s: float, angular_rad_s: float) -> Drive:
    drive = Drive()
    drive.step((linear_m_s, angular_rad_s), 10.0)
    assert drive.twist == (linear_m_s, angular_rad_s)
    return drive


def test_speeding_up_takes_the_acceleration_and_slowing_down_the_braking_limit() -> None:
    drive = Drive()
    assert drive.step((1.0, 0.0), 0.1).linear_m_s == pytest.approx(0.1)
    assert drive.step((0.0, 0.0), 0.02).linear_m_s == pytest.approx(0.06)


def test_a_change_of_sign_brakes_to_zero_and_speeds_up_in_the_time_that_is_left() -> None:
    drive = _drive_at(0.2, 0.0)
    # 0.1 s of braking from 0.2 m/s, then 0.05 s at 1 m/s².
    assert drive.step((-1.0, 0.0), 0.15).linear_m_s == pytest.approx(-0.05)


def test_the_turn_rate_has_limits_of_its_own() -> None:
    drive = Drive()
    assert drive.step((0.0, -2.0), 0.1).angular_rad_s == pytest.approx(-0.4)
    assert drive.step((0.0, 0.0), 0.02).angular_rad_s == pytest.approx(-0.24)


def test_a_target_is_clamped_to_the_limits() -> None:
    drive = Drive()
    assert drive.step((5.0, -9.0), 10.0) == (1.0, -2.0)


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan)])
def test_a_target_that_is_not_finite_means_standstill(bad: tuple[float, float]) -> None:
    drive = _drive_at(0.5, 1.0)
    for _ in range(1000):
        drive.step(bad, DT_S)
    assert drive.twist == STANDSTILL


@pytest.mark.parametrize("start", [(1.0, 2.0), (1.0, 0.3), (-0.2, 2.0), (0.7, -0.01)])
def test_a_robot_that_brakes_on_an_arc_stays_on_this_arc(start: tuple[float, float]) -> None:
    drive = _drive_at(*start)
    curvature = start[1] / start[0]
    while (twist := drive.step((0.0, 0.0), DT_S)) != STANDSTILL:
        assert twist.angular_rad_s == pytest.approx(curvature * twist.linear_m_s, abs=1e-9)


def test_a_full_stop_from_full_speed_takes_half_a_second() -> None:
    drive = _drive_at(1.0, 2.0)
    steps = 0
    while drive.step((0.0, 0.0), DT_S) != STANDSTILL:
        steps += 1
    assert steps * DT_S == pytest.approx(0.5, abs=2 * DT_S)


SPEEDS = st.floats(-1.0, 1.0)
RATES = st.floats(-2.0, 2.0)


@given(v0=SPEEDS, w0=RATES, v1=SPEEDS, w1=RATES)
def test_no_axis_ever_changes_faster_than_its_limit_or_overshoots(
    v0: float, w0: float, v1: float, w1: float
) -> None:
    drive = _drive_at(v0, w0)
    before = drive.twist
    for _ in range(30):
        after = drive.step((v1, w1), DT_S)
        _assert_step_within(before.linear_m_s, after.linear_m_s, v1, 1.0, 2.0)
        _assert_step_within(before.angular_rad_s, after.angular_rad_s, w1, 4.0, 8.0)
        before = after


def _assert_step_within(before: float, after: float, target: float, speed_up: float, brake: float) -> None:
    assert abs(after) - abs(before) <= speed_up * DT_S + 1e-12
    assert abs(after - before) <= brake * DT_S + 1e-12
    assert min(before, target) - 1e-12 <= after <= max(before, target) + 1e-12


@given(v0=SPEEDS, w0=RATES, v1=SPEEDS, w1=RATES)
def test_every_target_within_the_limits_is_reached_exactly(
    v0: float, w0: float, v1: float, w1: float
) -> None:
    drive = _drive_at(v0, w0)
    for _ in range(50):
        drive.step((v1, w1), 0.05)
    assert drive.twist == (v1, w1)


def test_a_reset_forgets_the_motion() -> None:
    drive = _drive_at(1.0, 2.0)
    drive.reset()
    assert drive.twist == STANDSTILL


def test_turning_left_on_the_spot_turns_the_right_wheel_forward() -> None:
    wheels = WheelGeometry(radius_m=0.08, track_m=0.34)
    assert wheels.wheel_speeds(Twist(0.0, 1.0)) == pytest.approx((-2.125, 2.125))


@given(v=SPEEDS, omega=RATES)
def test_wheel_speeds_and_twist_are_each_other_s_inverse(v: float, omega: float) -> None:
    wheels = WheelGeometry(radius_m=0.08, track_m=0.34)
    assert wheels.twist(*wheels.wheel_speeds(Twist(v, omega))) == pytest.approx((v, omega), abs=1e-12)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_a_limit_that_is_not_positive_and_finite_is_refused_by_name(bad: float) -> None:
    with pytest.raises(ValueError, match=r"braking_m_s2 must be positive and finite"):
        DriveLimits(braking_m_s2=bad)
    with pytest.raises(ValueError, match=r"track_m must be positive and finite"):
        WheelGeometry(radius_m=0.08, track_m=bad)


def test_the_least_twist_that_a_float_can_say_is_braked_as_any_other() -> None:
    """It was not: the time that both axes take was zero, and the sim ended."""
    drive = Drive()
    while drive.twist != (5e-324, 5e-324):
        drive.step((5e-324, 5e-324), 0.002)
    assert drive.step((0.0, 0.0), 0.002) == STANDSTILL
