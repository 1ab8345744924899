"""The part of the supervisor's configuration that the picture needs."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.launch import DEFAULT_CONFIG
from teleop.footprint import robot_of
from teleop.view import Robot


def test_without_a_section_it_is_the_default() -> None:
    assert robot_of({}) == Robot()


def test_the_example_is_the_default() -> None:
    assert robot_of(tomllib.loads(DEFAULT_CONFIG.read_text())) == Robot()


def test_what_the_file_says_is_drawn() -> None:
    text = """
        [supervisor]
        stop_distance_m = 0.4
        warning_distance_m = 1
        [supervisor.footprint]
        corners_m = [[0.3, 0.2], [-0.3, 0], [0, -0.2]]
        [supervisor.lidar]
        x_m = 0.1
        yaw_rad = -1.5
    """
    corners_m = ((0.3, 0.2), (-0.3, 0.0), (0.0, -0.2))
    assert robot_of(tomllib.loads(text)) == Robot(0.25, corners_m, 0.1, 0.0, -1.5, 0.4, 1.0)


def test_of_several_lidars_it_is_the_one_on_scan_that_is_drawn() -> None:
    lidars: list[object] = [3, {"topic": "scan_rear", "x_m": -0.3}, {"topic": "scan", "x_m": 0.2}]
    assert robot_of({"supervisor": {"lidars": lidars}}).lidar_x_m == 0.2
    assert robot_of({"supervisor": {"lidars": lidars[:2]}}).lidar_x_m == 0.0


@pytest.mark.parametrize("corners", [3, [1, 2], [[1]], [["a", 2]], "abc"])
def test_odd_corners_are_none(corners: object) -> None:
    assert robot_of({"supervisor": {"footprint": {"corners_m": corners}}}).corners_m == ()


odd = st.recursive(
    st.one_of(st.none(), st.text(max_size=3), st.floats(), st.lists(st.integers(), max_size=3)),
    lambda inner: st.dictionaries(
        st.sampled_from(["supervisor", "footprint", "lidar", "lidars", "radius_m", "corners_m", "x_m"]),
        inner,
        max_size=4,
    ),
)


@given(st.dictionaries(st.sampled_from(["supervisor", "bus"]), odd))
def test_whatever_the_file_says_it_is_the_supervisors_to_refuse(document: dict[str, object]) -> None:
    assert isinstance(robot_of(document), Robot)
