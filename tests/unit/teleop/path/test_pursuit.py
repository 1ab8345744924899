"""Pursuit is bounded and converges to the path from any offset; the course brings the real plant to the end."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.path.course import Pose, Poses, circle, placed, square, to_path, to_poses, wrap
from teleop.path.pursuit import (
    BRAKING_M_S2,
    HEADING_RAD,
    MAX_LOOKAHEAD_M,
    MAX_TURN_RAD_S,
    MIN_LOOKAHEAD_M,
    MIN_TURN_RAD_S,
    ON_PATH_M,
    Course,
    bearing,
    lookahead_m,
    pursue,
    turn,
)
from tests.unit.teleop.path.drives import drive

SPEED_M_S = 0.6
AHEAD = np.array([(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)])
BACK = np.array([(0.0, 0.0, 0.0), (-3.0, 0.0, 0.0)])
angles = st.floats(-math.pi, math.pi)


def say(text: object) -> None:
    print(f"\n    measured: {text}")


@given(
    x_m=st.floats(-2.0, 5.0),
    y_m=st.floats(-2.0, 2.0),
    yaw_rad=angles,
    along_m=st.floats(0.0, 3.0),
    backwards=st.booleans(),
)
def test_what_is_asked_for_is_finite_within_the_limits_and_in_the_leg_s_direction(
    x_m: float, y_m: float, yaw_rad: float, along_m: float, *, backwards: bool
) -> None:
    (leg,) = to_path(BACK if backwards else AHEAD).legs
    point_m = leg.point_at(along_m + 0.3)
    linear, angular = pursue(leg, point_m, along_m, 3.0 - along_m, Pose(x_m, y_m, yaw_rad), SPEED_M_S)
    assert math.isfinite(linear + angular)
    assert 0.0 < (-linear if backwards else linear) <= SPEED_M_S
    assert abs(angular) <= MAX_TURN_RAD_S


@given(angles.filter(lambda a: a != 0.0))
def test_a_turn_goes_the_short_way_within_its_limits(error_rad: float) -> None:
    linear, angular = turn(error_rad)
    assert linear == 0.0
    assert math.copysign(1.0, angular) == math.copysign(1.0, error_rad)
    assert MIN_TURN_RAD_S <= abs(angular) <= MAX_TURN_RAD_S


def test_the_lookahead_grows_with_the_speed_between_its_bounds() -> None:
    assert lookahead_m(0.0) == MIN_LOOKAHEAD_M
    assert lookahead_m(-0.5) == lookahead_m(0.5) == pytest.approx(0.3)
    assert lookahead_m(9.0) == MAX_LOOKAHEAD_M


def test_a_point_under_the_robot_has_no_bearing() -> None:
    assert bearing((1.0, 1.0), Pose(1.0, 1.0, 2.0), backwards=False) == 0.0
    assert abs(bearing((2.0, 1.0), Pose(1.0, 1.0, 0.0), backwards=True)) == pytest.approx(math.pi)


def test_straight_ahead_it_drives_at_full_speed_and_slows_down_before_the_end() -> None:
    (leg,) = to_path(AHEAD).legs
    ahead = pursue(leg, (1.5, 0.0), 1.0, 2.0, Pose(1.0, 0.0, 0.0), SPEED_M_S)
    assert ahead == (SPEED_M_S, 0.0)
    near_end = pursue(leg, (3.2, 0.0), 2.9, 0.1, Pose(2.9, 0.0, 0.0), SPEED_M_S)
    assert near_end.linear_m_s == pytest.approx(math.sqrt(2 * BRAKING_M_S2 * 0.1))


def test_before_a_bend_it_slows_down_while_the_way_to_its_point_is_still_straight() -> None:
    poses = np.concatenate((np.array([(-2.0, 0.0, 0.0)]), circle(0.25)))
    (leg,) = to_path(poses).legs
    straight = pursue(leg, leg.point_at(0.6), 0.3, 9.0, Pose(-1.7, 0.0, 0.0), SPEED_M_S)
    before = pursue(leg, leg.point_at(1.9), 1.7, 9.0, Pose(-0.3, 0.0, 0.0), SPEED_M_S)
    assert before.angular_rad_s == 0.0
    assert before.linear_m_s < 0.9 * straight.linear_m_s


def ideal(course: Course, start: Pose, limit_s: float = 120.0) -> tuple[Pose, list[float]]:
    """Simulate a robot that follows immediately; return its end and its largest offset from the path."""
    pose, off_m, speed = start, list[float](), 0.0
    for _ in range(round(limit_s / 0.05)):
        velocity = course.step(pose, speed)
        if velocity is None:
            return pose, off_m
        speed, yaw = velocity.linear_m_s, pose.yaw_rad + velocity.angular_rad_s * 0.025
        pose = Pose(
            pose.x_m + speed * math.cos(yaw) * 0.05,
            pose.y_m + speed * math.sin(yaw) * 0.05,
            wrap(pose.yaw_rad + velocity.angular_rad_s * 0.05),
        )
        off_m.append(course.station(pose).off_m)
    pytest.fail(f"not at the end after {limit_s:g} s, but at {pose}")


@settings(deadline=None, max_examples=60)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), angles, st.sampled_from([AHEAD, BACK, square(1.0)]))
def test_from_any_offset_it_comes_back_to_the_path_and_drives_it_to_its_end(
    x_m: float, y_m: float, yaw_rad: float, poses: Poses
) -> None:
    path = to_path(poses)
    end, off_m = ideal(Course(path, SPEED_M_S), Pose(x_m, y_m, yaw_rad))
    assert math.hypot(end.x_m - path.end.x_m, end.y_m - path.end.y_m) <= ON_PATH_M + 0.01
    assert abs(wrap(end.yaw_rad - path.end.yaw_rad)) <= HEADING_RAD
    back = next(i for i, off in enumerate(off_m) if off <= ON_PATH_M)
    assert max(off_m[back:]) < 2 * ON_PATH_M


def test_a_robot_that_is_carried_off_goes_on_where_it_left_the_path() -> None:
    course = Course(to_path(square(1.0)), SPEED_M_S)
    pose = Pose(0.0, 0.0, 0.0)
    assert course.step(pose, 0.0) is not None
    course.step(Pose(0.3, 0.0, 0.0), 0.3)
    before_m = course.done_m
    assert before_m == pytest.approx(0.3)
    carried = Pose(-0.5, 0.8, 2.0)
    velocity = course.step(carried, 0.0)
    assert velocity is not None
    assert velocity.linear_m_s == 0.0, "what lies to the side is turned to first"
    end, _ = ideal(course, carried)
    assert course.done_m == pytest.approx(4.0)
    assert end[:2] == pytest.approx((0.0, 0.0), abs=0.06)


def test_a_leg_passed_far_to_the_side_is_not_done_before_the_robot_was_at_its_end() -> None:
    course = Course(to_path(AHEAD), SPEED_M_S)
    for along_m in np.arange(0.0, 3.6, 0.1):
        course.step(Pose(float(along_m), 0.5, 0.0), 0.3)
    velocity = course.step(Pose(3.5, 0.5, 0.0), 0.3)
    assert velocity is not None
    end, _ = ideal(course, Pose(3.5, 0.5, 0.0))
    assert end[:2] == pytest.approx((3.0, 0.0), abs=0.06)


def test_after_the_end_the_last_leg_stays_the_current_one() -> None:
    course = Course(to_path(AHEAD), SPEED_M_S)
    end, _ = ideal(course, Pose(0.0, 0.0, 0.0))
    assert course.done_m == 3.0
    assert course.station(end).along_m == 3.0
    assert course.step(end, 0.0) is None


def test_it_is_never_neutral_on_its_way() -> None:
    """The supervisor distinguishes a source that requests nothing from one that drives."""
    course, pose, speed = Course(to_path(square(0.5)), SPEED_M_S), Pose(0.0, 0.0, 0.0), 0.0
    while (velocity := course.step(pose, speed)) is not None:
        assert not velocity.is_neutral
        speed = velocity.linear_m_s
        pose = Pose(
            pose.x_m + speed * math.cos(pose.yaw_rad) * 0.05,
            pose.y_m + speed * math.sin(pose.yaw_rad) * 0.05,
            pose.yaw_rad + velocity.angular_rad_s * 0.05,
        )


# --- the real plant

EIGHT = np.concatenate((circle(0.8), circle(0.8, clockwise=True)))
THREE_POINT = np.array(
    [(0, 0, 0), (2, 0, 0), (2, 0, math.pi / 2), (2, 0.5, math.pi / 2), (2, -0.5, math.pi / 2)], dtype=float
)


@pytest.mark.parametrize(
    ("name", "poses", "speed_m_s", "rms_m", "max_m"),
    [
        ("square of 1.5 m at 0.4 m/s", square(1.5), 0.4, 0.006, 0.015),
        ("square of 1.0 m to the right at 0.8 m/s", square(1.0, clockwise=True), 0.8, 0.006, 0.015),
        ("circle of 0.8 m at 0.4 m/s", circle(0.8), 0.4, 0.006, 0.015),
        ("circle of 0.3 m at 1.0 m/s", circle(0.3), 1.0, 0.01, 0.02),
        ("figure of eight at 0.6 m/s", EIGHT, 0.6, 0.01, 0.04),
        ("three-point turn at 0.4 m/s", THREE_POINT, 0.4, 0.006, 0.02),
    ],
)
def test_the_plant_stays_on_the_path(
    name: str, poses: Poses, speed_m_s: float, rms_m: float, max_m: float
) -> None:
    driven = drive(to_path(poses), speed_m_s)
    say(f"{name}: {driven}")
    assert driven.done
    assert driven.collisions == 0
    for error in (driven.by_odometry, driven.by_truth):
        assert error.rms_m < rms_m
        assert error.max_m < max_m
    assert driven.end_m < 0.02
    assert driven.end_rad < 0.03


def test_what_was_driven_once_is_driven_again() -> None:
    first = drive(to_path(THREE_POINT), 0.4)
    again = drive(to_path(to_poses(first.times_s, first.odometry)), 0.6)
    say(f"a recorded three-point turn, again: {again}")
    assert again.done
    assert again.by_odometry.rms_m < 0.006
    assert math.dist(again.odometry[-1][:2], first.odometry[-1][:2]) < 0.02


def test_a_path_beside_the_robot_is_come_to() -> None:
    driven = drive(to_path(placed(square(1.0), Pose(0.2, -0.2, 0.5))), 0.4)
    assert driven.done
    assert driven.end_m < 0.02
