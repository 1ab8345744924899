"""Whether a page may drive, by the robot's configuration."""

from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import ANY_BASE, Launch
from lifeline.page import painter_of, wheel_of


def launch(tmp_path: Path, text: str) -> Launch:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    return Launch.read(file, "tcp/127.0.0.1:20001")


def test_a_page_drives_as_the_source_of_teleop_which_the_supervisor_must_know(tmp_path: Path) -> None:
    wheel_of(launch(tmp_path, ""))
    unknown = '[supervisor]\nsources = [{ name = "pad", priority = 1 }]\n'
    with pytest.raises(DeployError, match=r"is not in .supervisor. sources: add it"):
        wheel_of(launch(tmp_path, unknown))
    wheel_of(launch(tmp_path, unknown + '[teleop]\nsource = "pad"\n'))


def test_without_the_robots_configuration_nothing_is_shown_and_nothing_drives(tmp_path: Path) -> None:
    robot = launch(tmp_path, "")
    assert painter_of(robot, "") is not None
    unknown = Launch(robot.config, robot.bus, nodes=("supervisor", ANY_BASE))
    assert painter_of(unknown, "") is None
    with pytest.raises(DeployError, match="name it with --config"):
        wheel_of(unknown)


async def test_before_the_supervisor_is_found_no_page_drives(tmp_path: Path) -> None:
    wheel = wheel_of(launch(tmp_path, ""))
    assert await wheel.take() == "The supervisor was not found yet: start it, and press Drive again."
    wheel.release()
