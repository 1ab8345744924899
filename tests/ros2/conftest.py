"""Fixtures of the tests with real ROS 2 processes (`make test-ros2`)."""

from collections.abc import Generator
from pathlib import Path

import pytest

from tests.marks import pytest_configure
from tests.ros2.host import ROS_PYTHON, Host, ros_domain
from tests.ros2.stack import MakeStack, Stack

__all__ = ["pytest_configure"]


@pytest.fixture
def host(tmp_path: Path) -> Generator[Host]:
    """Starts the processes of a test in a domain of its own, and ends them."""
    assert ROS_PYTHON.exists(), "there is no environment with rclpy: run `make test-ros2`"
    with ros_domain() as domain:
        made = Host(domain, tmp_path)
        try:
            yield made
        finally:
            made.close()


@pytest.fixture
def stack(host: Host, tmp_path: Path) -> Generator[Stack]:
    """The small robot with Lifeline, for one test."""
    host.start("diff_drive").ready()
    made = Stack(host, tmp_path)
    try:
        yield made
    finally:
        made.tidy()
        made.close()


@pytest.fixture
def make_stack(host: Host, tmp_path: Path) -> Generator[MakeStack]:
    """Lifeline for a robot that the test starts."""
    made: list[Stack] = []

    def make(ros2: str = "", *observer: str, source: str = "") -> Stack:
        made.append(Stack(host, tmp_path, ros2, observer, source))
        return made[-1]

    try:
        yield make
    finally:
        for stack in made:
            stack.close()
