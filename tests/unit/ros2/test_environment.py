"""The environment variables of a Python with rclpy."""

from pathlib import Path

import pytest

from ros2.environment import LOCALHOST_PROFILE, dds_variables, missing_middleware, ros_variables

NOWHERE = Path("/nowhere")


def environment_of_wheels(root: Path) -> Path:
    for name in ("ros_rclpy.libs", "ros_rcl.libs", "numpy.libs"):
        (root / "env/lib/python3.11/site-packages" / name).mkdir(parents=True)
    return root / "env/bin/python"


def test_the_wheels_find_their_libraries_before_all_others_without_a_second_start(tmp_path: Path) -> None:
    variables = ros_variables(environment_of_wheels(tmp_path), {"LD_LIBRARY_PATH": "/mine"}, NOWHERE)
    libraries = tmp_path / "env/lib"
    packages = libraries / "python3.11/site-packages"
    assert variables == {
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        "LD_LIBRARY_PATH": f"{libraries}:{packages}/ros_rcl.libs:{packages}/ros_rclpy.libs:/mine",
    }


def test_an_installed_ros_is_found_without_its_setup_script(tmp_path: Path) -> None:
    (tmp_path / "ros/lib/python3.12/site-packages").mkdir(parents=True)
    ros = tmp_path / "ros"
    assert ros_variables(tmp_path / "env/bin/python", {"PYTHONPATH": "/mine"}, ros) == {
        "AMENT_PREFIX_PATH": str(ros),
        "LD_LIBRARY_PATH": f"{ros}/lib",
        "PYTHONPATH": f"{ros}/lib/python3.12/site-packages:/mine",
    }


def test_a_sourced_ros_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "ros").mkdir()
    python = tmp_path / "env/bin/python"
    assert ros_variables(python, {"AMENT_PREFIX_PATH": "/opt/ros/other"}, tmp_path / "ros") == {}


def test_without_ros_nothing_is_set(tmp_path: Path) -> None:
    assert ros_variables(tmp_path / "env/bin/python", {}, NOWHERE) == {}


@pytest.mark.parametrize(
    "present", [{}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "/mine.xml"}, {"RMW_IMPLEMENTATION": ""}]
)
def test_on_one_host_a_node_uses_udp_on_the_loopback_interface_only(present: dict[str, str]) -> None:
    assert dds_variables("localhost", present) == {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "SKIP_DEFAULT_XML_FILE": "1",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(LOCALHOST_PROFILE),
        "FASTDDS_DEFAULT_PROFILES_FILE": str(LOCALHOST_PROFILE),
    }
    assert LOCALHOST_PROFILE.is_file()


def test_another_middleware_has_the_range_of_ros() -> None:
    variables = dds_variables("localhost", {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"})
    assert variables["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_in_a_subnet_only_shared_memory_is_excluded_and_the_users_transports_remain() -> None:
    assert dds_variables("subnet", {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}) == {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    assert (
        dds_variables("subnet", {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"})["FASTDDS_BUILTIN_TRANSPORTS"]
        == "LARGE_DATA"
    )


def test_a_middleware_that_is_not_installed_is_named(tmp_path: Path) -> None:
    (tmp_path / "librmw_fastrtps_cpp.so").touch()
    present = {"LD_LIBRARY_PATH": f"/nowhere:{tmp_path}"}
    assert missing_middleware(present) is None
    assert missing_middleware(present | {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}) is None
    sentence = missing_middleware(present | {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"})
    assert sentence is not None
    assert sentence.startswith("RMW_IMPLEMENTATION=rmw_cyclonedds_cpp is not installed")
