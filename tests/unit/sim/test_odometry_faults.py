"""What odometry with faults says of the way."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.motion_sensors import Reckoning
from sim.sensor_faults import NO_FAULTS, FaultyOdometry, parse_faults

STEP_S = 0.02


def reading(x_m: float, y_m: float, yaw_rad: float, linear: float = 0.5, angular: float = 0.2) -> Reckoning:
    return Reckoning(x_m, y_m, yaw_rad, linear, angular, np.zeros((3, 3)), np.zeros((2, 2)))


def arc(steps: int, linear: float = 0.5, angular: float = 0.2) -> list[Reckoning]:
    """A way from the origin; each reading has the mean heading of its step, as the encoders count it."""
    x_m = y_m = yaw_rad = 0.0
    found: list[Reckoning] = []
    for _ in range(steps):
        heading = yaw_rad + 0.5 * angular * STEP_S
        x_m += linear * STEP_S * math.cos(heading)
        y_m += linear * STEP_S * math.sin(heading)
        yaw_rad = math.remainder(yaw_rad + angular * STEP_S, math.tau)
        found.append(reading(x_m, y_m, yaw_rad, linear, angular))
    return found


def said(faulty: FaultyOdometry, text: str, counted: Reckoning) -> Reckoning:
    found = faulty.spoil(parse_faults(text), counted)
    assert found is not None
    return found


def test_without_faults_everything_is_said_as_it_was_counted_to_the_last_bit() -> None:
    faulty = FaultyOdometry()
    for counted in arc(500):
        found = faulty.spoil(NO_FAULTS, counted)
        assert found is not None
        assert found[:5] == counted[:5]
        assert found.pose_covariance is counted.pose_covariance


def test_zero_says_that_the_robot_stands_where_it_was_and_the_way_is_lost() -> None:
    faulty = FaultyOdometry()
    said(faulty, "none", reading(1.0, 0.0, 0.0))
    for x_m in (1.1, 1.5, 2.0):
        assert said(faulty, "odom_zero", reading(x_m, 0.0, 0.0))[:5] == (1.0, 0.0, 0.0, 0.0, 0.0)
    assert said(faulty, "none", reading(2.5, 0.0, 0.0))[:5] == (1.5, 0.0, 0.0, 0.5, 0.2)


def test_frozen_odometry_repeats_its_first_reading_and_then_reports_the_whole_way() -> None:
    faulty = FaultyOdometry()
    first = said(faulty, "odom_freeze", reading(1.0, 0.0, 0.1))
    assert first[:5] == (1.0, 0.0, 0.1, 0.5, 0.2)
    assert said(faulty, "odom_freeze", reading(2.0, 0.0, 0.2, 0.9)) == first
    assert said(faulty, "none", reading(3.0, 0.0, 0.3))[:3] == (3.0, 0.0, 0.3)
    assert said(faulty, "odom_freeze", reading(4.0, 0.0, 0.3))[:3] == (4.0, 0.0, 0.3), "it froze anew"


@pytest.mark.parametrize("factor", [0.5, 1.5, -1.0])
def test_a_scale_is_of_way_and_turn_and_velocity(factor: float) -> None:
    """A straight way and a turn on the spot, so that the end is known in a closed form."""
    faulty = FaultyOdometry()
    text = f"odom_scale {factor}"
    half = said(faulty, text, reading(2.0, 0.0, 0.0, 0.5, 0.0))
    assert half[:5] == pytest.approx((2.0 * factor, 0.0, 0.0, 0.5 * factor, 0.0))
    turned = said(faulty, text, reading(2.0, 0.0, 1.0, 0.0, 2.0))
    assert turned[:5] == pytest.approx((2.0 * factor, 0.0, factor, 0.0, 2.0 * factor))


@given(linear=st.floats(-1.0, 1.0), angular=st.floats(-2.0, 2.0), factor=st.floats(-2.0, 2.0))
def test_a_scaled_way_is_the_way_of_a_robot_that_is_as_much_faster(
    linear: float, angular: float, factor: float
) -> None:
    """The headings within a step differ by their half turn at most: 0.03 rad, of a way of 1 m."""
    faulty = FaultyOdometry()
    found = [said(faulty, f"odom_scale {factor!r}", counted) for counted in arc(50, linear, angular)][-1]
    expected = arc(50, factor * linear, factor * angular)[-1]
    assert found[:2] == pytest.approx(expected[:2], abs=0.09)
    assert math.cos(found.yaw_rad - expected.yaw_rad) == pytest.approx(1.0, abs=1e-9)


def test_after_a_scale_the_pose_goes_on_from_where_it_was_said_to_be() -> None:
    faulty = FaultyOdometry()
    said(faulty, "odom_scale 2", reading(1.0, 0.0, 0.5 * math.pi))
    after = said(faulty, "none", reading(1.0, 1.0, 0.5 * math.pi))
    assert after[:3] == pytest.approx((1.0, 0.0, math.pi)), "1 m ahead, which is back by now"


def test_silence_loses_nothing_of_the_way() -> None:
    faulty = FaultyOdometry()
    assert faulty.spoil(parse_faults("no_odom"), reading(1.0, 0.0, 0.0)) is None
    assert said(faulty, "none", reading(2.0, 0.0, 0.0))[:3] == (2.0, 0.0, 0.0)


def test_after_a_reset_it_begins_at_the_origin_with_no_old_error() -> None:
    faulty = FaultyOdometry()
    said(faulty, "odom_scale 2", reading(1.0, 0.0, 0.0))
    faulty.reset()
    assert said(faulty, "none", reading(0.1, 0.0, 0.0))[:3] == (0.1, 0.0, 0.0)
