"""What the first drive refuses before anything moves."""

from pathlib import Path

import pytest

from commission.commission import commission
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from wire.bus_config import BusConfig

BUS = BusConfig("tcp/127.0.0.1:1")


@pytest.mark.parametrize(
    ("text", "source", "lidar", "words"),
    [
        ("", "nobody", None, "nobody is not in"),
        ("", "path", "rear", "there is no lidar rear; there are: lidar"),
        ("[supervisor]\nodometry = false\n", "path", None, "without odometry, nothing can be measured"),
        ("[supervisor]\nwrong = 1\n", "path", None, "supervisor.wrong"),
        ("measured = {}\n", "path", None, "[measured] cannot be written"),
    ],
)
def test_a_file_or_an_option_that_cannot_be_used_is_refused(
    tmp_path: Path, text: str, source: str, lidar: str | None, words: str
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    with pytest.raises(DeployError) as refused:
        commission(file, Launch(file, BUS), source, lidar, None)
    assert words in str(refused.value)


def test_another_file_than_the_running_robots_is_refused(tmp_path: Path) -> None:
    file, other = tmp_path / "robot.toml", tmp_path / "other.toml"
    file.write_text("")
    with pytest.raises(DeployError, match=r"the robot was started with .*other\.toml"):
        commission(file, Launch(file, BUS), "path", None, Launch(other, BUS))
