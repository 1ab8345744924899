"""The robot, its observer and the operator's node as real processes; with Lifeline, also supervisor and bridge."""

import hashlib
import os
import signal
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pexpect

from bench.ros2_crash.trial import Case, Fault, Teleop
from deploy.campaign.real.rig.cable import Cable
from tests.ros2.host import ROS_PYTHON, Host, Peer, ros_domain
from tests.ros2.keyboards import LAB_TELEOP, upstream_teleop
from tests.system.ports import free_endpoint
from wire.state_directory import ENVIRONMENT

SUBNET = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
ONLY_UDP = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
"""Two namespaces of one machine share /dev/shm: with shared memory, no message would pass the cable."""
CABLE_SUBNET = 77
UP_LIMIT_S, POLL_S = 10.0, 0.02
HOLD_S = {Teleop.KEYBOARD: ", hold_s = 0.6", Teleop.LAB: ""}
"""teleop_twist_keyboard publishes only on key events: its command is held until the key repeats."""

CONFIG = """
[ros2]
sources = [{{ name = "teleop", topic = "/teleop/cmd_vel"{hold} }}]
discovery_range = "{discovery}"
domain_id = {domain}
"""


@dataclass
class Stage:
    """The processes of one trial."""

    observer: Peer
    terminal: "pexpect.spawn[str]"
    cable: Cable | None

    def inject(self, fault: Fault) -> None:
        if fault is Fault.KILL:
            self.terminal.kill(signal.SIGKILL)
        elif fault is Fault.STOP:
            self.terminal.kill(signal.SIGSTOP)
        else:
            assert self.cable is not None
            self.cable.unplug()


def program_of(teleop: Teleop) -> tuple[str, ...] | None:
    """Return the arguments that run it with the Python of ROS; None if it is not on this machine."""
    return LAB_TELEOP if teleop is Teleop.LAB else upstream_teleop()


def digest_of(teleop: Teleop) -> str:
    """Return the beginning of the SHA-256 of a program that is not in this repository; empty for ours."""
    if teleop is Teleop.LAB:
        return ""
    (path,) = upstream_teleop() or ("",)
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


@contextmanager
def stage(case: Case, logs: Path) -> Generator[Stage]:
    """Start everything for one trial, and end it.

    Raises:
        AssertionError: a process does not start.
    """
    with ExitStack() as ending:
        domain = ending.enter_context(ros_domain())
        cable = None
        beyond: tuple[str, ...] = ()
        reach: dict[str, str] = {ENVIRONMENT: str(logs)}
        if case.fault is Fault.UNPLUG:
            cable = Cable(os.getpid(), subnet=CABLE_SUBNET)
            ending.callback(cable.close)
            _wait_until_up(cable)
            beyond, reach = cable.prefix, reach | SUBNET
        here = Host(domain, logs, extra=reach)
        there = Host(domain, logs, prefix=beyond, extra=reach | (ONLY_UDP if cable else {}))
        ending.callback(here.close)
        ending.callback(there.close)

        endpoint = free_endpoint()
        timeout = "none" if case.robot.timeout_s is None else str(case.robot.timeout_s)
        robot = here.start("sim_robot", "--endpoint", endpoint, "--timeout", timeout)
        observer = here.start("observer", "--odom", "odom/truth")
        here.start_node("sim", "--endpoint", endpoint, "--no-viewer", "--no-moving")
        remapped: tuple[str, ...] = ()
        if case.lifeline:
            _start_lifeline(here, case, logs)
            remapped = ("--ros-args", "-r", "/cmd_vel:=/teleop/cmd_vel")
        program = program_of(case.teleop)
        assert program is not None, f"{case.teleop} is not on this machine"
        terminal = there.in_terminal(*program, *remapped)
        robot.ready()
        observer.until(lambda line: line.get("topic") == "odom", "odometry")
        terminal.expect("(?i)quit")
        yield Stage(observer, terminal, cable)


def _wait_until_up(cable: Cable) -> None:
    """Wait for the carrier: DDS ignores an interface that has none when a process starts."""
    deadline_s = time.monotonic() + UP_LIMIT_S
    while not cable.is_up:
        assert time.monotonic() < deadline_s, "the cable has no carrier"
        time.sleep(POLL_S)


def _start_lifeline(host: Host, case: Case, logs: Path) -> None:
    """Start the supervisor, and the bridge between it and ROS."""
    config, endpoint = logs / "robot.toml", free_endpoint()
    discovery = "subnet" if case.fault is Fault.UNPLUG else "localhost"
    config.write_text(CONFIG.format(hold=HOLD_S[case.teleop], discovery=discovery, domain=host.domain))
    options = ["--config", str(config), "--endpoint", endpoint]
    host.start_node("supervisor", *options)
    host.run("ros2", [str(ROS_PYTHON), "-m", "ros2", *options], host.variables)
