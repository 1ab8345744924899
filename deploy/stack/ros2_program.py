"""The command line and environment of `python -m ros2`, whose interpreter has rclpy and is not Lifeline's.

That interpreter finds Lifeline's packages in a directory of links, because Lifeline's environment may be for
another version of Python.
"""

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.statedir import StateDir, UnwritableError
from ros2.config import Ros2Section
from ros2.environment import ros_variables
from wire import topics
from wire.bus_config import BusConfig
from wire.host.command_line import bus_options
from wire.host.config import ConfigError, absolute, read_toml, section
from wire.host.installation import checkout

PACKAGES = ("ros2", "wire", "passport")
"""The packages that programs in that interpreter import. Of `passport`, this is only the program that replaces the ROS 2 process."""
ROOT = Path(__file__).resolve().parents[2]
"""Where Lifeline's packages are: the checkout, or `site-packages`."""
ALL_ROS = Path("/opt/ros")
SEARCH = "PYTHONPATH"
IS_SET_UP = "AMENT_PREFIX_PATH"


def interpreter(config: Path) -> Path:
    """Return the Python of the ROS 2 process: `[ros2] python`, else `.ros2/bin/python` of the checkout.

    With `rmw = "zenoh"` it needs no rclpy: this Python, unless `[ros2] python` names another one.

    Args:
        config: robot.toml; a relative path in it begins in its directory.

    Raises:
        DeployError: the section is refused, the interpreter is missing, or the installed ROS 2 is not set up.
    """
    try:
        ros2 = section(read_toml(config), "ros2", Ros2Section)
        named = ros2.python
        if named is None and ros2.rmw == "zenoh":
            return Path(sys.executable)
        root = checkout()
        python = None if root is None else root / ".ros2" / "bin" / "python"
        if named is not None:
            python = config.parent / (absolute(Path(named)) if named.startswith("~") else named)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    if python is None or not os.access(python, os.X_OK):
        missing = "no Python with rclpy is known" if python is None else f"{python} is missing"
        raise DeployError(
            f"{missing}: run `make ros2` in a checkout, or name the interpreter of an environment with rclpy in "
            "[ros2] python"
        )
    installed = unused_ros(ros_variables(python, os.environ), os.environ, ALL_ROS)
    if installed:
        raise DeployError(f"ROS 2 is not set up in this shell: run `. {installed[0]}/setup.sh` first")
    return python


def unused_ros(variables: Mapping[str, str], present: Mapping[str, str], all_ros: Path) -> list[Path]:
    """Return the installed ROS 2 distributions if none of them is set up and no other rclpy is known.

    Args:
        variables: those that `ros_variables` adds.
        present: those that are set now.
        all_ros: the directory of the distributions.
    """
    if variables or IS_SET_UP in present:
        return []
    return sorted(path.parent for path in all_ros.glob("*/setup.sh"))


def command(
    python: Path, config: Path, bus: BusConfig, *options: str, module: str = topics.ROS2
) -> list[str]:
    """Return the command line of the ROS 2 process, or of another module in its interpreter."""
    return [str(python), "-m", module, "--config", str(config), *bus_options(bus), *options]


def variables_of(python: Path, packages: Path, present: Mapping[str, str]) -> dict[str, str]:
    """Return the variables to set for the ROS 2 process, in addition to those that are set now.

    Args:
        python: its interpreter.
        packages: the directory that `link_packages` has made.
        present: the variables that are set now.
    """
    ros = ros_variables(python, present)
    others = ros.get(SEARCH, present.get(SEARCH, ""))
    return {**ros, SEARCH: ":".join(filter(None, [str(packages), others]))}


def link_packages(state: StateDir) -> Path:
    """Make a directory with links to the packages that the ROS 2 process imports, and return it.

    Raises:
        UnwritableError: the state directory is not writable.
    """
    directory = state.path / "packages"
    try:
        directory.mkdir(exist_ok=True)
        for name in PACKAGES:
            link = directory / name
            if link.is_symlink() and link.readlink() == ROOT / name:
                continue
            link.unlink(missing_ok=True)
            with suppress(FileExistsError):  # another command has just made it
                link.symlink_to(ROOT / name)
    except OSError as error:
        raise UnwritableError(state, error) from error
    return directory


def with_variables(state: StateDir, config: Path, bus: BusConfig, module: str = topics.ROS2) -> list[str]:
    """Return the command line of the ROS 2 process, or of another module in its interpreter, with its environment variables.

    Raises:
        DeployError: the interpreter is missing, or the state directory is not writable.
    """
    python = interpreter(config)
    variables = variables_of(python, link_packages(state), os.environ)
    words = [f"{name}={value}" for name, value in variables.items()]
    return ["/usr/bin/env", *words, *command(python, config, bus, module=module)]


def run(state: StateDir, config: Path, bus: BusConfig, *options: str) -> NoReturn:
    """Replace this process by the ROS 2 process with more options; the process id stays, which systemd needs for its reports.

    Raises:
        DeployError: the configuration has no `[ros2]`, or the interpreter is missing.
    """
    try:
        document = read_toml(config)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    if topics.ROS2 not in document:
        raise DeployError(
            f"{config} has no section [ros2], which names the topics of the base: give a file with --config; "
            "deploy/examples/ros2_diff_drive.toml is an example"
        )
    python = interpreter(config)
    state.create()
    variables = os.environ | variables_of(python, link_packages(state), os.environ)
    sys.stdout.flush()
    try:
        os.execve(python, command(python, config, bus, *options), variables)  # noqa: S606 - the user's own interpreter
    except OSError as error:
        raise DeployError(f"cannot run {python}: {error.strerror}") from error
