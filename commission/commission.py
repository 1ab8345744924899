"""`lifeline commission`: the first drive of a new robot, one confirmed step at a time, and the table `[measured]`."""

import asyncio
import datetime as dt
import itertools
import math
import os
from collections.abc import Awaitable, Callable, Collection
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from commission import plan, timing
from commission.driver import LEARN_S, WALL_LOST, AbortedError, Driver, SurpriseError
from commission.estimate import of_repeats
from commission.findings import Findings, report, results
from commission.measured import TableError, check_place, with_results
from commission.mounting import Mistake, forward_mistakes, is_moved, turn_mistakes
from commission.person import Person, TerminalPerson
from commission.trace import Driven
from deploy.stack.console import note
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import reach, run_command
from deploy.stack.robot_file import read_robot
from supervisor.config import UNMEASURED_M_S, NamedLidarSection, SupervisorSection
from teleop.terminal import is_terminal
from wire.bus import Bus
from wire.foreign import ForeignError, read_text
from wire.host.config import ConfigError, Sections, read_toml
from wire.reasons import StopReason
from wire.standstill import STILL_M_S
from wire.zenoh.hub_proof import HubProof

EXIT_ABORTED, EXIT_INTERRUPTED = 1, 130
REST_S = 3.0
NO_WALL = "no flat wall of at least 1 m is seen: move the robot, or choose another wall"
UNRESPONSIVE = f"STOPPED: {StopReason.BASE_UNRESPONSIVE}"


def commission(
    file: Path, launch: Launch, source: str, lidar_name: str | None, running: Launch | None
) -> NoReturn:
    """Run the first drive, and write `[measured]`; exit 0 at the end, 1 if it was aborted, 130 if interrupted.

    Args:
        file: the configuration of the robot.
        launch: how to reach it.
        source: the command source to drive as.
        lidar_name: the lidar that sees the wall; None for the first one.
        running: the robot that this computer runs; None without one.

    Raises:
        DeployError: the file is refused, or there is no terminal.
    """
    sections, lidar = checked(file, source, lidar_name)
    config = sections[SupervisorSection]
    _check_place(file, lidar)
    check_robot(file, launch, running)

    with_person(launch, lambda bus, person: Conductor(bus, person, file, config, lidar, source).run)


def with_person(
    launch: Launch, work: Callable[[Bus, Person], Callable[[asyncio.Event], Awaitable[int]]]
) -> NoReturn:
    """Run a guided measurement of a robot, and exit with its code.

    Args:
        launch: how to reach the robot.
        work: returns the measurement on this bus with this person; its argument is set when it must end.
    """

    async def run(stop: asyncio.Event) -> int:
        bus = await reach(launch.bus, stop, HubProof(launch.bus, note))
        if bus is None:
            return EXIT_INTERRUPTED
        try:
            with TerminalPerson() as person:
                return await work(bus, person)(stop)
        finally:
            await bus.close()

    run_command(run)


def checked(file: Path, source: str, lidar_name: str | None) -> tuple[Sections, NamedLidarSection]:
    """Return the configuration and the lidar that sees the wall.

    Args:
        file: the configuration of the robot.
        source: the command source to drive as.
        lidar_name: the lidar that sees the wall; None for the first one.

    Raises:
        DeployError: the robot cannot be measured with them.
    """
    try:
        sections = read_robot(read_toml(file), simulated=False)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    config = sections[SupervisorSection]
    if source not in (one.name for one in config.sources):
        raise DeployError(f"{source} is not in [supervisor] sources: add it, or give another --source")
    lidars = {one.name: one for one in config.all_lidars()}
    lidar = next(iter(lidars.values())) if lidar_name is None else lidars.get(lidar_name)
    if lidar is None:
        raise DeployError(f"there is no lidar {lidar_name}; there are: {', '.join(lidars)}")
    if not config.odometry:
        raise DeployError("odometry = false: without odometry, nothing can be measured")
    return sections, lidar


def check_robot(file: Path, launch: Launch, running: Launch | None) -> None:
    """Refuse a file with which the robot was not started, and a run without a person.

    Raises:
        DeployError: the robot of this computer has another configuration, or there is no terminal.
    """
    if running is not None and running.bus == launch.bus and running.config != launch.config:
        raise DeployError(
            f"the robot was started with {running.config}: give this file, or start it with {file}"
        )
    if not is_terminal():
        raise DeployError("a person must confirm each step: run it in a terminal")


def _check_place(file: Path, lidar: NamedLidarSection) -> None:
    """Refuse a file that has no place for the results.

    Raises:
        DeployError: it has none, or cannot be written.
    """
    if not (os.access(file, os.W_OK) and os.access(file.resolve().parent, os.W_OK)):
        raise DeployError(f"{file} or its directory cannot be written: the results belong into it")
    try:
        check_place(read_text(file), results(Findings(), lidar))
    except (OSError, ForeignError, TableError) as error:
        raise DeployError(f"{file}: {error}") from error


class Conductor:
    """Conducts the steps with one person."""

    def __init__(
        self,
        bus: Bus,
        person: Person,
        file: Path,
        config: SupervisorSection,
        lidar: NamedLidarSection,
        source: str,
    ) -> None:
        self._file, self._config, self._lidar = file, config, lidar
        self._say = person.say
        self._found = Findings()
        self._there_m = 0.0
        """Distance of the last straight drive, by odometry."""
        self._is_stopped = False
        """Whether the supervisor ended the last drive by an expected stop."""
        self._base = plan.Base(
            config.base_acceleration_m_s2,
            min(plan.POOR_DECELERATION_M_S2, config.deceleration_m_s2),
            max(plan.POOR_REACTION_S, config.base_dead_time_s + config.transport_s),
        )
        hull_m = config.footprint.hull().radius_m
        self._driver = Driver(bus, source, lidar, hull_m, person)

    async def run(self, stop: asyncio.Event) -> int:
        await self._driver.claim(stop)
        try:
            await self._steps()
            await self._write()
        except AbortedError as error:
            self._say(f"aborted: {error}. Nothing was written")
            return EXIT_INTERRUPTED if stop.is_set() else EXIT_ABORTED
        finally:
            await self._driver.leave()
        return 0

    # --- the steps

    async def _steps(self) -> None:
        self._say(
            "The first drive: place the robot on a flat, free floor, 3 m before a flat wall and facing it, with 2 m free "
            "behind and beside it, loaded as it will be. Stay beside it with the e-stop in your hand. Any key aborts a drive."
        )
        try:
            await self._driver.ready()
        except SurpriseError as error:
            raise AbortedError(str(error)) from error
        await self._check_wall()
        await self._rest()
        await self._first(plan.AHEAD, self._judge_ahead)
        await self._first(plan.LEFT, self._judge_left)
        await self._step(plan.HEADINGS)
        for speed_m_s in plan.speeds(min(self._config.max_linear_m_s, UNMEASURED_M_S)):
            if not await self._step(plan.stops(speed_m_s, self._base)):
                break
        await self._step(plan.ESTOP)

    async def _first(self, step: plan.Step, judge: Callable[[], Awaitable[None]]) -> None:
        """Repeat a step until the supervisor does not stop it, and judge the signs of base, odometry and lidar after each drive."""
        while True:
            await self._step(step, is_first=True)
            await judge()
            if not self._is_stopped:
                return
            self._say(f"step {step.name}: {UNRESPONSIVE}")

    async def _judge_ahead(self) -> None:
        is_ahead = await self._seen("Did the robot drive ahead, toward the wall?", "ahead", "back")
        _end_at(forward_mistakes(self._found.straights[-1], seen_ahead=is_ahead))

    async def _judge_left(self) -> None:
        is_left = await self._seen("Which way did the robot turn, seen from above?", "left", "right")
        _end_at(turn_mistakes(self._found.turns[-1], seen_left=is_left))

    async def _check_wall(self) -> None:
        wall = await self._driver.find_wall()
        if wall is None:
            raise AbortedError(NO_WALL)
        bearing_rad = self._driver.bearing_rad(wall)
        self._say(
            f"{self._lidar.name} sees a wall of {wall.length_m:.1f} m, {wall.distance_m:.2f} m from the lidar and "
            f"{self._driver.gap_m(wall):.2f} m from the hull, in the direction {math.degrees(bearing_rad):+.0f}° (0° is ahead, left is "
            "positive)."
        )
        if abs(bearing_rad) > plan.FACING_RAD:
            raise AbortedError(
                "by the mount in the file, the nearest wall is not ahead: turn the robot to the wall, or correct yaw_rad or flip"
            )
        await self._driver.confirm(
            "Measure with a tape from the lidar to the wall ahead. Type yes if it agrees.", "yes"
        )

    async def _rest(self) -> None:
        self._say(f"The robot stands for {REST_S:g} s: rate and noise of the lidar.")
        start_s = self._driver.now_s
        await self._driver.wait(REST_S)
        trace = self._driver.trace.between(start_s, self._driver.now_s)
        arrivals = [scan.at_s for scan in trace.scans]
        gaps_s = [b - a for a, b in itertools.pairwise(arrivals)]
        self._found.period, self._found.longest_s = of_repeats(gaps_s), max(gaps_s, default=math.nan)
        self._found.noise = timing.noise(trace.same_beams())
        before = trace.between(start_s, start_s + LEARN_S).mean_wall()
        after = trace.between(trace.scans[-1].at_s - LEARN_S, math.inf).mean_wall() if trace.scans else None
        if before is None or after is None:
            raise AbortedError(WALL_LOST)
        _end_at([Mistake.BASE_DRIFTS] if is_moved(before, after) else ())

    async def _step(self, step: plan.Step, *, is_first: bool = False) -> bool:
        """Drive a step, confirmed and again after a surprise; return whether it was driven."""
        while True:
            problem = await self._problem(step)
            if problem is None:
                if not await self._choose(step, "go", f"{self._announced(step)} Type go to drive"):
                    return False
                try:
                    for drive in step.drives:
                        await self._drive(drive, is_first=is_first, until_estop=step is plan.ESTOP)
                except SurpriseError as error:
                    problem = str(error)
                else:
                    return True
            self._say(f"step {step.name}: {problem}")
            question = "Place the robot with teleop if necessary. Type again for this step"
            if not await self._choose(step, "again", question, problem):
                return False

    async def _choose(
        self, step: plan.Step, word: str, question: str, problem: str = "not confirmed"
    ) -> bool:
        """Return True for the word, and False for a step that is left out.

        Raises:
            AbortedError: the person ends the drives because of the problem.
        """
        skip = "" if step.is_needed else ", skip to leave it out"
        answer = await self._driver.ask(f"{question}{skip}, anything else to end.")
        if answer == word:
            return True
        if skip and answer == "skip":
            return False
        raise AbortedError(problem)

    async def _problem(self, step: plan.Step) -> str | None:
        """Return why a step cannot begin where the robot stands; None if it can."""
        wall = self._driver.wall() or await self._driver.find_wall()
        if wall is None:
            return NO_WALL
        return plan.problem(step, self._base, self._driver.gap_m(wall), self._driver.bearing_rad(wall))

    def _announced(self, step: plan.Step) -> str:
        """Show the drives of a step; return which area must be free."""
        self._say(f"Step {step.name}, to measure {step.purpose}:")
        for text in dict.fromkeys(map(str, step.drives)):
            self._say(f"  {text}")
        ahead_m, behind_m = step.needs_m(self._base), step.needs_m(self._base, behind=True)
        where = f"{ahead_m:.1f} m ahead of the hull and {behind_m:.1f} m behind it"
        return f"Keep {where} free."

    async def _drive(self, drive: plan.Drive, *, is_first: bool, until_estop: bool) -> None:
        driven = await self._driver.drive(
            drive.back(self._there_m), self._base, is_first=is_first, until_estop=until_estop
        )
        self._is_stopped = driven.is_stopped
        if is_first and driven.is_stopped and not is_moved(driven.before, driven.after):
            raise SurpriseError(UNRESPONSIVE)
        motion = driven.motion(is_turn=bool(drive.turn_rad))
        if until_estop:
            self._keep_estop(driven)
        elif drive.turn_rad:
            self._found.turns.append(motion)
        else:
            self._there_m = motion.odometry
            self._found.straights.append(motion)
            # The slow drives are too short, and not all of them go toward the wall.
            if drive.way_m > 0.0 and drive.speed > plan.SLOW_M_S:
                self._found.driven.append(driven)

    def _keep_estop(self, driven: Driven) -> None:
        if not driven.is_stopped:
            raise SurpriseError("no e-stop was heard while the robot drove")
        still_s = (
            one.at_s
            for one in driven.trace.odometry
            if one.at_s > driven.stopped_s and abs(one.linear_m_s) < STILL_M_S
        )
        self._found.estop_s = next(still_s, math.nan) - driven.stopped_s
        self._say("the e-stop stopped the robot; reset it with r in teleop")

    async def _seen(self, question: str, as_commanded: str, other: str) -> bool:
        """Ask for the direction of the last motion; return whether it was the commanded one."""
        while True:
            answer = await self._driver.ask(f"{question} Type {as_commanded} or {other}.")
            if answer in {as_commanded, other}:
                return answer == as_commanded

    # --- the result

    async def _write(self) -> None:
        found = results(self._found, self._lidar)
        for line in report(found, self._found, self._config):
            self._say(line)
        today = dt.datetime.now(tz=dt.UTC).date().isoformat()
        while True:
            await self._driver.confirm(f"Type write to write [measured] into {self._file}.", "write")
            try:
                text = with_results(read_text(self._file), found, date=today, version=version("lifeline"))
                replace_file(self._file, text)
            except (OSError, ForeignError, TableError) as error:
                self._say(f"{self._file}: {error}. Correct it, and try again")
            else:
                break
        self._say(f"written. `lifeline check {self._file}` compares it with the configuration")


def _end_at(mistakes: Collection[Mistake]) -> None:
    """Raise AbortedError if there is a mistake."""
    if mistakes:
        raise AbortedError("; ".join(sorted(mistakes)))


def replace_file(file: Path, text: str) -> None:
    """Write a file at once; one that exists keeps its permissions, and a link stays a link.

    Raises:
        OSError: the file or its directory cannot be written.
    """
    target = file.resolve()
    beside = target.with_name(f".{target.name}.new")
    beside.unlink(missing_ok=True)  # of a run that was killed here
    with beside.open("x", encoding="utf-8", newline="") as new:
        new.write(text)
    if target.exists():
        beside.chmod(target.stat().st_mode & 0o7777)
    beside.replace(target)
