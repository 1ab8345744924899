"""`lifeline` with a real ROS 2 robot: `up`, `status`, `doctor` and `down`, and `ros2 exec` around a real source."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from deploy.stack import processes, takedown
from deploy.stack.statedir import StateDir
from tests.ros2.host import ROOT, ROS_PYTHON, Host, Line, Peer
from tests.ros2.stack import ATTEMPTS, SPEED_LIMIT_S, Watch
from tests.system.ports import free_endpoint
from wire.messages import SafetyStatus

SPEED_M_S = 0.3
COMMAND_LIMIT_S = 60
GENEROUS_LEASE_S = 3.0
"""Ten times the lease of 0.3 s in the profile; the default lease is 20 s."""
AT_ONCE_MS = 150.0
"""Less than the supervisor's command timeout of 200 ms."""


@dataclass
class Robot:
    """A robot that `lifeline up` has started, with an observer."""

    state: StateDir
    config: Path
    host: Host
    observer: Peer
    watch: Watch

    def lifeline(self, *words: str) -> subprocess.CompletedProcess[str]:
        return lifeline(self.state, *words)

    def status(self) -> dict[str, Any]:
        return json.loads(self.lifeline("status", "--json").stdout)

    def prints(self, text: str, *words: str) -> None:
        """Repeat a command until it prints a text, which may span lines; on a busy machine, one call may show nothing."""
        shown = ""
        for _ in range(ATTEMPTS):
            shown = self.lifeline(*words).stdout
            if text in " ".join(shown.split()):
                return
        raise AssertionError(f"not printed: {text}; {shown}")

    def guarded_source(self) -> Peer:
        """Start a source under `lifeline ros2 exec`."""
        program = [str(ROS_PYTHON), "-m", "tests.ros2.peers.source", "--topic", "/joy_vel"]
        words = ["ros2", "exec", "--source", "joy", "--config", str(self.config), "--", *program]
        wrapper = self.host.run(
            "exec", [sys.executable, "-m", "lifeline.cli.app", *words], self.host.variables
        )
        self.watch.report("source joy", "lifeline ros2 exec")
        return wrapper

    def drive(self, source: Peer, speed_m_s: float) -> None:
        """Drive; on a busy machine, the robot may stop in between. The source then starts again."""
        for _ in range(ATTEMPTS):
            source.tell(v=0.0)
            self.watch.until(
                lambda w: w.status is not None and w.status.mode == SafetyStatus.READY, "READY for motion"
            )
            seen = len(self.observer.lines)
            source.tell(v=speed_m_s)
            with suppress(AssertionError):
                self.observer.until(
                    lambda line: line.get("topic") == "odom" and abs(line["v"] - speed_m_s) < 0.02,
                    "motion",
                    after=seen,
                    within_s=SPEED_LIMIT_S,
                )
                return
        raise AssertionError(f"not at {speed_m_s} m/s after {ATTEMPTS} attempts; {self.watch.status}")

    def zero_after(self, from_ns: int) -> float:
        """Return the time from `from_ns` to the first zero on cmd_vel [ms]."""

        def is_zero(line: Line) -> bool:
            return line.get("topic") == "cmd_vel" and line["at_ns"] >= from_ns and line["v"] == 0.0

        return (self.observer.until(is_zero, "zero on cmd_vel")["at_ns"] - from_ns) / 1e6


def lifeline(state: StateDir, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lifeline.cli.app", words[0], "--state-dir", str(state.path), *words[1:]]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=COMMAND_LIMIT_S
    )


@pytest.fixture
def robot(host: Host, tmp_path: Path) -> Generator[Robot]:
    """Start a robot; its state is outside pytest's own directory, whose path is too long for a socket on some machines."""
    state = StateDir(Path(tempfile.mkdtemp(prefix="lifeline-test-")).resolve())
    endpoint, config = free_endpoint(), tmp_path / "robot.toml"
    config.write_text(
        f'[bus]\nendpoint = "{endpoint}"\n'
        f'[ros2]\ndomain_id = {host.domain}\npython = "{ROS_PYTHON}"\n'
        'sources = [{ name = "joy", topic = "/joy_vel" }]\n'
    )
    host.start("diff_drive").ready()
    observer = host.start("observer").ready()
    watch: Watch | None = None
    try:
        up = lifeline(state, "up", "--detach", "--config", str(config))
        assert up.returncode == 0, up.stderr
        watch = Watch(endpoint)
        yield Robot(state, config, host, observer, watch)
    finally:
        if watch is not None:
            watch.close()
        takedown.stop(state)
        shutil.rmtree(state.path)


def program_of(wrapper: Peer) -> int:
    """Return the pid of the program that `lifeline ros2 exec` runs."""
    (child,) = Path(f"/proc/{wrapper.pid}/task/{wrapper.pid}/children").read_text().split()
    return int(child)


def driving(robot: Robot, source: Peer) -> dict[str, Any]:
    """Drive, and return the status; a loaded machine may stop the robot in between."""
    seen: dict[str, Any] = {}
    for _ in range(ATTEMPTS):
        robot.drive(source, SPEED_M_S)
        seen = robot.status()
        if seen["mode"] == "DRIVING" and "ros2" in seen:
            break
    return seen


def test_a_ros_2_robot_comes_up_drives_is_shown_and_goes_down(robot: Robot) -> None:
    source = robot.host.start("source", "--topic", "/joy_vel").ready()
    robot.watch.report("source joy", "guarded by")
    seen = driving(robot, source)
    assert seen["running"]
    assert {name: node["alive"] for name, node in seen["nodes"].items()} == {
        "supervisor": True,
        "ros2": True,
        "teleop": False,
    }
    assert (seen["mode"], seen["owner"]) == ("DRIVING", "joy")
    reports = {report["name"]: report for report in seen["ros2"]}
    assert f"process {source.pid} on this host" in reports["source joy"]["values"]["guards"]
    assert all(report["level"] == "ok" for report in reports.values()), reports
    robot.prints("guarded by process", "status")
    source.tell(v=0.0)
    robot.watch.until(
        lambda w: w.status is not None and w.status.mode == SafetyStatus.READY, "READY for motion"
    )
    findings = json.loads(robot.lifeline("doctor", "--json").stdout)
    assert [one["what"] for one in findings if one["verdict"] == "problem"] == []
    source.end()

    robot.prints("source joy: no program publishes on /joy_vel", "doctor")
    down = robot.lifeline("down")
    assert down.stdout == "lifeline: everything is stopped\n"
    assert processes.of(robot.state.path) == []


def test_a_program_under_exec_stops_the_robot_at_once_when_it_or_its_wrapper_is_killed(robot: Robot) -> None:
    for victim, code in (("program", 128 + signal.SIGKILL), ("wrapper", -signal.SIGKILL)):
        wrapper = robot.guarded_source()
        program = program_of(wrapper)
        robot.drive(wrapper, SPEED_M_S if victim == "program" else -SPEED_M_S)
        killed_ns = time.monotonic_ns()
        os.kill(program if victim == "program" else wrapper.pid, signal.SIGKILL)
        took_ms = robot.zero_after(killed_ns)
        print(f"\n{victim} killed: zero on cmd_vel after {took_ms:.1f} ms")
        assert took_ms < AT_ONCE_MS
        assert wrapper.process.wait(COMMAND_LIMIT_S) == code
        robot.watch.until(
            lambda w: "lifeline ros2 exec" not in w.reports["source joy"].message, "the end of the source"
        )


def test_a_program_under_exec_drives_again_after_a_restart_of_the_supervisor(robot: Robot) -> None:
    wrapper = robot.guarded_source()
    robot.drive(wrapper, SPEED_M_S)
    (supervisor,) = (p.pid for p in processes.of(robot.state.path) if p.name == "supervisor")
    killed_ns = time.monotonic_ns()
    os.kill(supervisor, signal.SIGKILL)
    robot.zero_after(killed_ns)
    robot.watch.until(
        lambda w: w.status is not None and w.status.mode == SafetyStatus.STOPPED, "a new supervisor"
    )
    robot.watch.report("source joy", "lifeline ros2 exec")
    robot.drive(wrapper, -SPEED_M_S)


def test_with_the_profile_discovery_forgets_a_killed_program_within_its_lease(host: Host) -> None:
    """Without it, discovery lists the program for another 20 s."""
    profile = host.variables | {"FASTRTPS_DEFAULT_PROFILES_FILE": str(ROOT / "ros2/fastdds_short_lease.xml")}
    watcher = host.start("publishers", "--topic", "/joy_vel").ready()
    command = [str(ROS_PYTHON), "-m", "tests.ros2.peers.source", "--topic", "/joy_vel"]
    source = host.run("source", command, profile, ends_with_stdin=True).ready()
    watcher.until(lambda line: line.get("publishers") == 1, "the source")
    seen = len(watcher.lines)
    for _ in range(40):  # longer than a lease
        source.until(lambda line: "sent" in line, "a message", after=len(source.lines))
    assert len(watcher.lines) == seen, "a living program is not forgotten"
    killed_ns = source.kill()
    gone = watcher.until(lambda line: line.get("publishers") == 0, "the end", after=seen)
    took_s = (gone["at_ns"] - killed_ns) / 1e9
    print(f"\nkilled with the profile: discovery has forgotten it after {took_s:.2f} s")
    assert took_s < GENEROUS_LEASE_S
