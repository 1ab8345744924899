"""Processes the messages of a recording in order of time: of any robot, and of one that Lifeline supervised. Pure."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np

from recordings.judge.choice import TWIST_STAMPED, Chosen
from recordings.judge.findings import Moment, Places, Stream
from recordings.judge.monitors import Event, Monitors, Motion, Output, Pressed, Released, Request
from recordings.judge.own import events_of_status, is_estopped, moment_of_status, velocity_of
from recordings.judge.rerun import BREAK_S, SOURCE, START_S, Rerun
from recordings.recording import Recorded
from supervisor.law.base_motion import moves
from supervisor.law.lidar import PROFILES
from supervisor.law.model import LawConfig
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.messages import ScanHeaders, planar
from wire import cdr
from wire import messages as ros
from wire.bus import Arrival
from wire.messages import Twist, UndecodableError, decode
from wire.standstill import STILL_M_S, STILL_RAD_S, is_still

BELOW_MIN_SHARE = 0.05
"""A larger share of readings at or below `range_min` hardly shows the surroundings."""
LEAST_WAY_M = 0.5
"""A shorter way by the poses of odometry is no motion."""
STATUS_TIMEOUT_S = 1.0
NOISE = Velocity(3.0 * STILL_M_S, 3.0 * STILL_RAD_S)
"""A base that reports a lower velocity may stand: its odometry is noisy."""


class Feed(ABC):
    """What the messages of a recording show.

    Args:
        law: the configuration of the law.
        chosen: the topics.
        monitors: judge the rules.
    """

    def __init__(self, law: LawConfig, chosen: Chosen, monitors: Monitors) -> None:
        self.law, self.chosen, self.monitors = law, chosen, monitors
        self.places = Places(obeyed=chosen.status is not None)
        self.streams: dict[str, Stream] = {}
        self.notes: list[str] = []
        self.not_judged = ""
        """Why the law's stops are not judged; empty if they are."""
        self.judged_from_s = 0.0
        self.breaks = 0
        """Pauses of the whole recording."""
        self._last_s = 0.0
        self._moving = False
        timeouts_s = [lidar.timeout_s for lidar in law.lidars]
        timeouts_s += timeouts_s[-1:] * (len(chosen.scans) - len(timeouts_s))
        for name, timeout_s in zip(chosen.scans, timeouts_s, strict=False):
            self.add("scan", name, timeout_s)
        self.add("odometry", chosen.odom, law.odom_timeout_s)
        for name in chosen.estops:
            self.add("e-stop", name)

    def add(self, role: str, topic: str | None, timeout_s: float = math.inf) -> None:
        """Follow a topic, if it was chosen."""
        if topic is not None:
            self.streams[topic] = Stream(role, topic, timeout_s)

    def hear(self, time_s: float, message: Recorded) -> None:
        """Process a message, in order of time; one that cannot be decoded is counted."""
        if time_s - self._last_s > BREAK_S:
            self._pause()
        self._last_s = time_s
        stream = self.streams[message.topic]
        try:
            digest = self._hear(time_s, message)
        except UndecodableError:
            stream.undecodable += 1
            digest = None
        stream.hear(time_s, digest, moving=self._moving)

    def end(self, time_s: float) -> None:
        """Process the end of the recording."""
        for stream in self.streams.values():
            stream.end(time_s)
        if self.breaks:
            self.notes.append(
                f"all topics paused {self.breaks:,} ×; after a pause, law and rules start again"
            )

    def _pause(self) -> None:
        """Process a pause of all topics: what happened in it is unknown, and no topic was silent alone."""
        self.breaks += 1
        self.monitors.forget()
        for stream in self.streams.values():
            stream.pause()

    @abstractmethod
    def _hear(self, time_s: float, message: Recorded) -> int | None:
        """Process a message; return a digest if an equal one after it would be a repetition.

        Raises:
            UndecodableError: it is not of its type.
        """

    def _judge(self, events: Iterable[Event]) -> None:
        for event in events:
            self.monitors.hear(event)

    def _set_moving(self, *, moving: bool) -> None:
        self._moving = moving
        if moving:
            for stream in self.streams.values():
                stream.moved()


class AnyRobot(Feed):
    """A robot that Lifeline did not supervise: the law runs over its messages."""

    def __init__(self, law: LawConfig, chosen: Chosen, monitors: Monitors) -> None:
        super().__init__(law, chosen, monitors)
        self.add("commands", chosen.cmd_vel, law.command_timeout_s)
        self._rerun = Rerun(law, follows_odometry=chosen.cmd_vel is None) if chosen.scans else None
        self._headers = ScanHeaders(chosen.scans)
        self._readings = {name: np.zeros(2, dtype=np.int64) for name in chosen.scans}
        """By topic, the readings at or below `range_min`, and all readings."""
        self._has_velocity = False
        self._place_m: tuple[float, float] | None = None
        self._way_m = 0.0
        """Length of the way by the poses of odometry."""

    def _hear(self, time_s: float, message: Recorded) -> int | None:
        if self._rerun is not None:
            self._see(self._rerun.advance(time_s))
        if message.topic == self.chosen.odom:
            return self._hear_odometry(time_s, message)
        if message.topic in self.chosen.scans:
            return self._hear_scan(time_s, message)
        if message.topic in self.chosen.estops:
            is_pressed = decode(message.payload, ros.Bool).data
            self._judge([Pressed(time_s) if is_pressed else Released(time_s)])
            return None
        twist = _twist_of(message)
        velocity = planar(twist)
        if _is_finite(twist):  # this base may move sideways
            self._judge([Request(time_s, SOURCE, velocity == STANDSTILL)])
        if self.chosen.odom is None:
            self._set_moving(moving=velocity != STANDSTILL)
        if self._rerun is not None:
            self._see([self._rerun.hear_command(time_s, velocity)])
        return None

    def _hear_scan(self, time_s: float, message: Recorded) -> int:
        number, rerun = self.chosen.scans.index(message.topic), self._rerun
        assert rerun is not None  # there are scans
        try:
            scan = decode(message.payload, ros.LaserScan)
        except UndecodableError:
            self._see([rerun.hear_scan(time_s, number, None)])
            raise
        self._see([rerun.hear_scan(time_s, number, scan)])
        self._headers.hear(number, [Arrival(scan, START_S + time_s, None)])
        below = (scan.ranges >= 0.0) & (scan.ranges <= scan.range_min)
        self._readings[message.topic] += np.array((np.count_nonzero(below), below.size))
        return hash(scan.ranges.tobytes())

    def _hear_odometry(self, time_s: float, message: Recorded) -> int:
        odometry = decode(message.payload, ros.Odometry)
        at, velocity = odometry.pose.pose.position, velocity_of(odometry.twist.twist)
        self._set_moving(moving=not is_still(*velocity))
        self._has_velocity |= self._moving
        before, self._place_m = self._place_m, (at.x, at.y)
        self._way_m += 0.0 if before is None else math.dist(before, self._place_m)
        is_more_than_noise = moves(velocity, NOISE)
        self._judge([Motion(time_s, self.law.hull_speed_m_s(velocity) if is_more_than_noise else 0.0)])
        if self._rerun is not None:
            self._rerun.hear_odometry(time_s, ros.Motion(odometry.header.frame_id, *velocity))
        return hash(message.payload)

    def _see(self, moments: Iterable[Moment]) -> None:
        for moment in moments:
            self.places.see(moment)

    def end(self, time_s: float) -> None:
        super().end(time_s)
        rerun, scans = self._rerun, self.chosen.scans
        if self._way_m > LEAST_WAY_M and not self._has_velocity:
            self.notes.append(
                f"the poses of odometry move {self._way_m:.1f} m, but all its velocities are zero"
            )
        if rerun is None:
            self.not_judged = "the recording has no laser scan"
            return
        self._see(rerun.advance(time_s))
        self.judged_from_s = rerun.judged_from_s
        missing = [name for name in scans if not self.streams[name].messages]
        unread = [one.topic for one in self.streams.values() if 0 < one.messages == one.undecodable]
        if unread:
            self.not_judged = f"no message on {', '.join(unread)} can be decoded; if they are compressed, name the recording's folder"
        elif missing:
            self.not_judged = f"no scan on {', '.join(missing)}"
        elif not self.places.judged_s:
            self.not_judged = "no motion is recorded after the first scans"
        if self._headers.problem:
            self.notes.append(self._headers.problem)
        for name, lidar in zip(scans, self.law.lidars, strict=True):
            below, readings = self._readings[name].tolist()
            if below > BELOW_MIN_SHARE * readings and lidar.profile == PROFILES["rep117"]:
                self.notes.append(
                    f"{below / readings:.0%} of the readings on {name} are at or below range_min, too close by REP 117; if "
                    "they mean no return, set the lidar's profile in a file, and name it with --config"
                )


class Supervised(Feed):
    """A robot that Lifeline supervised: its status shows what Lifeline did."""

    def __init__(self, law: LawConfig, chosen: Chosen, monitors: Monitors) -> None:
        super().__init__(law, chosen, monitors)
        for name, source in chosen.requests.items():
            self.add(f"source {source}", name)
        self.add("commands", chosen.cmd_vel, law.base_timeout_s)
        self.add("status", chosen.status, STATUS_TIMEOUT_S)
        self._moved, self._moved_s = STANDSTILL, -math.inf
        """The last velocity that was permitted, and when."""
        self._status, self._status_s = ros.SafetyStatus(ros.header("", 0)), -math.inf
        """The last status, and when."""

    def _pause(self) -> None:
        super()._pause()
        self._status = ros.SafetyStatus(ros.header("", 0))

    def _hear(self, time_s: float, message: Recorded) -> int | None:
        topic, payload, chosen = message.topic, message.payload, self.chosen
        if topic in chosen.scans:
            return hash(decode(payload, ros.LaserScan).ranges.tobytes())
        if topic == chosen.odom:
            velocity = velocity_of(decode(payload, ros.Odometry).twist.twist)
            self._set_moving(moving=not is_still(*velocity))
            return hash(payload)
        if topic == chosen.status:
            status = decode(payload, ros.SafetyStatus)
            self._judge(events_of_status(time_s, status, was_estopped=is_estopped(self._status)))
            self._status, self._status_s = status, time_s
            moment, permitted = moment_of_status(time_s, status), velocity_of(status.permitted)
            if permitted != STANDSTILL:
                self._moved, self._moved_s = permitted, time_s
            elif moment.reasons and time_s - self._moved_s <= self.law.command_timeout_s:
                moment = moment._replace(wanted=self._moved)  # with an e-stop, teleop sends zero at once
            self.places.see(moment)
        elif topic == chosen.cmd_vel:
            self._judge([Output(time_s, planar(_twist_of(message)) != STANDSTILL)])
        elif topic in chosen.estops:
            is_heard = time_s - self._status_s <= STATUS_TIMEOUT_S  # otherwise no supervisor may run
            if is_heard and self._is_pressed(message):
                self._judge([Pressed(time_s)])
        elif _is_finite(twist := _twist_of(message)) and (velocity := planar(twist)) is not None:
            self._judge([Request(time_s, chosen.requests[topic], velocity == STANDSTILL)])
        return None

    def _is_pressed(self, message: Recorded) -> bool:
        """Return whether a message requests an e-stop; the stations of other robots do not."""
        if message.msgtype == ros.Bool.__msgtype__:
            return decode(message.payload, ros.Bool).data
        station = message.topic.split("/")[-2]
        is_own = any(one.name == station for one in self._status.estop_stations)
        return decode(message.payload, ros.EstopLease).stop and is_own


def _twist_of(message: Recorded) -> Twist:
    """Return the Twist of a command.

    Raises:
        UndecodableError: it is neither a Twist nor a TwistStamped.
    """
    payload = message.payload
    if message.msgtype == TWIST_STAMPED:
        payload = cdr.twist_of(payload, stamped=True) or b""
    return decode(payload, Twist)


def _is_finite(twist: Twist) -> bool:
    parts = twist.linear, twist.angular
    return all(math.isfinite(value) for part in parts for value in (part.x, part.y, part.z))
