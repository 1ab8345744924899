"""One run: from the place where the robot stands, toward the wall, through the fault, to the standstill; then back."""

import itertools
import math
from typing import NamedTuple

import numpy as np

from commission.driver import LEARN_S, WALL_LOST, AbortedError, Driver, SurpriseError
from commission.person import Person
from commission.plan import FACING_RAD, LEAST_BACK_M, RETURN_M_S, SLOW_RAD_S, Drive
from commission.wall import Wall
from commission.watch import Watch
from passport import cells
from passport.cells import SIDE_M, STOP_LIMIT_S, Bases, Fault, Plan
from passport.injection import CUTS, InjectionError, Injector, Operator
from passport.record import speed_in_words
from teleop.path.course import Pose, seen_from, wrap
from teleop.pilots.pilot import NEUTRAL, Velocity
from wire.reasons import StopReason
from wire.standstill import STILL_M_S, is_still

RETURN_LIMIT_S = 20.0
"""For the supervisor and its streams, after a fault is lifted."""
ARM_LIMIT_S = 5.0
TURN_RAD = 0.05
"""A robot that faces the wall less exactly is turned to it before a run."""
AT_ONCE_RAD = 2.0
"""Largest single turn back to the wall. A larger one, near half a circle, could not be distinguished from a turn in the other direction."""
MOST_TURNS = 4
"""Two turns of at most `AT_ONCE_RAD`, and two corrections. Without this limit, a base that always turns too far would never stop turning."""
LEAST_SHARE = 0.9
"""Of the commanded speed, at the fault."""
STANDS_S = 0.5
UNSEEN = {Fault.LIDAR_SILENT, Fault.ODOMETRY_SILENT, *(one for one in Fault if one.takes_recorder)}
"""After these, the wall is searched for again."""
OTHER_STOPS = {StopReason.OBSTACLE, StopReason.ESTOP}
"""A stop by one of these would be shorter than that of the fault."""
NOT_BACK = "the robot could not drive back to its place, because no lidar sees the space behind it"


class Place(NamedTuple):
    """Where the robot stood when the person confirmed the area."""

    pose: Pose
    gap_m: float
    """From the hull to the wall."""


class Seen(NamedTuple):
    """One run; all times are those of the recorder's clock."""

    start_s: float
    start: Pose
    before: Wall
    fault_s: float
    rest_s: float
    is_stopped: bool


class Rounds:
    """Drives runs.

    Args:
        driver: drives back, and records.
        operator: the operator's program, which drives toward the wall.
        injector: injects the faults.
        person: any key of them aborts a drive.
        bases: what is assumed of the base.
        source: the command source of the operator's program.
    """

    def __init__(
        self,
        driver: Driver,
        operator: Operator,
        injector: Injector,
        person: Person,
        bases: Bases,
        source: str,
    ) -> None:
        self._driver, self._operator, self._injector = driver, operator, injector
        self._person, self._bases, self._source = person, bases, source
        self.place: Place | None = None
        self._is_back = True
        """Whether the robot reached its place at the newest drive back."""

    @property
    def is_estop_latched(self) -> bool:
        return self._driver.has_stopped(StopReason.ESTOP)

    async def all_heard(self) -> None:
        """Wait until every stream is heard again.

        Raises:
            AbortedError: one is silent for too long.
        """
        end_s = self._driver.now_s + RETURN_LIMIT_S
        await self._driver.wait(STANDS_S)
        while (silent := self._driver.silent()) is not None:
            await self._driver.beat()
            if self._driver.now_s > end_s:
                raise AbortedError(silent)

    # --- back to the place

    async def back(self) -> None:
        """Face the wall, and drive back to the place.

        Raises:
            SurpriseError: something unexpected happened, or the robot is outside the area that was confirmed.
        """
        await self._driver.ready()
        await self._face()
        there_m = await self._from_place_m()
        self._is_back = True
        if there_m > LEAST_BACK_M:
            drive = Drive(-there_m, speed=RETURN_M_S).back(there_m)
            self._is_back = not (await self._driver.drive(drive, self._bases.straight)).is_stopped
        await self._face()
        await self._from_place_m()

    async def _face(self) -> None:
        """Turn to the wall if the wall is ahead, or in the direction that odometry expects after a turn.

        Raises:
            SurpriseError: something unexpected happened.
        """
        assert self.place is not None
        for _ in range(MOST_TURNS):
            bearing_rad = self._driver.bearing_rad(await self._wall())
            if abs(bearing_rad) <= TURN_RAD:
                return
            expected_rad = self.place.pose.yaw_rad - self._driver.trace.odometry[-1].pose.yaw_rad
            if min(abs(bearing_rad), abs(wrap(bearing_rad - expected_rad))) > FACING_RAD:
                return
            turn_rad = math.copysign(min(abs(bearing_rad), AT_ONCE_RAD), bearing_rad)
            await self._driver.drive(Drive(turn_rad=turn_rad, speed=SLOW_RAD_S), self._bases.turning)

    async def _from_place_m(self) -> float:
        """Return how much nearer to the wall than its place the robot stands.

        Raises:
            SurpriseError: it is outside the area, or does not face the wall.
        """
        assert self.place is not None
        wall, pose = await self._wall(), self._driver.trace.odometry[-1].pose
        there_m = self.place.gap_m - self._driver.gap_m(wall)
        aside_m = float(seen_from(np.array([pose]), self.place.pose)[0, 1])
        if max(-there_m, abs(aside_m)) > SIDE_M or abs(self._driver.bearing_rad(wall)) > FACING_RAD:
            raise SurpriseError("the robot has left the area that was confirmed, or does not face the wall")
        return there_m

    async def _wall(self) -> Wall:
        """Return the wall; search for it if it is lost.

        Raises:
            SurpriseError: it is not found.
        """
        wall = self._driver.wall() or await self._driver.find_wall()
        if wall is None:
            raise SurpriseError(WALL_LOST)
        return wall

    # --- a run

    async def run(self, plan: Plan) -> Seen:
        """Drive toward the wall, inject the fault, and record until the robot stands. A robot that does not stand is stopped by the e-stop.

        Raises:
            SurpriseError: something unexpected happened before the fault, or a key was pressed.
        """
        problem = cells.problem(plan, self._bases.of(plan), self._driver.gap_m(await self._wall()))
        if problem is not None:
            raise SurpriseError(problem if self._is_back else f"{problem}; {NOT_BACK}")
        try:
            await self._start_operator(with_link=plan.fault in CUTS)
            try:
                return await self._drive(plan)
            except SurpriseError:
                if not plan.with_lifeline:  # a base may keep the last command of a program that was killed
                    await self._latch()
                raise
        except InjectionError as error:
            raise SurpriseError(str(error)) from error
        finally:
            self._operator.request(NEUTRAL)
            await self._operator.end()

    async def _start_operator(self, *, with_link: bool) -> None:
        await self._driver.during(self._operator.start(with_link=with_link))
        self._check_key()
        end_s = self._driver.now_s + ARM_LIMIT_S
        while (missing := self._driver.missing(self._source)) is not None:
            self._operator.request(NEUTRAL)
            await self._driver.beat()
            if self._driver.now_s > end_s:
                raise SurpriseError(f"the operator's program may not drive: {missing}")

    async def _drive(self, plan: Plan) -> Seen:
        driver = self._driver
        start_s = driver.now_s - LEARN_S
        before = driver.trace.between(start_s, driver.now_s).mean_wall()
        if before is None:
            raise SurpriseError(WALL_LOST)
        base = self._bases.of(plan)
        drive = cells.drive_of(plan, base)
        start = driver.trace.odometry[-1].pose
        watch = Watch(drive, base, start, before, driver.gap_m(before), driver.now_s, is_first=False)
        while not watch.is_done(driver.trace.odometry[-1], driver.wall()):
            self._operator.request(plan.velocity)
            driver.check(await driver.beat(), watch)
            self._person.show(f"{plan.fault.words}: {watch.progress(driver.trace.odometry[-1])}")
        newest = driver.trace.odometry[-1]
        speed = newest.angular_rad_s if plan.is_turn else newest.linear_m_s
        if speed < LEAST_SHARE * plan.speed:
            shown = speed_in_words(round(speed, 2), turn=plan.is_turn)
            raise SurpriseError(f"its speed is only {shown}: the supervisor or the base limits it")
        try:  # a fault whose start failed is lifted too, because a part of it may have happened
            fault_s = await self._injector.begin(plan.fault)
            seen = Seen(start_s, start, before, fault_s, fault_s, is_stopped=False)
            if not await self._watch(plan, fault_s, watch):
                return await self._stop_it(seen)
        finally:  # request zero before the lift: it may wait for a reply, and motion is permitted from then on
            self._operator.request(NEUTRAL)
            await self._injector.lift(plan.fault)
        if plan.fault in UNSEEN:
            await self.all_heard()
            await self._driver.find_wall()
        if plan.fault.takes_recorder and not self._stood(plan, seen):
            return await self._stop_it(seen)
        return await self._at_rest(plan, seen)

    async def _watch(self, plan: Plan, fault_s: float, watch: Watch) -> bool:
        """Record until the robot stands or, if the fault takes the recorder, until it must stand; return whether it stopped."""
        stands_s = fault_s + cells.standing_s(plan, self._bases.of(plan))
        while True:
            await self._beat(plan, plan.after)
            now_s = self._driver.now_s
            if plan.fault.takes_recorder:
                if now_s > stands_s:
                    return True
                continue
            if now_s > fault_s + STANDS_S and self._stands():
                return True
            wall = self._driver.wall()
            if now_s > stands_s + STOP_LIMIT_S or (
                wall is not None and watch.too_near(self._driver.gap_m(wall)) is not None
            ):
                return False

    async def _beat(self, plan: Plan, velocity: Velocity) -> None:
        """Let the operator's program request a velocity.

        Raises:
            SurpriseError: a key was pressed, or something other than the fault has stopped the robot.
        """
        self._operator.request(velocity)
        if plan.fault is Fault.ESTOP and not self.is_estop_latched:
            self._injector.press_estop()
        await self._driver.beat()
        self._check_key()
        own = {StopReason.ESTOP} if plan.fault is Fault.ESTOP else set[StopReason]()
        for reason in OTHER_STOPS - own:
            if self._driver.has_stopped(reason):
                raise SurpriseError(f"{reason} has stopped the robot, not the fault")

    def _check_key(self) -> None:
        if (key := self._driver.key()) is not None:
            raise SurpriseError(key)

    def _stood(self, plan: Plan, seen: Seen) -> bool:
        """Return whether the base stood when it had to, after a fault during which nothing was recorded.

        The first odometry that was sent after that time shows it. What arrives first may have waited in buffers, so the clock of its sender counts; its
        difference to the recorder's is that of the shortest delay before the fault. The robot must be at rest, and no farther away than a base that stood in
        time: the process that is back stops one that drove on, before any odometry arrives.
        """
        base, odometry = self._bases.of(plan), self._driver.trace.odometry
        before = [one for one in odometry if seen.start_s <= one.at_s <= seen.fault_s]
        apart_s = min((one.at_s - one.sent_s for one in before), default=math.nan)
        stands_s = seen.fault_s + cells.standing_s(plan, base)
        first = next((one for one in odometry if one.sent_s + apart_s > stands_s), None)
        if first is None or not is_still(first.linear_m_s, first.angular_rad_s):
            return False
        return math.dist(before[-1].pose[:2], first.pose[:2]) <= cells.standing_m(plan, base)

    def _stands(self) -> bool:
        """Return whether odometry, or the wall while odometry is silent, has shown a standing robot for `STANDS_S`.

        Raises:
            SurpriseError: neither shows the robot.
        """
        begin_s = self._driver.now_s - STANDS_S
        trace = self._driver.trace
        recent = list(itertools.takewhile(lambda one: one.at_s > begin_s, reversed(trace.odometry)))
        if recent:
            return all(is_still(one.linear_m_s, one.angular_rad_s) for one in recent)
        seen = itertools.takewhile(lambda one: one.at_s > begin_s, reversed(trace.scans))
        distances = [one.wall.distance_m for one in seen if one.wall is not None]
        if len(distances) < 2:
            raise SurpriseError("the robot is not seen: if it moves, switch it off")
        return max(distances) - min(distances) < STILL_M_S * STANDS_S

    async def _stop_it(self, seen: Seen) -> Seen:
        self._operator.request(NEUTRAL)
        self._person.say(
            "The robot did not stop. The e-stop of Lifeline is pressed: if it still moves, press its own."
        )
        await self._latch()
        await self._driver.wait(STANDS_S)
        return seen._replace(rest_s=self._driver.now_s)

    async def _latch(self) -> None:
        """Press the e-stop, also if it is latched, until the status shows it."""
        end_s = self._driver.now_s + STOP_LIMIT_S
        self._injector.press_estop()
        while not self.is_estop_latched and self._driver.now_s < end_s:
            await self._driver.beat()
            self._injector.press_estop()

    async def _at_rest(self, plan: Plan, seen: Seen) -> Seen:
        """Wait until the robot was seen at rest; return the run with this time. Stop a robot that continues to move.

        The operator's program requests zero: the fault is lifted, so the supervisor may permit motion again.
        """
        end_s = self._driver.now_s + STOP_LIMIT_S
        while not self._stands():
            await self._beat(plan, NEUTRAL)
            if self._driver.now_s > end_s:
                return await self._stop_it(seen)
        return seen._replace(rest_s=self._driver.now_s, is_stopped=True)
