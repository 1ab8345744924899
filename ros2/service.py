"""The asyncio shell of the ROS 2 process: it connects the robot's topics with the keys of the wire.

Scans and odometry pass on rclpy's thread, as bytes. Commands in both directions pass through the event loop, which also
owns the tokens and the base's watchdog: if it hangs, no source stays alive and nothing is published.
"""

import asyncio
import logging
import os
import time
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from ros2 import cdr
from ros2.base import Base
from ros2.config import Ros2Section, RosSourceSection
from ros2.diagnostics import Level, Report, supervisor_report, topic_report
from ros2.endpoints import Endpoint, names, wrong_qos, wrong_types
from ros2.guard import Guard
from ros2.samples import Sample, Writers
from ros2.source import Command, Source
from ros2.status import Status, status_of
from wire import topics
from wire.inbox import Inbox, LivelinessChange, NoReplyError, RawArrival, Token, woken_by
from wire.session import RawPublisher, ZenohSession
from wire.stamp import GID_BYTES, Stamp
from wire.suspend import never_suspended
from wire.watchdog import BaseReason

_log = logging.getLogger(__name__)

TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
COMMAND_DEPTH = 32
LOOK_PERIOD_S = 0.5
"""Time between two looks at ROS's discovery; its changes are also reported at once."""
POLL_PERIOD_S = 0.05
"""Time between two checks for processes that are stopped by a signal."""
REPORT_PERIOD_S = 1.0
STATUS_SILENT_S = 0.5
RESET_LIMIT_S = 1.0
REQUEST_LIMIT_S = 2.0
EXEC_SUFFIX = "_exec"
"""`<source>_exec` is the token of `lifeline ros2 exec --source <source>`."""


class Ros(Protocol):
    """The ROS 2 side, as node.py has it."""

    @property
    def name(self) -> str: ...
    def start(self) -> None: ...
    def subscribe(
        self,
        topic: str,
        type_name: str,
        heard: Callable[[Sample], None],
        matched: Callable[[], None],
        *,
        is_reliable: bool = False,
    ) -> None: ...
    def publisher(
        self, topic: str, type_name: str, matched: Callable[[], None]
    ) -> Callable[[bytes], None]: ...
    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None: ...
    def publishers(self, topic: str) -> list[Endpoint]: ...
    def subscriptions(self, topic: str) -> list[Endpoint]: ...
    def encode_array(self, reports: list[Report]) -> bytes: ...
    def encode_status(self, report: Report) -> bytes: ...
    def close(self) -> None: ...


def _twist_type(*, stamped: bool) -> str:
    return TWIST_STAMPED if stamped else TWIST


def _new_gid() -> bytes:
    return os.urandom(GID_BYTES)


@dataclass(slots=True)
class _Feed:
    """A source with its topic, its token and its publisher on the wire."""

    section: RosSourceSection
    topic: str
    source: Source
    out: RawPublisher
    heard: Inbox[Sample]
    token: Token | None = None
    live: list[Endpoint] = field(default_factory=list[Endpoint])
    stopped: bool = False
    pid: int | None = None
    wrapped: bool = False
    """Whether a program started by `lifeline ros2 exec` holds it."""


@dataclass(slots=True)
class _Sensor:
    """A sensor's topic."""

    name: str
    topic: str
    type_name: str
    writers: Writers
    messages: int = 0
    seen: int = 0
    """Number of messages at the last report."""


class Ros2Service:
    """One robot's ROS 2 side on one Zenoh session.

    Args:
        session: the session, as a client of the supervisor.
        ros: the node; `run` starts it.
        config: `[ros2]`.
        command_timeout_s: the supervisor's command timeout, for commands that are adapted here.
        lidar_topics: the wire topics of the lidars, in the order of `[ros2] scan`.
        suspended_s: returns how long the machine was suspended since the last call [s].
    """

    def __init__(
        self,
        session: ZenohSession,
        ros: Ros,
        config: Ros2Section,
        *,
        command_timeout_s: float,
        lidar_topics: tuple[str, ...],
        suspended_s: Callable[[], float] = never_suspended,
    ) -> None:
        self._session, self._ros, self._config = session, ros, config
        self._suspended_s = suspended_s
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._changes: Inbox[None] = Inbox(1, self._wake)
        """Filled when a publisher or a subscription appears or disappears."""
        self._guard = Guard(self._on_death)
        self._dead: set[bytes] = set()
        """Publishers whose process has ended, although DDS still lists them."""
        self._own_gid = b""
        self._publishers: dict[str, list[Endpoint]] = {}
        """The publishers of each topic, at the last look."""

        self._sensors = [
            self._sensor(f"scan {topic}", topic, "sensor_msgs/msg/LaserScan", topics.lidar_scan(on_wire).key)
            for topic, on_wire in zip(config.scans, lidar_topics, strict=True)
        ]
        self._sensors.append(self._sensor("odom", config.odom, "nav_msgs/msg/Odometry", topics.ODOM.key))
        self._feeds = [self._feed(section, command_timeout_s) for section in config.sources]

        self._base = Base(config.command_timeout_s)
        self._cmd_vel_topic = config.resolved(config.cmd_vel)
        self._cmd_vel_type = _twist_type(stamped=config.stamped)
        self._cmd_vel = ros.publisher(self._cmd_vel_topic, self._cmd_vel_type, self._on_match)
        self._commands: Inbox[RawArrival] = Inbox(1, self._wake)
        session.subscribe_raw(topics.CMD_VEL.key, partial(_push, self._commands))
        self._alive: Inbox[LivelinessChange] = session.watch_alive(self._wake)

        self._statuses: Inbox[RawArrival] = Inbox(1, self._wake)
        session.subscribe_raw(topics.STATUS.key, partial(_push, self._statuses))
        self._status: Status | None = None
        self._status_s = float("-inf")
        self._diagnostics = ros.publisher(
            "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", self._on_match
        )
        self._diagnostics_out = session.publisher_raw(topics.DIAGNOSTICS.key)
        self._status_out = ros.publisher(
            "/lifeline/status", "diagnostic_msgs/msg/DiagnosticStatus", self._on_match
        )
        self._reported: list[tuple[str, Level, str]] = []
        self._next_look_s = self._next_poll_s = self._next_report_s = 0.0

        self._estop = session.publisher_raw(topics.ESTOP.key)
        for is_reliable in (False, True):  # from every publisher, and again if the message is lost
            ros.subscribe(
                config.resolved("estop"),
                "std_msgs/msg/Bool",
                self._on_estop,
                self._on_match,
                is_reliable=is_reliable,
            )
        ros.serve("/lifeline/reset", partial(self._on_request, self._reset))
        ros.serve("/lifeline/arm", partial(self._on_request, self._arm))

    # --- declarations

    def _sensor(self, name: str, relative: str, type_name: str, key: str) -> _Sensor:
        topic = self._config.resolved(relative)
        sensor = _Sensor(name, topic, type_name, Writers(_new_gid))
        out = self._session.publisher_raw(key)

        def on_message(sample: Sample) -> None:
            """Pass a message on; called on rclpy's thread."""
            sensor.messages += 1
            gid = sensor.writers.gid_of(sample)
            out.put_bytes(sample.payload, Stamp(sample.sequence, sample.source_time_ns, gid).pack())

        self._ros.subscribe(topic, type_name, on_message, self._on_match)
        return sensor

    def _feed(self, section: RosSourceSection, timeout_s: float) -> _Feed:
        source = Source(
            Writers(_new_gid),
            stamped=section.stamped,
            hold_s=section.hold_s,
            on_request=section.arm == "on_request",
            timeout_s=timeout_s,
        )
        feed = _Feed(
            section,
            self._config.resolved(section.topic),
            source,
            self._session.publisher_raw(topics.source_cmd_vel(section.name).key),
            Inbox(COMMAND_DEPTH, self._wake),
        )
        self._ros.subscribe(feed.topic, _twist_type(stamped=section.stamped), feed.heard.push, self._on_match)
        return feed

    # --- callbacks on other threads

    def _on_match(self) -> None:
        self._changes.push(None)

    def _on_estop(self, sample: Sample) -> None:
        """Press the e-stop; a message that is not a Bool may be a press: unproven means stop."""
        if cdr.bool_of(sample.payload) is not False:
            self._estop.put_bytes(cdr.TRUE)

    def _on_request(self, answer: Callable[[], Coroutine[None, None, tuple[bool, str]]]) -> tuple[bool, str]:
        try:
            return asyncio.run_coroutine_threadsafe(answer(), self._loop).result(REQUEST_LIMIT_S)
        except (TimeoutError, RuntimeError):
            return False, "Lifeline did not answer in time"

    # --- the loop

    async def run(self, stop: asyncio.Event) -> None:
        """Connect until `stop` is set; then command zero and return."""
        token = self._session.declare_alive(topics.ROS2)
        stopping = asyncio.ensure_future(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        self._ros.start()
        try:
            while not stop.is_set():
                await woken_by(self._wake, self._due_s())
                self._wake.clear()
                self._serve_base()
                self._serve_sources()
                self._serve_base()  # a command of a source may take as long as a tick
                now_s = self._loop.time()
                if self._changes.take() or now_s >= self._next_look_s:
                    self._next_look_s = now_s + LOOK_PERIOD_S
                    self._look()
                    self._report(now_s)
                elif now_s >= self._next_poll_s:
                    self._next_poll_s = now_s + POLL_PERIOD_S
                    self._poll()
                self._pass_status(now_s)
        finally:
            stopping.cancel()
            self._publish(cdr.STANDSTILL)
            for feed in self._feeds:
                self._end(feed)
            token.withdraw()

    def _due_s(self) -> float:
        return min(
            self._base.due_s,
            self._next_look_s,
            self._next_poll_s,
            *(feed.source.due_s() for feed in self._feeds),
        )

    def _serve_base(self) -> None:
        """Take the supervisor's commands and token, and publish what the watchdog decides."""
        for change in self._alive.take():
            if change.node == topics.SUPERVISOR:
                self._base.supervisor_alive(change.alive, change.arrival_s)
            elif change.node.endswith(EXEC_SUFFIX):
                self._on_wrapper(change.node.removesuffix(EXEC_SUFFIX), alive=change.alive)
        commands = self._commands.take()
        for command in commands:
            self._base.command(*command)
        if self._suspended_s() > 0.0:
            self._base.resumed(self._loop.time())
        now_s = self._loop.time()
        if now_s >= self._base.due_s:
            before = self._base.reason
            self._publish(self._base.target(now_s, repeated=not commands))
            if self._base.reason is not before:
                _log.info("base: %s", _base_text(self._base.reason))

    def _publish(self, velocity: cdr.Planar) -> None:
        if self._config.stamped:
            self._cmd_vel(cdr.twist_stamped(velocity, time.time_ns(), self._config.frame_id))
        else:
            self._cmd_vel(cdr.twist(velocity))

    def _serve_sources(self) -> None:
        for feed in self._feeds:
            for sample in feed.heard.take():
                if not feed.source.present:
                    self._look_at(feed)  # a message may arrive before the match is reported
                self._put(feed, feed.source.heard(sample))
            self._put(feed, feed.source.repeat(self._loop.time()))

    @staticmethod
    def _put(feed: _Feed, commands: list[Command]) -> None:
        for command in commands:
            sent = command.sent
            attachment = (
                None
                if sent is None
                else Stamp(sent.sequence, round(sent.source_time_s * 1e9), sent.epoch).pack()
            )
            feed.out.put_bytes(command.twist, attachment, true_at_s=command.true_at_s)

    # --- who publishes

    def _look(self) -> None:
        """Ask ROS's discovery for the publishers of all topics, and begin and end sources accordingly."""
        watched = [feed.topic for feed in self._feeds]
        for topic in (*watched, self._cmd_vel_topic, *(sensor.topic for sensor in self._sensors)):
            self._publishers[topic] = self._ros.publishers(topic)
        listed = {endpoint.gid for topic in watched for endpoint in self._publishers[topic]}
        self._dead &= listed
        self._guard.forget(listed - self._dead)
        for feed in self._feeds:
            self._judge(feed)

    def _look_at(self, feed: _Feed) -> None:
        self._publishers[feed.topic] = self._ros.publishers(feed.topic)
        self._judge(feed)

    def _poll(self) -> None:
        stopped = self._guard.stopped()
        for feed in self._feeds:
            if feed.stopped != any(p.gid in stopped for p in feed.live):
                self._judge(feed)

    def _judge(self, feed: _Feed) -> None:
        """Serve a source while exactly one live program publishes on its topic."""
        expected = _twist_type(stamped=feed.section.stamped)
        feed.live = [
            p for p in self._publishers[feed.topic] if p.gid not in self._dead and p.type_name == expected
        ]
        feed.pid = None
        if len(feed.live) == 1:
            feed.pid = self._guard.watch(feed.live[0].gid, self._own_identity())
        feed.stopped = any(p.gid in self._guard.stopped() for p in feed.live)
        if len(feed.live) == 1 and not feed.stopped:
            self._begin(feed)
        else:
            self._end(feed)

    def _begin(self, feed: _Feed) -> None:
        if feed.token is None:
            feed.source.attend(self._loop.time())
            feed.token = self._session.declare_alive(feed.section.name)
            _log.info("source %s: %s", feed.section.name, names(feed.live))

    def _end(self, feed: _Feed) -> None:
        if feed.token is not None:
            feed.token.withdraw()
            feed.token = None
            feed.source.leave()
            _log.info("source %s: ended; publishers: %s", feed.section.name, names(feed.live))

    def _on_death(self, gid: bytes) -> None:
        """End a source whose process has ended."""
        self._dead.add(gid)
        for feed in self._feeds:
            if any(endpoint.gid == gid for endpoint in feed.live):
                self._look_at(feed)
        self._wake.set()

    def _on_wrapper(self, name: str, *, alive: bool) -> None:
        """Process the token of `lifeline ros2 exec`: if it goes, its program has ended."""
        for feed in self._feeds:
            if feed.section.name == name:
                feed.wrapped = alive
                if not alive:
                    self._dead.update(endpoint.gid for endpoint in feed.live)
                    self._look_at(feed)

    def _own_identity(self) -> bytes:
        if not self._own_gid:
            own = [e for e in self._publishers.get(self._cmd_vel_topic, ()) if e.node == self._ros.name]
            self._own_gid = own[0].gid if own else b""
        return self._own_gid

    # --- requests

    async def _reset(self) -> tuple[bool, str]:
        try:
            return await self._session.call_raw(
                topics.SUPERVISOR_RESET.key, None, cdr.trigger_reply, timeout_s=RESET_LIMIT_S
            )
        except NoReplyError as error:
            return False, str(error)

    async def _arm(self) -> tuple[bool, str]:
        """Send one neutral command for each source that a person arms."""
        on_request = [f for f in self._feeds if f.section.arm == "on_request"]
        if not on_request:
            return False, 'no source has arm = "on_request": send zero velocity with the source itself'
        armed: list[str] = []
        for feed in on_request:
            commands = feed.source.arm(self._loop.time())
            self._put(feed, commands)
            armed += [feed.section.name] if commands else []
        if not armed:
            return False, "no program publishes on the topic of such a source"
        _log.info("armed on request: %s", ", ".join(armed))
        return True, f"sent zero velocity for {' and '.join(armed)}"

    # --- reports

    def _pass_status(self, now_s: float) -> None:
        """Publish the supervisor's status, which comes 10 times a second and on a change."""
        fresh = self._statuses.take()
        if fresh:
            self._status, self._status_s = status_of(fresh[-1].payload), fresh[-1].arrival_s
            self._status_out(self._ros.encode_status(self._mode_report()))
        elif self._status is not None and now_s - self._status_s > STATUS_SILENT_S:
            self._status = None
            self._status_out(self._ros.encode_status(self._mode_report()))

    def _mode_report(self) -> Report:
        return supervisor_report(self._status, _base_text(self._base.reason))

    def _report(self, now_s: float) -> None:
        """Publish all reports once a second, and at once when a source or the mode has changed."""
        first = [self._mode_report(), *(self._source_report(feed) for feed in self._feeds)]
        outline = [(r.name, r.level, r.message) for r in first]
        if now_s < self._next_report_s and outline == self._reported:
            return
        self._reported = outline
        self._next_report_s = now_s + REPORT_PERIOD_S
        array = self._ros.encode_array(
            [*first, *(self._sensor_report(sensor) for sensor in self._sensors), self._base_report()]
        )
        self._diagnostics(array)
        self._diagnostics_out.put_bytes(array)

    def _source_report(self, feed: _Feed) -> Report:
        section = feed.section
        expected = _twist_type(stamped=section.stamped)
        problems: list[str] = []
        if len(feed.live) > 1:
            problems.append(
                f"{names(feed.live)} all publish on {feed.topic}, so none is obeyed: end all but one"
            )
        if feed.stopped:
            problems.append(f"process {feed.pid} of {names(feed.live)} is stopped by a signal")
        everyone = [e for e in self._publishers[feed.topic] if e.gid not in self._dead]
        wrong = wrong_types(feed.topic, expected, everyone, f"stamped of the source {section.name}")
        if wrong is not None:
            problems.append(wrong)
        if not feed.live and not problems:
            return Report(f"source {section.name}", Level.WARN, f"no program publishes on {feed.topic}")
        guards = [f"process {feed.pid} on this host"] if feed.pid is not None else []
        guards += ["lifeline ros2 exec"] if feed.wrapped else []
        guards += ["liveliness of DDS", "command timeout"]
        values = [
            ("topic", f"{feed.topic} ({expected})"),
            ("node", names(feed.live)),
            ("guards", ", ".join(guards)),
            ("hold_s", "off" if section.hold_s is None else f"{section.hold_s:g}"),
            ("arm", section.arm),
            ("accepted", str(feed.source.accepted)),
            ("refused", str(feed.source.refused)),
        ]
        hold = "" if section.hold_s is None else f"; each command is held for {section.hold_s:g} s"
        return topic_report(
            f"source {section.name}",
            problems,
            f"{names(feed.live)} on {feed.topic}, guarded by {', '.join(guards)}{hold}",
            values,
        )

    def _sensor_report(self, sensor: _Sensor) -> Report:
        publishers = self._publishers[sensor.topic]
        problems: list[str] = []
        wrong = wrong_types(sensor.topic, sensor.type_name, publishers, "")
        if wrong is not None:
            problems.append(wrong)
        if not publishers:
            problems.append(
                f"no node publishes on {sensor.topic}: start the driver, or correct the topic in [ros2]"
            )
        active = sensor.writers.active(self._loop.time(), REPORT_PERIOD_S)
        if active > 1:
            problems.append(
                f"{active} writers publish on {sensor.topic} ({names(publishers)}): end all but one"
            )
        arrived, sensor.seen = sensor.messages - sensor.seen, sensor.messages
        if not problems and not arrived:
            problems.append(f"{names(publishers)} publishes nothing on {sensor.topic}")
        return topic_report(
            sensor.name,
            problems,
            f"{names(publishers)} on {sensor.topic}",
            [("topic", f"{sensor.topic} ({sensor.type_name})"), ("messages", str(sensor.messages))],
        )

    def _base_report(self) -> Report:
        topic = self._cmd_vel_topic
        own = self._own_identity()
        others = [p for p in self._publishers[topic] if p.gid[:12] != own[:12] and p.gid not in self._dead]
        subscriptions = self._ros.subscriptions(topic)
        problems: list[str] = []
        if others:
            problems.append(
                f"{names(others)} also publishes on {topic}, past the supervisor: the robot obeys it even when "
                "Lifeline commands zero. End it, or remap it to the topic of a source"
            )
        wrong = wrong_types(topic, self._cmd_vel_type, subscriptions, "stamped")
        problems += [p for p in (wrong, wrong_qos(topic, subscriptions)) if p is not None]
        if not subscriptions:
            problems.append(
                f"no node listens on {topic}: start the base's driver, or correct cmd_vel in [ros2]"
            )
        return topic_report(
            "cmd_vel",
            problems,
            f"{names(subscriptions)} listens on {topic}",
            [("topic", f"{topic} ({self._cmd_vel_type})"), ("base", _base_text(self._base.reason))],
        )


def _push(inbox: Inbox[RawArrival], payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
    inbox.push(RawArrival(payload, attachment, arrival_s))


def _base_text(reason: BaseReason) -> str:
    return "follows the supervisor" if reason is BaseReason.OK else str(reason)
