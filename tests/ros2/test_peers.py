"""Tests of the peers themselves: robots, sources and observers without Lifeline."""

import itertools
import signal
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from tests.ros2.host import (
    ROS_PYTHON,
    SHARED_MEMORY,
    WITH_SHARED_MEMORY,
    Host,
    Line,
    Peer,
    shared_memory_of,
)
from tests.ros2.keyboards import KEY_TELEOP, LAB_TELEOP, VARIABLE, holding, pressing, upstream_teleop
from tests.system.ports import free_endpoint

AT_REST_M_S = 0.005
CTRL_C = "\x03"


def moves_at(speed_m_s: float) -> Callable[[Line], bool]:
    return lambda line: line.get("topic") == "odom" and abs(line["v"] - speed_m_s) < 0.01


def rests(line: Line) -> bool:
    return line.get("topic") == "odom" and abs(line["v"]) < AT_REST_M_S


def median_hz(lines: Sequence[Line]) -> float:
    return 1e9 / statistics.median(b["at_ns"] - a["at_ns"] for a, b in itertools.pairwise(lines))


def counted(observer: Peer, topic: str, count: int) -> list[Line]:
    """Wait for so many messages of a topic, and return them."""
    arrived = itertools.count(1)
    observer.until(lambda line: line.get("topic") == topic and next(arrived) == count, f"{count} of {topic}")
    return observer.of(topic)


def test_a_source_moves_the_robot_and_its_death_stops_it_after_the_robots_own_timeout(host: Host) -> None:
    host.start("diff_drive").ready()
    observer, source = host.start("observer"), host.start("source")
    source.ready().tell(v=0.5, w=0.0)
    observer.until(moves_at(0.5), "0.5 m/s")
    observer.until(lambda line: line.get("topic") == "cmd_vel" and line["v"] == 0.5, "the source's command")
    killed_ns = source.kill()
    rest = observer.until(rests, "standstill", after=len(observer.lines))
    assert 0.5 < (rest["at_ns"] - killed_ns) / 1e9 < 2.0
    assert observer.of("cmd_vel")[-1]["v"] == 0.5


def test_a_robot_without_a_timeout_keeps_the_command_of_a_killed_source(host: Host) -> None:
    host.start("diff_drive", "--timeout", "none").ready()
    observer, source = host.start("observer"), host.start("source")
    source.ready().tell(v=0.5, w=0.0)
    at_kill = observer.until(moves_at(0.5), "0.5 m/s")
    source.kill()
    later = observer.until(
        lambda line: line.get("topic") == "odom" and line["x"] - at_kill["x"] > 1.0, "another metre"
    )
    assert later["v"] == 0.5


def test_a_stamped_source_moves_a_robot_that_listens_to_stamped_commands(host: Host) -> None:
    host.start("diff_drive", "--stamped").ready()
    observer = host.start("observer", "--stamped")
    source = host.start("source", "--stamped", "--topic", "cmd_vel", "--rate", "0")
    observer.ready()
    source.ready()
    observer.until(rests, "odometry")
    for _ in range(40):  # DDS may discover the subscribers after the first of them
        source.tell(v=0.2, w=0.5)
        source.until(lambda line: line.get("sent") == [0.2, 0.5], "its message", after=len(source.lines) - 1)
        if observer.of("cmd_vel"):
            break
        counted(observer, "odom", len(observer.of("odom")) + 5)
    assert {(line["v"], line["w"]) for line in observer.of("cmd_vel")} == {(0.2, 0.5)}


def test_the_small_robot_sees_its_room_and_its_pillar(host: Host) -> None:
    host.start("diff_drive").ready()
    observer = host.start("observer", "--scan").ready()
    scans = counted(observer, "scan", 20)
    odom = observer.of("odom")
    assert scans[-1]["beams"] == 360
    assert scans[-1]["nearest"] == pytest.approx(4.0, abs=0.01)
    assert median_hz(scans) == pytest.approx(20, rel=0.1)
    assert median_hz(odom) == pytest.approx(50, rel=0.1)


def drives_by_held_key(host: Host, program: Sequence[str]) -> None:
    """Check that a held key drives the robot, and that it stands after Ctrl-C.

    The program publishes a last zero, but DDS may lose it, because its writer ends at once; then the base stops by itself.
    """
    host.start("diff_drive").ready()
    observer = host.start("observer").ready()
    terminal = host.in_terminal(*program)
    terminal.expect("(?i)ctrl-c")
    with holding(terminal, "i"):
        observer.until(moves_at(0.5), "0.5 m/s")
        counted(observer, "odom", len(observer.of("odom")) + 50)
        assert observer.of("odom")[-1]["v"] == pytest.approx(0.5)
    terminal.send(CTRL_C)
    observer.until(rests, "standstill", after=len(observer.lines))


def test_a_held_key_of_a_teleop_that_publishes_on_key_events_drives_the_robot(host: Host) -> None:
    drives_by_held_key(host, KEY_TELEOP)


def test_a_held_key_of_unmodified_teleop_twist_keyboard_drives_the_robot(host: Host) -> None:
    program = upstream_teleop()
    if program is None:
        pytest.skip(f"teleop_twist_keyboard is not on this machine: {VARIABLE} names its file")
    drives_by_held_key(host, program)


def test_the_labs_teleop_drives_and_a_stopped_one_is_silent(host: Host) -> None:
    host.start("diff_drive").ready()
    observer = host.start("observer").ready()
    terminal = host.in_terminal(*LAB_TELEOP)
    terminal.expect("quit")
    with pressing(terminal, "wwwww", then=None):
        observer.until(moves_at(0.5), "0.5 m/s")
        terminal.kill(signal.SIGSTOP)
        observer.until(rests, "standstill by the robot's own timeout", after=len(observer.lines))
        terminal.kill(signal.SIGCONT)
        observer.until(moves_at(0.5), "it goes on", after=len(observer.lines))
    host.kill_terminal(terminal)


def test_the_simulated_robot_is_a_ros_robot(host: Host) -> None:
    endpoint = free_endpoint()
    robot = host.start("sim_robot", "--endpoint", endpoint, "--timeout", "0.5").ready()
    host.start_node("sim", "--endpoint", endpoint, "--scene", "empty", "--no-viewer")
    observer = host.start("observer", "--scan").ready()
    scans = counted(observer, "scan", 20)
    assert scans[-1]["beams"] == 360
    assert median_hz(scans) == pytest.approx(20, rel=0.1)
    assert median_hz(observer.of("odom")) == pytest.approx(50, rel=0.1)
    source = host.start("source").ready()
    source.tell(v=0.5, w=0.0)
    observer.until(lambda line: line.get("topic") == "odom" and line["v"] > 0.45, "0.5 m/s")
    source.kill()
    observer.until(rests, "standstill", after=len(observer.lines))
    robot.tell(reset=True)
    robot.until(lambda line: "reset" in line, "the reset")
    observer.until(
        lambda line: line.get("topic") == "odom" and abs(line["x"]) < 0.01,
        "its start",
        after=len(observer.lines),
    )


def test_what_a_killed_process_leaves_in_shared_memory_is_removed(host: Host, tmp_path: Path) -> None:
    other = Host(host.domain, tmp_path, discovery=WITH_SHARED_MEMORY)
    source = other.start("source").ready()
    files = shared_memory_of(source.pid)
    source.kill()
    assert files
    assert all((SHARED_MEMORY / file).exists() for file in files)
    other.close()
    assert not any((SHARED_MEMORY / file).exists() for file in files)


def test_a_peer_ends_when_its_test_dies(host: Host) -> None:
    source = host.start("source").ready()
    assert source.process.stdin is not None
    source.process.stdin.close()
    assert source.process.wait(10) == 0


def test_the_environment_of_ros_needs_neither_rosbags_nor_mujoco(host: Host) -> None:
    for module in ("rosbags", "mujoco"):
        found = host.run("python", [str(ROS_PYTHON), "-c", f"import {module}"], host.variables)
        assert found.process.wait(30) == 1
