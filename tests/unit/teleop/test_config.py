"""[teleop] and [teleop.gamepad] of robot.toml, and the part of the supervisor's configuration that the picture needs."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.launch import DEFAULT_CONFIG
from teleop.pilots.config import GamepadSection, TeleopSection
from teleop.pilots.keyboard import Incremental
from teleop.pilots.pilot import Ramp, Velocity
from teleop.screen.top_view import robot_of
from teleop.screen.view import Control, Robot
from teleop.service import Setup
from wire.host.config import ConfigError, section

NUMBERS = [
    "rate_hz",
    "vigilance_s",
    "linear_step_m_s",
    "angular_step_rad_s",
    "max_linear_m_s",
    "max_angular_rad_s",
    "level",
    "acceleration_m_s2",
    "angular_acceleration_rad_s2",
    "hold_linear_m_s",
    "hold_angular_rad_s",
]


def load(**values: object) -> TeleopSection:
    return section({"teleop": values}, "teleop", TeleopSection)


def test_without_a_section_the_defaults_are_those_of_the_pilot() -> None:
    config = section({}, "teleop", TeleopSection)
    assert (config.source, config.rate_hz) == ("teleop", 20.0)
    ramp = Ramp(config.acceleration_m_s2, config.angular_acceleration_rad_s2)
    configured, default = Incremental(ramp, config.step(), config.most(), config.level), Incremental(ramp)
    assert (configured.note, configured.limit, configured.level) == (
        default.note,
        default.limit,
        default.level,
    )


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf"), "fast"])
def test_no_number_is_an_off_switch(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"teleop.{key}"):
        load(**{key: value})


@pytest.mark.parametrize("vigilance_s", [math.nextafter(2.0, 0.0), math.nextafter(120.0, 121.0)])
def test_a_vigilance_outside_its_range_is_refused_and_its_ends_are_not(vigilance_s: float) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.vigilance_s.*from 2 to 120"):
        load(vigilance_s=vigilance_s)
    assert load(vigilance_s=float(round(vigilance_s))).vigilance_s == round(vigilance_s)


def test_the_vigilance_of_a_setup_is_that_of_the_configuration() -> None:
    assert Setup("", "", Control.INCREMENTAL).vigilance_s == load().vigilance_s


@pytest.mark.parametrize("source", ["", "Teleop", "a/b", "*", "1st", "x" * 33])
def test_a_source_is_one_chunk_of_a_key(source: str) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.source"):
        load(source=source)


def test_an_unknown_key_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"teleop\.rate: there is no such key"):
        load(rate=20)


def test_the_steps_are_those_of_the_section() -> None:
    config = load(linear_step_m_s=0.5, angular_step_rad_s=0.6, max_linear_m_s=0.7, max_angular_rad_s=0.8)
    assert (config.step(), config.most()) == (Velocity(0.5, 0.6), Velocity(0.7, 0.8))


def test_what_may_be_asked_for_is_that_of_the_section() -> None:
    assert load(max_linear_m_s=0.7, max_angular_rad_s=0.8).most() == Velocity(0.7, 0.8)


@pytest.mark.parametrize("mode", ["incremental", "hold", "gamepad"])
def test_a_mode_is_named(mode: str) -> None:
    assert load(mode=mode).mode == mode


@pytest.mark.parametrize("mode", ["", "Hold", "view only", 1])
def test_an_unknown_mode_is_refused(mode: object) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.mode"):
        load(mode=mode)


@pytest.mark.parametrize("level", [6, 2.5, True])
def test_a_level_is_a_whole_number_up_to_five(level: object) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.level"):
        load(level=level)


# --- the gamepad


GAMEPAD_NUMBERS = ["dead_zone", "normal_share", "turbo_share", "silence_limit_s", "pulse_limit_s"]


def load_gamepad(**values: object) -> GamepadSection:
    return section({"gamepad": values}, "gamepad", GamepadSection)


@pytest.mark.parametrize("key", GAMEPAD_NUMBERS)
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), "much"])
def test_no_number_of_the_gamepad_is_an_off_switch(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load_gamepad(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("dead_zone", 0.51), ("normal_share", 1.01), ("turbo_share", 1.01), ("silence_limit_s", 30.1)],
)
def test_every_number_has_an_upper_limit(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load_gamepad(**{key: value})


@pytest.mark.parametrize("key", ["silence_limit_s", "pulse_limit_s"])
def test_a_limit_on_silence_leaves_room_for_two_looks(key: str) -> None:
    assert load_gamepad(**{key: 0.2})
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load_gamepad(**{key: 0.19})


@pytest.mark.parametrize(
    ("key", "value"), [("forward_axis", "BTN_TL"), ("turn_axis", "abs_x"), ("dead_man_button", "ABS_Z")]
)
def test_axes_and_buttons_go_by_their_linux_names(key: str, value: str) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key} = '{value}'"):
        load_gamepad(**{key: value})


def test_one_axis_does_not_do_both() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turn_axis = 'ABS_Y': expected another axis"):
        load_gamepad(turn_axis="ABS_Y")


def test_one_button_does_not_do_both() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turbo_button = 'BTN_TL': expected another button"):
        load_gamepad(turbo_button="BTN_TL")


def test_turbo_is_not_slower() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turbo_share = 0.4: expected at least normal_share"):
        load_gamepad(turbo_share=0.4)


def test_a_wrong_first_value_does_not_hide_the_second() -> None:
    with pytest.raises(ConfigError, match=r"(?s)normal_share.*turbo_share = 0"):
        load_gamepad(normal_share=2.0, turbo_share=0.0)


def test_a_device_is_a_path() -> None:
    assert load_gamepad(device="/dev/input/event5").device == "/dev/input/event5"
    with pytest.raises(ConfigError, match=r"gamepad.device"):
        load_gamepad(device="event5")


def test_turbo_may_be_no_faster() -> None:
    assert load_gamepad(turbo_share=0.5).turbo_share == 0.5


# --- the robot in the picture


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
