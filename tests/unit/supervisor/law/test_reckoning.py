"""Dead reckoning since a scan, by odometry."""

import math

import pytest

from supervisor.law.reckoning import (
    LONGEST_S,
    RECALL_STEP_S,
    STANDSTILL,
    Odometer,
    Pose,
    Velocity,
    back_then,
    displacement,
    reckon,
    remembered,
)

FASTEST = Velocity(2.0, 4.0)
HERE = Pose(3.0, -2.0, 0.5)


def start(velocity: Velocity, pose: Pose = HERE) -> Odometer:
    return Odometer(pose, velocity=velocity, at_s=10.0)


def test_a_velocity_holds_until_the_next_one_arrives() -> None:
    after = reckon(start(Velocity(1.0, 0.0), Pose(0.0, 0.0, 0.0)), Velocity(0.5, 0.2), 10.1, FASTEST)
    assert after.pose == pytest.approx((0.1, 0.0, 0.0))
    assert after.velocity == Velocity(0.5, 0.2)
    assert after.at_s == 10.1


def test_an_arc_driven_back_ends_where_it_began() -> None:
    there = reckon(start(Velocity(1.0, -2.0)), Velocity(-1.0, 2.0), 10.1, FASTEST)
    back = reckon(there, STANDSTILL, 10.2, FASTEST)
    assert back.pose == pytest.approx(HERE, abs=1e-9)


def test_an_arc_is_integrated_at_its_middle_heading() -> None:
    after = reckon(start(Velocity(1.0, 2.0), Pose(0.0, 0.0, 0.0)), STANDSTILL, 10.2, FASTEST)
    assert after.pose == pytest.approx((0.2 * math.cos(0.2), 0.2 * math.sin(0.2), 0.4))


@pytest.mark.parametrize("velocity", [FASTEST, Velocity(-2.0, -4.0)])
def test_a_velocity_up_to_the_maximum_is_accepted(velocity: Velocity) -> None:
    assert reckon(start(STANDSTILL), velocity, 10.1, FASTEST).velocity == velocity


@pytest.mark.parametrize(
    "velocity", [Velocity(math.nextafter(2.0, 3.0), 0.0), Velocity(0.0, -4.1), Velocity(31.0, 0.0)]
)
def test_an_implausible_velocity_counts_as_standstill(velocity: Velocity) -> None:
    assert reckon(start(STANDSTILL), velocity, 10.1, FASTEST).velocity == STANDSTILL


def test_the_last_velocity_is_extrapolated_for_a_limited_time() -> None:
    odometer = start(Velocity(1.0, 0.0), Pose(0.0, 0.0, 0.0))
    origin = Pose(0.0, 0.0, 0.0)
    assert displacement(odometer, origin, 10.0 + LONGEST_S / 2) == pytest.approx((LONGEST_S / 2, 0.0, 0.0))
    assert displacement(odometer, origin, 99.0) == pytest.approx((LONGEST_S, 0.0, 0.0))
    assert displacement(odometer, origin, 9.0) is None


def test_a_displacement_is_expressed_in_the_earlier_frame() -> None:
    then = Pose(1.0, 2.0, math.pi / 2)
    odometer = Odometer(Pose(1.0 - 0.3, 2.0 + 0.5, math.pi / 2 + 0.2))
    assert displacement(odometer, then, 0.0) == pytest.approx((0.5, 0.3, 0.2))
    turned = Pose(0.0, 0.0, 0.3)
    x_m, y_m = 0.4 * math.cos(0.3) - 0.1 * math.sin(0.3), 0.4 * math.sin(0.3) + 0.1 * math.cos(0.3)
    assert displacement(Odometer(Pose(x_m, y_m, 0.3)), turned, 0.0) == pytest.approx((0.4, 0.1, 0.0))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_displacement_below_one_millimetre_or_milliradian_is_ignored(axis: int, sign: float) -> None:
    then, moved = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    moved[axis] = sign * 1e-3
    assert displacement(Odometer(Pose(*moved)), Pose(*then), 0.0) is not None
    moved[axis] = sign * math.nextafter(1e-3, 0.0)
    assert displacement(Odometer(Pose(*moved)), Pose(*then), 0.0) is None


def odometers(*at_s: float) -> tuple[Odometer, ...]:
    """At 1 m/s along x from zero on."""
    return tuple(Odometer(Pose(time_s, 0.0, 0.0), Velocity(1.0, 0.0), time_s) for time_s in at_s)


def test_the_remembered_odometers_reach_back_to_the_requested_time() -> None:
    before, newest = odometers(1.0, 1.125, 1.25), odometers(1.375)[0]
    assert remembered(before, newest, 1.125) == (*before[1:], newest)
    assert remembered(before, newest, math.nextafter(1.125, 2.0)) == (before[2], newest)
    assert remembered((), newest, 0.0) == (newest,)


def test_odometers_are_remembered_at_a_minimum_interval() -> None:
    before = odometers(1.0)
    just_later, later = odometers(math.nextafter(1.0 + RECALL_STEP_S, 0.0), 1.0 + RECALL_STEP_S)
    assert remembered(before, just_later, 0.0) == before
    assert remembered(before, later, 0.0) == (*before, later)


@pytest.mark.parametrize(
    ("then_s", "x_m"),
    [(1.0, 1.0), (1.1, 1.1), (1.125, 1.125), (1.2, 1.2), (1.25, 1.25), (1.3, 1.3), (0.5, 1.0)],
)
def test_a_past_pose_is_extrapolated_from_the_odometer_before_it(then_s: float, x_m: float) -> None:
    earlier, newest = odometers(1.0, 1.125), odometers(1.25)[0]
    assert back_then(earlier, newest, then_s).x_m == pytest.approx(x_m)


def test_without_remembered_odometers_the_past_pose_is_the_present_one() -> None:
    assert back_then((), odometers(1.25)[0], 1.0).x_m == 1.25


def test_the_newest_odometer_applies_from_its_own_time() -> None:
    earlier = (Odometer(Pose(0.0, 0.0, 0.0), Velocity(1.0, 0.0), 1.0),)
    assert back_then(earlier, Odometer(Pose(5.0, 0.0, 0.0), STANDSTILL, 1.5), 1.5).x_m == 5.0
    assert back_then(earlier, Odometer(Pose(5.0, 0.0, 0.0), STANDSTILL, 1.5), 1.4).x_m == pytest.approx(0.25)
