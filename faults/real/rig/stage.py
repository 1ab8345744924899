"""The stage of the real campaign: the whole robot, an operator at a terminal, and the observer.

sim and supervisor run under supervisord as with `lifeline up`, with injectable faults (faulty_process.py); teleop has
its own terminals. If the rights allow it, the state directory is a small disk, so that it can be filled. Everything
is stopped at the end, whatever happens.
"""

import asyncio
import logging
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Coroutine
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from deploy.stack import bringup, errors, processes, supervisord, takedown
from deploy.stack.errors import DeployError
from deploy.stack.keyboard import TypedTeleop
from deploy.stack.launch import DEFAULT_CONFIG, Launch, free_loopback_endpoint
from deploy.stack.statedir import StateDir
from deploy.stack.takedown import Say
from faults.classes import BY_NAME, Group
from faults.page import PageFault
from faults.port import PAGE, End, Hold
from faults.real.rig import faulty_process
from faults.real.rig.cable import Cable
from faults.real.rig.helper_process import HelperProcess, Links
from faults.real.rig.janitor import STATE, hire, sweep
from faults.real.rig.observer import Observer
from faults.real.rig.station import StationOperator
from faults.real.rig.wheels import WheelPipe
from faults.seen import Seen
from teleop.pilots.keys import PAUSE_S
from wire import topics
from wire.bus import BusError, NoReplyError
from wire.messages import Bool, Point
from wire.zenoh.bus import ZenohBus, open_bus

NODES = (topics.SUPERVISOR, topics.SIM)
UNPLUGGED = "net_unplugged"
DISK_BYTES = 96 << 20
"""Size of the state directory: more than logs and black boxes need."""
OPEN_LIMIT_S = 10.0
ALIVE_LIMIT_S = 15.0
"""Limit for everything that restarts by itself: supervisord may wait for some seconds."""
RESET_LIMIT_S = 5.0
READY_LIMIT_S = 5.0
START_M = (-4.5, 0.0)
"""Start of the robot in the warehouse, facing along x."""
PRESS_AGAIN_S = PAUSE_S + 0.2
"""An operator who sees no effect pauses and presses again: after keys that nobody typed in this way, teleop obeys only after a pause."""
CALL_LIMIT_S = 1.0
ASK_AGAIN_S = 0.1
PRESSED_LIMIT_S = 1.0
"""From the press of the e-stop to zero."""
INSISTS_S, LOOK_S = 1.5, 0.05
SWITCH_S = 0.0005
"""Maximum time that a thread keeps the interpreter: the observer's stamps must not wait for a table."""
SETTLE_POLL_S = 0.1


class Route(StrEnum):
    """How a process reaches the hub."""

    DIRECT = "direct"
    PROXY = "proxy"
    CABLE = "cable"
    """From a separate network namespace; teleop only."""
    STATION = "station"
    """A page drives through the server of a station; only in place of teleop."""


class StageError(DeployError):
    """The robot did not do what must precede or follow a fault."""


def routes_for(classes: Collection[str]) -> tuple[Route, Route]:
    """Return the routes of teleop and sim to the hub that these classes of faults need."""
    routes = {topics.TELEOP: Route.DIRECT, topics.SIM: Route.DIRECT}
    for name in classes:
        if BY_NAME[name].group is Group.STATION:
            routes[topics.TELEOP] = Route.STATION
        elif BY_NAME[name].group is Group.NETWORK:
            routes[BY_NAME[name].target] = Route.CABLE if name == UNPLUGGED else Route.PROXY
    return routes[topics.TELEOP], routes[topics.SIM]


@dataclass(frozen=True, slots=True)
class ArmedLaunch(Launch):
    """The processes of a `Launch`, with injectable faults."""

    directory: Path = Path()

    def environment(self, state: StateDir) -> dict[str, str]:
        faulty = {
            "LIFELINE_PYTHON": str(self.directory / "python"),
            faulty_process.DIRECTORY: str(self.directory),
        }
        # super() without arguments does not work in a dataclass with slots
        return Launch.environment(self, state) | faulty

    def command(self, module: str) -> list[str]:
        python, _, *rest = Launch.command(self, module)
        return [python, "-m", "faults.real.rig.faulty_process", "-m", *rest]


class Stage:
    """The robot, its operator and an observer; `open` starts them, `close` ends them. Faults use it as their `Port`.

    Args:
        sim_options: options of `python -m sim`.
        say: called with each step of the start.
        small_disk: whether to mount a small disk as the state directory, if the rights allow it.
    """

    def __init__(
        self, *, sim_options: str = "--no-viewer", say: Say = lambda _: None, small_disk: bool = True
    ) -> None:
        self._say = say
        self.directory = Path(tempfile.mkdtemp(prefix="lifeline-faults-")).resolve()
        self.state = StateDir(self.directory / STATE)
        self.state.create()
        self._closing = ExitStack()
        """Resources that are closed without an event loop."""
        self._closing.callback(hire("faults.real.rig.janitor", self.directory).communicate)
        self._closing.callback(sweep, self.directory, os.getpid())
        self.has_disk = small_disk and self._mount_disk()
        """Whether the state directory is a separate disk."""
        self._bus: ZenohBus | None = None
        self._links: Links | None = None
        self._cable: Cable | None = None
        self._cable_link: Links | None = None
        self._attacker: HelperProcess | None = None
        self._watch: Observer | None = None
        self._operator: TypedTeleop | StationOperator | None = None
        self.is_ready = False
        """Whether the robot has just been observed driving."""
        self.routes = {topics.TELEOP: Route.DIRECT, topics.SIM: Route.DIRECT}
        launch = Launch.read(DEFAULT_CONFIG, free_loopback_endpoint(), sim_options=sim_options)
        self.launch = ArmedLaunch(launch.config, launch.bus, launch.sim_options, directory=self.directory)

    @property
    def observer(self) -> Observer:
        assert self._watch is not None
        return self._watch

    @property
    def operator(self) -> TypedTeleop | StationOperator:
        """The program that takes the operator's keys."""
        assert self._operator is not None
        return self._operator

    @property
    def teleop(self) -> TypedTeleop:
        assert isinstance(self._operator, TypedTeleop)
        return self._operator

    @property
    def station(self) -> StationOperator:
        assert isinstance(self._operator, StationOperator)
        return self._operator

    @property
    def attacker(self) -> HelperProcess:
        """Started when first needed."""
        if self._attacker is None:
            bus = self.launch.bus
            self._attacker = HelperProcess(
                "faults.real.rig.attacker", bus.endpoint, bus.namespace, environment=self.environment
            )
            self._closing.callback(self._attacker.close)
            self._attacker.answer()
        return self._attacker

    @property
    def links(self) -> Links:
        if self._links is None:
            self._links = self._linked("127.0.0.1", topics.TELEOP, topics.SIM)
        return self._links

    def _linked(self, host: str, *names: str) -> Links:
        links = Links(self.launch.bus.endpoint, names, environment=self.environment, host=host)
        self._closing.callback(links.close)
        return links

    @property
    def cable(self) -> Cable:
        assert self._cable is not None
        return self._cable

    @property
    def environment(self) -> dict[str, str]:
        """Environment that marks the processes of this stage."""
        return {processes.MARK: str(self.state.path)}

    # --- up and down

    def run(self, play: Callable[[], Coroutine[Any, Any, None]]) -> KeyboardInterrupt | None:
        """Start everything, play, and stop everything; return the interrupt that ended it early, if any.

        Raises:
            DeployError: the robot cannot be started, or what `play` raises.
        """

        async def opened() -> None:
            try:
                await self.open()
                await play()
            finally:
                await self.close()

        self._closing.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(SWITCH_S)
        # The observer receives every attack, so undecodable messages are expected.
        logging.getLogger("wire").setLevel(logging.CRITICAL)
        with errors.interrupts():
            try:
                try:
                    asyncio.run(opened())
                finally:
                    errors.ignore()
            except KeyboardInterrupt as error:
                return error
            finally:
                self.discard()
        return None

    async def open(self) -> None:
        """Start everything; teleop is neutral.

        Raises:
            DeployError: it cannot be started.
        """
        wheels = WheelPipe(self.directory / faulty_process.WHEELS)
        self._closing.callback(wheels.close)
        python = self.directory / "python"
        python.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m faults.real.rig.faulty_process "$@"\n')
        python.chmod(stat.S_IRWXU)
        await self._start_stack()
        try:
            async with asyncio.timeout(OPEN_LIMIT_S):
                self._bus = await open_bus(self.launch.bus, "client")
        except (TimeoutError, BusError) as error:
            raise StageError(f"the campaign's observer cannot connect: {error}") from error
        self._watch = Observer(self._bus, wheels)
        await self.start_teleop()

    async def close(self) -> None:
        """Stop everything; processes that have ended already cause no error."""
        if self._watch is not None:
            self._watch.close()
        if self._operator is not None:
            await self._operator.close()
        if self._bus is not None:
            await self._bus.close()
        self.discard()

    def discard(self) -> None:
        """Stop everything without an event loop; may be called repeatedly."""
        self._closing.close()

    async def restart_stack(self) -> None:
        """Restart everything, to reach a known state."""
        await self.stop_teleop()
        for name in (topics.TELEOP, topics.SIM):
            if self._links is not None:
                self._links.heal(name)
        await self.restart_supervisord()
        await self.start_teleop()

    async def restart_supervisord(self) -> None:
        takedown.stop(self.state)
        await self._start_stack()

    async def _start_stack(self) -> None:
        bringup.start(self.state, self.launch, self._say)
        await bringup.wait_until_alive(self.state, self.launch, self._say)

    def _mount_disk(self) -> bool:
        if os.geteuid() != 0:
            return False
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES},mode=700", "lifeline", str(self.state.path)],  # noqa: S607 - the system's
            capture_output=True,
            check=False,
        )
        return done.returncode == 0

    # --- routes

    async def prepare(self, classes: Collection[str]) -> None:
        """Prepare the routes and helper processes that these classes of faults need, and heal the links.

        A process whose route to the hub changes is restarted.
        """
        if any(BY_NAME[name].group is Group.WIRE for name in classes):
            _ = self.attacker
        teleop, sim = routes_for(classes)
        if self.routes != {topics.TELEOP: teleop, topics.SIM: sim}:
            self.is_ready = False
        if self.routes[topics.SIM] is not sim:
            path = self.directory / f"{faulty_process.ROUTE}-{topics.SIM}"
            if sim is Route.PROXY:
                path.write_text(self.links.endpoints[topics.SIM])
            else:
                path.unlink(missing_ok=True)
            self.routes[topics.SIM] = sim
            self.observer.alive.discard(topics.SIM)
            self.signal(topics.SIM, signal.SIGTERM)
            await self.alive()
        if self.routes[topics.TELEOP] is not teleop:
            await self.stop_teleop()
            self.routes[topics.TELEOP] = teleop
        if self._operator is None:
            await self.start_teleop()
        for node, route in self.routes.items():
            if route is Route.PROXY:
                self.links.heal(node)

    def _teleop_way(self) -> tuple[tuple[str, ...], str]:
        """Return the prefix of teleop's command, and the endpoint that it connects to."""
        match self.routes[topics.TELEOP]:
            case Route.DIRECT | Route.STATION:
                return (), self.launch.bus.endpoint
            case Route.PROXY:
                return (), self.links.endpoints[topics.TELEOP]
            case Route.CABLE:
                if self._cable is None:
                    self._cable = Cable(os.getpid(), subnet=os.getpid() % 250)
                if self._cable_link is None:
                    self._cable_link = self._linked(self._cable.host, topics.TELEOP)
                return self._cable.prefix, self._cable_link.endpoints[topics.TELEOP]

    # --- processes

    async def start_teleop(self) -> None:
        """Start a new teleop on new terminals, or a new page and its server if it has ended, without waiting until it is alive."""
        if self._watch is not None:
            self.observer.look()
            self.observer.alive.discard(topics.TELEOP)
        environment = dict(os.environ | self.environment | {faulty_process.DIRECTORY: str(self.directory)})
        if self.routes[topics.TELEOP] is Route.STATION:
            if not (isinstance(self._operator, StationOperator) and self._operator.open_again()):
                await self.stop_teleop()
                self._operator = StationOperator(self.launch, environment, self.directory)
            return
        await self.stop_teleop()
        prefix, endpoint = self._teleop_way()
        command = self.launch.command(topics.TELEOP)
        command[command.index("--endpoint") + 1] = endpoint
        self._operator = TypedTeleop([*prefix, *command], environment)

    async def stop_teleop(self) -> None:
        if self._operator is not None:
            desk, self._operator = self._operator, None
            await desk.close()

    def pid(self, node: str) -> int:
        """Return the process id of a node, or of supervisord.

        Raises:
            StageError: it does not run.
        """
        if node == topics.TELEOP:
            return self.operator.pid
        if node == PAGE and (pid := self.station.page_pid) is not None:
            return pid
        for process in processes.of(self.state.path):
            if process.name == node:
                return process.pid
        raise StageError(f"{node} does not run")

    def signal(self, node: str, number: signal.Signals) -> float:
        """Signal a node, or supervisord; return the time just before."""
        pid = self.pid(node)
        now_s = time.monotonic()
        with suppress(ProcessLookupError):
            os.kill(pid, number)
        return now_s

    def order(self, node: str, order: str) -> float:
        """Trigger a fault inside a node; return the time just before."""
        (self.directory / f"{faulty_process.ORDER}-{node}").write_text(order)
        return self.signal(node, signal.SIGUSR1)

    def crash_file(self, node: str) -> Path:
        """Return the file that makes a node end at each start, while it exists."""
        return self.directory / f"{faulty_process.CRASH}-{node}"

    # --- the port of the faults

    async def pause(self, duration_s: float) -> None:
        await self.observer.watch(duration_s)

    def kill(self, *nodes: str) -> float:
        pids = [self.pid(node) for node in nodes]
        now_s = time.monotonic()
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.observer.alive.difference_update(nodes)
        return now_s

    def end(self, node: str, how: End) -> float:
        match how:
            case End.TERM:
                return self.signal(node, signal.SIGTERM)
            case End.RAISE:
                return self.order(node, how)
            case End.INPUT:
                return self.teleop.end_input()
            case End.HANG_UP:
                return self.teleop.hang_up()

    async def restart(self, *nodes: str) -> None:
        """Do nothing: supervisord and the operator restart what has ended."""

    def hold(self, node: str, how: Hold, for_s: float) -> float:
        if how is Hold.STOP:
            return self.signal(node, signal.SIGSTOP)
        return self.order(node, f"{how} {for_s}")

    def let_go(self, node: str, how: Hold) -> None:
        if how is Hold.STOP:
            self.signal(node, signal.SIGCONT)

    def cut(self, node: str, *, up: bool, down: bool) -> float:
        now_s = time.monotonic()
        self.links.open(node, up=not up, down=not down)
        return now_s

    def delay(self, node: str, least_s: float, most_s: float) -> float:
        now_s = time.monotonic()
        self.links.delay(node, least_s, most_s)
        return now_s

    def heal(self, node: str) -> None:
        self.links.heal(node)

    def attack(self, name: str, seed: int, for_s: float) -> float:
        attacker = self.attacker
        now_s = time.monotonic()
        attacker.order({"attack": name, "seed": seed, "for_s": for_s})
        return now_s

    def end_attack(self, name: str) -> int:  # noqa: ARG002 - there is one attack at a time
        return int(self.attacker.order({"attack": "stop"}))

    def step_clock(self, node: str, by_s: float) -> float:
        if node == topics.TELEOP:
            self.observer.trusts_stamps = False
        return self.order(node, f"clock {by_s}")

    def set_page_fault(self, fault: PageFault) -> float:
        self.pid(PAGE)  # without a page, it fails
        now_s = time.monotonic()
        self.station.order(fault._asdict())
        return now_s

    async def press_estop(self) -> float:
        at_s = time.monotonic()
        self.observer.bus.publisher(topics.ESTOP).put(Bool(data=True))
        if not await self.observer.until(
            lambda seen: any(one.is_zero and one.arrival_s > at_s for one in seen.commands[-200:]),
            PRESSED_LIMIT_S,
        ):
            raise StageError("the e-stop did not reach the supervisor")
        return at_s

    async def insist(self) -> None:
        """Wait until all processes are alive; then send neutral, and request motion."""
        await self.alive(topics.TELEOP)
        until_s = time.monotonic() + INSISTS_S
        while time.monotonic() < until_s:
            self.operator.press("s")
            await self.observer.watch(3 * LOOK_S)
            self.operator.press("wwww")
            await self.observer.watch(6 * LOOK_S)

    async def sensors(self, faults: str) -> float:
        """As `Port.sensors`.

        Raises:
            StageError: the sim refuses, or does not answer.
        """
        now_s = time.monotonic()
        try:
            response = await self.observer.bus.call(topics.SIM_FAULTS, faults, timeout_s=CALL_LIMIT_S)
        except NoReplyError as error:
            raise StageError(f"the sim does not take the faults {faults!r}: {error}") from error
        if not response.success:
            raise StageError(f"the sim refuses the faults {faults!r}: {response.message}")
        return now_s

    async def mend_sensors(self) -> None:
        deadline_s = time.monotonic() + ALIVE_LIMIT_S
        while time.monotonic() < deadline_s:
            with suppress(StageError):
                await self.sensors("none")
                return
            await self.observer.watch(ASK_AGAIN_S)
        raise StageError(f"no sim accepted the end of its sensor faults within {ALIVE_LIMIT_S:g} s")

    # --- waiting

    async def settled(self) -> None:
        """Wait until supervisord considers its programs running; it restarts a program that dies earlier with growing delays.

        Raises:
            StageError: it does not in time.
        """
        deadline_s = time.monotonic() + ALIVE_LIMIT_S
        while (programs := supervisord.programs(self.state)) is not None:
            waiting = [program.name for program in programs if program.state != "RUNNING"]
            if not waiting:
                return
            if time.monotonic() > deadline_s:
                raise StageError(f"not running within {ALIVE_LIMIT_S:g} s: {', '.join(waiting)}")
            await self.observer.watch(SETTLE_POLL_S)

    async def alive(self, *more: str) -> None:
        """Wait until sim and supervisor have their tokens and publish.

        Raises:
            StageError: they do not in time.
        """
        wanted = {*NODES, *more}
        since_s = time.monotonic()

        def are_there(seen: Seen) -> bool:
            return (
                self.observer.alive >= wanted
                and any(status.arrival_s > since_s for status in seen.statuses[-1:])
                and any(motion.time_s > since_s for motion in seen.motions[-1:])
            )

        if not await self.observer.until(are_there, ALIVE_LIMIT_S):
            missing = wanted - self.observer.alive
            raise StageError(
                f"not alive within {ALIVE_LIMIT_S:g} s: {', '.join(sorted(missing)) or 'they publish nothing'}"
            )

    # --- the operator

    async def neutral(self) -> float:
        """Send neutral until the supervisor permits driving; return the time that it took [s].

        Raises:
            StageError: it does not in time.
        """
        began_s = time.monotonic()
        deadline_s = began_s + READY_LIMIT_S
        while time.monotonic() < deadline_s:
            self.press_neutral()
            pressed_s = time.monotonic()
            if await self.observer.until(lambda seen: _is_free(seen, pressed_s), PRESS_AGAIN_S):  # noqa: B023 - called at once
                return time.monotonic() - began_s
        statuses = self.observer.seen.statuses
        reasons = ", ".join(statuses[-1].reasons) if statuses else "no status arrived"
        ended = "" if self.operator.running else f"; teleop has ended: {self.operator.last_lines}"
        raise StageError(f"not ready to drive {READY_LIMIT_S:g} s after neutral ({reasons}){ended}")

    def press_neutral(self) -> None:
        """Press `s`, and `r` if an e-stop is latched."""
        is_latched = any("ESTOP" in status.reasons for status in self.observer.seen.statuses[-1:])
        self.operator.press("sr" if is_latched else "s")

    async def back_to_start(self) -> None:
        """Put the robot at rest at its start, with at least 4 m of free aisle ahead and without any pillar.

        Raises:
            StageError: the sim did not reset.
        """
        bus = self.observer.bus
        bus.publisher(topics.OBSTACLE).put(Point(0.0, 0.0, -1.0))
        deadline_s = time.monotonic() + RESET_LIMIT_S
        while True:
            try:
                response = await bus.call(topics.SIM_RESET, timeout_s=CALL_LIMIT_S)
                break
            except NoReplyError as error:
                if time.monotonic() > deadline_s:
                    raise StageError(f"the sim did not reset: {error}") from error
        if not response.success:
            raise StageError(f"the sim did not reset: {response.message}")

    def put_pillar(self, ahead_m: float, left_m: float) -> None:
        """Place a pillar relative to the robot's start pose."""
        x_m, y_m = START_M
        self.observer.bus.publisher(topics.OBSTACLE).put(Point(x_m + ahead_m, y_m + left_m, 0.0))


def _is_free(seen: Seen, since_s: float) -> bool:
    """Return whether a newer status without a stop reason has arrived."""
    return bool(seen.statuses) and seen.statuses[-1].arrival_s > since_s and not seen.statuses[-1].is_stopped
