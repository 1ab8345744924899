"""Poses and shapes; a path is divided at its corners and cusps, and progress along a leg only increases."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.path.course import (
    CORNER_RAD,
    WINDOW_M,
    Leg,
    PathError,
    Pose,
    TrackError,
    circle,
    placed,
    seen_from,
    square,
    to_path,
    wrap,
)

metres = st.floats(-50.0, 50.0)
poses = st.builds(Pose, metres, metres, st.floats(-math.pi, math.pi))


@given(poses, poses)
def test_what_is_seen_from_a_frame_and_placed_in_it_is_where_it_was(pose: Pose, frame: Pose) -> None:
    (back,) = placed(seen_from(np.array([pose]), frame), frame).tolist()
    assert back[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert wrap(back[2] - pose.yaw_rad) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_pose_of_anything_but_numbers_is_not_finite(bad: float) -> None:
    assert Pose(1.0, 2.0, 3.0).is_finite
    assert not Pose(1.0, bad, 3.0).is_finite


@pytest.mark.parametrize(("clockwise", "side"), [(False, 1.0), (True, -1.0)])
def test_a_square_lies_ahead_and_to_one_side_and_ends_as_it_began(*, clockwise: bool, side: float) -> None:
    path = to_path(square(1.5, 2, clockwise=clockwise))
    assert [leg.length_m for leg in path.legs] == [1.5] * 8
    corners = [leg.points_m[-1].tolist() for leg in path.legs[:4]]
    assert corners == [[1.5, 0.0], [1.5, side * 1.5], [0.0, side * 1.5], [0.0, 0.0]]
    assert path.start == (0.0, 0.0, 0.0)
    assert path.end == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(("clockwise", "side"), [(False, 1.0), (True, -1.0)])
@pytest.mark.parametrize("radius_m", [0.1, 1.0])
def test_a_circle_is_one_leg_around_a_centre_beside_the_robot(
    radius_m: float, *, clockwise: bool, side: float
) -> None:
    path = to_path(circle(radius_m, 3, clockwise=clockwise))
    (leg,) = path.legs
    assert not leg.backwards
    assert leg.length_m == pytest.approx(3 * math.tau * radius_m, rel=1e-3)
    distances = np.hypot(leg.points_m[:, 0], leg.points_m[:, 1] - side * radius_m)
    assert distances == pytest.approx(radius_m)
    assert leg.headings_rad[0] == pytest.approx(0.0, abs=0.1)
    assert path.end == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


# --- legs


def bent(angle_rad: float) -> np.ndarray:
    x, y = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0 + x, y, angle_rad)])


def test_a_bend_is_a_corner_just_beyond_the_limit() -> None:
    assert len(to_path(bent(CORNER_RAD - 1e-6)).legs) == 1
    assert len(to_path(bent(CORNER_RAD + 1e-6)).legs) == 2


def test_what_lies_behind_is_driven_backwards_with_the_same_heading() -> None:
    path = to_path(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 0.0, 0.0)]))
    assert [leg.backwards for leg in path.legs] == [False, True]
    assert [leg.heading_at(0.1) for leg in path.legs] == [0.0, 0.0]
    assert path.length_m == 1.5


def test_standing_makes_no_leg_and_the_last_pose_says_how_it_ends() -> None:
    path = to_path(np.array([(0.0, 0.0, 0.0)] * 3 + [(1.0, 0.0, 0.0), (1.0, 0.0, 3 * math.pi / 2)]))
    assert len(path.legs) == 1
    assert path.end == pytest.approx((1.0, 0.0, -math.pi / 2))


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (np.zeros((4, 3)), "goes nowhere"),
        (np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 2.0)]), "goes nowhere"),
        (np.array([(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0)]), "finite"),
    ],
)
def test_a_path_that_is_none_is_refused(poses: np.ndarray, words: str) -> None:
    with pytest.raises(PathError, match=words):
        to_path(poses)


def test_a_leg_goes_straight_on_beyond_its_ends() -> None:
    (leg,) = to_path(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.2, 0.2)])).legs
    assert leg.point_at(-0.5) == pytest.approx((-0.5, 0.0))
    assert leg.point_at(0.25) == pytest.approx((0.25, 0.0))
    beyond = leg.point_at(leg.length_m + 1.0)
    assert beyond == pytest.approx((2.0 + math.cos(math.atan(0.2)), 0.2 + math.sin(math.atan(0.2))))


def a_leg() -> Leg:
    return to_path(circle(0.5, 2)).legs[0]


@given(
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
    st.floats(0.0, 1.0),
)
def test_progress_never_goes_back_and_never_beyond_its_window(x_m: float, y_m: float, share: float) -> None:
    leg = a_leg()
    from_m = share * leg.length_m
    station = leg.nearest(x_m, y_m, from_m)
    assert from_m - 1e-9 <= station.along_m <= min(from_m + WINDOW_M, leg.length_m) + 1e-9
    place = leg.point_at(station.along_m)
    assert station.off_m == pytest.approx(math.hypot(x_m - place[0], y_m - place[1]), abs=1e-9)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.5), st.floats(0.0, 1.0))
def test_nothing_in_the_window_is_nearer(x_m: float, y_m: float, share: float) -> None:
    leg = a_leg()
    from_m = share * leg.length_m
    off_m = leg.nearest(x_m, y_m, from_m).off_m
    for along_m in np.linspace(from_m, min(from_m + WINDOW_M, leg.length_m), 60):
        x, y = leg.point_at(float(along_m))
        assert math.hypot(x_m - x, y_m - y) >= off_m - 1e-9


def test_the_second_lap_is_not_the_first() -> None:
    leg = a_leg()
    lap_m = leg.length_m / 2
    assert leg.nearest(0.0, 0.0, 0.0).along_m == pytest.approx(0.0)
    assert leg.nearest(0.0, 0.0, lap_m - 0.1).along_m == pytest.approx(lap_m)
    assert leg.nearest(0.0, 0.0, leg.length_m - 0.1).along_m == pytest.approx(leg.length_m)


def test_where_a_path_crosses_itself_the_robot_does_not_change_over() -> None:
    """A cross: the second arm passes through the middle of the first."""
    poses = np.array(
        [(0.0, 0.0, 0.0), (2.0, 0.0, 0.4), (2.0, 1.0, 2.0), (1.0, 1.0, 3.0), (1.0, -1.0, -math.pi / 2)]
    )
    path = to_path(poses)
    assert path.legs[0].nearest(1.0, 0.0, 0.9).along_m == pytest.approx(1.0)
    assert path.legs[-1].nearest(1.0, 0.0, 0.9).along_m == pytest.approx(1.0)


# --- distances


def test_the_track_error_of_nothing_is_none() -> None:
    assert TrackError.of([]) is None


def test_the_track_error_is_count_root_mean_square_and_maximum() -> None:
    assert TrackError.of([3.0, 4.0]) == TrackError(2, math.sqrt(12.5), 4.0)
