"""Robots that cannot be measured without Lifeline."""

from pathlib import Path
from typing import Any, cast

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from passport import measure
from passport.cells import OF_LIFELINE, Fault
from passport.measure import Orders
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


@pytest.mark.parametrize("fault", sorted(OF_LIFELINE))
def test_a_fault_or_a_stop_of_lifeline_is_refused(tmp_path: Path, fault: Fault) -> None:
    orders = Orders("path", None, tmp_path / "out", 1, (0,), [Fault.ZERO, fault], with_lifeline=False)
    with pytest.raises(DeployError, match=f"^{fault}: not without Lifeline"):
        measure._without(cast("Any", None), StateDir(tmp_path), orders)  # pyright: ignore[reportPrivateUsage]
