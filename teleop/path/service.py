"""The asyncio shell: a heartbeat like that of every source, neutral except while the path is driven.

Every stop of the robot also pauses the path: the source becomes neutral, reports the reason, and continues only on a
request of the person at its terminal. If there is no person, it ends.
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from typing import Protocol

from teleop.holder import HeldError, Holder
from teleop.path.course import Path, Pose, wrap
from teleop.path.permit import OffBeat, nearest, what_is_missing, what_stops
from teleop.path.pursuit import ON_PATH_M, Course, Limits
from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.rate import Rate
from teleop.screen.view import plain
from wire import topics
from wire.bus import Arrival, Bus, wait_until
from wire.messages import Odometry, SafetyStatus, planar_twist
from wire.standstill import is_still

SOURCE = "path"
RATE_HZ = 20.0

ODOM_SILENT_S = 0.25
STATUS_SILENT_S = 0.5
HANG_S = 0.15
"""A heartbeat later than this counts as a hang: the supervisor may have stopped the robot meanwhile."""
ARM_LIMIT_S = 3.0
"""Maximum time from a request to the start of the motion: after that, the person no longer expects it."""
HEADWAY_S, HEADWAY_M, HEADWAY_RAD = 3.0, 0.01, 0.03
"""A robot that has moved or turned less than this within this time is stuck."""
SETTLE_LIMIT_S = 1.0
SHOW_PERIOD_S = 0.2
DEPTH = 64


class Person(Protocol):
    """Interface to the person at the terminal. A request to continue also sets the `wake` of the service."""

    @property
    def present(self) -> bool:
        """Whether there is a person who can ask to continue."""
        ...

    def asks_to_go_on(self) -> bool:
        """Return whether the person asked to continue since the last call; never blocks."""
        ...

    def say(self, sentence: str) -> None:
        """Print a sentence that stays visible."""
        ...

    def show(self, line: str) -> None:
        """Show a line in place of the previous one."""
        ...


class Ending(StrEnum):
    """How the drive ended."""

    DONE = "done"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"


@dataclass
class Drive:
    """Result of driving a path."""

    ending: Ending = Ending.INTERRUPTED
    reason: str = ""
    path: Path | None = None
    """The path; None if driving never began."""
    off_path_m: list[float] = field(default_factory=list[float])
    """Distance from the path at each odometry sample, from the first one on the path since each start."""
    done_m: float = 0.0
    driving_s: float = 0.0
    """Duration without the pauses."""


class _Phase(Enum):
    ARMING = auto()
    """Neutral, until the supervisor permits this source to drive."""
    DRIVING = auto()
    PAUSED = auto()
    SETTLING = auto()
    """Neutral at the end of the path, until the robot stands still."""


Plan = Callable[[Pose], Path]
"""Returns the path for a robot at this pose.

Raises:
    PathError: there is no such path.
"""


class PathService:
    """One command source that drives along a path.

    Args:
        bus: an open bus; the caller closes it.
        plan: returns the path; called once, when the robot may start.
        person: the person at the terminal.
        wake: set on every request of the person.
        limits: limits of speed and acceleration.
        operator: the source whose key presses pause the path.
        operator_rate_hz: the rate of its heartbeat.
        about: a sentence about this program, for other programs that want the source's name.
    """

    def __init__(
        self,
        bus: Bus,
        plan: Plan,
        *,
        person: Person,
        wake: asyncio.Event,
        limits: Limits,
        operator: str = topics.TELEOP,
        operator_rate_hz: float = RATE_HZ,
        about: str = "the path",
    ) -> None:
        self._plan, self._person, self._wake, self._limits = plan, person, wake, limits
        self._operator = operator
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(SOURCE))
        self._odometry = bus.subscribe(topics.ODOM, depth=DEPTH)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=wake)
        self._keys = bus.subscribe(topics.source_cmd_vel(operator), depth=DEPTH, wake=wake)
        self._off_beat = OffBeat(1.0 / operator_rate_hz)
        self._holder = Holder(bus, SOURCE, self._cmd_vel, about)

        self._course: Course | None = None
        self._drive = Drive()
        self._ended = False
        self._status: Arrival[SafetyStatus] | None = None
        self._pose: Pose | None = None
        self._odom_s = -math.inf
        self._speed = NEUTRAL
        self._on_path = False
        self._headway: tuple[float, Pose] | None = None

    async def run(self, stop: asyncio.Event) -> Drive:
        """Drive to the end of the path, or until `stop`; at the end, send zero and withdraw the token.

        Raises:
            HeldError: another program drives a path; the message says what to do.
            PathError: there is no such path.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        self._phase, self._since_s = _Phase.ARMING, loop.time()
        try:
            await self._claim(stopping)
            self._since_s = loop.time()
            self._beat = Rate(1.0 / RATE_HZ, self._since_s)
            self._display = Rate(SHOW_PERIOD_S, self._since_s)
            while not stop.is_set():
                self._turn(loop.time())
                if self._ended:
                    break
                await wait_until(self._wake, self._beat.next_s)
                self._wake.clear()
        finally:
            stopping.cancel()
            try:
                self._ask(NEUTRAL)
            finally:
                await self._holder.leave()
        self._enter(_Phase.PAUSED, loop.time())
        if self._course is not None:
            self._drive.done_m = self._course.done_m
        return self._drive

    async def _claim(self, stopping: "asyncio.Task[bool]") -> None:
        """Acquire the source's name, unless `stopping` is finished first."""
        claiming = asyncio.ensure_future(self._holder.claim())
        try:
            await asyncio.wait({claiming, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if claiming.done():
                claiming.result()
        except HeldError as error:
            raise HeldError(f"a path is driven already, by {plain(str(error))}: end that first") from error
        finally:
            claiming.cancel()

    def _turn(self, now_s: float) -> None:
        late_s = self._beat.lateness_s(now_s)
        self._listen(now_s)
        if late_s > HANG_S:
            self._pause_drive(f"this program hung for {late_s:.1f} s", now_s)
        if self._phase is _Phase.PAUSED and not self._ended and self._person.asks_to_go_on():
            self._enter(_Phase.ARMING, now_s)
        if self._beat.tick(now_s) and not self._ended:
            self._ask(self._on_beat(now_s))
        if self._display.tick(now_s):
            self._person.show(self._line(now_s))

    def _on_beat(self, now_s: float) -> Velocity:
        """Act in the present phase; return the velocity to request."""
        if self._phase is _Phase.ARMING:
            self._arm(now_s)
        elif self._phase is _Phase.DRIVING:
            return self._drive_on(now_s)
        elif self._phase is _Phase.SETTLING and (
            is_still(*self._speed) or now_s - self._since_s > SETTLE_LIMIT_S
        ):
            self._end(Ending.DONE, "")
        return NEUTRAL

    # --- input

    def _listen(self, now_s: float) -> None:
        for odometry in self._odometry.take():
            if odometry.message is not None:
                self._move(odometry.message, odometry.arrival_s)
        for status in self._statuses.take():
            if status.message is not None:
                self._status = status
                self._pause_drive(what_stops(status.message, SOURCE), now_s)
        pressed = [k.stamp is not None and self._off_beat.hears_key(k.stamp) for k in self._keys.take()]
        if any(pressed):
            self._pause_drive(f"a key was pressed at {self._operator}", now_s)

    def _move(self, odometry: Odometry, arrival_s: float) -> None:
        twist, pose = odometry.twist.twist, Pose.of(odometry)
        speed = Velocity(twist.linear.x, twist.angular.z)
        if not pose.is_finite or not all(map(math.isfinite, speed)):
            return  # proves nothing and counts as silence
        self._pose, self._speed, self._odom_s = pose, speed, arrival_s
        if self._course is not None and self._phase in {_Phase.DRIVING, _Phase.SETTLING}:
            off_m = self._course.station(pose).off_m
            self._on_path = self._on_path or off_m <= ON_PATH_M
            if self._on_path:
                self._drive.off_path_m.append(off_m)

    # --- the phases

    def _arm(self, now_s: float) -> None:
        missing = self._missing(now_s)
        if missing is None and self._pose is not None:
            if self._course is None:
                path = self._drive.path = self._plan(self._pose)
                self._course = Course(path, self._limits)
                self._person.say(f"driving {path.length_m:.2f} m at up to {self._limits.speed_m_s:g} m/s")
            self._on_path, self._headway = False, None
            self._enter(_Phase.DRIVING, now_s)
        elif now_s - self._since_s > ARM_LIMIT_S:
            self._pause(missing or "no odometry arrives", now_s)

    def _missing(self, now_s: float) -> str | None:
        """Return why the robot must not start; None if it may."""
        silent = self._silent(now_s)
        if silent is not None or self._status is None or self._status.message is None:
            return silent
        return what_is_missing(self._status.message, SOURCE)

    def _silent(self, now_s: float) -> str | None:
        """Return a text about a required stream that is silent; None if there is none."""
        if self._status is None or now_s - self._status.arrival_s > STATUS_SILENT_S:
            return "the supervisor is silent"
        return "the odometry is silent" if now_s - self._odom_s > ODOM_SILENT_S else None

    def _drive_on(self, now_s: float) -> Velocity:
        course, pose = self._course, self._pose
        assert course is not None
        assert pose is not None
        reason = self._silent(now_s) or self._stuck(pose, now_s)
        if reason is not None:
            self._pause(reason, now_s)
            return NEUTRAL
        velocity = course.step(pose, self._speed.linear_m_s)
        if velocity is None:
            self._enter(_Phase.SETTLING, now_s)
            return NEUTRAL
        return velocity

    def _stuck(self, pose: Pose, now_s: float) -> str | None:
        """Return the reason for a pause if the robot makes no headway; None if it does."""
        since_s, before = self._headway or (-math.inf, pose)
        moved_m = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m)
        turned_rad = abs(wrap(pose.yaw_rad - before.yaw_rad))
        if self._headway is None or moved_m >= HEADWAY_M or turned_rad >= HEADWAY_RAD:
            self._headway = (now_s, pose)
        elif now_s - since_s > HEADWAY_S:
            status = None if self._status is None else self._status.message
            where = "" if status is None or not nearest(status) else f" (nearest: {nearest(status)})"
            return f"no headway for {HEADWAY_S:g} s{where}"
        return None

    def _pause_drive(self, reason: str | None, now_s: float) -> None:
        """Pause if the path is being driven and there is a reason."""
        if reason is not None and self._phase is _Phase.DRIVING:
            self._pause(reason, now_s)

    def _pause(self, reason: str, now_s: float) -> None:
        self._enter(_Phase.PAUSED, now_s)
        self._ask(NEUTRAL)
        self._drive.reason = reason
        if not self._person.present:
            self._end(Ending.STOPPED, reason)
            return
        self._person.asks_to_go_on()  # discard a request from before this stop
        self._person.say(f"paused: {reason}; Enter continues, Ctrl-C ends")

    def _enter(self, phase: _Phase, now_s: float) -> None:
        if self._phase is _Phase.DRIVING:
            self._drive.driving_s += now_s - self._since_s
        self._phase, self._since_s = phase, now_s

    def _end(self, ending: Ending, reason: str) -> None:
        self._drive.ending, self._drive.reason, self._ended = ending, reason, True

    # --- output

    def _ask(self, velocity: Velocity) -> None:
        if self._holder.holds:  # before that, another program may hold the name
            self._cmd_vel.put(planar_twist(*velocity))

    def _line(self, now_s: float) -> str:
        if self._phase is _Phase.ARMING:
            return f"waiting: {self._missing(now_s) or 'ready'}"
        course, pose = self._course, self._pose
        if course is None or pose is None:
            return self._phase.name.lower()
        return (
            f"{self._phase.name.lower()}: {course.done_m:.2f} of {course.path.length_m:.2f} m, "
            f"{abs(self._speed.linear_m_s):.2f} m/s, {course.station(pose).off_m * 1000:.0f} mm off the path"
        )
