"""Where the robot has gone since a scan, by odometry."""

import math

import pytest

from supervisor.reckoning import LONGEST_S, STANDSTILL, Odometer, Pose, Velocity, displacement, reckon

FASTEST = Velocity(2.0, 4.0)
HERE = Pose(3.0, -2.0, 0.5)


def start(velocity: Velocity, pose: Pose = HERE) -> Odometer:
    return Odometer(pose, velocity=velocity, at_s=10.0)


def test_a_velocity_holds_until_the_next_one_comes() -> None:
    after = reckon(start(Velocity(1.0, 0.0), Pose(0.0, 0.0, 0.0)), Velocity(0.5, 0.2), 10.1, FASTEST)
    assert after.pose == pytest.approx((0.1, 0.0, 0.0))
    assert after.velocity == Velocity(0.5, 0.2)
    assert after.at_s == 10.1


def test_an_arc_backwards_ends_where_it_began() -> None:
    there = reckon(start(Velocity(1.0, -2.0)), Velocity(-1.0, 2.0), 10.1, FASTEST)
    back = reckon(there, STANDSTILL, 10.2, FASTEST)
    assert back.pose == pytest.approx(HERE, abs=1e-9)


def test_an_arc_is_taken_at_its_middle_heading() -> None:
    after = reckon(start(Velocity(1.0, 2.0), Pose(0.0, 0.0, 0.0)), STANDSTILL, 10.2, FASTEST)
    assert after.pose == pytest.approx((0.2 * math.cos(0.2), 0.2 * math.sin(0.2), 0.4))


@pytest.mark.parametrize("velocity", [FASTEST, Velocity(-2.0, -4.0)])
def test_a_velocity_up_to_the_fastest_is_believed(velocity: Velocity) -> None:
    assert reckon(start(STANDSTILL), velocity, 10.1, FASTEST).velocity == velocity


@pytest.mark.parametrize(
    "velocity", [Velocity(math.nextafter(2.0, 3.0), 0.0), Velocity(0.0, -4.1), Velocity(31.0, 0.0)]
)
def test_a_spike_counts_as_standing(velocity: Velocity) -> None:
    assert reckon(start(STANDSTILL), velocity, 10.1, FASTEST).velocity == STANDSTILL


def test_silent_odometry_holds_for_so_long_and_no_longer() -> None:
    odometer = start(Velocity(1.0, 0.0), Pose(0.0, 0.0, 0.0))
    origin = Pose(0.0, 0.0, 0.0)
    assert displacement(odometer, origin, 10.0 + LONGEST_S / 2) == pytest.approx((LONGEST_S / 2, 0.0, 0.0))
    assert displacement(odometer, origin, 99.0) == pytest.approx((LONGEST_S, 0.0, 0.0))
    assert displacement(odometer, origin, 9.0) is None


def test_a_displacement_is_told_in_the_frame_of_then() -> None:
    then = Pose(1.0, 2.0, math.pi / 2)
    odometer = Odometer(Pose(1.0 - 0.3, 2.0 + 0.5, math.pi / 2 + 0.2))
    assert displacement(odometer, then, 0.0) == pytest.approx((0.5, 0.3, 0.2))
    turned = Pose(0.0, 0.0, 0.3)
    x_m, y_m = 0.4 * math.cos(0.3) - 0.1 * math.sin(0.3), 0.4 * math.sin(0.3) + 0.1 * math.cos(0.3)
    assert displacement(Odometer(Pose(x_m, y_m, 0.3)), turned, 0.0) == pytest.approx((0.4, 0.1, 0.0))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_next_to_nothing_is_no_displacement(axis: int, sign: float) -> None:
    then, moved = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    moved[axis] = sign * 1e-3
    assert displacement(Odometer(Pose(*moved)), Pose(*then), 0.0) is not None
    moved[axis] = sign * math.nextafter(1e-3, 0.0)
    assert displacement(Odometer(Pose(*moved)), Pose(*then), 0.0) is None
