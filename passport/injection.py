"""Injects a fault into the running robot, and lifts it."""

import asyncio
import math
import signal
import sys

from deploy.stack import processes
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from passport.cells import Fault
from passport.child import READY, Child
from teleop.pilots.pilot import NEUTRAL, Velocity
from wire import topics
from wire.bus import Bus, NoReplyError
from wire.messages import Bool
from wire.zenoh.local_socket import socket_of

CALL_LIMIT_S = 1.0
SUPERVISORD = "supervisord"
SENSORS = {Fault.LIDAR_SILENT: "silent", Fault.ODOMETRY_SILENT: "no_odom"}
"""The fault for the service of the simulated robot."""


CUTS = {Fault.LINK_CUT: "up down", Fault.LINK_CUT_UP: "up", Fault.LINK_CUT_DOWN: "down"}
"""The order to the operator's link."""
SIGNALS = {Fault.OPERATOR_KILLED: signal.SIGKILL, Fault.OPERATOR_STOPPED: signal.SIGSTOP}
"""For the operator's program."""


class InjectionError(Exception):
    """The fault cannot be injected or lifted; the message says why."""


class Operator:
    """The operator's program, and its link to the hub.

    Args:
        launch: how to reach the robot.
        source: the command source.
    """

    def __init__(self, launch: Launch, source: str) -> None:
        self._launch, self._source = launch, source
        self._program: Child | None = None
        self._link: Child | None = None
        self._is_out_of_reach = False
        """Whether the program cannot be ended by its stdin."""

    async def start(self, *, with_link: bool) -> None:
        """Start the program, and wait until it holds its source; `with_link`: through a link that can be cut.

        Raises:
            InjectionError: it cannot drive.
        """
        command = [*self._launch.command("passport.pilot"), "--source", self._source]
        command += ["--namespace", self._launch.bus.namespace]
        if with_link:
            socket = str(socket_of(self._launch.bus.endpoint))
            self._link = Child([sys.executable, "-m", "passport.link", socket])
            port = await self._link.first_line()
            command[command.index("--endpoint") + 1] = f"tcp/127.0.0.1:{port}"
        self._program = Child(command)
        answer = await self._program.first_line()
        if answer != READY:
            raise InjectionError(f"the operator's program cannot drive: {answer or 'it has ended'}")

    def request(self, velocity: Velocity) -> None:
        if self._program is not None:
            self._program.order("{!r} {!r}".format(*velocity))

    def hit(self, fault: Fault) -> None:
        """Kill it, stop it, or cut its link."""
        assert self._program is not None
        if fault in SIGNALS:
            self._program.send(SIGNALS[fault])
        else:
            assert self._link is not None
            self._link.order(CUTS[fault])
        self._is_out_of_reach = True

    async def end(self) -> None:
        """End the program, which sends zero if it can."""
        limits = {} if not self._is_out_of_reach else {"limit_s": 0.0}
        for child in (self._program, self._link):
            if child is not None:
                await child.end(**limits)
        self._program = self._link = None
        self._is_out_of_reach = False


def not_supervised(launch: Launch, state: StateDir, name: str) -> str | None:
    """Return why a process cannot be ended and started again from here; None if it can."""
    names = {process.name for process in processes.of(state.path)}
    if not launch.is_started(state) or name not in names:
        return f"the process {name} is not one of this computer's `lifeline up`"
    if SUPERVISORD not in names:
        return f"nothing would start the process {name} again: start the robot with `lifeline up --detach`"
    return None


class Injector:
    """Injects the faults of one robot.

    Args:
        bus: the bus of the recorder.
        launch: how to reach the robot.
        state: the state directory of this computer.
        operator: the operator's program.
    """

    def __init__(self, bus: Bus, launch: Launch, state: StateDir, operator: Operator) -> None:
        self._bus, self._launch, self._state, self._operator = bus, launch, state, operator
        self._estop = bus.publisher(topics.ESTOP)

    async def refusal(self, fault: Fault) -> str | None:
        """Return why this fault cannot be injected from here; None if it can."""
        if fault in CUTS and socket_of(self._launch.bus.endpoint) is None:
            return "the link has certificates, and only a link on this computer can be cut: pull its cable by hand"
        if fault.takes_recorder:
            struck = topics.ROS2 if fault is Fault.ROS2_KILLED else topics.SUPERVISOR
            if (problem := not_supervised(self._launch, self._state, struck)) is not None:
                return problem
        if fault in SENSORS:
            try:
                await self._bus.call(topics.SIM_FAULTS, timeout_s=CALL_LIMIT_S)
            except NoReplyError:
                return (
                    "only the sensors of a simulated robot can be silenced from here: pull their plug by hand"
                )
        return None

    async def begin(self, fault: Fault) -> float:
        """Inject a fault; return the time just before.

        Raises:
            InjectionError: it cannot be injected.
        """
        now_s = asyncio.get_running_loop().time()
        match fault:
            case Fault.ZERO | Fault.TURN:
                self._operator.request(NEUTRAL)
            case Fault.SUPERVISOR_KILLED:
                now_s = self._signal((topics.SUPERVISOR, signal.SIGKILL))
            case Fault.SUPERVISOR_STOPPED:
                now_s = self._signal((topics.SUPERVISOR, signal.SIGSTOP))
            case Fault.ROS2_KILLED:  # a restart before the base stands would stop the base
                now_s = self._signal((SUPERVISORD, signal.SIGSTOP), (topics.ROS2, signal.SIGKILL))
            case Fault.LIDAR_SILENT | Fault.ODOMETRY_SILENT:
                await self._sensors(SENSORS[fault])
            case Fault.ESTOP:
                self.press_estop()
            case _:
                self._operator.hit(fault)
        return now_s

    async def lift(self, fault: Fault) -> None:
        """End a fault that does not end with the operator's program. supervisord restarts killed processes without a lift.

        Raises:
            InjectionError: it cannot be ended.
        """
        if fault is Fault.SUPERVISOR_STOPPED:
            self._signal((topics.SUPERVISOR, signal.SIGCONT))
        elif fault is Fault.ROS2_KILLED:
            self._signal((SUPERVISORD, signal.SIGCONT))
        elif fault in SENSORS:
            await self._sensors("none")

    def press_estop(self) -> None:
        """Press the e-stop once; a press that was lost must be repeated."""
        self._estop.put(Bool(data=True))

    async def reset(self) -> str | None:
        """Reset the e-stop; return why it was refused."""
        try:
            reply = await self._bus.call(topics.SUPERVISOR_RESET, timeout_s=CALL_LIMIT_S)
        except NoReplyError as error:
            return str(error)
        return None if reply.success else reply.message

    def _signal(self, *signals: tuple[str, signal.Signals]) -> float:
        """Send signals to processes of this computer in this order; return the time just before the last signal.

        Raises:
            InjectionError: one of the processes does not run; no signal is sent.
        """
        running = {process.name: process for process in processes.of(self._state.path)}
        now_s = math.nan
        for name, _ in signals:
            if name not in running:
                raise InjectionError(f"the process {name} does not run")
        for name, number in signals:
            now_s = asyncio.get_running_loop().time()
            processes.send(running[name], self._state.path, number)
        return now_s

    async def _sensors(self, faults: str) -> None:
        try:
            reply = await self._bus.call(topics.SIM_FAULTS, faults, timeout_s=CALL_LIMIT_S)
        except NoReplyError as error:
            raise InjectionError(f"the simulated robot does not take the fault {faults}: {error}") from error
        if not reply.success:
            raise InjectionError(f"the simulated robot refuses the fault {faults}: {reply.message}")
