"""All sections of a robot.toml, against each other."""

import math
from typing import Any

import pytest

from deploy.launch import DEFAULT_CONFIG
from deploy.robot_file import read_robot
from sim.config import SimSection
from supervisor.config import SupervisorSection
from wire.config import ConfigError, read_toml


def refusal(document: dict[str, Any], *, simulated: bool = True) -> str:
    with pytest.raises(ConfigError) as caught:
        read_robot(document, simulated=simulated)
    return str(caught.value)


def test_the_complete_example_fits_together() -> None:
    assert read_robot(read_toml(DEFAULT_CONFIG), simulated=True)[SupervisorSection] == SupervisorSection()


def test_the_faults_of_all_sections_are_named_in_one_pass() -> None:
    message = refusal(
        {
            "bus": {"lease_s": 10.0},
            "supervisor": {"stop_distance_m": 1e-9},
            "teleop": {"level": 6},
            "sim": {"braking_m_s2": 0.0},
        }
    )
    for key in ("bus.lease_s", "supervisor.stop_distance_m", "teleop.level", "sim.braking_m_s2"):
        assert f"  {key} = " in message


def test_a_contradiction_is_named_beside_the_faults_of_other_sections() -> None:
    message = refusal({"bus": {"lease_s": 10.0}, "supervisor": {"deceleration_m_s2": 3.0}})
    assert "bus.lease_s" in message
    assert "supervisor.deceleration_m_s2 = 3.0: is more than the base does" in message


def test_a_real_base_is_not_held_to_the_simulated_one() -> None:
    document = {"supervisor": {"deceleration_m_s2": 3.0}}
    sections = read_robot(document, simulated=False)
    assert sections.get(SimSection) is None
    with pytest.raises(KeyError):
        sections[SimSection]
    assert "deceleration_m_s2" in refusal({**document, "sim": {}}, simulated=False)


@pytest.mark.parametrize("key", ["max_linear_m_s", "max_angular_rad_s"])
def test_teleop_may_ask_for_more_than_is_clamped_but_not_for_what_stops_the_robot(key: str) -> None:
    low = {"max_linear_m_s": 0.25, "max_angular_rad_s": 0.25}
    assert read_robot({"supervisor": low, "teleop": {key: 2.5}}, simulated=True)
    message = refusal({"supervisor": low, "teleop": {key: math.nextafter(2.5, 3.0)}})
    assert f"teleop.{key} = 2.5" in message
    assert "COMMAND_INVALID: set at most 0.25" in message


def test_teleop_speaks_often_enough() -> None:
    assert read_robot(
        {"supervisor": {"command_timeout_s": 0.1875}, "teleop": {"rate_hz": 8.0}}, simulated=True
    )
    message = refusal(
        {"supervisor": {"command_timeout_s": math.nextafter(0.1875, 0.0)}, "teleop": {"rate_hz": 8.0}}
    )
    assert "supervisor.command_timeout_s = 0.187" in message
    assert "1.5 periods of [teleop] rate_hz = 8" in message


def test_a_source_of_teleop_shadows_no_node() -> None:
    assert "teleop.source = 'sim': is a node or a topic" in refusal({"teleop": {"source": "sim"}})
