"""Where the ROS 2 process listens, which nodes it reaches, and what the start of other programs does to the robot."""

import os
import subprocess
from collections.abc import Generator
from itertools import pairwise
from pathlib import Path

import pytest

from ros2.environment import DISCOVERY_RANGE
from tests.ros2.host import ROS_PYTHON, WITH_SHARED_MEMORY, Host, ros_domain
from tests.ros2.stack import Stack
from tests.system.process_state import listening

JOINING = 8
LONGEST_GAP_S = 0.25
"""Between the command timeout and the 0.35 s for which Fast DDS blocks a process that uses shared memory."""
LIMIT_S = 60.0
LOOPBACK = "0100007F"


def addresses(pid: int) -> set[str]:
    """Return the local addresses on which a process receives, as the kernel writes them."""
    return {address for address, _ in listening(pid)}


def test_on_one_host_the_ros2_process_has_no_socket_beyond_the_loopback_interface(stack: Stack) -> None:
    stack.watch.report("cmd_vel", "diff_drive")
    assert addresses(stack.bridge.pid) == {LOOPBACK}


def test_programs_that_start_do_not_interrupt_a_driven_robot(stack: Stack, tmp_path: Path) -> None:
    """The programs use shared memory, as ROS 2 does by default."""
    others = Host(stack.host.domain, tmp_path, discovery=WITH_SHARED_MEMORY)
    stack.drive(stack.source())
    begin = len(stack.observer.lines)
    try:
        for number in range(JOINING):
            others.start("publishers", "--name", f"other{number}", "--topic", "/elsewhere").ready()
    finally:
        others.close()
    lines = stack.observer.lines[begin:]
    gaps_s = {
        topic: max(
            (b["at_ns"] - a["at_ns"]) / 1e9
            for a, b in pairwise(line for line in lines if line.get("topic") == topic)
        )
        for topic in ("odom", "cmd_vel")
    }
    print(f"\n{JOINING} programs have joined: longest gaps [s] {gaps_s}")
    assert max(gaps_s.values()) < LONGEST_GAP_S


@pytest.fixture
def namespace() -> Generator[str]:
    """Yield a network namespace with a loopback interface only."""
    name = f"lifeline-ros2-{os.getpid()}"
    subprocess.run(["ip", "netns", "add", name], check=True, timeout=LIMIT_S)
    try:
        subprocess.run(["ip", "-n", name, "link", "set", "lo", "up"], check=True, timeout=LIMIT_S)
        yield name
    finally:
        subprocess.run(["ip", "netns", "delete", name], check=True, timeout=LIMIT_S)


@pytest.mark.skipif(os.geteuid() != 0, reason="creates a network namespace: needs root")
@pytest.mark.parametrize("discovery_range", ["SUBNET", "LOCALHOST"])
def test_a_robot_with_the_settings_of_ros_is_heard_and_commanded(
    namespace: str, tmp_path: Path, discovery_range: str
) -> None:
    inside = ("ip", "netns", "exec", namespace)
    with ros_domain() as domain:
        robots = Host(domain, tmp_path, prefix=inside, discovery={DISCOVERY_RANGE: discovery_range})
        config = tmp_path / "robot.toml"
        config.write_text(f"[ros2]\ndomain_id = {domain}\n")
        command = [str(ROS_PYTHON), "-m", "ros2", "--config", str(config), "--check-base", "--yes"]
        try:
            robots.start("diff_drive").ready()
            done = subprocess.run(
                [*inside, *command],
                env=robots.rclpy_variables,
                capture_output=True,
                text=True,
                timeout=LIMIT_S,
                check=False,
            )
        finally:
            robots.close()
    assert done.returncode == 0, done.stderr
    assert "it has a timeout of its own" in done.stdout
