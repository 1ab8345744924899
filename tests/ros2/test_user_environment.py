"""Variables and files of the user beside the process `ros2`'s own profile (decision 0046)."""

import sys
from pathlib import Path

import pytest

from tests.ros2.host import ROOT, ROS_PYTHON, Host, Peer, shared_memory_of
from tests.ros2.test_networks import LOOPBACK, addresses
from tests.system.ports import free_endpoint

PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com"><profiles>
<participant profile_name="mine" is_default_profile="true"><rtps><builtinTransports>DEFAULT</builtinTransports></rtps></participant>
</profiles></dds>
"""
END_LIMIT_S = 20.0


def start(host: Host, folder: Path, variables: dict[str, str], ros2: str = "") -> Peer:
    """Start the supervisor, and the process `ros2` in a working directory of its own."""
    config = folder / "robot.toml"
    config.write_text(
        f'[bus]\nendpoint = "{free_endpoint()}"\n[supervisor]\nblack_box_dir = "{folder}/blackbox"\nsources = [{{ name = "joy", priority = 1 }}]\n'
        f"[ros2]\ndomain_id = {host.domain}\n{ros2}\n"
    )
    state = {"LIFELINE_STATE_DIR": str(folder)}
    host.run(
        "supervisor", [sys.executable, "-m", "supervisor", "--config", str(config)], host.variables | state
    )
    return host.run(
        "ros2",
        ["env", "-C", str(folder), str(ROS_PYTHON), "-m", "ros2", "--config", str(config)],
        {**host.rclpy_variables, "PYTHONPATH": str(ROOT), **variables},
    )


def until_connected(host: Host) -> None:
    observer = host.start("observer").ready()
    observer.until(lambda line: line.get("topic") == "cmd_vel", "cmd_vel")


@pytest.mark.parametrize(
    "variables",
    [
        {"ROS_LOCALHOST_ONLY": "1"},
        {"RMW_IMPLEMENTATION": ""},
        {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"},
        {"ROS_STATIC_PEERS": "127.0.0.2;localhost"},
        {"FASTDDS_BUILTIN_TRANSPORTS": "SHM"},
    ],
    ids=str,
)
def test_no_variable_of_the_user_brings_shared_memory_or_other_interfaces_into_the_process_ros2(
    host: Host, tmp_path: Path, variables: dict[str, str]
) -> None:
    bridge = start(host, tmp_path, variables)
    until_connected(host)
    assert addresses(bridge.pid) == {LOOPBACK}
    assert not shared_memory_of(bridge.pid)


def test_a_profile_in_the_working_directory_does_not_replace_that_of_the_process_ros2(
    host: Host, tmp_path: Path
) -> None:
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text(PROFILE)
    bridge = start(host, tmp_path, {})
    until_connected(host)
    assert addresses(bridge.pid) == {LOOPBACK}
    assert not shared_memory_of(bridge.pid)


@pytest.mark.parametrize(
    "variables",
    [
        {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"},
        {"ROS_LOG_DIR": "/proc/nowhere"},
        {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
    ],
    ids=str,
)
def test_an_environment_with_which_ros_does_not_start_is_refused_in_a_sentence(
    host: Host, tmp_path: Path, variables: dict[str, str]
) -> None:
    bridge = start(host, tmp_path, variables)
    assert bridge.process.wait(END_LIMIT_S) != 0
    log = bridge.log.read_text()
    assert "Traceback" not in log
    assert "ros2: " in log


@pytest.mark.parametrize(
    "ros2", ['odom = "scan"', 'cmd_vel = "estop"', 'sources = [{ name = "joy", topic = "/diagnostics" }]']
)
def test_one_topic_for_messages_of_two_types_is_refused_in_a_sentence(
    host: Host, tmp_path: Path, ros2: str
) -> None:
    bridge = start(host, tmp_path, {}, ros2)
    assert bridge.process.wait(END_LIMIT_S) == 2
    assert "Traceback" not in bridge.log.read_text()
