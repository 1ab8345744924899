"""A recording's odometry becomes a path: without standstills, with every turn and cusp."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.path.course import JUMP_M, JUMP_M_S, PathError, to_path, to_poses

ODOM_S = 0.02


class Recording:
    """Odometry at 50 Hz of a robot that follows immediately."""

    def __init__(self) -> None:
        self.rows = [(0.0, 0.0, 0.0)]

    def do(self, linear_m_s: float, angular_rad_s: float, duration_s: float) -> "Recording":
        for _ in range(round(duration_s / ODOM_S)):
            x, y, yaw = self.rows[-1]
            middle = yaw + angular_rad_s * ODOM_S / 2
            self.rows.append(
                (
                    x + linear_m_s * math.cos(middle) * ODOM_S,
                    y + linear_m_s * math.sin(middle) * ODOM_S,
                    math.remainder(yaw + angular_rad_s * ODOM_S, math.tau),
                )
            )
        return self

    @property
    def samples(self) -> np.ndarray:
        return np.array(self.rows)

    @property
    def times_s(self) -> np.ndarray:
        return 100.0 + ODOM_S * np.arange(len(self.rows))

    def poses(self) -> np.ndarray:
        return to_poses(self.times_s, self.samples)


def test_standing_leaves_no_trace() -> None:
    with_pauses = Recording().do(0, 0, 5).do(0.5, 0, 2).do(0, 0, 60).do(0.5, 0, 2).do(0, 0, 5)
    path = to_path(with_pauses.poses())
    assert len(path.legs) == 1
    assert path.length_m == pytest.approx(2.0, abs=0.01)
    assert len(with_pauses.poses()) < 120


def test_a_turn_on_the_spot_is_one_corner_where_the_robot_turned() -> None:
    path = to_path(Recording().do(0.43, 0, 2.3).do(0, 1, math.pi / 2).do(0.43, 0, 2.3).poses())
    assert len(path.legs) == 2
    assert path.legs[1].points_m[0].tolist() == pytest.approx([0.989, 0.0], abs=0.002)
    assert path.legs[1].headings_rad[0] == pytest.approx(math.pi / 2, abs=0.03)


def test_reversing_is_a_leg_of_its_own_that_begins_at_the_farthest_point() -> None:
    path = to_path(Recording().do(0.47, 0, 2.1).do(0, 0, 1).do(-0.31, 0, 2).poses())
    assert [leg.backwards for leg in path.legs] == [False, True]
    assert path.legs[0].length_m == pytest.approx(0.987, abs=0.005)
    assert path.legs[1].length_m == pytest.approx(0.62, abs=0.005)


def test_rolling_back_a_little_is_no_change_of_direction() -> None:
    path = to_path(Recording().do(0.5, 0, 1).do(-0.1, 0, 0.1).do(0.5, 0, 1).poses())
    assert len(path.legs) == 1


def test_how_it_stood_in_the_end_is_kept() -> None:
    path = to_path(Recording().do(0.5, 0, 1).do(0, -1, 2).poses())
    assert path.end.yaw_rad == pytest.approx(-2.0, abs=0.01)


def test_it_may_begin_backwards() -> None:
    assert [leg.backwards for leg in to_path(Recording().do(-0.5, 0.3, 2).poses()).legs] == [True]


velocities = st.tuples(
    st.sampled_from([-0.4, 0.0, 0.3, 0.6]), st.sampled_from([-1.5, -0.5, 0.0, 0.8]), st.floats(0.1, 2.0)
)


@given(st.lists(velocities, min_size=1, max_size=6))
def test_every_sample_lies_near_the_path(parts: list[tuple[float, float, float]]) -> None:
    recording = Recording().do(0.5, 0.0, 1.0)
    for part in parts:
        recording.do(*part)
    path = to_path(recording.poses())
    for x_m, y_m, _ in recording.rows[::5]:
        off_m = min(leg.nearest(x_m, y_m, 0.0, leg.length_m).off_m for leg in path.legs)
        assert off_m < 0.03


def test_odometry_that_jumps_is_refused_just_beyond_what_a_robot_can_drive() -> None:
    times_s = np.array([0.0, 1.0, 1.1])
    most_m = JUMP_M + JUMP_M_S * 0.1

    def jumping(by_m: float) -> np.ndarray:
        return np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0 + by_m, 0.0, 0.0)])

    assert len(to_poses(times_s, jumping(most_m - 1e-6))) == 3
    with pytest.raises(PathError, match=r"jumps by 0\.45 m, 1\.1 s after"):
        to_poses(times_s, jumping(most_m + 1e-6))


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (np.zeros((0, 3)), "empty"),
        (np.zeros((1, 3)), "empty"),
        (np.array([(0.0, 0.0, 0.0), (0.0, math.inf, 0.0)]), "finite"),
        (np.zeros((50, 3)), "does not drive"),
    ],
)
def test_a_recording_without_a_path_is_refused(samples: np.ndarray, words: str) -> None:
    with pytest.raises(PathError, match=words):
        to_poses(np.arange(float(len(samples))), samples)
