"""Poses and shapes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.path.legs import to_path
from teleop.path.pose import Pose, placed, seen_from, wrap
from teleop.path.shapes import circle, square

metres = st.floats(-50.0, 50.0)
poses = st.builds(Pose, metres, metres, st.floats(-math.pi, math.pi))


@given(poses, poses)
def test_what_is_seen_from_a_frame_and_placed_in_it_is_where_it_was(pose: Pose, frame: Pose) -> None:
    (back,) = placed(np.array([seen_from(pose, frame)]), frame).tolist()
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
