"""Checks the configuration before the start. Without a sim, it needs neither MuJoCo nor a scene."""

from deploy.stack.errors import DeployError
from deploy.stack.interrupts import held_back
from deploy.stack.launch import Launch
from deploy.stack.robot_file import read_robot
from wire import topics
from wire.host.config import ConfigError, read_toml


def check(launch: Launch) -> None:
    """Refuse a configuration that would fail or be unsafe at runtime.

    Raises:
        DeployError: a section or the scene is invalid, the simulated robot extends beyond the footprint, or the
            interpreter of the ROS 2 process is missing.
    """
    try:
        sections = read_robot(read_toml(launch.config), simulated=topics.SIM in launch.nodes)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    if topics.SIM in launch.nodes:
        with held_back():
            from deploy.stack.preflight_sim import check_scene  # noqa: PLC0415 - needs the extra `sim`

        check_scene(launch, sections)
    if topics.ROS2 in launch.nodes:
        from deploy.stack.ros2_program import interpreter  # noqa: PLC0415 - not without [ros2]

        interpreter(launch.config)
