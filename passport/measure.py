"""`lifeline passport measure`: a robot is driven toward a flat wall and stopped by faults, and each stop is recorded."""

import asyncio
import hashlib
import math
import os
from collections.abc import Collection
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple, NoReturn, TypeVar

from commission.commission import (
    EXIT_ABORTED,
    EXIT_INTERRUPTED,
    NO_WALL,
    REST_S,
    check_robot,
    checked,
    with_person,
)
from commission.driver import AbortedError, Driver, SurpriseError
from commission.person import Person
from commission.plan import FACING_RAD
from commission.wall import Wall
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.provenance import commit, machine, now
from deploy.stack.statedir import StateDir
from passport import cells
from passport.cells import Fault, Plan
from passport.injection import InjectionError, Injector, Operator
from passport.instrument import instrument
from passport.record import MAX_TEXT, Conditions, Instrument, Passport, Run, way_in_words
from passport.results import Results
from passport.rounds import Place, Rounds, Seen
from passport.stops import no_stop, run_of
from passport.without import Without
from supervisor.config import NamedLidarSection, SupervisorSection
from supervisor.measured import MeasuredLidar, MeasuredSection
from teleop.pilots.config import TeleopSection
from teleop.pilots.pilot import Velocity
from wire import topics
from wire.bus import Bus
from wire.host.config import Sections

T = TypeVar("T")


class Orders(NamedTuple):
    """What is to be measured."""

    source: str
    """The command source that drives back."""
    lidar: str | None
    """The lidar that sees the wall; None for the first one."""
    out: Path
    runs: int
    """Of each cell."""
    loads_percent: tuple[int, ...]
    faults: Collection[Fault]
    """Empty: all."""
    with_lifeline: bool = True


class Robot(NamedTuple):
    """The robot that is measured."""

    file: Path
    launch: Launch
    sections: Sections
    lidar: NamedLidarSection

    @property
    def config(self) -> SupervisorSection:
        return self.sections[SupervisorSection]

    @property
    def measured(self) -> MeasuredSection:
        return self.sections.get(MeasuredSection) or MeasuredSection()

    @property
    def operator(self) -> str:
        """The command source of the operator's program."""
        return self.sections[TeleopSection].source

    @property
    def top(self) -> Velocity:
        """The top speed, and the top rate of a turn."""
        return Velocity(self.config.max_linear_m_s, self.config.max_angular_rad_s)

    def scale(self, *, turn: bool) -> float:
        """Return the true distance (of a turn: angle) divided by that of odometry."""
        found = self.measured.turn_scale if turn else self.measured.odometry_scale
        return 1.0 if found is None else found.value

    def latency_s(self) -> tuple[float, float | None]:
        """Return the latency of the scans and its uncertainty, which is None if it was not measured."""
        found = self.measured.lidars.get(self.lidar.name, MeasuredLidar()).latency_s
        if found is None:
            return self.lidar.usual_latency_s(), None
        return found.value, abs(found.limit - found.value)


def measure(file: Path, launch: Launch, state: StateDir, running: Launch | None, orders: Orders) -> NoReturn:
    """Run the measurement; exit 0 at the end, 1 if it was aborted or the robot did not stop, 130 if interrupted.

    Args:
        file: the configuration of the robot.
        launch: how to reach it.
        state: the state directory of this computer.
        running: the robot that this computer runs; None without one.
        orders: what to measure.

    Raises:
        DeployError: the file is refused, or there is no terminal.
    """
    robot = Robot(file, launch, *checked(file, orders.source, orders.lidar))
    if robot.operator not in (one.name for one in robot.config.sources):
        raise DeployError(f"[teleop] source = {robot.operator!r} is not in [supervisor] sources: add it")
    if robot.operator == orders.source:
        raise DeployError(f"--source {orders.source} is the source of the operator's program: give another")
    check_robot(file, launch, running)
    without = None if orders.with_lifeline else _without(robot, state, orders)

    operator = Operator(launch, robot.operator)
    with_person(
        launch, lambda bus, person: Measurement(bus, person, operator, robot, state, orders, without).run
    )


def _without(robot: Robot, state: StateDir, orders: Orders) -> Without:
    """Return what replaces Lifeline's processes.

    Raises:
        DeployError: the robot, or one of the faults, cannot be measured without Lifeline.
    """
    of_lifeline = [fault for fault in orders.faults if fault in cells.OF_LIFELINE]
    if of_lifeline:
        raise DeployError(
            f"{' and '.join(of_lifeline)}: not without Lifeline, because it is a fault or a stop of Lifeline"
        )
    without = Without(robot.launch, state, (robot.operator, orders.source))
    if (refusal := without.refusal()) is not None:
        raise DeployError(refusal)
    return without


class Measurement:
    """Conducts the measurement with one person."""

    def __init__(
        self,
        bus: Bus,
        person: Person,
        operator: Operator,
        robot: Robot,
        state: StateDir,
        orders: Orders,
        without: Without | None,
    ) -> None:
        self._without = without
        self._person, self._robot, self._orders = person, robot, orders
        self._say = person.say
        self._bases = cells.trusted_bases(robot.config, robot.measured, robot.launch.bus.lease_s)
        hull_m = robot.config.footprint.hull().radius_m
        self._driver = Driver(bus, orders.source, robot.lidar, hull_m, person)
        self._injector = Injector(bus, robot.launch, state, operator)
        self._kept = "Nothing was written"
        self._rounds = Rounds(self._driver, operator, self._injector, person, self._bases, robot.operator)

    async def run(self, stop: asyncio.Event) -> int:
        await self._driver.claim(stop)
        try:
            await self._steps()
        except (AbortedError, DeployError, InjectionError) as error:
            self._say(f"aborted: {error}. {self._kept}")
            return EXIT_INTERRUPTED if stop.is_set() else EXIT_ABORTED
        finally:
            try:
                await self._driver.leave()
            finally:
                if self._without is not None and not await self._without.end():
                    self._say("Lifeline was not started again: `lifeline down`, then `lifeline up`")
        self._say(f"written: {self._orders.out}")
        return 0

    async def _steps(self) -> None:
        has_ros2 = topics.ROS2 in self._robot.launch.nodes
        with_lifeline = self._orders.with_lifeline
        plans = list(
            cells.plans(self._robot.top, self._orders.faults, has_ros2=has_ros2, with_lifeline=with_lifeline)
        )
        self._say(
            "The robot is driven toward a flat wall, and stopped by faults. Place it on a flat, free floor, facing the wall. Stand "
            "beside it with its own e-stop in your hand. Any key aborts a drive."
        )
        try:
            await self._driver.ready()
        except SurpriseError as error:
            raise AbortedError(str(error)) from error
        wall = await self._check_wall()
        found = await self._instrument(wall)
        floor = await self._driver.ask("Type what the floor is, such as smooth concrete.")
        results = Results(self._orders.out, self._begun(found, floor))
        self._kept = f"The runs until now are in {self._orders.out}"
        fitting = [one for one in plans if self._misfit(one) is None]
        if fitting:
            needed_m = max(cells.needs_m(one, self._bases.of(one)) for one in fitting)
            turns = " It also turns on the spot." if any(one.is_turn for one in fitting) else ""
            alone = (
                "While a process of Lifeline is killed or stopped, only the base itself and you can stop it."
            )
            word = "go"
            if self._without is not None:
                alone = (
                    "Lifeline is not there: NOTHING but the base itself and you stops the robot, neither before an obstacle nor when "
                    "a stream ends. Keep your hand on its own e-stop."
                )
                word = "without"
            await self._driver.confirm(
                f"The robot drives {needed_m:.1f} m toward the wall at most, and back to where it stands now, {len(fitting)} cells with "
                f"{self._orders.runs} runs each.{turns} {alone} Keep this area free, and {cells.SIDE_M:g} m beside the robot and "
                f"behind it. Type {word} to drive.",
                word,
            )
            if self._without is not None:
                await self._driver.during(self._without.begin())
                await self._rounds.all_heard()
        for load_percent in self._orders.loads_percent:
            if any(results.runs(plan, load_percent) < self._orders.runs for plan in fitting):
                await self._load(results, load_percent)
            for plan in plans:
                await self._cell(results, plan, load_percent)

    # --- before the first run

    async def _check_wall(self) -> Wall:
        wall = await self._driver.find_wall()
        if wall is None:
            raise AbortedError(NO_WALL)
        bearing_rad = self._driver.bearing_rad(wall)
        if abs(bearing_rad) > FACING_RAD:
            raise AbortedError(
                f"the nearest wall is in the direction {math.degrees(bearing_rad):+.0f}°: turn the robot to it"
            )
        await self._driver.confirm(
            f"{self._robot.lidar.name} sees a wall of {wall.length_m:.1f} m, {wall.distance_m:.3f} m from the lidar. Measure this "
            "with a tape. Type yes if it agrees.",
            "yes",
        )
        return wall

    async def _instrument(self, wall: Wall) -> Instrument:
        """Measure the noise of the wall at rest, and keep the place of the robot."""
        self._say(f"The robot stands for {REST_S:g} s: noise of the wall, rate of odometry.")
        start_s = self._driver.now_s
        await self._driver.wait(REST_S)
        trace = self._driver.trace.between(start_s, self._driver.now_s)
        arrivals_s = [one.at_s for one in trace.odometry]
        latency_s = self._robot.latency_s()[1]
        found = instrument(
            self._robot.lidar.name,
            trace.walls(),
            trace.bearings(),
            arrivals_s,
            top=self._robot.top,
            latency_s=latency_s,
        )
        if found is None:
            raise AbortedError("the wall or odometry is not seen well enough at rest")
        self._rounds.place = Place(trace.odometry[-1].pose, self._driver.gap_m(trace.mean_wall() or wall))
        self._say(
            f"A distance is uncertain by {1000.0 * found.uncertainty_m:.1f} mm, a time by {1000.0 * found.uncertainty_s:.0f} ms."
        )
        return found

    def _misfit(self, plan: Plan) -> str | None:
        """Return why a cell does not fit into the free distance at the start; None if it fits."""
        assert self._rounds.place is not None
        return cells.problem(plan, self._bases.of(plan), self._rounds.place.gap_m)

    def _begun(self, found: Instrument, floor: str) -> Passport:
        file = self._robot.file
        return Passport(
            robot=f"{self._robot.launch.bus.namespace} ({file.name})"[:MAX_TEXT],
            version=version("lifeline"),
            commit=commit(),
            configuration_sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
            date=now(),
            conditions=Conditions(
                top_speed_m_s=self._robot.top.linear_m_s,
                loads=(),
                floor=floor[:MAX_TEXT],
                machine_load=machine()[:MAX_TEXT],
            ),
            instrument=found,
            not_tested=cells.NOT_TESTED,
        )

    async def _load(self, results: Results, percent: int) -> None:
        """Ask for a load, and note its mass."""
        kilograms = await self._driver.ask(
            f"Load the robot with {percent} % of its payload. Type the mass, such as 20 kg."
        )
        begins = f"{percent} %: "
        conditions = results.passport.conditions
        others = [one for one in conditions.loads if not one.startswith(begins)]
        loads = (*others, f"{begins}{kilograms}"[:MAX_TEXT])
        results.update(conditions=conditions.model_copy(update={"loads": loads}))

    # --- a cell

    async def _cell(self, results: Results, plan: Plan, load_percent: int) -> None:
        """Drive the runs of a cell that are missing."""
        name = f"{plan}, load {load_percent} %"
        if results.runs(plan, load_percent) >= self._orders.runs:
            return
        refusal = self._misfit(plan) or await self._injector.refusal(plan.fault)
        results.refuse(plan, load_percent, refusal)
        if refusal is not None:
            self._say(f"{name}: not measured: {refusal}")
            return
        while (done := results.runs(plan, load_percent)) < self._orders.runs:
            try:
                await self._rounds.back()
                seen = await self._rounds.run(plan)
                run = self._run_of(plan, seen, results.passport.instrument)
            except SurpriseError as error:
                self._say(f"{name}, run {done + 1}: {error}")
                results.deviate(f"{name}: run {done + 1} was interrupted: {error}")
                await self._recover(plan)
                answer = await self._driver.ask(
                    "Place the robot with teleop if necessary. Type again to repeat the run, skip to leave out the cell, anything "
                    "else to end."
                )
                if answer == "skip":
                    results.refuse(plan, load_percent, f"left out after {done} runs: {error}")
                    return
                if answer != "again":
                    raise AbortedError(str(error)) from error
                continue
            results.add(plan, load_percent, run)
            self._note_machine(results)
            if not run.stopped and plan.with_lifeline:
                raise AbortedError(f"the robot did not stop after {name}: the measurement ends")
            if not run.stopped:
                self._say(f"{name}: the robot did not stop")
                results.refuse(plan, load_percent, f"ended in run {done + 1}: the robot did not stop")
                await self._recover(plan)
                return
            self._say(f"{name}, run {done + 1} of {self._orders.runs}: {_in_words(plan, run)}")
            await self._recover(plan)

    def _run_of(self, plan: Plan, seen: Seen, found: Instrument) -> Run:
        """Return the run that was seen.

        Raises:
            SurpriseError: it cannot be computed.
        """
        trace = self._driver.trace.between(seen.start_s, seen.rest_s)
        is_turn = plan.is_turn
        odometry = trace.turning(seen.start) if is_turn else trace.toward(seen.start)
        walls = trace.bearings() if is_turn else trace.walls()
        is_seen = not plan.fault.takes_recorder
        if not seen.is_stopped:
            return no_stop(plan.speed, seen.fault_s, seen.rest_s, trace.commands, odometry, is_seen=is_seen)
        if not is_turn:  # the robot does not face the wall exactly
            walls[:, 1] /= math.cos(self._driver.bearing_rad(seen.before))
        run = run_of(
            seen.fault_s,
            seen.rest_s,
            trace.commands,
            odometry,
            walls,
            is_seen=is_seen,
            scale=self._robot.scale(turn=is_turn),
            latency_s=self._robot.latency_s()[0],
            uncertainty_m=(found.uncertainty_rad or 0.0) if is_turn else found.uncertainty_m,
            is_turn=is_turn,
        )
        if run is None:
            raise SurpriseError("the robot did not drive steadily before the fault, or the wall was lost")
        return run

    def _note_machine(self, results: Results) -> None:
        conditions = results.passport.conditions
        first = conditions.machine_load.partition("; ")[0]
        text = f"{first}; at the last run, load average {os.getloadavg()[0]:.1f}"
        results.update(conditions=conditions.model_copy(update={"machine_load": text[:MAX_TEXT]}))

    async def _recover(self, plan: Plan) -> None:
        """Make the robot ready again; a person resets the e-stop."""
        can_latch = plan.fault is Fault.ESTOP or not plan.with_lifeline
        while can_latch and self._rounds.is_estop_latched:
            await self._driver.confirm("The e-stop is latched. Type reset to reset it.", "reset")
            problem = await self._injector.reset()
            if problem is not None:
                self._say(f"the e-stop was not reset: {problem}")
            await self._rounds.all_heard()


def _in_words(plan: Plan, run: Run) -> str:
    time = "" if run.t3_s is None else f"stood after {run.t3_s:.2f} s and "
    slip = "; lidar and odometry disagree" if run.slip else ""
    return f"{time}{way_in_words(run, turn=plan.is_turn)}{slip}"
