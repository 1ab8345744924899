"""The asyncio shell: a heartbeat like every source's, neutral except while the path is driven.

Whatever makes the robot stop also stops the path: it asks for nothing, says why, and goes on only when the
person at its terminal asks for it. Nobody there, and it ends.
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from typing import NamedTuple, Protocol

from teleop.holder import HeldError, Holder
from teleop.path.course import ON_PATH_M, Course
from teleop.path.legs import Path
from teleop.path.offbeat import OffBeat
from teleop.path.permit import nearest, what_is_missing, what_stops
from teleop.path.pose import Pose, wrap
from teleop.path.pursuit import Limits
from teleop.pilot import NEUTRAL, Velocity
from teleop.rate import Rate
from teleop.view import plain
from wire import topics
from wire.bus import Arrival, Bus, wait_until
from wire.messages import Odometry, SafetyStatus, planar_twist

SOURCE = "path"
RATE_HZ = 20.0

ODOM_SILENT_S = 0.25
STATUS_SILENT_S = 0.5
HANG_S = 0.15
"""A heartbeat this late was a hang: the supervisor may have stopped the robot by then."""
ARM_LIMIT_S = 3.0
"""Whoever asked for motion so long ago does not expect it any more."""
HEADWAY_S, HEADWAY_M, HEADWAY_RAD = 3.0, 0.01, 0.03
"""A robot that has not come this far in this time does not get on."""
SETTLE_LIMIT_S = 1.0
STILL_M_S, STILL_RAD_S = 0.005, 0.01
SHOW_PERIOD_S = 0.2
DEPTH = 64


class Person(Protocol):
    """Who watches. Whenever they ask to go on, they set the `wake` of the service."""

    @property
    def present(self) -> bool:
        """Whether anybody can ask to go on."""
        ...

    def asks_to_go_on(self) -> bool:
        """Whether they asked since the last time; never blocks."""
        ...

    def say(self, sentence: str) -> None:
        """Something that stays."""
        ...

    def show(self, line: str) -> None:
        """In the place of the last line."""
        ...


class Ending(StrEnum):
    """How it came to an end."""

    DONE = "done"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"


class Sample(NamedTuple):
    """An odometry sample while the path was driven."""

    arrival_s: float
    pose: Pose
    leg: int
    """Its number."""
    along_m: float
    off_m: float
    """To the path."""
    on_path: bool
    """It has been on the path since the last start; before that it was on its way to it."""


@dataclass
class Drive:
    """What became of a path."""

    ending: Ending = Ending.INTERRUPTED
    reason: str = ""
    path: Path | None = None
    """None: it never began."""
    began: Sample | None = None
    """At rest, before the first motion."""
    samples: list[Sample] = field(default_factory=list[Sample])
    done_m: float = 0.0
    driving_s: float = 0.0
    """Without the pauses."""
    pose: Pose | None = None
    """The last one."""


class _Phase(Enum):
    ARMING = auto()
    """Neutral, until the supervisor lets this source drive."""
    DRIVING = auto()
    PAUSED = auto()
    SETTLING = auto()
    """Neutral at the end of the path, until the robot stands."""


Plan = Callable[[Pose], Path]
"""The path for a robot that stands here.

Raises:
    PathError: there is none.
"""


class PathService:
    """One command source that drives along a path.

    Args:
        bus: open; the caller closes it.
        plan: makes the path, once, when the robot may start.
        person: who watches.
        wake: set by the person whenever they ask.
        limits: how fast.
        operator: the source whose every key pauses the path.
        operator_rate_hz: its heartbeat.
        about: a sentence about this program, for whoever finds the source's name held.
    """

    def __init__(
        self,
        bus: Bus,
        plan: Plan,
        *,
        person: Person,
        wake: asyncio.Event,
        limits: Limits | None = None,
        operator: str = topics.TELEOP,
        operator_rate_hz: float = RATE_HZ,
        about: str = "the path",
    ) -> None:
        self._bus, self._plan, self._person, self._wake = bus, plan, person, wake
        self._limits = limits or Limits()
        self._operator = operator
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(SOURCE))
        self._odometry = bus.subscribe(topics.ODOM, depth=DEPTH)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=wake)
        self._keys = bus.subscribe(topics.source_cmd_vel(operator), depth=DEPTH, wake=wake)
        self._off_beat = OffBeat(1.0 / operator_rate_hz)
        self._holder = Holder(bus, SOURCE, about)

        self._start(asyncio.get_running_loop().time())
        self._course: Course | None = None
        self._drive = Drive()
        self._ended = False
        self._status: Arrival[SafetyStatus] | None = None
        self._odom_s = -math.inf
        self._speed = NEUTRAL
        self._on_path = False
        self._headway: tuple[float, Pose] | None = None

    def _start(self, now_s: float) -> None:
        self._beat = Rate(1.0 / RATE_HZ, now_s)
        self._display = Rate(SHOW_PERIOD_S, now_s)
        self._phase = _Phase.ARMING
        self._since_s = now_s
        """When this phase began."""

    async def run(self, stop: asyncio.Event) -> Drive:
        """Drive until the end of the path, or until `stop`; leaves with a zero and without token.

        Raises:
            HeldError: somebody else drives a path; in one sentence with what to do.
            PathError: there is no such path.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            await self._claim(stopping)
            self._start(loop.time())
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
                self._holder.release()
        if self._phase is _Phase.DRIVING:
            self._drive.driving_s += loop.time() - self._since_s
        if self._course is not None:
            self._drive.done_m = self._course.done_m
        return self._drive

    async def _claim(self, stopping: "asyncio.Task[bool]") -> None:
        """Take the source's name, or leave it when it is time to stop."""
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
        if late_s > HANG_S and self._phase is _Phase.DRIVING:
            self._pause(f"this program hung for {late_s:.1f} s", now_s)
        if self._phase is _Phase.PAUSED and not self._ended and self._person.asks_to_go_on():
            self._enter(_Phase.ARMING, now_s)
        if self._beat.tick(now_s) and not self._ended:
            self._on_beat(now_s)
        if self._display.tick(now_s):
            self._person.show(self._line(now_s))

    def _on_beat(self, now_s: float) -> None:
        velocity = NEUTRAL
        match self._phase:
            case _Phase.ARMING:
                self._arm(now_s)
            case _Phase.DRIVING:
                velocity = self._drive_on(now_s)
            case _Phase.SETTLING:
                self._settle(now_s)
            case _Phase.PAUSED:
                pass
        self._ask(velocity)

    # --- what comes in

    def _listen(self, now_s: float) -> None:
        for odometry in self._odometry.take():
            if odometry.message is not None:
                self._move(odometry.message, odometry.arrival_s)
        for status in self._statuses.take():
            if status.message is None:
                continue
            self._status = status
            reason = what_stops(status.message, SOURCE) if self._phase is _Phase.DRIVING else None
            if reason is not None:
                self._pause(reason, now_s)
        pressed = [k.stamp is not None and self._off_beat.hears_key(k.stamp) for k in self._keys.take()]
        if any(pressed) and self._phase is _Phase.DRIVING:
            self._pause(f"a key was pressed at {self._operator}", now_s)

    def _move(self, odometry: Odometry, arrival_s: float) -> None:
        twist, pose = odometry.twist.twist, Pose.of(odometry)
        speed = Velocity(twist.linear.x, twist.angular.z)
        if not pose.is_finite or not all(map(math.isfinite, speed)):
            return  # it proves nothing, and is as good as silence
        self._drive.pose, self._speed, self._odom_s = pose, speed, arrival_s
        if self._course is not None and self._phase in {_Phase.DRIVING, _Phase.SETTLING}:
            self._drive.samples.append(self._sample(self._course, pose))

    def _sample(self, course: Course, pose: Pose) -> Sample:
        station = course.station(pose)
        self._on_path = self._on_path or station.off_m <= ON_PATH_M
        return Sample(self._odom_s, pose, course.leg, station.along_m, station.off_m, self._on_path)

    # --- the phases

    def _arm(self, now_s: float) -> None:
        missing = self._missing(now_s)
        pose = self._drive.pose
        if missing is None and pose is not None:
            if self._course is None:
                self._drive.path = self._plan(pose)
                self._course = Course(self._drive.path, self._limits)
                self._drive.began = self._sample(self._course, pose)
                self._person.say(
                    f"driving {self._drive.path.length_m:.2f} m at up to {self._limits.speed_m_s:g} m/s"
                )
            self._enter(_Phase.DRIVING, now_s)
        elif now_s - self._since_s > ARM_LIMIT_S:
            self._pause(missing or "no odometry comes", now_s)

    def _missing(self, now_s: float) -> str | None:
        """Why the robot may not start."""
        silent = self._silent(now_s)
        if silent is not None or self._status is None or self._status.message is None:
            return silent
        return what_is_missing(self._status.message, SOURCE)

    def _silent(self, now_s: float) -> str | None:
        """Who is silent, and is needed."""
        if self._status is None or now_s - self._status.arrival_s > STATUS_SILENT_S:
            return "the supervisor is silent"
        return "the odometry is silent" if now_s - self._odom_s > ODOM_SILENT_S else None

    def _drive_on(self, now_s: float) -> Velocity:
        course, pose = self._course, self._drive.pose
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
        if self._headway is not None:
            since_s, before = self._headway
            moved_m = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m)
            if moved_m < HEADWAY_M and abs(wrap(pose.yaw_rad - before.yaw_rad)) < HEADWAY_RAD:
                if now_s - since_s <= HEADWAY_S:
                    return None
                status = None if self._status is None else self._status.message
                where = "" if status is None or not nearest(status) else f" (nearest: {nearest(status)})"
                return f"no headway for {HEADWAY_S:g} s{where}"
        self._headway = (now_s, pose)
        return None

    def _settle(self, now_s: float) -> None:
        still = abs(self._speed.linear_m_s) < STILL_M_S and abs(self._speed.angular_rad_s) < STILL_RAD_S
        if still or now_s - self._since_s > SETTLE_LIMIT_S:
            self._end(Ending.DONE, "")

    def _pause(self, reason: str, now_s: float) -> None:
        self._enter(_Phase.PAUSED, now_s)
        self._ask(NEUTRAL)
        self._drive.reason = reason
        if not self._person.present:
            self._end(Ending.STOPPED, reason)
            return
        self._person.asks_to_go_on()  # what was asked before this stop does not answer it
        self._person.say(f"paused: {reason}; Enter goes on, Ctrl-C ends")

    def _enter(self, phase: _Phase, now_s: float) -> None:
        if self._phase is _Phase.DRIVING:
            self._drive.driving_s += now_s - self._since_s
        if phase is _Phase.DRIVING:
            self._on_path = False
            self._headway = None
        self._phase, self._since_s = phase, now_s

    def _end(self, ending: Ending, reason: str) -> None:
        self._drive.ending, self._drive.reason, self._ended = ending, reason, True

    # --- what goes out

    def _ask(self, velocity: Velocity) -> None:
        if self._holder.holds:  # a newcomer must not speak in another's name
            self._cmd_vel.put(planar_twist(*velocity))

    def _line(self, now_s: float) -> str:
        if self._phase is _Phase.ARMING:
            return f"waiting: {self._missing(now_s) or 'ready'}"
        course, pose = self._course, self._drive.pose
        if course is None or pose is None:
            return self._phase.name.lower()
        return (
            f"{self._phase.name.lower()}: {course.done_m:.2f} of {course.path.length_m:.2f} m, "
            f"{abs(self._speed.linear_m_s):.2f} m/s, {course.station(pose).off_m * 1000:.0f} mm off the path"
        )
