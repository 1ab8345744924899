"""Robots that cannot be measured without Lifeline."""

from pathlib import Path

import pytest

from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from passport.without import Without
from wire import topics
from wire.bus_config import BusConfig

TCP, QUIC = "tcp/127.0.0.1:7447", "quic/127.0.0.1:7447"


@pytest.mark.parametrize(
    ("endpoint", "base", "why"),
    [
        (TCP, topics.ROS2, "the process ros2 itself stops its base"),
        (QUIC, topics.SIM, "a robot with certificates"),
        (TCP, topics.SIM, "the process supervisor is not one of this computer's `lifeline up`"),
    ],
)
def test_a_robot_whose_supervisor_cannot_be_replaced_is_refused_with_the_reason(
    tmp_path: Path, endpoint: str, base: str, why: str
) -> None:
    launch = Launch(tmp_path / "robot.toml", BusConfig(endpoint), nodes=(topics.SUPERVISOR, base))
    refused = Without(launch, StateDir(tmp_path), ("teleop", "path")).refusal()
    assert refused is not None
    assert why in refused
