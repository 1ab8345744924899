"""The lidar: where its beams point, what they measure, and ROS's values for what they cannot."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim import mj
from sim.lidar import Lidar, Ranges
from sim.lidar_config import LidarConfig

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
    lidar, data = _lidar(config, seed)
    return lidar.scan(data, x_m, y_m, yaw_rad)


def _lidar(config: LidarConfig | None = None, seed: int = 0) -> tuple[Lidar, mj.Data]:
    model = mj.mujoco.MjModel.from_xml_string(ROOM)
    data = mj.make_data(model)
    mj.forward(model, data)
    return Lidar(model, config, seed), data


def test_beams_go_counter_clockwise_from_straight_behind() -> None:
    ranges = _scan()
    assert ranges.dtype == np.float32
    assert ranges.shape == (360,)
    assert ranges[[AHEAD, LEFT, BEHIND, RIGHT]] == pytest.approx([1.0, 2.0, 3.0, 4.0])


def test_the_angles_describe_the_beams() -> None:
    config = LidarConfig()
    assert config.angle_min_rad + AHEAD * config.angle_increment_rad == pytest.approx(0.0)
    assert config.angles_rad[-1] == pytest.approx(math.pi - config.angle_increment_rad)


@pytest.mark.parametrize(("beams", "span_rad"), [(181, math.pi), (271, 1.5 * math.pi), (1081, 4.7), (2, 0.1)])
def test_a_partial_span_is_centred_ahead_and_its_beams_reach_both_edges(beams: int, span_rad: float) -> None:
    config = LidarConfig(beams=beams, span_rad=span_rad)
    assert config.angle_min_rad == -0.5 * span_rad
    assert config.angles_rad[-1] == pytest.approx(0.5 * span_rad)
    assert config.angle_increment_rad == pytest.approx(span_rad / (beams - 1))
    assert config.angles_rad[0] == config.angle_min_rad
    assert len(config.angles_rad) == beams


def test_the_beams_of_a_half_turn_see_right_ahead_and_left() -> None:
    ranges = _scan(LidarConfig(beams=181, span_rad=math.pi))
    assert ranges[[0, 90, 180]] == pytest.approx([4.0, 1.0, 2.0])


def test_a_single_beam_looks_ahead() -> None:
    config = LidarConfig(beams=1, span_rad=1.0)
    assert config.angle_min_rad == config.angles_rad[-1] == 0.0
    assert config.angle_increment_rad > 0.0
    assert _scan(config) == pytest.approx([1.0])


def test_a_single_beam_of_a_full_turn_looks_where_a_turn_begins() -> None:
    assert _scan(LidarConfig(beams=1)) == pytest.approx([3.0])


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
    config = LidarConfig(noise_m=0.01)
    ranges = _scan(config, seed=3)
    np.testing.assert_array_equal(ranges, _scan(config, seed=3))
    assert not np.array_equal(ranges, _scan(config, seed=4))
    assert ranges[AHEAD] == pytest.approx(1.0, abs=0.06)
    assert ranges[AHEAD + 60] == math.inf


def test_dropped_beams_read_nan_others_each_time_and_the_rest_is_untouched() -> None:
    lidar, data = _lidar(LidarConfig(beams=3600, dropout=0.1))
    first, second = lidar.scan(data, 0.0, 0.0, 0.0), lidar.scan(data, 0.0, 0.0, 0.0)
    for ranges in (first, second):
        assert 0.08 < np.mean(np.isnan(ranges)) < 0.12
    assert not np.array_equal(np.isnan(first), np.isnan(second))
    whole = _scan(LidarConfig(beams=3600))
    np.testing.assert_array_equal(first[~np.isnan(first)], whole[~np.isnan(first)])


def test_with_a_dropout_of_one_every_beam_reads_nan() -> None:
    assert np.isnan(_scan(LidarConfig(dropout=1.0))).all()


def test_noise_and_dropout_go_on_from_a_state_that_was_kept() -> None:
    lidar, data = _lidar(LidarConfig(noise_m=0.01, dropout=0.2))
    lidar.scan(data, 0.0, 0.0, 0.0)
    state = lidar.random.bit_generator.state
    first = lidar.scan(data, 0.0, 0.0, 0.0)
    assert not np.array_equal(first, lidar.scan(data, 0.0, 0.0, 0.0))
    lidar.random.bit_generator.state = state
    np.testing.assert_array_equal(first, lidar.scan(data, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("beams", 0),
        ("beams", 65_537),
        ("span_rad", 0.0),
        ("span_rad", -1.0),
        ("span_rad", math.nan),
        ("span_rad", math.nextafter(math.tau, 7.0)),
        ("dropout", -0.01),
        ("dropout", 1.01),
        ("dropout", math.nan),
        ("range_min_m", -0.1),
        ("range_min_m", math.nan),
        ("range_max_m", math.inf),
        ("noise_m", -1.0),
        ("noise_m", math.nan),
        *((name, value) for name in ("x_m", "y_m", "yaw_rad") for value in (math.nan, math.inf)),
    ],
)
def test_a_geometry_that_makes_no_sense_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        LidarConfig(**{name: value})  # pyright: ignore[reportArgumentType]


DIAGONAL = LidarConfig(beams=271, span_rad=1.5 * math.pi, x_m=0.3, y_m=0.2, yaw_rad=math.pi / 4)
"""At the front left corner of the rectangular hull; beam 135 is its axis, one for each degree."""


def test_a_mounted_lidar_measures_from_its_mount_along_its_own_axis() -> None:
    ranges = _scan(DIAGONAL)
    ahead, left, right = 135 - 45, 135 + 45, 135 - 135
    assert ranges[ahead] == pytest.approx(1.0 - 0.3)
    assert ranges[left] == math.inf, "the wall to the left is 10 cm wide, and not beside the mount"
    assert ranges[right] == math.inf
    assert _scan(LidarConfig(y_m=0.5))[[LEFT, RIGHT]] == pytest.approx([1.5, 4.5])


@given(x_m=st.floats(-0.5, 0.5), y_m=st.floats(-0.5, 0.5), yaw_rad=st.floats(-4.0, 4.0))
def test_a_mount_turns_and_moves_with_the_robot(x_m: float, y_m: float, yaw_rad: float) -> None:
    lidar, data = _lidar(DIAGONAL)
    mounted = lidar.scan(data, x_m, y_m, yaw_rad)
    place = complex(x_m, y_m) + complex(DIAGONAL.x_m, DIAGONAL.y_m) * cmath.exp(1j * yaw_rad)
    bare, _ = _lidar(DIAGONAL.model_copy(update={"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0}))
    there = bare.scan(data, place.real, place.imag, yaw_rad + DIAGONAL.yaw_rad)
    # A beam on the very edge of a wall may hit in one sum and miss in the other.
    assert np.isclose(mounted, there, atol=1e-4).mean() > 0.98
