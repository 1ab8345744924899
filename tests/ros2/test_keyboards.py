"""A keyboard teleop of ROS 2 drives the simulated robot: terminal → ROS → Lifeline → ROS → MuJoCo."""

import signal
import time
from collections.abc import Generator, Sequence
from pathlib import Path

import pexpect
import pytest

from tests.ros2.host import Host, Line
from tests.ros2.keyboards import KEY_TELEOP, VARIABLE, holding, upstream_teleop
from tests.ros2.stack import Stack
from tests.system.ports import free_endpoint

REMAPPED = ("--ros-args", "-r", "cmd_vel:=/keys_vel")
SPEED_M_S = 0.5
HOLD_MS = 600.0
TIMEOUT_MS = 200.0
MARGIN_MS = 100.0


@pytest.fixture
def stack(host: Host, tmp_path: Path) -> Generator[Stack]:
    endpoint = free_endpoint()
    robot = host.start("sim_robot", "--endpoint", endpoint, "--timeout", "0.5")
    host.start_node("sim", "--endpoint", endpoint, "--no-view")
    robot.ready()
    made = Stack(host, tmp_path)
    try:
        yield made
    finally:
        made.close()


def at_speed(line: Line) -> bool:
    return line.get("topic") == "odom" and abs(line["v"] - SPEED_M_S) < 0.03


def drive_for_two_seconds(stack: Stack, terminal: "pexpect.spawn[str]") -> None:
    """Hold a key until the robot is at speed, and for another two seconds, in which it must not be commanded zero."""
    with holding(terminal, "i"):
        stack.observer.until(at_speed, "the speed", after=len(stack.observer.lines))
        from_ns, count = time.monotonic_ns(), 0

        def two_seconds(line: Line) -> bool:
            nonlocal count
            count += line.get("topic") == "odom" and line["at_ns"] > from_ns
            return count == 100

        stack.observer.until(two_seconds, "two seconds of odometry")
        commands = stack.observer.of("cmd_vel", from_ns=from_ns)
        assert commands
        assert all(line["v"] > 0.0 for line in commands), [line["v"] for line in commands]


def drives_and_stops(stack: Stack, program: Sequence[str]) -> None:
    terminal = stack.host.in_terminal(*program, *REMAPPED)
    terminal.expect("(?i)ctrl-c")
    stack.armed("keys")
    drive_for_two_seconds(stack, terminal)
    released_ns = time.monotonic_ns()
    released_ms = stack.zero_after(released_ns)
    assert released_ms < HOLD_MS + MARGIN_MS
    stack.rest_after(released_ns)
    drive_for_two_seconds(stack, terminal)
    with holding(terminal, "i"):
        stack.observer.until(at_speed, "the speed", after=len(stack.observer.lines))
        killed_ms = stack.zero_after(stack.host.kill_terminal(terminal))
    print(f"\nlast key to zero {released_ms:.0f} ms; SIGKILL while a key is held to zero {killed_ms:.1f} ms")
    assert killed_ms < TIMEOUT_MS + MARGIN_MS


def test_a_teleop_that_publishes_on_key_events_drives_without_a_gap_and_its_death_stops_the_robot(
    stack: Stack,
) -> None:
    drives_and_stops(stack, KEY_TELEOP)


def test_unmodified_teleop_twist_keyboard_drives_without_a_gap_and_its_death_stops_the_robot(
    stack: Stack,
) -> None:
    program = upstream_teleop()
    if program is None:
        pytest.skip(f"teleop_twist_keyboard is not on this machine: {VARIABLE} names its file")
    drives_and_stops(stack, program)


def test_a_stopped_teleop_with_a_held_key_stops_the_robot_and_keys_typed_meanwhile_do_not_move_it(
    stack: Stack,
) -> None:
    terminal = stack.host.in_terminal(*KEY_TELEOP, *REMAPPED)
    terminal.expect("(?i)ctrl-c")
    stack.armed("keys")
    assert terminal.pid is not None
    with holding(terminal, "i"):
        stack.observer.until(at_speed, "the speed", after=len(stack.observer.lines))
        at_ns = time.monotonic_ns()
        terminal.kill(signal.SIGSTOP)
        print(f"\nSIGSTOP to zero {stack.zero_after(at_ns):.1f} ms")
        stack.rest_after(at_ns)
    terminal.send("iiiii")
    terminal.kill(signal.SIGCONT)
    stack.watch.report("source keys", "guarded by")
    stack.stays_at_rest()
