"""Cross-checks between all sections of a robot.toml."""

import math
from typing import Any

import pytest

from deploy.stack.launch import DEFAULT_CONFIG
from deploy.stack.robot_file import read_robot
from ros2.config import Ros2Section
from sim.config import SimSection
from supervisor.config import SupervisorSection
from wire.host.config import ConfigError, read_toml


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


FRONT: dict[str, Any] = {"name": "front", "topic": "scan", "x_m": 0.2, "yaw_rad": 0.5}
REAR: dict[str, Any] = {"name": "rear", "topic": "scan_rear", "x_m": -0.2, "y_m": 0.1}


def carried(supervisor: object, sim: object) -> dict[str, Any]:
    return {"supervisor": {"lidars": supervisor}, "sim": {"lidars": sim}}


def test_the_simulated_robot_carries_the_lidars_where_the_supervisor_has_them() -> None:
    assert read_robot(carried([FRONT, REAR], [FRONT, REAR]), simulated=True)
    assert read_robot(carried([FRONT], [FRONT, REAR]), simulated=True)  # an unused one is harmless


@pytest.mark.parametrize(("key", "value"), [("x_m", 0.22), ("y_m", -0.02), ("yaw_rad", 0.52)])
def test_a_lidar_that_the_simulated_robot_carries_elsewhere_is_refused(key: str, value: float) -> None:
    message = refusal(carried([{**FRONT, key: value}], [FRONT]))
    assert f"supervisor.lidars.0.{key} = {value}: but the lidar of [sim]" in message
    assert "give [sim] the same mount" in message


def test_a_lidar_off_the_axis_is_refused_for_the_simulated_robot_whose_lidar_is_on_it() -> None:
    document = {"supervisor": {"lidar": {"x_m": 0.1}}}
    assert "supervisor.lidar.x_m = 0.1: but the lidar of [sim] on scan is at 0" in refusal(document)
    assert read_robot(document, simulated=False)


def test_a_lidar_that_the_simulated_robot_does_not_carry_is_refused() -> None:
    message = refusal({"supervisor": {"lidars": [{**FRONT, "x_m": 0.0, "yaw_rad": 0.0}, REAR]}})
    assert (
        "supervisor.lidars.1.topic = 'scan_rear': no lidar of [sim] publishes there, only on scan" in message
    )


def test_a_lidar_of_too_few_beams_is_refused() -> None:
    document: dict[str, Any] = {"supervisor": {"lidar": {"min_beams": 90}}, "sim": {"lidar_beams": 90}}
    assert read_robot(document, simulated=True)
    message = refusal({**document, "sim": {"lidar_beams": 89}})
    assert "supervisor.lidar.min_beams = 90: is more than the 89 beams of this lidar in [sim]" in message


def test_a_source_of_teleop_shadows_no_node() -> None:
    assert "teleop.source = 'sim': is a node or a topic" in refusal({"teleop": {"source": "sim"}})


# --- ROS 2


def test_each_ros_2_source_is_one_of_the_supervisors_and_not_the_keyboards() -> None:
    def document(name: str) -> dict[str, Any]:
        return {"ros2": {"sources": [{"name": name, "topic": "commands"}]}}

    assert read_robot(document("joy"), simulated=False)[Ros2Section].sources[0].name == "joy"
    message = refusal(document("planner"), simulated=False)
    assert (
        "ros2.sources.0.name = 'planner': is none of [supervisor] sources, which are teleop, joy, path"
        in message
    )
    message = refusal(document("teleop"), simulated=False)
    assert "ros2.sources.0.name = 'teleop': is the source of the keyboard" in message
    assert "such as joy" in message
    assert read_robot({**document("teleop"), "teleop": {"source": "joy"}}, simulated=False)


def test_there_is_one_scan_topic_of_ros_2_for_each_lidar() -> None:
    two: dict[str, Any] = {"supervisor": {"lidars": [FRONT, REAR]}}
    assert read_robot({**two, "ros2": {"scan": ["scan", "rear/scan"]}}, simulated=False)
    message = refusal({**two, "ros2": {}}, simulated=False)
    assert "ros2.scan = 'scan': must name one topic for each lidar of [supervisor]" in message
    assert "there are 2 (front, rear)" in message
    message = refusal({"ros2": {"scan": ["scan", "rear/scan"]}}, simulated=False)
    assert "ros2.scan = ['scan', 'rear/scan']" in message
    assert "there is 1 (lidar)" in message


def test_the_timeout_of_ros_2_is_at_least_two_ticks() -> None:
    assert read_robot({"ros2": {"command_timeout_s": 0.04}}, simulated=False)
    message = refusal({"ros2": {"command_timeout_s": math.nextafter(0.04, 0.0)}}, simulated=False)
    assert "ros2.command_timeout_s = 0.03" in message
    assert "2 ticks of [supervisor] tick_hz = 50" in message


def test_the_router_of_rmw_zenoh_has_another_port_than_the_supervisor() -> None:
    message = refusal({"ros2": {"rmw": "zenoh", "router": "tcp/localhost:7447"}}, simulated=False)
    assert "ros2.router = 'tcp/localhost:7447'" in message
    assert "give [bus] endpoint another port" in message


def test_without_its_section_there_is_no_ros_2() -> None:
    assert read_robot({}, simulated=True).get(Ros2Section) is None
    assert "ros2.domain_id = 300" in refusal({"ros2": {"domain_id": 300}}, simulated=False)
