"""The asyncio shell: a heartbeat like that of every source, neutral except while the path is driven.

Every stop of the robot also pauses the path: the source becomes neutral, reports the reason, and continues only on a
request of the person at its terminal. If there is no person, it ends.
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto

from teleop.holder import HeldError, Holder
from teleop.path.course import Path, Pose, wrap
from teleop.path.permit import OffBeat, what_is_missing, what_stops
from teleop.path.pursuit import ON_PATH_M, Course
from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.rate import Rate
from teleop.screen.view import nearest_in_words, plain
from wire import topics
from wire.bus import Bus, wait_until
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
    ENDED = auto()


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
        speed_m_s: the maximum speed, above zero.
        say: prints a sentence that stays visible.
        show: shows a line in place of the previous one.
        operator: the source whose key presses pause the path.
        operator_rate_hz: the rate of its heartbeat.
        about: a sentence about this program, for other programs that want the source's name.
    """

    def __init__(
        self,
        bus: Bus,
        plan: Plan,
        *,
        speed_m_s: float,
        say: Callable[[str], None],
        show: Callable[[str], None],
        operator: str = topics.TELEOP,
        operator_rate_hz: float = RATE_HZ,
        about: str = "the path",
    ) -> None:
        self._plan, self._speed_m_s, self._say, self._show = plan, speed_m_s, say, show
        self._operator = operator
        self._wake = asyncio.Event()
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(SOURCE))
        self._odometry = bus.subscribe(topics.ODOM, depth=DEPTH)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=self._wake)
        self._keys = bus.subscribe(topics.source_cmd_vel(operator), depth=DEPTH, wake=self._wake)
        self._off_beat = OffBeat(1.0 / operator_rate_hz)
        self._holder = Holder(bus, SOURCE, self._cmd_vel, about)
        self.is_attended = False
        """Whether there is a person who can ask to continue; if there is none, a stop ends the drive."""

        self._phase, self._since_s = _Phase.ARMING, 0.0
        self._course: Course | None = None
        self._drive = Drive()
        self._status: SafetyStatus | None = None
        self._status_s = self._odom_s = -math.inf
        self._pose: Pose | None = None
        self._speed = NEUTRAL
        self._on_path = False

    def go_on(self) -> None:
        """Continue after a pause. A request at another time has no effect: it does not answer a later stop."""
        if self._phase is _Phase.PAUSED:
            self._enter(_Phase.ARMING, asyncio.get_running_loop().time())
            self._wake.set()

    async def run(self, stop: asyncio.Event) -> Drive:
        """Drive to the end of the path, or until `stop`; at the end, send zero and withdraw the token.

        Raises:
            HeldError: another program drives a path; the message says what to do.
            PathError: there is no such path.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            await self._claim(stopping)
            self._since_s = loop.time()
            self._beat = Rate(1.0 / RATE_HZ, self._since_s)
            self._display = Rate(SHOW_PERIOD_S, self._since_s)
            while not stop.is_set():
                self._turn(loop.time())
                if self._phase is _Phase.ENDED:
                    break
                await wait_until(self._wake, self._beat.next_s)
                self._wake.clear()
        finally:
            stopping.cancel()
            try:
                self._ask(NEUTRAL)
            finally:
                await self._holder.leave()
        self._enter(_Phase.ENDED, loop.time())
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
        reason = self._listen()
        if reason is None and late_s > HANG_S:
            reason = f"this program hung for {late_s:.1f} s"
        if reason is not None and self._phase is _Phase.DRIVING:
            self._pause(reason, now_s)
        if self._beat.tick(now_s) and self._phase is not _Phase.ENDED:
            self._ask(self._on_beat(now_s))
        if self._display.tick(now_s):
            self._show(self._line(now_s))

    def _on_beat(self, now_s: float) -> Velocity:
        """Act in the present phase; return the velocity to request."""
        if self._phase is _Phase.ARMING:
            self._arm(now_s)
        elif self._phase is _Phase.DRIVING:
            return self._drive_on(now_s)
        elif self._phase is _Phase.SETTLING and (
            is_still(*self._speed) or now_s - self._since_s > SETTLE_LIMIT_S
        ):
            self._drive.ending, self._drive.reason = Ending.DONE, ""
            self._enter(_Phase.ENDED, now_s)
        return NEUTRAL

    # --- input

    def _listen(self) -> str | None:
        """Process all messages; return the first reason among them to stop a drive, None if there is none."""
        reasons: list[str | None] = []
        for odometry in self._odometry.take():
            if odometry.message is not None:
                self._move(odometry.message, odometry.arrival_s)
        for status in self._statuses.take():
            if status.message is not None:
                self._status, self._status_s = status.message, status.arrival_s
                reasons.append(what_stops(status.message, SOURCE))
        pressed = [k.stamp is not None and self._off_beat.hears_key(k.stamp) for k in self._keys.take()]
        if any(pressed):
            reasons.append(f"a key was pressed at {self._operator}")
        return next(filter(None, reasons), None)

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
                self._course = Course(path, self._speed_m_s)
                self._say(f"driving {path.length_m:.2f} m at up to {self._speed_m_s:g} m/s")
            self._on_path, self._headway = False, (now_s, self._pose)
            self._enter(_Phase.DRIVING, now_s)
        elif now_s - self._since_s > ARM_LIMIT_S:
            self._pause(missing or "no odometry arrives", now_s)

    def _missing(self, now_s: float) -> str | None:
        """Return why the robot must not start; None if it may."""
        silent = self._silent(now_s)
        if silent is not None or self._status is None:
            return silent
        return what_is_missing(self._status, SOURCE)

    def _silent(self, now_s: float) -> str | None:
        """Return a text about a required stream that is silent; None if there is none."""
        if now_s - self._status_s > STATUS_SILENT_S:
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
        since_s, before = self._headway
        turned_rad = abs(wrap(pose.yaw_rad - before.yaw_rad))
        if math.dist(pose[:2], before[:2]) >= HEADWAY_M or turned_rad >= HEADWAY_RAD:
            self._headway = (now_s, pose)
        elif now_s - since_s > HEADWAY_S:
            where = "" if self._status is None else nearest_in_words(self._status)
            return f"no headway for {HEADWAY_S:g} s" + (f" (nearest: {where})" if where else "")
        return None

    def _pause(self, reason: str, now_s: float) -> None:
        self._ask(NEUTRAL)
        self._drive.reason = reason
        if self.is_attended:
            self._enter(_Phase.PAUSED, now_s)
            self._say(f"paused: {reason}; Enter continues, Ctrl-C ends")
        else:
            self._drive.ending = Ending.STOPPED
            self._enter(_Phase.ENDED, now_s)

    def _enter(self, phase: _Phase, now_s: float) -> None:
        if self._phase is _Phase.DRIVING:
            self._drive.driving_s += now_s - self._since_s
        self._phase, self._since_s = phase, now_s

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
