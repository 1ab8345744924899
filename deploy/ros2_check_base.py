"""`lifeline ros2 check-base`: replace this process by `python -m ros2 --check-base` in the environment of ROS 2."""

import os
import sys
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.ros2_program import command, interpreter, link_packages, variables_of
from deploy.stack.statedir import StateDir
from wire import topics


def check_base(launch: Launch, state: StateDir, *, ask: bool) -> NoReturn:
    """Measure the timeout of the base; the output and the exit code are those of the ROS 2 process.

    Raises:
        DeployError: the configuration has no `[ros2]`, or the interpreter is missing.
    """
    if topics.ROS2 not in launch.nodes:
        raise DeployError(
            f"{launch.config} has no section [ros2], which names the topics of the base: give a file with --config; "
            "deploy/examples/ros2_diff_drive.toml is an example"
        )
    python = interpreter(launch.config)
    state.create()
    variables = os.environ | variables_of(python, link_packages(state), os.environ)
    words = command(python, launch.config, launch.bus, "--check-base", *([] if ask else ["--yes"]))
    sys.stdout.flush()
    try:
        os.execve(python, words, variables)  # noqa: S606 - the user's own interpreter
    except OSError as error:
        raise DeployError(f"cannot run {python}: {error.strerror}") from error
