"""The process `ros2` before a program that plays the supervisor at its endpoint: another user's moves no robot (decision 0060)."""

import os
import sys
import time
from pathlib import Path

import pytest

from tests.ros2.host import ROS_PYTHON, Host, Line, Peer
from tests.ros2.stack import CONFIGURATION
from tests.system.ports import free_endpoint
from tests.system.test_fake_hub import FOR_S, ROOT, SPEED_M_S, STRANGER, fake_hub, needs_root, refusals, said

BRAKED_M_S = 0.02


class Robot:
    """A robot with the process `ros2`, and without a supervisor."""

    def __init__(self, host: Host, folder: Path) -> None:
        self.endpoint = free_endpoint()
        self.config = folder / "robot.toml"
        self.config.write_text(
            CONFIGURATION.format(
                endpoint=self.endpoint, folder=folder, domain=host.domain, ros2="", source=""
            )
        )
        self.elsewhere = folder / "elsewhere"
        """For the socket of a fake hub, so that `ros2` finds only the TCP endpoint."""
        self.elsewhere.mkdir(mode=0o700)
        (folder / "state").mkdir()
        self._host, self._state = host, {"LIFELINE_STATE_DIR": str(folder / "state")}
        host.start("diff_drive").ready()
        self.observer = host.start("observer").ready()

    def start(self) -> Peer:
        """Start the process `ros2`."""
        command = [str(ROS_PYTHON), "-m", "ros2", "--config", str(self.config)]
        return self._host.run("ros2", command, self._host.rclpy_variables)

    def start_supervisor(self) -> None:
        command = [sys.executable, "-m", "supervisor", "--config", str(self.config)]
        self._host.run("supervisor", command, {**self._host.variables, **self._state})

    def until_at(self, least_m_s: float, most_m_s: float) -> None:
        """Wait until odometry from now on shows a speed within these bounds."""
        from_ns = time.monotonic_ns()

        def is_so(line: Line) -> bool:
            return (
                line.get("topic") == "odom" and line["at_ns"] > from_ns and least_m_s <= line["v"] <= most_m_s
            )

        self.observer.until(is_so, f"{least_m_s} to {most_m_s} m/s")

    def stands_for(self, seconds: float) -> None:
        """Check that every odometry message of the robot's own driver shows standstill."""
        from_ns = time.monotonic_ns()
        until_ns = from_ns + round(1e9 * seconds)
        self.observer.until(
            lambda line: line.get("topic") == "odom" and line["at_ns"] > until_ns, f"odometry in {seconds} s"
        )
        moving = [line for line in self.observer.of("odom", from_ns=from_ns) if abs(line["v"]) > BRAKED_M_S]
        assert not moving, moving[:3]


@needs_root
async def test_ros2_moves_no_robot_for_another_user_who_took_the_port_before_the_supervisor(
    host: Host, tmp_path: Path
) -> None:
    robot = Robot(host, tmp_path)
    async with fake_hub(robot.endpoint, STRANGER, robot.elsewhere) as fake:
        ros2 = robot.start()
        await said(ros2.log, f"it is a program of the user {STRANGER}")
        robot.stands_for(FOR_S)
        assert await fake.heard() == (0, 0.0), "it is not even heard"
    assert refusals(ros2.log) == 1
    robot.start_supervisor()
    await said(ros2.log, "node ")


async def test_ros2_follows_a_hub_of_its_own_user_and_brakes_for_another_user_who_takes_the_port_after_it(
    host: Host, tmp_path: Path
) -> None:
    robot = Robot(host, tmp_path)
    ros2 = robot.start()
    async with fake_hub(robot.endpoint, os.getuid(), robot.elsewhere):
        robot.until_at(0.9 * SPEED_M_S, 1.1 * SPEED_M_S)
    if os.getuid() != ROOT:
        pytest.skip("needs root, to become another user")
    async with fake_hub(robot.endpoint, STRANGER, robot.elsewhere):
        await said(ros2.log, "refused the hub at")
        robot.until_at(-BRAKED_M_S, BRAKED_M_S)
        robot.stands_for(FOR_S)
    async with fake_hub(robot.endpoint, ROOT, robot.elsewhere):
        robot.until_at(0.9 * SPEED_M_S, 1.1 * SPEED_M_S)
