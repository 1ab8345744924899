"""The simulated robot of an exam: alone, or behind Lifeline's supervisor; for programs over Zenoh or ROS 2.

Alone, it is a base that keeps its last command, as the lab's robot in Gazebo does, or stops when none has arrived for a while. This
process is then the hub of the simulator, whose own watchdog remains, and repeats the last command to it. Programs reach the base at
another endpoint, through a proxy that can be cut; a ROS 2 program reaches it by topics, and by a cable that can be unplugged.
"""

import asyncio
import fcntl
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Callable, Generator, Sequence
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from deploy.stack import ros2_program
from deploy.stack.errors import DeployError
from deploy.stack.launch import DEFAULT_CONFIG, check_endpoint_is_free, free_loopback_endpoint
from faults.grade import leftovers
from faults.grade.program import Program
from faults.real.rig import faulty_process
from faults.real.rig.cable import Cable
from faults.real.rig.helper_process import Links
from faults.real.rig.wheels import WheelPipe
from recordings.incidents.braking import Motion
from ros2.environment import dds_variables, ros_variables
from wire import cdr, topics
from wire.access import LOCAL_ROLES, Contract
from wire.bus import BusError, NoReplyError
from wire.bus_config import DEFAULT_ENDPOINT, BusConfig
from wire.host.installation import ENVIRONMENT
from wire.messages import Point
from wire.watchdog import BaseReason
from wire.zenoh.bus import ZenohBus, open_bus
from wire.zenoh.connect import Role
from wire.zenoh.session import Push, RawPublisher

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = "program"
"""The name of the link to the program, and of the command source that it is behind a supervisor."""
START_LIMIT_S, OPEN_LIMIT_S, RESET_LIMIT_S, CALL_LIMIT_S, END_LIMIT_S = 30.0, 10.0, 5.0, 1.0, 3.0
POLL_S, PERIOD_S = 0.02, 0.02
LOG_LINES = 4
STALL_S = 0.1
"""A robot whose motion is unknown for longer than this has not been observed."""
FOLLOWS = list(BaseReason).index(BaseReason.OK)
DOMAINS = range(30, 100)
"""ROS domains above those that people use by hand; from 102 on, the ports of a domain are those of outgoing connections."""
CABLE_SUBNET = 78
SOURCE = topics.TELEOP
ROS_ROBOT, ROS_READY = "ros_robot", "ready"
"""The robot's node, and what it prints once it runs; its module cannot be imported without rclpy."""
ROS_TOPIC = f"/{SOURCE}/cmd_vel"
HOLD_S = 0.6
"""Behind a supervisor, a program that publishes only while its key repeats is held for this time (docs/ros2.md)."""
CONFIG = """
[supervisor]
deceleration_m_s2 = 1.5
mounts_confirmed = true
sources = [{{ name = "{source}", priority = 100 }}]
[ros2]
sources = [{{ name = "{source}", topic = "{topic}"{hold} }}]
discovery_range = "{discovery}"
domain_id = {domain}
"""


@dataclass(frozen=True)
class Setup:
    """What the program drives.

    Attributes:
        endpoint: where a Zenoh program finds the robot.
        lifeline: whether a supervisor is between the program and the robot.
        timeout_s: the time after which a robot alone stops without commands; None: it keeps the last command.
        ros2: whether the program is a ROS 2 node.
        hold: whether the program needs a held key.
        cable: whether the ROS 2 program runs behind a cable, in a network namespace.
        scene: the world of the simulator; None: the default.
    """

    endpoint: str = DEFAULT_ENDPOINT
    lifeline: bool = False
    timeout_s: float | None = None
    ros2: bool = False
    hold: bool = False
    cable: bool = False
    scene: str | None = None

    def __str__(self) -> str:
        if self.lifeline:
            return "the simulated robot behind Lifeline's supervisor"
        keeps = "keeps the last command" if self.timeout_s is None else f"stops after {self.timeout_s:g} s"
        return f"the simulated robot alone, which {keeps}"


class Base:
    """The base of a robot alone: it repeats the last command to the simulator.

    Args:
        timeout_s: as `Setup.timeout_s`.
    """

    def __init__(self, timeout_s: float | None) -> None:
        self._timeout_s = timeout_s
        self._loop, self._due = asyncio.get_running_loop(), asyncio.Event()
        self.forget()

    def forget(self) -> None:
        self._last = (cdr.twist(cdr.STANDSTILL), 0.0)

    def command(self, payload: bytes, _: bytes | None, arrival_s: float) -> None:
        """Take a command; called on Zenoh's thread. What is no Twist is ignored."""
        twist = cdr.twist_of(payload, stamped=False)
        if twist is not None:
            self._last = (twist, arrival_s)
            self._loop.call_soon_threadsafe(self._due.set)

    def output(self, now_s: float) -> bytes:
        """Return the Twist to send now."""
        twist, arrival_s = self._last
        is_silent = self._timeout_s is not None and now_s - arrival_s > self._timeout_s
        return cdr.twist(cdr.STANDSTILL) if is_silent else twist

    async def repeat(self, out: RawPublisher) -> None:
        """Send the last command at 50 Hz, and each new one at once."""
        while True:
            self._due.clear()
            out.put_bytes(self.output(time.monotonic()))
            with suppress(TimeoutError):
                # `wait_for` of Python 3.11 can lose the end of this task.
                async with asyncio.timeout(PERIOD_S):
                    await self._due.wait()


class Robot:
    """A running robot; `running` starts and ends it.

    Args:
        setup: what runs.
        directory: of this exam; its name marks all processes.
        ending: what must be closed at the end.
    """

    def __init__(self, setup: Setup, directory: Path, ending: AsyncExitStack) -> None:
        self.setup = setup
        self._directory, self._ending = directory, ending
        self._base: Base | None = None
        self._cable: Cable | None = None
        self._links: Links | None = None
        self._programs = 0
        self.second: Program | None = None
        """The second instance of the program, while there is one."""
        self._supervisor: ZenohBus | None = None
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._domain = 0
        self._stalled_s = -math.inf
        self.motions: list[Motion] = []
        """The true motion since the last `clear`."""

    # --- up

    async def start(self) -> None:
        """Start everything.

        Raises:
            DeployError: something does not start.
        """
        setup = self.setup
        wheels = self._directory / faulty_process.WHEELS
        wheels.unlink(missing_ok=True)
        self._wheels = WheelPipe(wheels)
        self._ending.callback(self._wheels.close)
        if setup.ros2:
            self._domain = self._ending.enter_context(_ros_domain())
            if setup.cable:
                self._cable = Cable(os.getpid(), subnet=CABLE_SUBNET)
                self._ending.callback(self._cable.close)
                await self._until(lambda: self._is_plugged, "the cable has no carrier")
        if setup.lifeline and not setup.ros2:
            hub = await self._guarded()
        else:
            hub = await self._alone()
        scene = [] if setup.scene is None else ["--scene", setup.scene]
        sim = [sys.executable, "-m", "faults.real.rig.faulty_process", "-m", topics.SIM]
        self._run(topics.SIM, [*sim, "--endpoint", hub, "--no-viewer", "--no-moving", *scene])
        if setup.ros2:
            await self._start_ros2()
        await self._until(lambda: bool(self.look()), "the simulator does not start")

    async def _guarded(self) -> str:
        """Start a supervisor with a link to the program; return its endpoint."""
        hub = free_loopback_endpoint()
        self._run(topics.SUPERVISOR, [sys.executable, "-m", topics.SUPERVISOR, "--endpoint", hub])
        self._bus = self._supervisor = await self._open(BusConfig(hub), "client")
        self._link(hub)
        return hub

    async def _alone(self) -> str:
        """Become the hub of the simulator, and open the base to the program; return the hub's endpoint."""
        hub, to_program = free_loopback_endpoint(), free_loopback_endpoint()
        self._bus = await self._open(BusConfig(hub), "hub")
        open_to_all = BusConfig(
            to_program, contract=Contract(more_keys=(topics.CMD_VEL.key,)), unproven=LOCAL_ROLES
        )
        side = await self._open(open_to_all, "hub")
        base = self._base = Base(self.setup.timeout_s)
        for key in (topics.CMD_VEL.key, topics.source_cmd_vel(SOURCE).key):
            side.subscribe_raw(key, base.command)
        for topic in (topics.SCAN, topics.ODOM):
            self._bus.subscribe_raw(topic.key, _relay(side.publisher_raw(topic)))
        self._bus.declare_alive(topics.SUPERVISOR)
        repeating = asyncio.ensure_future(base.repeat(self._bus.publisher_raw(topics.CMD_VEL)))
        self._ending.callback(repeating.cancel)
        if self.setup.ros2:
            self._to_program = to_program
        else:
            self._link(to_program)
        return hub

    async def _start_ros2(self) -> None:
        """Start the robot's node, and in front of it supervisor and ROS 2 process."""
        setup, python = self.setup, self.ros_python
        node = [str(python), "-m", "faults.grade.ros_robot", self._to_program, str(self._domain)]
        self._run(ROS_ROBOT, node, self.ros_variables)
        log = self._log(ROS_ROBOT)
        await self._until(
            lambda: ROS_READY in log.read_text(errors="replace"), "the ROS 2 node does not start"
        )
        if not setup.lifeline:
            return
        config, hub = self._directory / "robot.toml", free_loopback_endpoint()
        hold = f", hold_s = {HOLD_S}" if setup.hold else ""
        discovery = self._discovery
        config.write_text(
            CONFIG.format(source=SOURCE, topic=ROS_TOPIC, hold=hold, discovery=discovery, domain=self._domain)
        )
        options = ["--config", str(config), "--endpoint", hub]
        self._run(topics.SUPERVISOR, [sys.executable, "-m", topics.SUPERVISOR, *options])
        self._run(topics.ROS2, [str(python), "-m", topics.ROS2, *options], self.ros_variables)
        self._supervisor = await self._open(BusConfig(hub), "client")

    @property
    def ros_python(self) -> Path:
        return ros2_program.interpreter(DEFAULT_CONFIG)

    @property
    def _discovery(self) -> str:
        return "subnet" if self.setup.cable else "localhost"

    @property
    def ros_variables(self) -> dict[str, str]:
        """Environment variables of a ROS 2 program."""
        return {
            **ros_variables(self.ros_python, os.environ),
            **dds_variables(self._discovery, {}),
            "ROS_DOMAIN_ID": str(self._domain),
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "ROS_LOG_DIR": str(self._directory),
            "PATH": f"{self.ros_python.parent}{os.pathsep}{os.environ.get('PATH', os.defpath)}",
        }

    @property
    def _mark(self) -> dict[str, str]:
        return {leftovers.MARK: str(self._directory)}

    @property
    def _is_plugged(self) -> bool:
        return self._cable is None or self._cable.is_up

    async def _open(self, config: BusConfig, role: Role) -> ZenohBus:
        try:
            async with asyncio.timeout(OPEN_LIMIT_S):
                bus = await open_bus(config, role)
        except (TimeoutError, BusError) as error:
            raise DeployError(
                f"the robot cannot be started: {error or 'the supervisor does not answer'}{self._logs()}"
            ) from error
        self._ending.push_async_callback(bus.close)
        return bus

    def _link(self, hub: str) -> None:
        """Offer a hub to the program at its endpoint, by a link that can be cut."""
        check_endpoint_is_free(self.setup.endpoint)
        host, _, port = self.setup.endpoint.partition("/")[2].rpartition(":")
        self._links = Links(hub, (f"{PROGRAM}:{port}",), environment=self._mark, host=host.strip("[]"))
        self._ending.callback(self._links.close)

    def _run(self, name: str, command: Sequence[str], variables: dict[str, str] | None = None) -> None:
        environment = {**os.environ, **(variables or {}), **self._mark}
        environment |= {faulty_process.DIRECTORY: str(self._directory), ENVIRONMENT: str(self._directory)}
        with self._log(name).open("wb") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                cwd=ROOT,
                env=environment,
                start_new_session=True,
            )
        self._processes[name] = process
        self._ending.callback(_end, process)

    def _log(self, name: str) -> Path:
        return self._directory / f"{name}.log"

    def _logs(self) -> str:
        ends = (
            (name, self._log(name).read_text(errors="replace").splitlines()[-LOG_LINES:])
            for name in self._processes
        )
        return "".join(f"\n{name}: {line}" for name, lines in ends for line in lines)

    async def _until(self, condition: Callable[[], bool], otherwise: str) -> None:
        deadline_s = time.monotonic() + START_LIMIT_S
        while not condition():
            if time.monotonic() > deadline_s:
                raise DeployError(f"the robot cannot be used: {otherwise}{self._logs()}")
            await asyncio.sleep(POLL_S)

    # --- the program

    def start_program(self, command: Sequence[str], *, whole_group: bool) -> Program:
        """Start an instance of the program.

        Args:
            command: `{endpoint}` in it stands for the robot's endpoint.
            whole_group: as in `Program`.

        Raises:
            DeployError: it cannot be started.
        """
        self._programs += 1
        words = [word.replace("{endpoint}", self.setup.endpoint) for word in command]
        environment = {**os.environ, leftovers.MARK: f"{self._directory}/{self._programs}."}
        if self.setup.ros2:
            environment |= self.ros_variables
            if self.setup.lifeline:
                words += ["--ros-args", "-r", f"/cmd_vel:={ROS_TOPIC}"]
        prefix = () if self._cable is None else self._cable.prefix
        return Program([*prefix, *words], environment, whole_group=whole_group)

    async def cut(self) -> float:
        """Cut the link to the program; return the time just before."""
        at_s = time.monotonic()
        if self._cable is not None:
            await asyncio.to_thread(self._cable.unplug)
        elif self._links is not None:
            self._links.open(PROGRAM, up=False, down=False)
        return at_s

    async def heal(self) -> None:
        if self._links is not None:
            self._links.heal(PROGRAM)
        if self._cable is not None:
            await asyncio.to_thread(self._cable.plug)
            await self._until(lambda: self._is_plugged, "the cable has no carrier")

    # --- the world

    def look(self) -> list[Motion]:
        """Return the motion since the last `clear`.

        Raises:
            DeployError: a process of the robot has ended.
        """
        ended = [name for name, process in self._processes.items() if process.poll() is not None]
        if ended:
            raise DeployError(f"{' and '.join(ended)} ended by itself{self._logs()}")
        for sample in self._wheels.take():
            now_s = sample.motion.time_s
            gap_s = now_s - self.motions[-1].time_s if self.motions else 0.0
            if gap_s > STALL_S or (self._base is not None and sample.reason != FOLLOWS):
                self._stalled_s = now_s
            self.motions.append(sample.motion)
        return self.motions

    def has_stalled(self, since_s: float) -> bool:
        """Return whether the simulation stood still, or stopped by itself for lack of commands of this process."""
        return self._stalled_s >= since_s

    def clear(self) -> None:
        self.look()
        self.motions = self.motions[-1:]

    def place_pillar(self, x_m: float, y_m: float) -> None:
        self._bus.publisher(topics.OBSTACLE).put(Point(x_m, y_m, 0.0))

    async def back_to_start(self) -> None:
        """Put the robot at rest at its start, without a pillar and without a latched e-stop.

        Raises:
            DeployError: the simulator or the supervisor does not answer.
        """
        if self._base is not None:
            self._base.forget()
        self._bus.publisher(topics.OBSTACLE).put(Point(0.0, 0.0, -1.0))
        await self._call(self._bus, topics.SIM_RESET)
        if self._supervisor is not None:
            await self._call(self._supervisor, topics.SUPERVISOR_RESET)

    async def _call(self, bus: ZenohBus, service: topics.Service) -> None:
        deadline_s = time.monotonic() + RESET_LIMIT_S
        while True:
            try:
                await bus.call(service, timeout_s=CALL_LIMIT_S)
            except NoReplyError as error:
                if time.monotonic() > deadline_s:
                    raise DeployError(f"{service.server} does not answer: {error}{self._logs()}") from error
            else:
                return


def _relay(out: RawPublisher) -> Push:
    """Return what publishes each sample again, in this loop: a callback of Zenoh must not call Zenoh."""
    loop = asyncio.get_running_loop()

    def pass_on(payload: bytes, _: bytes | None, __: float) -> None:
        loop.call_soon_threadsafe(out.put_bytes, payload)

    return pass_on


@asynccontextmanager
async def running(setup: Setup, directory: Path) -> AsyncGenerator[Robot]:
    """Start a robot, and end it.

    Raises:
        DeployError: it cannot be started.
    """
    async with AsyncExitStack() as ending:
        robot = Robot(setup, directory, ending)
        await robot.start()
        yield robot


def _end(process: "subprocess.Popen[bytes]") -> None:
    with suppress(OSError):
        assert process.stdin is not None
        process.stdin.close()
        process.send_signal(signal.SIGTERM)
    try:
        process.wait(END_LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def _ros_domain() -> Generator[int]:
    """Yield a domain that no other exam on this machine has; a lock on a file claims it until this process ends.

    Raises:
        DeployError: all are in use.
    """
    first = os.getpid() % len(DOMAINS)
    for domain in [*DOMAINS[first:], *DOMAINS[:first]]:
        with ExitStack() as ending:
            try:
                claim = ending.enter_context(Path(f"/tmp/lifeline-ros-domain-{domain}").open("w"))  # noqa: S108 - all users share the domains
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:  # also if another user claims it
                continue
            yield domain
            return
    raise DeployError("no ROS domain is free: end other exams, or programs of ROS 2")
