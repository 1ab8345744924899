"""One trial: drive at 0.5 m/s, inject the fault, and measure until standstill.

The robot, its observer and the operator's node are real processes; with Lifeline, also supervisor and ros2.
"""

import itertools
import math
import os
import random
import signal
import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pexpect

from bench.ros2_crash.trial import LIMIT_S, SPEED_M_S, Case, Fault, Setup, Teleop, Trial
from faults.real.rig.cable import Cable
from ros2.environment import dds_variables
from sim.config import DEFAULT
from tests.ros2.host import ROS_PYTHON, Host, Line, Peer, ros_domain
from tests.ros2.keyboards import LAB_TELEOP, pressing, upstream_teleop
from tests.system.ports import free_endpoint
from wire.host.state_directory import ENVIRONMENT

CABLE_SUBNET = 77
UP_LIMIT_S, POLL_S = 10.0, 0.02
TOPICS = {Teleop.LAB: "/teleop/cmd_vel", Teleop.KEYBOARD: "/keyboard/cmd_vel"}
"""The topics to which the nodes are remapped with Lifeline."""
QUIT_KEYS = {Teleop.LAB: "q", Teleop.KEYBOARD: "\x03"}
DRIVE_TRIES = 8
DRIVE_LIMIT_S = 2.5
AT_REST_M_S = 0.005
MOMENTS_S = 0.2
"""The fault comes at a random moment of this span after the robot has reached its speed."""
BEFORE_NS = 1_000_000_000
BETWEEN_KEYS_S = 0.5
"""Without this pause, the neutral command and the first motion command would arrive together."""
STOP_KEYS = {Teleop.LAB: "s", Teleop.KEYBOARD: "k"}
DRIVE_KEYS = {Teleop.LAB: "wwwww", Teleop.KEYBOARD: "i"}
HELD_KEYS = {Teleop.LAB: None, Teleop.KEYBOARD: "i"}

# teleop_twist_keyboard publishes only on key events: its command is held until the key repeats.
CONFIG = """
[supervisor]
deceleration_m_s2 = 1.5
mounts_confirmed = true
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


@contextmanager
def stage(setup: Setup, logs: Path, scene: str = DEFAULT) -> Generator[Stage]:
    """Start the robot in a scene of the simulator, and end it.

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
        here.start_node("sim", "--endpoint", endpoint, "--scene", scene, "--no-viewer", "--no-moving")
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


@contextmanager
def at_speed(
    made: Stage, terminal: "pexpect.spawn[str]", teleop: Teleop, keys: str, speed_m_s: float
) -> Generator[None]:
    """Press the keys until the robot drives at this speed; a key to be held is held until the block ends.

    Raises:
        AssertionError: the robot does not drive.
    """
    observer = made.observer
    for number in range(1, DRIVE_TRIES + 1):
        terminal.send(STOP_KEYS[teleop])
        time.sleep(BETWEEN_KEYS_S)
        with pressing(terminal, keys, then=HELD_KEYS[teleop]):
            try:
                observer.until(
                    lambda line: line.get("topic") == "odom" and line["v"] > 0.95 * speed_m_s,
                    f"{speed_m_s} m/s",
                    after=len(observer.lines),
                    within_s=DRIVE_LIMIT_S,
                )
            except AssertionError:
                if number == DRIVE_TRIES:
                    raise
                continue  # DDS had not found the robot yet, or the supervisor was not ready
            yield
            return


def run(made: Stage, case: Case, number: int, moments: random.Random) -> Trial:
    """Press the keys, inject the fault at speed, and measure.

    Raises:
        AssertionError: a process does not start, or the robot does not drive.
    """
    observer, teleop = made.observer, case.teleop
    with made.operator(teleop) as terminal, at_speed(made, terminal, teleop, DRIVE_KEYS[teleop], SPEED_M_S):
        time.sleep(moments.uniform(0.0, MOMENTS_S))
        begin = len(observer.lines)
        begin_ns = time.monotonic_ns()
        made.inject(case.fault, terminal)
        with suppress(AssertionError):  # the robot may not stop
            observer.until(
                lambda line: line["at_ns"] >= begin_ns and _rests(line),
                "standstill",
                after=begin,
                within_s=LIMIT_S,
            )
        from_ns = begin_ns - BEFORE_NS
        travel, commands = observer.of("odom", from_ns=from_ns), observer.of("cmd_vel", from_ns=from_ns)
        return _measured(case, number, travel, commands, begin_ns)


def _rests(line: Line) -> bool:
    return line.get("topic") == "odom" and abs(line["v"]) < AT_REST_M_S


def _measured(
    case: Case, number: int, travel: Sequence[Line], commands: Sequence[Line], begin_ns: int
) -> Trial:
    """Return the trial.

    Args:
        case: its case.
        number: its number.
        travel: the true odometry before and after the fault.
        commands: what the robot received.
        begin_ns: the time of the fault.
    """
    before = [line for line in travel if line["at_ns"] < begin_ns]
    after = [line for line in travel if begin_ns <= line["at_ns"] <= begin_ns + LIMIT_S * 1e9]
    rest = next((index for index, line in enumerate(after) if _rests(line)), None)
    way = [before[-1], *after[: None if rest is None else rest + 1]]
    zero = next(
        (line for line in commands if line["at_ns"] >= begin_ns and line["v"] == line["w"] == 0), None
    )
    return Trial(
        case.teleop,
        case.fault,
        case.robot,
        case.lifeline,
        number,
        speed_m_s=before[-1]["v"],
        zero_s=None if zero is None else (zero["at_ns"] - begin_ns) / 1e9,
        standstill_s=None if rest is None else (after[rest]["at_ns"] - begin_ns) / 1e9,
        distance_m=sum(math.dist((a["x"], a["y"]), (b["x"], b["y"])) for a, b in itertools.pairwise(way)),
    )
