"""Odometry from encoders: how it counts, how it drifts, and whether it knows how far."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.drive import Twist, WheelGeometry
from sim.motion_sensors import MAX_ERROR, PERFECT, EncoderConfig, Odometer, Reckoning

WHEELS = WheelGeometry(radius_m=0.08, track_m=0.34)
PERIOD_S = 0.02


def drive(odometer: Odometer, *legs: tuple[float, float, float]) -> Reckoning:
    """Drive (v, ω, duration) legs without any slip; returns the last reading."""
    left_rad = right_rad = 0.0
    reckoning = odometer.read(left_rad, right_rad, PERIOD_S)
    for linear_m_s, angular_rad_s, duration_s in legs:
        left, right = WHEELS.wheel_speeds(Twist(linear_m_s, angular_rad_s))
        for _ in range(round(duration_s / PERIOD_S)):
            left_rad += left * PERIOD_S
            right_rad += right * PERIOD_S
            reckoning = odometer.read(left_rad, right_rad, PERIOD_S)
    return reckoning


def test_without_errors_it_is_right_to_a_tick() -> None:
    reckoning = drive(Odometer(WHEELS, PERFECT), (0.5, 0.0, 4.0), (0.0, math.pi / 4, 2.0), (0.5, 0.0, 2.0))
    assert reckoning[:3] == pytest.approx((2.0, 1.0, math.pi / 2), abs=0.001)
    assert reckoning.linear_m_s == pytest.approx(0.5, abs=0.002)
    assert reckoning.angular_rad_s == pytest.approx(0.0, abs=0.005)


def test_a_wheel_that_turns_by_less_than_a_tick_is_not_seen() -> None:
    odometer = Odometer(WHEELS, EncoderConfig(ticks=100))
    tick_rad = math.tau / 100
    odometer.reset(0.5 * tick_rad, 0.5 * tick_rad)
    assert odometer.read(0.99 * tick_rad, 0.99 * tick_rad, PERIOD_S)[:5] == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert odometer.read(1.01 * tick_rad, 1.01 * tick_rad, PERIOD_S).linear_m_s > 0.0


def test_backwards_counts_like_forwards() -> None:
    reckoning = drive(Odometer(WHEELS, PERFECT), (-0.5, 0.0, 2.0))
    assert reckoning.x_m == pytest.approx(-1.0, abs=0.001)
    assert reckoning.linear_m_s == pytest.approx(-0.5, abs=0.002)


@pytest.mark.parametrize("error", [0.01, -0.01])
def test_wheels_taken_for_larger_make_the_way_longer_by_the_same_share(error: float) -> None:
    config = EncoderConfig(left_error=error, right_error=error, track_error=0.0, noise_m=0.0)
    assert drive(Odometer(WHEELS, config), (1.0, 0.0, 10.0)).x_m == pytest.approx(
        10.0 * (1.0 + error), abs=0.001
    )


def test_wheels_of_different_size_make_a_straight_way_an_arc() -> None:
    config = EncoderConfig(left_error=0.0, right_error=0.01, track_error=0.0, noise_m=0.0)
    reckoning = drive(Odometer(WHEELS, config), (1.0, 0.0, 10.0))
    assert reckoning.yaw_rad == pytest.approx(0.01 * 10.0 / 0.34, abs=0.001)
    assert reckoning.y_m > 1.0


def test_a_track_taken_for_wider_makes_a_turn_smaller_by_the_same_share() -> None:
    config = EncoderConfig(left_error=0.0, right_error=0.0, track_error=0.02, noise_m=0.0)
    assert drive(Odometer(WHEELS, config), (0.0, 1.0, 3.0)).yaw_rad == pytest.approx(3.0 / 1.02, abs=0.001)


def test_by_default_ten_metres_drift_by_centimetres_and_a_turn_by_half_a_degree() -> None:
    ahead = drive(Odometer(WHEELS), (1.0, 0.0, 10.0))
    assert 0.01 < math.dist((ahead.x_m, ahead.y_m), (10.0, 0.0)) < 0.15
    turn = drive(Odometer(WHEELS), (0.0, 1.0, math.pi / 2))
    assert 0.001 < abs(turn.yaw_rad - math.pi / 2) < math.radians(1.0)


def test_a_robot_at_rest_does_not_drift() -> None:
    odometer = Odometer(WHEELS)
    before = drive(odometer, (0.3, 0.1, 1.0))
    left_rad = right_rad = 0.3 / 0.08
    rest = odometer.read(left_rad, right_rad, PERIOD_S)
    for _ in range(500):
        rest = odometer.read(left_rad, right_rad, PERIOD_S)
    assert rest[3:5] == (0.0, 0.0)
    assert math.dist(before[:2], rest[:2]) < 0.02
    np.testing.assert_array_equal(
        rest.pose_covariance, odometer.read(left_rad, right_rad, PERIOD_S).pose_covariance
    )


def test_the_same_seed_makes_the_same_drift_and_another_another() -> None:
    legs = ((0.5, 0.3, 5.0),)
    first = drive(Odometer(WHEELS, seed=1), *legs)
    assert drive(Odometer(WHEELS, seed=1), *legs)[:3] == first[:3]
    assert drive(Odometer(WHEELS, seed=2), *legs)[:3] != first[:3]


def test_a_reset_starts_at_the_origin_from_wherever_the_wheels_are() -> None:
    odometer = Odometer(WHEELS)
    drive(odometer, (1.0, 0.5, 5.0))
    odometer.reset(123.0, -45.0)
    reckoning = odometer.read(123.0, -45.0, PERIOD_S)
    assert reckoning[:5] == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert math.sqrt(reckoning.pose_covariance[0, 0]) < 1e-4


# Legs that go far, turn, and come back; errors and noise of either sign are those of many robots of one make.
TOUR = ((0.8, 0.0, 5.0), (0.3, 0.8, 4.0), (0.8, -0.1, 5.0), (-0.4, 0.2, 3.0))


@pytest.mark.proof
def test_its_covariance_is_as_large_as_its_error_is_over_many_robots() -> None:
    true = drive(Odometer(WHEELS, PERFECT), *TOUR)
    robots = np.random.default_rng(5)
    errors: list[list[float]] = []
    for seed in range(80):
        left, right, track = (robots.normal(0.0, (0.003, 0.0025, 0.005))).tolist()
        off = drive(Odometer(WHEELS, EncoderConfig(16384, left, right, track), seed), *TOUR)
        errors.append([off[0] - true[0], off[1] - true[1], math.remainder(off[2] - true[2], math.tau)])
    seen = np.sqrt(np.mean(np.square(errors), axis=0))
    of_such = EncoderConfig(left_error=0.003, right_error=0.0025, track_error=0.005)
    said = np.sqrt(np.diag(drive(Odometer(WHEELS, of_such), *TOUR).pose_covariance))
    print(f"\n    measured: drift of 80 robots (x, y, yaw) {seen.round(4)}, said {said.round(4)}")
    np.testing.assert_allclose(said, seen, rtol=0.25)


@given(
    left=st.floats(-MAX_ERROR, MAX_ERROR),
    right=st.floats(-MAX_ERROR, MAX_ERROR),
    track=st.floats(-MAX_ERROR, MAX_ERROR),
    noise_m=st.floats(0.0, 0.1),
    ways_rad=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=20),
)
def test_its_covariances_are_covariances(
    left: float, right: float, track: float, noise_m: float, ways_rad: list[tuple[float, float]]
) -> None:
    odometer = Odometer(WHEELS, EncoderConfig(1000, left, right, track, noise_m))
    left_rad = right_rad = 0.0
    for left_way_rad, right_way_rad in ways_rad:
        left_rad, right_rad = left_rad + left_way_rad, right_rad + right_way_rad
        reckoning = odometer.read(left_rad, right_rad, PERIOD_S)
        for matrix in (reckoning.pose_covariance, reckoning.twist_covariance):
            np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
            assert np.min(np.linalg.eigvalsh(matrix)) > 0.0
