"""How the ROS 2 process is started: its interpreter, its variables, and the packages that it finds."""

import sys
from pathlib import Path

import pytest

from deploy.stack import ros2_program
from deploy.stack.errors import DeployError
from deploy.stack.ros2_program import (
    command,
    interpreter,
    link_packages,
    unused_ros,
    variables_of,
    with_variables,
)
from deploy.stack.statedir import StateDir
from wire.bus_config import BusConfig


def config(directory: Path, line: str = "") -> Path:
    path = directory / "robot.toml"
    path.write_text(f"[ros2]\n{line}\n")
    return path


def python(directory: Path) -> Path:
    """An environment made by `uv venv` whose interpreter does nothing."""
    path = directory / "env" / "bin" / "python"
    path.parent.mkdir(parents=True)
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return path


@pytest.fixture(autouse=True)
def no_installed_ros(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("AMENT_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("deploy.stack.ros2_program.ALL_ROS", tmp_path / "ros")


def test_a_relative_interpreter_is_looked_for_beside_the_configuration(tmp_path: Path) -> None:
    here = python(tmp_path)
    assert interpreter(config(tmp_path, 'python = "env/bin/python"')) == here
    assert interpreter(config(tmp_path, f'python = "{here}"')) == here


def test_a_robot_with_rmw_zenoh_needs_no_rclpy(tmp_path: Path) -> None:
    here = python(tmp_path)
    assert interpreter(config(tmp_path, 'rmw = "zenoh"')) == Path(sys.executable)
    assert interpreter(config(tmp_path, f'rmw = "zenoh"\npython = "{here}"')) == here


def test_the_default_interpreter_is_that_of_make_ros2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.stack.ros2_program.checkout", lambda: tmp_path)
    with pytest.raises(DeployError, match=r"\.ros2/bin/python is missing: run `make ros2`"):
        interpreter(config(tmp_path))
    monkeypatch.setattr("deploy.stack.ros2_program.checkout", lambda: None)
    with pytest.raises(DeployError, match=r"no Python with rclpy is known: .*\[ros2\] python"):
        interpreter(config(tmp_path))


def test_an_installed_ros_2_that_is_not_set_up_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python(tmp_path)
    path = config(tmp_path, 'python = "env/bin/python"')
    (tmp_path / "ros" / "kilted").mkdir(parents=True)
    (tmp_path / "ros" / "kilted" / "setup.sh").touch()
    with pytest.raises(DeployError, match=r"is not set up in this shell: run `\. .*/ros/kilted/setup\.sh`"):
        interpreter(path)
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/kilted")
    assert interpreter(path)


def test_an_installed_ros_2_does_not_matter_if_the_environment_has_its_own(tmp_path: Path) -> None:
    (tmp_path / "jazzy").mkdir()
    (tmp_path / "jazzy" / "setup.sh").touch()
    assert unused_ros({}, {}, tmp_path) == [tmp_path / "jazzy"]
    assert unused_ros({"LD_LIBRARY_PATH": "/env/lib"}, {}, tmp_path) == []


def test_its_packages_come_first_and_the_callers_path_remains(tmp_path: Path) -> None:
    here = python(tmp_path)
    assert variables_of(here, tmp_path, {}) == {"PYTHONPATH": str(tmp_path)}
    present = {"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "PYTHONPATH": "/opt/ros/jazzy/packages"}
    assert variables_of(here, tmp_path, present)["PYTHONPATH"] == f"{tmp_path}:/opt/ros/jazzy/packages"


def test_the_wheels_need_their_libraries_and_no_second_start(tmp_path: Path) -> None:
    here = python(tmp_path)
    libraries = tmp_path / "env" / "lib" / "python3.11" / "site-packages" / "ros_rclpy.libs"
    libraries.mkdir(parents=True)
    assert variables_of(here, tmp_path, {"LD_LIBRARY_PATH": "/own"}) == {
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        "LD_LIBRARY_PATH": f"{tmp_path / 'env' / 'lib'}:{libraries}:/own",
        "PYTHONPATH": str(tmp_path),
    }


def test_only_the_packages_of_the_ros_2_process_are_linked(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    stale = tmp_path / "packages" / "ros2"
    stale.parent.mkdir()
    stale.symlink_to(tmp_path / "an earlier checkout")
    for _ in range(2):
        directory = link_packages(state)
        assert sorted(link.name for link in directory.iterdir()) == ["passport", "ros2", "wire"]
        assert (directory / "ros2" / "__init__.py").samefile(ros2_program.ROOT / "ros2" / "__init__.py")


def test_an_unwritable_state_directory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "packages").touch()
    with pytest.raises(DeployError, match="cannot write in the state directory"):
        link_packages(StateDir(tmp_path))


def test_the_command_line_is_one_of_shell_words(tmp_path: Path) -> None:
    home = tmp_path / "a robot"
    home.mkdir()
    here = python(home)
    path = config(home, 'python = "env/bin/python"')
    bus = BusConfig("tcp/127.0.0.1:2222")
    words = with_variables(StateDir(home), path, bus)
    assert words == ["/usr/bin/env", f"PYTHONPATH={home / 'packages'}", *command(here, path, bus)]
    assert words[2:] == [
        *(str(here), "-m", "ros2", "--config", str(path), "--endpoint", "tcp/127.0.0.1:2222")
    ]
