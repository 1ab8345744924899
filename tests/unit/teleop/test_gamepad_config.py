"""[teleop.gamepad] of robot.toml."""

import pytest

from teleop.gamepad_config import GamepadSection
from wire.host.config import ConfigError, section

NUMBERS = ["dead_zone", "normal_share", "turbo_share", "silence_limit_s", "pulse_limit_s"]


def load(**values: object) -> GamepadSection:
    return section({"gamepad": values}, "gamepad", GamepadSection)


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), "much"])
def test_no_number_is_an_off_switch(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("dead_zone", 0.51), ("normal_share", 1.01), ("turbo_share", 1.01), ("silence_limit_s", 30.1)],
)
def test_every_number_has_an_upper_limit(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load(**{key: value})


@pytest.mark.parametrize("key", ["silence_limit_s", "pulse_limit_s"])
def test_a_limit_on_silence_leaves_room_for_two_looks(key: str) -> None:
    assert load(**{key: 0.2})
    with pytest.raises(ConfigError, match=f"gamepad.{key}"):
        load(**{key: 0.19})


@pytest.mark.parametrize(
    ("key", "value"), [("forward_axis", "BTN_TL"), ("turn_axis", "abs_x"), ("dead_man_button", "ABS_Z")]
)
def test_axes_and_buttons_go_by_their_linux_names(key: str, value: str) -> None:
    with pytest.raises(ConfigError, match=f"gamepad.{key} = '{value}'"):
        load(**{key: value})


def test_one_axis_does_not_do_both() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turn_axis = 'ABS_Y': expected another axis"):
        load(turn_axis="ABS_Y")


def test_one_button_does_not_do_both() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turbo_button = 'BTN_TL': expected another button"):
        load(turbo_button="BTN_TL")


def test_turbo_is_not_slower() -> None:
    with pytest.raises(ConfigError, match=r"gamepad.turbo_share = 0.4: expected at least normal_share"):
        load(turbo_share=0.4)


def test_a_wrong_first_value_does_not_hide_the_second() -> None:
    with pytest.raises(ConfigError, match=r"(?s)normal_share.*turbo_share = 0"):
        load(normal_share=2.0, turbo_share=0.0)


def test_a_device_is_a_path() -> None:
    assert load(device="/dev/input/event5").device == "/dev/input/event5"
    with pytest.raises(ConfigError, match=r"gamepad.device"):
        load(device="event5")


def test_turbo_may_be_no_faster() -> None:
    assert load(turbo_share=0.5).turbo_share == 0.5
