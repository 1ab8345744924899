"""`lifeline ros2`: what is refused, and the profile."""

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner

from deploy.stack.errors import DeployError
from lifeline.cli.app import app
from lifeline.ros2_exec import check_source
from ros2.config import Ros2Section

ROS2 = Ros2Section.model_validate({"sources": [{"name": "joy", "topic": "joy/cmd_vel"}]})
DDS = "{http://www.eprosima.com}"


@pytest.mark.parametrize("name", ["sim", "supervisor", "A B", "", "\x1b[2J", "x" * 33])
def test_a_name_that_cannot_be_a_source_is_refused(name: str) -> None:
    with pytest.raises(DeployError, match="is no name of a command source") as caught:
        check_source(name, None, "robot.toml")
    assert str(caught.value).isprintable()


def test_with_a_section_the_source_is_one_of_its_own() -> None:
    check_source("joy", ROS2, "robot.toml")
    with pytest.raises(DeployError, match=r"'pilot' is no source of \[ros2\] in robot\.toml: there are joy"):
        check_source("pilot", ROS2, "robot.toml")
    with pytest.raises(DeployError, match="there are none"):
        check_source("pilot", Ros2Section(), "robot.toml")


def test_without_a_section_the_file_is_not_the_robots_own_and_any_name_is_accepted() -> None:
    check_source("pilot", None, "robot.toml")


def test_a_base_without_a_section_cannot_be_checked(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("")
    result = CliRunner().invoke(app, ["ros2", "check-base", "--config", str(config)])
    assert result.exit_code == 2
    assert "has no section [ros2]" in result.output


def test_the_profile_has_a_lease_of_three_announcements() -> None:
    result = CliRunner().invoke(app, ["ros2", "profile"])
    assert result.exit_code == 0
    root = ET.fromstring(result.output)
    (config,) = root.iter(f"{DDS}discovery_config")

    def seconds(name: str) -> float:
        duration = config.find(f"{DDS}{name}")
        assert duration is not None
        return int(duration.findtext(f"{DDS}sec") or "") + 1e-9 * int(
            duration.findtext(f"{DDS}nanosec") or ""
        )

    assert seconds("leaseDuration") == pytest.approx(0.3)
    assert seconds("leaseAnnouncement") == pytest.approx(0.1)
    (participant,) = root.iter(f"{DDS}participant")
    assert participant.get("is_default_profile") == "true"
