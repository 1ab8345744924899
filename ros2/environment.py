"""The environment variables with which a process can import rclpy and reach other nodes.

This module does not import ROS. `make ros2` creates the environment `.ros2`.
"""

from collections.abc import Mapping
from pathlib import Path

ROS = Path("/opt/ros/jazzy")
WHEELS_ARE_SET_UP = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
LIBRARIES = "LD_LIBRARY_PATH"
LOCALHOST_PROFILE = Path(__file__).with_name("fastdds_localhost.xml")
PROFILE_FILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""The variables that name the profile of Fast DDS 2 and of Fast DDS 3."""
DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
OLD_DISCOVERY_RANGE = "ROS_LOCALHOST_ONLY"
"""Replaces the range where it is set."""


def ros_variables(python: Path, present: Mapping[str, str], ros: Path = ROS) -> dict[str, str]:
    """Return the variables with which this interpreter can import rclpy.

    Without these variables, a Python with the wheels restarts itself to set them. An installed ROS needs what its
    `setup.bash` sets; if that was sourced already, nothing is added.

    Args:
        python: the interpreter of a virtual environment.
        present: the variables that are set now.
        ros: where ROS 2 is installed.
    """
    environment = python.absolute().parent.parent
    libraries = sorted(environment.glob("lib/python3.*/site-packages/ros_*.libs"))
    if libraries:
        return {
            WHEELS_ARE_SET_UP: "1",
            LIBRARIES: _joined([environment / "lib", *libraries], present.get(LIBRARIES, "")),
        }
    if "AMENT_PREFIX_PATH" in present or not ros.is_dir():
        return {}
    return {
        "AMENT_PREFIX_PATH": str(ros),
        LIBRARIES: _joined([ros / "lib"], present.get(LIBRARIES, "")),
        "PYTHONPATH": _joined(sorted(ros.glob("lib/python3.*/site-packages")), present.get("PYTHONPATH", "")),
    }


def dds_variables(discovery_range: str, present: Mapping[str, str]) -> dict[str, str]:
    """Return the variables with which a node finds others: on one host over loopback only, and without shared memory.

    With shared memory, Fast DDS blocks a process's publishers for up to 0.35 s when another process joins, and killed
    processes leave files. A Fast DDS profile of the user has an effect only with `subnet` (docs/decisions/0046).

    Args:
        discovery_range: `localhost` or `subnet`.
        present: the variables that are set now.
    """
    is_fast_dds = (present.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp").startswith("rmw_fastrtps")
    if discovery_range == "localhost" and is_fast_dds:
        return {
            DISCOVERY_RANGE: "SYSTEM_DEFAULT",
            **dict.fromkeys(PROFILE_FILES, str(LOCALHOST_PROFILE)),
            "SKIP_DEFAULT_XML_FILE": "1",  # a profile in the working directory
        }
    transports = present.get("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    return {DISCOVERY_RANGE: discovery_range.upper(), "FASTDDS_BUILTIN_TRANSPORTS": transports}


def missing_middleware(present: Mapping[str, str]) -> str | None:
    """Return a sentence if the chosen middleware is not installed, with which rclpy ends the process; None if it is.

    Args:
        present: the variables that are set now.
    """
    name = present.get("RMW_IMPLEMENTATION", "")
    folders = filter(None, present.get(LIBRARIES, "").split(":"))
    if not name or any((Path(folder) / f"lib{name}.so").exists() for folder in folders):
        return None
    return f"RMW_IMPLEMENTATION={name} is not installed for this Python: install it, or unset the variable"


def _joined(first: list[Path], rest: str) -> str:
    return ":".join([*map(str, first), *filter(None, [rest])])
