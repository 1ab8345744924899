"""`lifeline ros2 run` and `check-base`: replace this process by `python -m ros2` in the environment of ROS 2."""

import os
import sys
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.ros2_program import command, interpreter, link_packages, variables_of
from deploy.stack.statedir import StateDir
from wire import topics
from wire.host.config import ConfigError, read_toml


def run(launch: Launch, state: StateDir, *options: str) -> NoReturn:
    """Run the ROS 2 process with more options; the process id stays the same, which systemd needs for its reports.

    Raises:
        DeployError: the configuration has no `[ros2]`, or the interpreter is missing.
    """
    try:
        document = read_toml(launch.config)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    if topics.ROS2 not in document:
        raise DeployError(
            f"{launch.config} has no section [ros2], which names the topics of the base: give a file with --config; "
            "deploy/examples/ros2_diff_drive.toml is an example"
        )
    python = interpreter(launch.config)
    state.create()
    variables = os.environ | variables_of(python, link_packages(state), os.environ)
    sys.stdout.flush()
    try:
        os.execve(python, command(python, launch.config, launch.bus, *options), variables)  # noqa: S606 - the user's own interpreter
    except OSError as error:
        raise DeployError(f"cannot run {python}: {error.strerror}") from error
