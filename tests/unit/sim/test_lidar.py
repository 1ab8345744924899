"""The lidar: where its beams point, what they measure, and ROS's values for what they cannot."""

import math

import numpy as np
import pytest

from sim import mj
from sim.lidar import Lidar, LidarConfig, Ranges

AHEAD = 180
LEFT = 270
BEHIND = 0
RIGHT = 90

# Four walls at different distances: 1 m ahead, 2 m left, 3 m behind, 4 m right; only ahead is wide.
ROOM = """
<mujoco><worldbody>
  <geom group="1" type="box" size="0.1 1 1" pos="1.1 0 0"/>
  <geom group="1" type="box" size="0.1 0.1 1" pos="0 2.1 0"/>
  <geom group="1" type="box" size="0.1 0.1 1" pos="-3.1 0 0"/>
  <geom group="1" type="box" size="0.1 0.1 1" pos="0 -4.1 0"/>
  <geom group="2" type="sphere" size="0.5"/>
</worldbody></mujoco>
"""


def _scan(
    config: LidarConfig | None = None, x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, seed: int = 0
) -> Ranges:
    model = mj.load_string(ROOM)
    data = mj.make_data(model)
    mj.forward(model, data)
    return Lidar(model, config, seed).scan(data, x_m, y_m, yaw_rad)


def test_beams_go_counter_clockwise_from_straight_behind() -> None:
    ranges = _scan()
    assert ranges.dtype == np.float32
    assert ranges.shape == (360,)
    assert ranges[[AHEAD, LEFT, BEHIND, RIGHT]] == pytest.approx([1.0, 2.0, 3.0, 4.0])


def test_the_angles_describe_the_beams() -> None:
    config = LidarConfig()
    assert config.angle_min_rad + AHEAD * config.angle_increment_rad == pytest.approx(0.0)
    assert config.angle_max_rad == pytest.approx(math.pi - config.angle_increment_rad)


def test_the_beams_turn_and_move_with_the_robot() -> None:
    ranges = _scan(x_m=0.25, yaw_rad=math.pi / 2)
    assert ranges[RIGHT] == pytest.approx(0.75)
    assert ranges[LEFT] == pytest.approx(3.25)


def test_a_slanted_beam_is_longer_by_its_angle() -> None:
    assert _scan()[AHEAD + 30] == pytest.approx(1.0 / math.cos(math.radians(30.0)))


def test_a_miss_is_plus_infinity() -> None:
    assert _scan()[AHEAD + 60] == math.inf


def test_a_hit_beyond_the_longest_range_is_a_miss() -> None:
    ranges = _scan(LidarConfig(range_max_m=2.5))
    assert ranges[[AHEAD, LEFT, BEHIND, RIGHT]].tolist() == [1.0, 2.0, math.inf, math.inf]


def test_a_hit_before_the_shortest_range_is_minus_infinity() -> None:
    ranges = _scan(LidarConfig(range_min_m=1.5))
    assert ranges[AHEAD] == -math.inf
    assert ranges[LEFT] == 2.0


def test_the_robot_s_own_geoms_are_not_seen() -> None:
    assert np.min(_scan()) == pytest.approx(1.0)


def test_noise_is_the_same_for_the_same_seed_and_leaves_misses_alone() -> None:
    config = LidarConfig(noise_std_m=0.01)
    ranges = _scan(config, seed=3)
    np.testing.assert_array_equal(ranges, _scan(config, seed=3))
    assert not np.array_equal(ranges, _scan(config, seed=4))
    assert ranges[AHEAD] == pytest.approx(1.0, abs=0.06)
    assert ranges[AHEAD + 60] == math.inf


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("beams", 0),
        ("height_m", 0.0),
        ("range_min_m", -0.1),
        ("range_min_m", math.nan),
        ("range_max_m", math.inf),
        ("noise_std_m", -1.0),
        ("noise_std_m", math.nan),
    ],
)
def test_a_geometry_that_makes_no_sense_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        LidarConfig(**{name: value})  # pyright: ignore[reportArgumentType]
