"""The environment variables that a Python needs to import rclpy, from PyPI's wheels or from an installed ROS 2.

This module does not import ROS. `make ros2` creates the environment `.ros2`.
"""

from collections.abc import Mapping
from pathlib import Path

ROS = Path("/opt/ros/jazzy")
WHEELS_ARE_SET_UP = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
LIBRARIES = "LD_LIBRARY_PATH"


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


def _joined(first: list[Path], rest: str) -> str:
    return ":".join([*map(str, first), *filter(None, [rest])])
