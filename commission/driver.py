"""Drives a robot from rest to rest as a command source, and ends a drive at any surprise.

The heartbeat also runs during a question. It is neutral except during a drive.
"""

import asyncio
import math
from collections.abc import Coroutine
from typing import Any

from commission.person import Person
from commission.plan import Base, Drive
from commission.trace import Command, Driven, Odom, Trace
from commission.wall import Wall
from commission.watch import Watch
from deploy.stack.errors import DeployError
from supervisor.config import NamedLidarSection
from supervisor.messages import to_scan
from teleop.holder import HeldError, Holder, about_this_process
from teleop.path.course import Pose
from teleop.path.permit import what_is_missing, what_stops
from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.rate import Rate
from wire import cdr, topics
from wire.bus import Bus, wait_until
from wire.messages import Odometry, SafetyStatus, planar_twist
from wire.reasons import StopReason
from wire.stamp import Stamp
from wire.standstill import is_still

RATE_HZ = 20.0
DEPTH = 256
STATUS_SILENT_S = 0.5
HUB_SILENT_S = 0.2
"""A status older than this counts as missing if another stream is silent."""
ODOM_SILENT_S = 0.3
SCAN_SILENT_S = 0.6
ARM_LIMIT_S = 5.0
WALL_LOST = "the wall is lost: nothing may stand or walk between the robot and the wall"
FIND_S = 0.5
"""Time in which the lidar must show a wall."""
LEARN_S = 0.6
"""How long the wall is observed at rest before and after a drive."""
REST_LIMIT_S = 6.0


class AbortedError(Exception):
    """The drives end here; the message says why."""


class SurpriseError(Exception):
    """One drive has ended early; the message says why. Zero has been sent, which only a running supervisor passes on."""


class Driver:
    """One command source that drives in front of a wall.

    Args:
        bus: an open bus; the caller closes it.
        source: the name of the command source.
        lidar: the configuration of the lidar that sees the wall.
        hull_radius_m: the radius of the circle around the hull.
        person: any key of them aborts a drive.
    """

    def __init__(
        self,
        bus: Bus,
        source: str,
        lidar: NamedLidarSection,
        hull_radius_m: float,
        person: Person,
    ) -> None:
        self._source, self._lidar, self._hull_radius_m = source, lidar, hull_radius_m
        self._person = person
        self.trace = Trace(lidar.mount())
        self._wake = asyncio.Event()
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(source))
        self._odometry = bus.subscribe(topics.ODOM, depth=DEPTH)
        self._scans = bus.subscribe(topics.lidar_scan(lidar.topic), depth=DEPTH)
        self._commands = bus.subscribe(topics.CMD_VEL, depth=DEPTH)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=self._wake)
        self._holder = Holder(bus, source, self._cmd_vel, about_this_process(source))
        self._velocity = NEUTRAL
        self._status: SafetyStatus | None = None
        self._status_s = self._scan_s = -math.inf
        self._stopping = asyncio.Event()

    async def claim(self, stop: asyncio.Event) -> None:
        """Acquire the source's name, and begin the heartbeat.

        Raises:
            DeployError: another program holds the name.
        """
        self._stopping = stop
        try:
            await self._holder.claim()
        except HeldError as error:
            raise DeployError(f"the source is in use, by {error}: end that first") from error
        self._rate = Rate(1.0 / RATE_HZ, self.now_s)

    async def leave(self) -> None:
        """Send zero, and withdraw the token."""
        try:
            self._send(NEUTRAL)
        finally:
            await self._holder.leave()

    @property
    def now_s(self) -> float:
        return asyncio.get_running_loop().time()

    # --- the heartbeat

    async def beat(self) -> str | None:
        """Send the present velocity at the next beat, and take what has arrived; return why a drive must end, or None.

        Raises:
            AbortedError: a signal ends the program.
        """
        while not self._rate.tick(self.now_s):
            await wait_until(self._wake, self._rate.next_s)
            self._wake.clear()
            reason = self._listen()
            if reason is not None:  # at once, not at the next beat
                self._send(NEUTRAL)
                return reason
        self._send(self._velocity)
        if self._stopping.is_set():
            self._send(NEUTRAL)
            raise AbortedError("interrupted")
        return self._listen()

    async def wait(self, seconds: float) -> None:
        """Stand still for a time."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            await self.beat()

    async def during(self, work: Coroutine[Any, Any, None]) -> None:
        """Stand still while something is done, and raise what it raises."""
        working = asyncio.ensure_future(work)
        try:
            while not working.done():
                await self.beat()
            working.result()
        finally:
            working.cancel()

    async def ask(self, question: str) -> str:
        """Ask the person, and return the typed line, in small letters.

        Raises:
            AbortedError: the terminal was closed, or a signal ends the program.
        """
        self._person.expect(line=True)
        self._person.say(question)
        typed = ""
        while not typed:
            await self.beat()
            typed = self._person.take()
            if self._person.has_ended:
                raise AbortedError("the terminal was closed")
        self._person.expect(line=False)
        return typed.strip().lower()

    async def confirm(self, question: str, word: str) -> None:
        """Ask the person for a word.

        Raises:
            AbortedError: the person types another word, or as for `ask`.
        """
        if await self.ask(question) != word:
            raise AbortedError(f"not confirmed with {word!r}")

    def _send(self, velocity: Velocity) -> None:
        if self._holder.holds:
            self._cmd_vel.put(planar_twist(*velocity))

    def _listen(self) -> str | None:
        """Take what has arrived; return why a drive must end, or None."""
        for odometry in self._odometry.take():
            if odometry.message is not None:
                self._hear_odometry(odometry.message, odometry.arrival_s, odometry.stamp)
        for command in self._commands.take():
            if (twist := command.message) is not None:
                is_zero = twist.linear.x == 0.0 and twist.angular.z == 0.0
                self.trace.commands.append(Command(command.arrival_s, is_zero))
        for arrival in self._scans.take():
            scan = to_scan(arrival, 0.0)
            if scan is not None and len(scan.ranges) > 0:
                self._scan_s = scan.arrival_s
                self.trace.add_scan(scan)
        reasons = [self._hear_status(s.message, s.arrival_s) for s in self._statuses.take() if s.message]
        return next(filter(None, reasons), None)

    def _hear_odometry(self, message: Odometry, arrival_s: float, stamp: Stamp | None) -> None:
        pose, twist = Pose.of(message), message.twist.twist
        if pose.is_finite and math.isfinite(twist.linear.x) and math.isfinite(twist.angular.z):
            header = message.header.stamp
            sent_ns = cdr.ns_of(header.sec, header.nanosec) if stamp is None else stamp.source_time_ns
            sent_s = sent_ns * 1e-9 if sent_ns else arrival_s
            self.trace.odometry.append(Odom(arrival_s, pose, twist.linear.x, twist.angular.z, sent_s))

    def _hear_status(self, status: SafetyStatus, arrival_s: float) -> str | None:
        self._status, self._status_s = status, arrival_s
        reason = what_stops(status, self._source)
        return reason if reason is None or not status.detail else f"{reason}: {status.detail}"

    # --- what is known

    async def find_wall(self) -> Wall | None:
        """Find the nearest wall anew; return None if there is none."""
        self.trace.forget_wall()
        await self.wait(FIND_S)
        return self.wall()

    def wall(self) -> Wall | None:
        """Return the wall as it was seen last, in the lidar's frame; None if it is lost."""
        return self.trace.wall(self.now_s)

    def bearing_rad(self, wall: Wall) -> float:
        """Return the direction of a wall by the configured mount, counter-clockwise from straight ahead."""
        return math.remainder(wall.bearing_rad + self._lidar.yaw_rad, math.tau)

    def gap_m(self, wall: Wall) -> float:
        """Return the distance from the circle around the hull to a wall."""
        bearing_rad = self.bearing_rad(wall)
        of_lidar_m = self._lidar.x_m * math.cos(bearing_rad) + self._lidar.y_m * math.sin(bearing_rad)
        return wall.distance_m + of_lidar_m - self._hull_radius_m

    def silent(self) -> str | None:
        """Return a text about a required stream that is silent; None if there is none."""
        now_s, status_s = self.now_s, self.now_s - self._status_s
        odom_s = self.trace.odometry[-1].at_s if self.trace.odometry else -math.inf
        no_odom = now_s - odom_s > ODOM_SILENT_S
        no_scan = now_s - self._scan_s > max(SCAN_SILENT_S, self._lidar.timeout_s or 0.0)
        # All streams end with the supervisor, because it is the hub.
        if status_s > (HUB_SILENT_S if no_odom or no_scan else STATUS_SILENT_S):
            return "the supervisor is silent: if the robot moves, switch it off"
        if no_odom:
            return "odometry is silent"
        return f"the lidar {self._lidar.name} is silent" if no_scan else None

    def missing(self, source: str) -> str | None:
        """Return what is missing for this source to drive; None if nothing is."""
        status = self._status
        return self.silent() or ("no status" if status is None else what_is_missing(status, source))

    def has_stopped(self, reason: StopReason | None) -> bool:
        """Return whether this reason has stopped the robot."""
        return self._status is not None and any(reason in some for some in self._status.causes_and_latched())

    # --- driving

    async def ready(self) -> None:
        """Wait until the supervisor permits this source to drive.

        Raises:
            SurpriseError: it does not.
        """
        end_s = self.now_s + ARM_LIMIT_S
        while True:
            await self.beat()
            missing = self.missing(self._source)
            if missing is None:
                return
            if self.now_s > end_s:
                raise SurpriseError(f"the robot may not drive: {missing}")

    async def drive(
        self, drive: Drive, base: Base, *, is_first: bool = False, until_estop: bool = False
    ) -> Driven:
        """Drive from rest to rest. A drive back also ends where no lidar looks.

        Args:
            drive: the motion.
            base: what is assumed of the base.
            is_first: whether the signs of base, odometry and lidar are still unknown. Then no direction is a surprise, and
                a stop by `BASE_UNRESPONSIVE` is expected, because a wrong sign looks like a base that does not respond.
            until_estop: whether an e-stop is expected.

        Raises:
            SurpriseError: something unexpected happened, or a key was pressed.
        """
        await self.ready()
        started_s = await self._rest(None, None)
        before, start = self._mean_wall(started_s), self.trace.odometry[-1].pose
        gap_m = self.gap_m(before)
        if drive.way_m > 0.0 and gap_m < (needs_m := drive.needs_m(base)):
            raise SurpriseError(f"the drive needs {needs_m:.2f} m, and the wall is {gap_m:.2f} m away")
        watch = Watch(drive, base, start, before, gap_m, started_s, is_first=is_first)
        expected = StopReason.SCAN_BLIND if drive.way_m < 0.0 else None
        if until_estop:
            expected = StopReason.ESTOP
        elif is_first:  # caused by a wrong sign, which the motion before the stop shows
            expected = StopReason.BASE_UNRESPONSIVE
        is_stopped = False
        forward, turn = math.copysign(drive.speed, drive.way_m), math.copysign(drive.speed, drive.turn_rad)
        self._velocity = Velocity(0.0, turn) if drive.turn_rad else Velocity(forward, 0.0)
        try:
            while not is_stopped and not watch.is_done(self.trace.odometry[-1], self.wall()):
                reason = await self.beat()
                is_stopped = reason is not None and self.has_stopped(expected)
                if not is_stopped:
                    self.check(reason, watch)
                self._person.show(f"{drive}: {watch.progress(self.trace.odometry[-1])}")
        finally:
            self._velocity = NEUTRAL
            self._send(NEUTRAL)
        rest_s = await self._rest(watch, expected)
        trace = self.trace.between(started_s - LEARN_S, rest_s)
        moving_s = max((one.at_s for one in trace.commands if not one.is_zero), default=math.inf)
        stopped_s = next((one.at_s for one in trace.commands if one.at_s > moving_s), math.nan)
        return Driven(
            trace, start, drive.speed, before, self._mean_wall(rest_s), stopped_s, rest_s, is_stopped
        )

    def _mean_wall(self, to_s: float) -> Wall:
        """Return the wall at rest, before a time.

        Raises:
            SurpriseError: it is lost.
        """
        wall = self.trace.between(to_s - LEARN_S, to_s).mean_wall()
        if wall is None:
            raise SurpriseError(WALL_LOST)
        return wall

    def key(self) -> str | None:
        """Return a text if a key was pressed since a question was answered, or the terminal is closed; else None."""
        return "a key was pressed" if self._person.take() or self._person.has_ended else None

    def check(self, reason: str | None, watch: Watch) -> None:
        """Raise SurpriseError if something is unexpected."""
        wall = self.wall()
        reason = self.key() or reason or self.silent()
        if reason is None and wall is None:
            reason = WALL_LOST
        if reason is None and wall is not None:
            reason = watch.surprise(self.now_s, self.trace.odometry[-1], wall, self.gap_m(wall))
        if reason is not None:
            raise SurpriseError(reason)

    async def _rest(self, watch: Watch | None, expected: StopReason | None) -> float:
        """Wait until the robot has been at rest for `LEARN_S`; return the time.

        Args:
            watch: what is expected of the drive that ends; None before a drive.
            expected: the reason of a stop that is no surprise.

        Raises:
            SurpriseError: the robot does not come to rest, or something else is unexpected.
        """
        end_s, still_s = self.now_s + REST_LIMIT_S, math.inf
        while self.now_s - still_s < LEARN_S + 0.1:
            reason = await self.beat()
            wall = self.wall()
            near = None if watch is None or wall is None else watch.too_near(self.gap_m(wall))
            if near is None and self.has_stopped(expected):
                reason = None
            reason = self.key() or near or reason or self.silent()
            if reason is not None:
                raise SurpriseError(reason)
            newest = self.trace.odometry[-1]
            if not is_still(newest.linear_m_s, newest.angular_rad_s):
                still_s = math.inf
            elif math.isinf(still_s):
                still_s = newest.at_s
            if self.now_s > end_s:
                raise SurpriseError(f"the robot is not at rest after {REST_LIMIT_S:g} s of zero commands")
        return self.now_s
