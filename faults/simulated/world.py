"""The real services as processes on a virtual network, each of which can end, hang and restart; and the witness of the true motion."""

import asyncio
import math
from collections import deque
from collections.abc import Callable, Coroutine, Iterable
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from faults.measure import BaseReport
from faults.page import Page
from faults.port import PAGE
from faults.seen import Asked, Command, Motion, Seen, Status
from faults.simulated.rules import RuleJudge
from faults.simulated.scenario import Drivers, Scenario
from faults.simulated.station import CODE, StationServer
from faults.trial import BrokenPromise
from sim import mj
from sim.config import Build, Hull, SimSection
from sim.floorplan import Circle, FloorPlan, Outline, Standing, survey
from sim.messages import base_reason
from sim.plant import Plant, Snapshot
from sim.scene import Scene, build
from sim.service import SimService
from supervisor.config import FootprintSection, SupervisorSection
from supervisor.estop_record import MemoryRecord
from supervisor.service import SupervisorService
from teleop.holder import HeldError
from teleop.pilots.keyboard import Incremental
from teleop.pilots.pilot import KeyEvent, Ramp
from teleop.screen.view import Control, Line, View
from teleop.service import Setup, Teleop
from virtual.loop import VirtualLoop, VirtualProcess
from virtual.network import VirtualBus, VirtualNetwork
from wire import topics
from wire.bus import wait_until
from wire.messages import SafetyStatus, Twist, planar_twist
from wire.stamp import Stamp

SIM = SimSection(imu_hz=1.0)
"""The default configuration; the inertial unit is slow, because no service uses it."""
SIM_SLACK_S = 0.01
"""Five physics steps at each wake-up, unless a message arrives; a process on a busy machine is no more exact."""
SAMPLE_S = 0.02
HEARTBEAT_S = 0.05
RESTART_S = 0.3
TRY_AGAIN_S = 0.3
START_CLEARANCE_M = 0.5
PLACES = 50
"""Number of random places that are tried before the default start is used."""
FREE_AHEAD_M, AHEAD_STEP_M = 4.0, 0.25
HALF_LENGTH_M, HALF_WIDTH_M = 0.3, 0.2
JOY = "joy"
SOURCES = (topics.TELEOP, JOY)

FAR_M = 0.5
"""Larger clearances are not measured at every sample."""
FASTEST_M_S, FASTEST_ALONE_M_S = 3.0, 2.0
"""Upper bounds of the closing speed: of robot and mover together, and of the robot alone."""

Main = Callable[["Life"], Coroutine[Any, Any, None]]


@dataclass(eq=False)
class Life:
    """One run of a process."""

    name: str
    process: VirtualProcess
    bus: VirtualBus
    stop: asyncio.Event = field(default_factory=asyncio.Event)
    task: asyncio.Task[None] | None = None


class Witness:
    """Measures the clearance of the robot's hull, and how much of its change is due to the robot's own motion.

    Args:
        plant: the robot in its world.
        scene: the scene of its world.
    """

    def __init__(self, plant: Plant, scene: Scene) -> None:
        self._plant = plant
        self._standing = FloorPlan(scene.standing)
        pillar = mj.id_of(plant.model, "geom", "pillar")  # its geom follows at the next step only
        self._moving = [geom for geom in scene.moving_geoms if geom != pillar]
        self._fastest_m_s = FASTEST_M_S if self._moving else FASTEST_ALONE_M_S
        self.start(0.0)

    def start(self, now_s: float) -> None:
        """Forget the earlier samples, because the robot was placed elsewhere."""
        self._measured = self._plant.outline
        self._skip = False
        self._pillar = self._plant.pillar
        self._clear_until_s = now_s
        self._clearance_m = min(self._nearest_m(self._measured, self._present()), FAR_M)

    def look(self, now_s: float) -> Motion:
        """Return the current sample. Every second sample measures the clearance; clearances above `FAR_M` are given as `FAR_M`."""
        plant = self._plant
        outline, own_approach_m, appeared_m = plant.outline, 0.0, math.inf
        self._skip = not self._skip
        is_due = not self._skip and now_s >= self._clear_until_s
        if (is_due and (self._moving or outline != self._measured)) or plant.pillar != self._pillar:
            if plant.pillar != self._pillar:
                self._pillar = plant.pillar
                appeared_m = FloorPlan(self._pillars()).nearest(outline).distance_m
            present = self._present()
            clearance_m = self._nearest_m(outline, present)
            if clearance_m > FAR_M:
                self._clear_until_s = now_s + (clearance_m - FAR_M) / self._fastest_m_s
            else:
                own_approach_m = min(self._nearest_m(self._measured, present), FAR_M) - clearance_m
                self._clear_until_s = now_s
            self._clearance_m = min(clearance_m, FAR_M)
            self._measured = outline
        elif now_s < self._clear_until_s:
            self._measured = outline  # no object is near: the approach to the next one is measured from here
        velocity = plant.true_velocity
        return Motion(
            now_s,
            outline.x_m,
            outline.y_m,
            velocity.linear_m_s,
            velocity.angular_rad_s,
            self._clearance_m,
            own_approach_m,
            plant.hull_contacts > 0,
            appeared_m,
        )

    def _present(self) -> FloorPlan | None:
        """Return the present places of the objects that can move; None if there are none."""
        present, _ = survey(self._plant.model, self._plant.data, self._moving)
        present += self._pillars()
        return FloorPlan(present) if present else None

    def _pillars(self) -> list[Standing]:
        """Return the pillar, if it is placed."""
        pillar = self._plant.pillar
        return [] if pillar is None else [Standing("pillar", Circle(*pillar, self._plant.pillar_radius_m))]

    def _nearest_m(self, hull: Outline, present: FloorPlan | None) -> float:
        others_m = math.inf if present is None else present.nearest(hull).distance_m
        return min(self._standing.nearest(hull).distance_m, others_m)


@dataclass(frozen=True)
class Stage:
    """A compiled world, reused for many trials."""

    plant: Plant
    witness: Witness
    initial: Snapshot
    floor: FloorPlan
    half_size_m: tuple[float, float]


@lru_cache(maxsize=12)
def stage(scene: str, *, movers: bool, rectangular: bool) -> Stage:
    """Return the world of a scenario; every trial first restores its initial state, exact to the bit."""
    options = Build(hull=Hull.RECTANGULAR if rectangular else Hull.ROUND, moving=movers)
    world = build(scene, options)
    plant = Plant(scene, limits=SIM.limits(), lidars=SIM.lidar_configs(), options=options)
    assert world.size_m is not None
    half_size_m = (0.5 * world.size_m[0], 0.5 * world.size_m[1])
    witness = Witness(plant, world)
    return Stage(plant, witness, plant.save(), FloorPlan(world.standing), half_size_m)


class Machine:
    """What outlives a supervisor's process: its machine's suspended time, and its record of a pressed e-stop."""

    def __init__(self) -> None:
        self._slept_s = 0.0
        self.record = MemoryRecord()

    def sleep(self, duration_s: float) -> None:
        """Suspend the machine: time passes, but the monotonic clock does not advance."""
        self._slept_s += duration_s

    def suspended_s(self) -> float:
        """Return the suspended time since the last call [s]."""
        slept_s, self._slept_s = self._slept_s, 0.0
        return slept_s


class Keyboard:
    """The keyboard input of one run of teleop."""

    ended = False

    def __init__(self, wake: asyncio.Event) -> None:
        self.wake = wake
        self.steps: tuple[int, int] = (0, 0)
        """Net key presses forward and to the left since the last stop."""
        self._events: list[KeyEvent] = []

    def press(self, keys: Iterable[str]) -> None:
        self._events += [KeyEvent(key) for key in keys]
        self.wake.set()

    def end(self) -> None:
        """End the terminal's input."""
        self.ended = True
        self.wake.set()

    def take(self) -> list[KeyEvent]:
        events, self._events = self._events, []
        return events


class Dark:
    """A screen that discards its output."""

    size = (80, 24)

    def show(self, lines: object) -> bool:  # noqa: ARG002
        return True

    def note(self, text: str) -> None: ...

    def bell(self) -> None: ...

    def doubt(self) -> None: ...

    def suspend(self) -> None: ...


def _render(_view: View, _columns: int, _rows: int) -> tuple[Line, ...]:
    return ()


class World:
    """All processes of a trial, and all observations of it."""

    def __init__(
        self, loop: VirtualLoop, scenario: Scenario, config: SupervisorSection | None = None
    ) -> None:
        self.loop, self.scenario = loop, scenario
        self.network = VirtualNetwork(loop, scenario.stream("network"))
        self.network.tap = self._tap
        self.stage = stage(scenario.scene, movers=scenario.movers, rectangular=scenario.rectangular)
        self.plant, self._witness = self.stage.plant, self.stage.witness
        self._config = config or SupervisorSection()
        if scenario.rectangular:
            corners = [(x * HALF_LENGTH_M, y * HALF_WIDTH_M) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
            self._config = self._config.model_copy(update={"footprint": FootprintSection(corners_m=corners)})
        self.seen = Seen()
        self.base: list[BaseReport] = []
        self.crashes: list[tuple[float, str, str]] = []
        """Processes that ended with an error: time, name and error."""
        self.broken: list[BrokenPromise] = []
        """Promises that a step of a supervisor broke."""
        self.status: SafetyStatus | None = None
        self.velocity = (0.0, 0.0)
        """The velocity that the sources without recovery request."""
        self.keyboard: Keyboard | None = None
        self.station: StationServer | None = None
        self.page: Page | None = None
        self.lives: dict[str, Life] = {}
        self._ended: list[Life] = []
        self.may_reset = True
        """Whether an e-stop is reset."""
        self.machine = Machine()
        self.contacts = 0
        self.heard: deque[tuple[Twist, Stamp]] = deque(maxlen=100)
        """Teleop's last commands, for replay."""
        self._mains: dict[str, Main] = {
            topics.SUPERVISOR: self._supervisor,
            topics.SIM: self._sim,
            topics.TELEOP: {Drivers.STUBBORN: self._beat, Drivers.STATION: self._station}.get(
                scenario.drivers, self._teleop
            ),
            JOY: self._beat,
            PAGE: self._page,
        }
        loop.on_error = self._on_error
        self._place_robot()

    @property
    def speed_m_s(self) -> float:
        return abs(self.plant.true_velocity.linear_m_s)

    # --- processes

    def start(self, name: str) -> None:
        """Start a process if it does not run."""
        if name in self.lives:
            return
        process = VirtualProcess(name, SIM_SLACK_S if name == topics.SIM else 0.0)
        network = self.network
        is_hub = name == topics.SUPERVISOR
        bus = network.open_hub(name, process) if is_hub else network.open_client(name, process)
        life = self.lives[name] = Life(name, process, bus)
        if name == topics.SIM:
            self._place_robot()
        life.task = self.loop.create_task(self._mains[name](life), context=process.context)
        life.task.add_done_callback(lambda task: self._on_end(life, task))

    def start_all(self) -> None:
        more = {Drivers.BOTH: JOY, Drivers.STATION: PAGE}.get(self.scenario.drivers)
        drivers = (topics.TELEOP,) if more is None else (topics.TELEOP, more)
        for name in (topics.SUPERVISOR, topics.SIM, *drivers):
            self.start(name)

    def kill(self, name: str) -> None:
        """SIGKILL."""
        life = self.lives.pop(name, None)
        if life is not None:
            self._ended.append(life)
            life.bus.die()
            if self.station is not None:
                self.station.lose(life.bus)

    def terminate(self, name: str) -> None:
        """SIGTERM."""
        life = self.lives.get(name)
        if life is not None:
            life.stop.set()

    def hold(self, name: str, *, deaf: bool = False, stopped: bool = False) -> None:
        """Hold a process; see `virtual/network.py` for the ways."""
        life = self.lives.get(name)
        if life is not None:
            life.process.hold()
            if stopped:
                life.bus.set_stopped(stopped=True)
            elif deaf:
                life.bus.set_deaf(deaf=True)

    def let_go(self, life: Life) -> None:
        """Continue a process; it first receives the messages that arrived meanwhile."""
        if life.bus.is_dead or not life.process.is_held:
            return
        if life.bus.is_stopped:
            life.bus.set_stopped(stopped=False)
        elif life.bus.is_deaf:
            life.bus.set_deaf(deaf=False)
        self.loop.resume(life.process)

    def end(self) -> None:
        """End all processes."""
        for name in list(self.lives):
            self.kill(name)

    def _on_end(self, life: Life, task: asyncio.Task[None]) -> None:
        if self.lives.get(life.name) is not life:
            return
        self.kill(life.name)
        error = None if task.cancelled() else task.exception()
        if isinstance(error, HeldError):  # the operator is told so, and tries again
            self.network.after(TRY_AGAIN_S, self.start, life.name)
        elif error is not None:
            self.crashes.append((self.loop.time(), life.name, f"{type(error).__name__}: {error}"))

    def _on_error(self, name: str, error: BaseException | None) -> None:
        self.crashes.append((self.loop.time(), name, f"{type(error).__name__}: {error}"))
        self.kill(name)

    async def _supervisor(self, life: Life) -> None:
        machine = self.machine
        rules = RuleJudge(self._config.command_timeout_s, self.broken)
        service = SupervisorService(life.bus, self._config, rules, machine.record, machine.suspended_s)
        await service.run(life.stop)
        await life.bus.close()

    async def _sim(self, life: Life) -> None:
        await life.bus.connect()
        await SimService(life.bus, SIM, self.plant).run(life.stop)
        await life.bus.close()

    async def _teleop(self, life: Life) -> None:
        await life.bus.connect()
        wake = asyncio.Event()
        self.keyboard = keyboard = Keyboard(wake)
        pilot = Incremental(Ramp(1.0, 4.0))
        setup = Setup(topics.TELEOP, "virtual", Control.INCREMENTAL, about=life.name, pictures=False)
        teleop = Teleop(life.bus, setup, pilot=pilot, keys=keyboard, screen=Dark(), render=_render, wake=wake)
        await teleop.run(life.stop)
        await life.bus.close()

    async def _station(self, life: Life) -> None:
        await life.bus.connect()
        self.station = StationServer(life.bus, self.network)
        self.kill(PAGE)  # a new server needs a new page
        self.start(PAGE)
        await self.station.run(life.stop)
        await life.bus.close()

    async def _page(self, life: Life) -> None:
        if self.station is None:
            return
        wake = asyncio.Event()
        self.keyboard = keyboard = Keyboard(wake)
        self.page = page = Page(partial(self.station.opened, life.bus), CODE)
        running = asyncio.ensure_future(page.run())
        running.add_done_callback(lambda task: task.result())
        while not keyboard.ended:
            await wake.wait()
            wake.clear()
            await page.press([event.key for event in keyboard.take()])

    async def _beat(self, life: Life) -> None:
        """Request the velocity all the time."""
        await life.bus.connect()
        life.bus.declare_alive(life.name)
        publisher = life.bus.publisher(topics.source_cmd_vel(life.name))
        while not life.stop.is_set():
            publisher.put(planar_twist(*self.velocity))
            await wait_until(life.stop, self.loop.time() + HEARTBEAT_S)
        publisher.put(planar_twist(0.0, 0.0))
        await life.bus.close()

    # --- the robot

    def _place_robot(self) -> None:
        """Restore the plant, place the robot where it has room, and seed the noise of this trial."""
        plant, random = self.plant, self.scenario.stream("place")
        noise = np.random.default_rng(self.scenario.seed).bit_generator.state
        plant.restore(replace(self.stage.initial, noise=(noise,)))
        half_x_m, half_y_m = self.stage.half_size_m
        base = int(plant.model.jnt_qposadr[mj.id_of(plant.model, "joint", "robot")])
        for _ in range(PLACES):
            x_m, y_m = random.uniform(-half_x_m, half_x_m), random.uniform(-half_y_m, half_y_m)
            yaw_rad = random.uniform(-math.pi, math.pi)
            if not self._has_room(x_m, y_m):
                continue
            if self.scenario.straight and not self._is_free_ahead(x_m, y_m, yaw_rad):
                continue
            plant.data.qpos[base : base + 2] = x_m, y_m
            plant.data.qpos[base + 3 : base + 7] = math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)
            mj.forward(plant.model, plant.data)
            break
        self._witness.start(self.loop.time())

    def _is_free_ahead(self, x_m: float, y_m: float, yaw_rad: float) -> bool:
        """Return whether the way straight ahead of a pose is free for long enough."""
        return all(
            self._has_room(x_m + ahead_m * math.cos(yaw_rad), y_m + ahead_m * math.sin(yaw_rad))
            for ahead_m in np.arange(AHEAD_STEP_M, FREE_AHEAD_M, AHEAD_STEP_M)
        )

    def _has_room(self, x_m: float, y_m: float) -> bool:
        """Return whether a hull at a pose is clear of all static objects and of the movers' starts."""
        hull = Circle(x_m, y_m, self.plant.hull_radius_m)
        clear = all(math.dist((x_m, y_m), pose[:2]) > 3.0 for pose in self.plant.movers.values())
        return clear and self.stage.floor.nearest(hull).distance_m > START_CLEARANCE_M

    async def watch(self) -> None:
        """Sample the true state until the trial ends."""
        while True:
            motion = self._witness.look(self.loop.time())
            before = self.seen.motions[-1] if self.seen.motions else motion
            self.contacts += motion.is_touching and not before.is_touching
            self.seen.motions.append(motion)
            await asyncio.sleep(SAMPLE_S)

    # --- what is seen

    def _tap(self, _node: str, key: str, message: Any, stamp: Stamp) -> None:  # noqa: ANN401 - any message
        now_s = self.loop.time()
        if key == topics.CMD_VEL.key:
            self.seen.commands.append(Command.of(now_s, message))
        elif key == topics.STATUS.key:
            self.status = message
            self.seen.statuses.append(Status.of(now_s, message))
        elif key == topics.DIAGNOSTICS.key:
            reason = base_reason(message)
            if reason is not None and (not self.base or self.base[-1].reason != reason):
                self.base.append(BaseReport(now_s, reason))
        elif (source := topics.source_of(key)) in SOURCES:
            self.seen.asked.append(Asked.of(now_s, source, message))
            if source == topics.TELEOP:
                self.heard.append((message, stamp))
