"""The robot, its observer and the operator's node as real processes; with Lifeline, also supervisor and ros2."""

import hashlib
import os
import signal
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pexpect

from bench.ros2_crash.trial import Fault, Setup, Teleop
from faults.real.rig.cable import Cable
from ros2.environment import dds_variables
from tests.ros2.host import ROS_PYTHON, Host, Peer, ros_domain
from tests.ros2.keyboards import LAB_TELEOP, upstream_teleop
from tests.system.ports import free_endpoint
from wire.host.state_directory import ENVIRONMENT

CABLE_SUBNET = 77
UP_LIMIT_S, POLL_S = 10.0, 0.02
TOPICS = {Teleop.LAB: "/teleop/cmd_vel", Teleop.KEYBOARD: "/keyboard/cmd_vel"}
"""The topics to which the nodes are remapped with Lifeline."""
QUIT_KEYS = {Teleop.LAB: "q", Teleop.KEYBOARD: "\x03"}

# teleop_twist_keyboard publishes only on key events: its command is held until the key repeats.
CONFIG = """
[supervisor]
sources = [{{ name = "teleop", priority = 100 }}, {{ name = "keyboard", priority = 90 }}]
[ros2]
sources = [
  {{ name = "teleop", topic = "/teleop/cmd_vel" }},
  {{ name = "keyboard", topic = "/keyboard/cmd_vel", hold_s = 0.6 }},
]
discovery_range = "{discovery}"
domain_id = {domain}
"""


@dataclass
class Stage:
    """The processes of the robot; each trial starts an operator's node of its own."""

    setup: Setup
    observer: Peer
    cable: Cable | None
    _robot: Peer
    _here: Host
    _there: Host

    @contextmanager
    def operator(self, teleop: Teleop) -> Generator["pexpect.spawn[str]"]:
        """Start the operator's node; at the end, kill it, and put the robot back at its start.

        Raises:
            AssertionError: a process does not answer.
        """
        program = program_of(teleop)
        assert program is not None, f"{teleop} is not on this machine"
        remapped = ("--ros-args", "-r", f"/cmd_vel:={TOPICS[teleop]}") if self.setup.lifeline else ()
        terminal = self._there.in_terminal(*program, *remapped)
        terminal.expect("(?i)quit")
        try:
            yield terminal
        finally:
            if self.cable is not None:
                # DDS would count an unplugged node as present for another 20 s.
                self.cable.plug()
                wait_until_up(self.cable)
                terminal.send(QUIT_KEYS[teleop])
                terminal.expect(pexpect.EOF)
            self._there.kill_terminal(terminal)
            begin = len(self._robot.lines)
            self._robot.tell(reset=True)
            self._robot.until(lambda line: "reset" in line, "the reset", after=begin)

    def inject(self, fault: Fault, terminal: "pexpect.spawn[str]") -> None:
        if fault is Fault.KILL:
            terminal.kill(signal.SIGKILL)
        elif fault is Fault.STOP:
            terminal.kill(signal.SIGSTOP)
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
def stage(setup: Setup, logs: Path) -> Generator[Stage]:
    """Start the robot, and end it.

    Raises:
        AssertionError: a process does not start.
    """
    with ExitStack() as ending:
        domain = ending.enter_context(ros_domain())
        cable = None
        beyond: tuple[str, ...] = ()
        reach = dds_variables("localhost", {})
        if setup.cable:
            cable = Cable(os.getpid(), subnet=CABLE_SUBNET)
            ending.callback(cable.close)
            wait_until_up(cable)
            beyond, reach = cable.prefix, dds_variables("subnet", {})
        state = {ENVIRONMENT: str(logs)}
        here = Host(domain, logs, discovery=reach, extra=state)
        there = Host(domain, logs, prefix=beyond, discovery=reach, extra=state)
        ending.callback(here.close)
        ending.callback(there.close)

        endpoint = free_endpoint()
        timeout = "none" if setup.robot.timeout_s is None else str(setup.robot.timeout_s)
        robot = here.start("sim_robot", "--endpoint", endpoint, "--timeout", timeout)
        observer = here.start("observer", "--odom", "odom/truth")
        here.start_node("sim", "--endpoint", endpoint, "--no-viewer", "--no-moving")
        if setup.lifeline:
            _start_lifeline(here, setup, logs)
        robot.ready()
        observer.until(lambda line: line.get("topic") == "odom", "odometry")
        yield Stage(setup, observer, cable, robot, here, there)


def wait_until_up(cable: Cable) -> None:
    """Wait for the carrier: DDS ignores an interface that has none when a process starts."""
    deadline_s = time.monotonic() + UP_LIMIT_S
    while not cable.is_up:
        assert time.monotonic() < deadline_s, "the cable has no carrier"
        time.sleep(POLL_S)


def _start_lifeline(host: Host, setup: Setup, logs: Path) -> None:
    """Start the supervisor and the ROS 2 process."""
    config, endpoint = logs / "robot.toml", free_endpoint()
    discovery = "subnet" if setup.cable else "localhost"
    config.write_text(CONFIG.format(discovery=discovery, domain=host.domain))
    options = ["--config", str(config), "--endpoint", endpoint]
    host.start_node("supervisor", *options)
    host.run("ros2", [str(ROS_PYTHON), "-m", "ros2", *options], host.variables)
