"""A path is divided at its corners and cusps, and progress along a leg only increases."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.path.legs import CORNER_RAD, Leg, to_path
from teleop.path.pose import PathError
from teleop.path.progress import WINDOW_M, nearest
from teleop.path.shapes import circle


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
    station = nearest(leg, x_m, y_m, from_m)
    assert from_m - 1e-9 <= station.along_m <= min(from_m + WINDOW_M, leg.length_m) + 1e-9
    place = leg.point_at(station.along_m)
    assert station.off_m == pytest.approx(math.hypot(x_m - place[0], y_m - place[1]), abs=1e-9)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.5), st.floats(0.0, 1.0))
def test_nothing_in_the_window_is_nearer(x_m: float, y_m: float, share: float) -> None:
    leg = a_leg()
    from_m = share * leg.length_m
    off_m = nearest(leg, x_m, y_m, from_m).off_m
    for along_m in np.linspace(from_m, min(from_m + WINDOW_M, leg.length_m), 60):
        x, y = leg.point_at(float(along_m))
        assert math.hypot(x_m - x, y_m - y) >= off_m - 1e-9


def test_the_second_lap_is_not_the_first() -> None:
    leg = a_leg()
    lap_m = leg.length_m / 2
    assert nearest(leg, 0.0, 0.0, 0.0).along_m == pytest.approx(0.0)
    assert nearest(leg, 0.0, 0.0, lap_m - 0.1).along_m == pytest.approx(lap_m)
    assert nearest(leg, 0.0, 0.0, leg.length_m - 0.1).along_m == pytest.approx(leg.length_m)


def test_where_a_path_crosses_itself_the_robot_does_not_change_over() -> None:
    """A cross: the second arm passes through the middle of the first."""
    poses = np.array(
        [(0.0, 0.0, 0.0), (2.0, 0.0, 0.4), (2.0, 1.0, 2.0), (1.0, 1.0, 3.0), (1.0, -1.0, -math.pi / 2)]
    )
    path = to_path(poses)
    assert nearest(path.legs[0], 1.0, 0.0, 0.9).along_m == pytest.approx(1.0)
    assert nearest(path.legs[-1], 1.0, 0.0, 0.9).along_m == pytest.approx(1.0)
