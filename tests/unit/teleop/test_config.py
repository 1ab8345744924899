"""[teleop] of robot.toml."""

import pytest

from teleop.config import Mode, TeleopSection
from teleop.pilot import Velocity
from teleop.setpoint import Steps
from wire.host.config import ConfigError, section

NUMBERS = [
    "rate_hz",
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


def test_without_a_section_the_defaults_are_those_of_the_setpoint() -> None:
    config = section({}, "teleop", TeleopSection)
    assert (config.source, config.rate_hz, config.to_steps()) == ("teleop", 20.0, Steps())


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf"), "fast"])
def test_no_number_is_an_off_switch(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"teleop.{key}"):
        load(**{key: value})


@pytest.mark.parametrize("source", ["", "Teleop", "a/b", "*", "1st", "x" * 33])
def test_a_source_is_one_chunk_of_a_key(source: str) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.source"):
        load(source=source)


def test_an_unknown_key_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"teleop\.rate: there is no such key"):
        load(rate=20)


def test_the_steps_are_those_of_the_section() -> None:
    config = load(linear_step_m_s=0.5, angular_step_rad_s=0.6, max_linear_m_s=0.7, max_angular_rad_s=0.8)
    assert config.to_steps() == Steps(0.5, 0.6, 0.7, 0.8)


def test_what_may_be_asked_for_is_that_of_the_section() -> None:
    assert load(max_linear_m_s=0.7, max_angular_rad_s=0.8).most() == Velocity(0.7, 0.8)


@pytest.mark.parametrize("mode", Mode)
def test_a_mode_is_named(mode: Mode) -> None:
    assert load(mode=mode.value).mode is mode


@pytest.mark.parametrize("mode", ["", "Hold", "view only", 1])
def test_an_unknown_mode_is_refused(mode: object) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.mode"):
        load(mode=mode)


@pytest.mark.parametrize("level", [6, 2.5, True])
def test_a_level_is_a_whole_number_up_to_five(level: object) -> None:
    with pytest.raises(ConfigError, match=r"teleop\.level"):
        load(level=level)
