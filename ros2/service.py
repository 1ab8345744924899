"""The asyncio shell of the ROS 2 process: it connects the robot's topics with the keys of the wire.

Scans and odometry pass on the node's thread, as bytes. Commands in both directions pass through the event loop, which
also owns the tokens and the base's watchdog: if it hangs, nothing is published.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import partial

from ros2 import ros
from ros2.base_clock import ODOM_DEPTH, BaseClock
from ros2.commands import Base, Command, Source, message
from ros2.config import Ros2Section, RosSourceSection
from ros2.header_age import HeaderAge
from ros2.inputs import Inputs, Sensor, new_gid
from ros2.presence import Presence, Programs
from ros2.reports import (
    base_report,
    diagnostic_array,
    diagnostic_status,
    estop_report,
    sensor_report,
    source_report,
    supervisor_report,
)
from ros2.ros import Level, Report, Ros, twist_type
from ros2.samples import Sample, Writers
from ros2.status import Status, status_of
from wire import cdr, topics
from wire.host.notify import Notifier
from wire.host.pauses import StallMeter, never_suspended
from wire.inbox import Inbox, LivelinessChange, NoReplyError, RawArrival, Token, woken_by
from wire.stamp import Stamp
from wire.watchdog import BaseReason
from wire.zenoh.session import RawPublisher, ZenohSession

_log = logging.getLogger(__name__)

COMMAND_DEPTH = 32
LOOK_PERIOD_S = 0.5
"""Time between two queries of discovery; a change of discovery also causes one at once."""
POLL_PERIOD_S = 0.05
"""Time between two checks for processes that are stopped by a signal."""
REPORT_PERIOD_S = 1.0
STATUS_SILENT_S = 0.5
RESET_LIMIT_S = 1.0
REQUEST_LIMIT_S = 2.0
LATE = False, "Lifeline did not answer in time"
STALLED = False, "Lifeline was stopped meanwhile: ask again in a second"


@dataclass(slots=True)
class _Feed:
    """A command source: its topic, its token and its publisher on the wire."""

    section: RosSourceSection
    source: Source
    programs: Programs
    out: RawPublisher
    heard: Inbox[Sample]
    token: Token | None = None
    program: bytes | None = None
    """Identity of the program that is served; None: none is."""
    epoch: bytes = b""
    """The epoch of its commands; empty before the first."""
    run: Token | None = None
    """The token of this run."""

    def end_of_run(self) -> None:
        if self.run is not None:
            self.run.withdraw()
        self.epoch, self.run = b"", None


class Ros2Service:
    """One robot's ROS 2 side on one Zenoh session.

    Args:
        session: the session, as a client of the supervisor.
        node: the ROS 2 node; `run` starts it.
        config: `[ros2]`.
        command_timeout_s: the supervisor's command timeout, for commands that are adapted here.
        lidar_topics: the wire topics of the lidars, in the order of `[ros2] scan`.
        suspended_s: returns how long the machine was suspended since the last call [s].
        notifier: reports in each turn that the loop runs; None reports nothing.
    """

    def __init__(
        self,
        session: ZenohSession,
        node: Ros,
        config: Ros2Section,
        *,
        command_timeout_s: float,
        lidar_topics: tuple[str, ...],
        suspended_s: Callable[[], float] = never_suspended,
        notifier: Notifier | None = None,
    ) -> None:
        self._notifier = Notifier() if notifier is None else notifier
        self._session, self._node, self._config = session, node, config
        self._suspended_s = suspended_s
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._stall = StallMeter(self._loop.time())
        self._matches: Inbox[None] = Inbox(1, self._wake)
        """Filled when a publisher or a subscription appears or disappears."""
        self._presence = Presence(node, self._on_programs)

        self._base = Base(config.command_timeout_s)
        self._base_clock = BaseClock(config.stamp)
        self._odometry: Inbox[Sample] = Inbox(ODOM_DEPTH, None)
        """Of a base that listens to TwistStamped, for its clock. It wakes nothing, because the loop reads it often enough."""
        self._inputs = Inputs(
            session,
            node,
            config,
            lidar_topics=lidar_topics,
            matched=self._on_match,
            odometry=self._odometry.push,
        )
        self._feeds = [self._feed(section, command_timeout_s) for section in config.sources]

        self._cmd_vel_topic = config.resolved(config.cmd_vel)
        self._cmd_vel = node.publisher(
            self._cmd_vel_topic, twist_type(stamped=config.stamped), self._on_match
        )
        self._commands: Inbox[RawArrival] = Inbox(1, self._wake)
        session.subscribe_raw(topics.CMD_VEL.key, partial(_push, self._commands))
        wrappers = [f"{section.name}{topics.EXEC_SUFFIX}" for section in config.sources]
        self._alive: Inbox[LivelinessChange] = session.watch_alive(self._wake, [topics.SUPERVISOR, *wrappers])

        self._statuses: Inbox[RawArrival] = Inbox(1, self._wake)
        session.subscribe_raw(topics.STATUS.key, partial(_push, self._statuses))
        self._status: Status | None = None
        self._status_s = -math.inf
        self._status_out = node.publisher("/lifeline/status", ros.DIAGNOSTIC_STATUS, self._on_match)
        self._diagnostics = node.publisher("/diagnostics", ros.DIAGNOSTIC_ARRAY, self._on_match)
        self._diagnostics_out = session.publisher_raw(topics.DIAGNOSTICS)
        self._reported: list[tuple[str, Level, str]] = []
        self._next_look_s = self._next_poll_s = self._next_report_s = 0.0

        node.serve("/lifeline/reset", partial(self._on_request, self._reset))
        node.serve("/lifeline/arm", partial(self._on_request, self._arm))

    def _feed(self, section: RosSourceSection, timeout_s: float) -> _Feed:
        topic, type_name = self._config.resolved(section.topic), twist_type(stamped=section.stamped)
        limit_s = None if section.clock == "own" else section.clock_limit_s
        source = Source(
            Writers(new_gid),
            headers=HeaderAge(section.name, timeout_s, limit_s) if section.stamped else None,
            hold_s=section.hold_s,
            on_request=section.arm == "on_request",
            timeout_s=timeout_s,
        )
        feed = _Feed(
            section,
            source,
            self._presence.watch(topic, type_name),
            self._session.publisher_raw(topics.source_cmd_vel(section.name)),
            Inbox(COMMAND_DEPTH, self._wake),
        )
        self._node.subscribe(topic, type_name, feed.heard.push, self._on_match)
        return feed

    # --- callbacks on the node's threads

    def _on_match(self) -> None:
        self._matches.push(None)

    def _on_request(self, answer: Callable[[], Coroutine[None, None, tuple[bool, str]]]) -> tuple[bool, str]:
        """Answer a request in the loop; after the time limit it is not executed, because its caller was sent a failure."""
        deadline_s = self._loop.time() + REQUEST_LIMIT_S

        async def in_time() -> tuple[bool, str]:
            now_s = self._loop.time()
            if self._stall.may_be_old(now_s):
                return STALLED
            return LATE if now_s >= deadline_s else await answer()

        request = in_time()
        try:
            return asyncio.run_coroutine_threadsafe(request, self._loop).result(REQUEST_LIMIT_S)
        except (TimeoutError, CancelledError):
            return LATE
        except RuntimeError:  # the loop has closed
            request.close()
            return LATE

    # --- the loop

    async def run(self, stop: asyncio.Event) -> None:
        """Pass messages in both directions until `stop` is set; then command zero and return."""
        tokens = [self._session.declare_alive(topics.ROS2, epoch) for epoch in (b"", self._inputs.epoch)]
        stopping = asyncio.ensure_future(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        self._node.start()
        try:
            while not stop.is_set():
                # The base is due at least every 30 ms, so all other work needs no timer of its own.
                due_s = min([self._base.due_s, *(feed.source.due_s() for feed in self._feeds)])
                await woken_by(self._wake, due_s)
                self._wake.clear()
                self._stall.turn(self._loop.time())
                self._serve_base()
                self._serve_sources()
                self._look(self._loop.time())
                self._notifier.running(self._loop.time())
        finally:
            stopping.cancel()
            self._publish(cdr.STANDSTILL)
            self._notifier.stopping()
            for feed in self._feeds:
                self._end(feed)
            for token in tokens:
                token.withdraw()

    def _serve_base(self) -> None:
        """Take the supervisor's commands and token, and publish what the watchdog decides."""
        for change in self._alive.take():
            if not change.epoch:
                self._on_token(change)
        commands = self._commands.take()
        for command in commands:
            self._base.command(*command)
        for odometry in self._odometry.take():
            self._base_clock.hear(odometry)
        # Evaluated last, so that it covers a suspend while the commands were taken.
        if self._suspended_s() > 0.0:
            self._base.resumed(self._loop.time())
        now_s = self._loop.time()
        if now_s >= self._base.due_s:
            before = self._base.reason
            may_move = self._base_clock.may_move(now_s)
            self._publish(self._base.target(now_s, repeated=not commands, may_move=may_move))
            if self._base.reason is not before:
                why = self._base_clock.problem(now_s)
                _log.info("base: %s%s", _base_text(self._base.reason), f": {why}" if why else "")

    def _publish(self, velocity: cdr.Planar) -> None:
        self._cmd_vel(message(velocity, self._config, self._base_clock.stamp_ns(time.time_ns())))

    def _serve_sources(self) -> None:
        for feed in self._feeds:
            samples = feed.heard.take()
            if samples and not feed.source.present:  # a message may arrive before the match is reported
                self._presence.look_at(feed.programs)
            for sample in samples:
                self._put(feed, feed.source.heard(sample))
            self._put(feed, feed.source.repeat(self._loop.time()))

    def _on_token(self, change: LivelinessChange) -> None:
        if change.node == topics.SUPERVISOR:
            self._base.supervisor_alive(change.alive, change.arrival_s)
            return
        for feed in self._feeds:
            if change.node == f"{feed.section.name}{topics.EXEC_SUFFIX}":
                self._presence.wrapper(feed.programs, alive=change.alive)

    def _look(self, now_s: float) -> None:
        """Query discovery, check for stopped processes, and publish the reports."""
        if self._matches.take() or now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_PERIOD_S
            others = self._presence.others(self._cmd_vel_topic)
            self._presence.look()
            self._report(
                now_s,
                base_report(
                    self._cmd_vel_topic,
                    twist_type(stamped=self._config.stamped),
                    others,
                    self._node.subscriptions(self._cmd_vel_topic),
                    _base_text(self._base.reason),
                    own_node=self._node.name,
                    clock=self._base_clock.shown(now_s) if self._config.stamped else "",
                    clock_problem=self._base_clock.problem(now_s),
                ),
            )
        elif now_s >= self._next_poll_s:
            self._next_poll_s = now_s + POLL_PERIOD_S
            self._presence.poll()
        self._pass_status(now_s)

    def _on_programs(self, programs: Programs) -> None:
        """Serve a source while exactly one live program publishes on its topic."""
        only = programs.only
        for feed in self._feeds:
            if feed.programs is programs and feed.program != only:
                self._end(feed)
                if only is not None:
                    self._begin(feed, only)

    def _begin(self, feed: _Feed, program: bytes) -> None:
        feed.program = program
        feed.source.attend(program, self._loop.time(), is_here=feed.programs.pid is not None)
        feed.token = self._session.declare_alive(feed.section.name)
        _log.info("%s", self._source_report(feed).message)

    def _end(self, feed: _Feed) -> None:
        if feed.token is not None:
            feed.token.withdraw()
            feed.token = feed.program = None
            feed.end_of_run()
            feed.source.leave()
            _log.info("source %s ended: %s", feed.section.name, self._source_report(feed).message)

    def _put(self, feed: _Feed, commands: list[Command]) -> None:
        for command in commands:
            sent = command.sent
            epoch = feed.out.epoch if sent is None else sent.epoch
            if epoch != feed.epoch:
                feed.end_of_run()
                feed.epoch, feed.run = epoch, self._session.declare_alive(feed.section.name, epoch)
            stamp = (
                feed.out.next_stamp(command.true_at_s)
                if sent is None
                else Stamp(sent.sequence, round(sent.source_time_s * 1e9), epoch)
            )
            feed.out.put_bytes(command.twist, stamp.pack())

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
        on_request = [feed for feed in self._feeds if feed.section.arm == "on_request"]
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
        elif self._status is None or now_s - self._status_s <= STATUS_SILENT_S:
            return
        else:
            self._status = None
        self._status_out(diagnostic_status(self._mode_report()))

    def _mode_report(self) -> Report:
        return supervisor_report(self._status, _base_text(self._base.reason))

    def _source_report(self, feed: _Feed) -> Report:
        headers = feed.source.headers
        problem = headers.problem if headers is not None and feed.source.present else None
        return source_report(
            feed.section,
            feed.programs,
            feed.source.accepted,
            feed.source.refused,
            problem or self._node.problem(feed.programs.topic),
            age="" if headers is None else headers.shown,
        )

    def _report(self, now_s: float, base: Report) -> None:
        """Publish all reports once a second, and at once when a source, the mode or the base's topic has changed."""
        estop = estop_report(self._inputs.estop_topic, self._node.publishers(self._inputs.estop_topic))
        first = [self._mode_report(), *map(self._source_report, self._feeds), base, estop]
        outline = [(report.name, report.level, report.message) for report in first]
        if now_s < self._next_report_s and outline == self._reported:
            return
        self._reported = outline
        self._next_report_s = now_s + REPORT_PERIOD_S
        reports = [*first, *(self._sensor_report(sensor, now_s) for sensor in self._inputs.sensors)]
        array = diagnostic_array(reports, time.time_ns())
        self._diagnostics(array)
        self._diagnostics_out.put_bytes(array)

    def _sensor_report(self, sensor: Sensor, now_s: float) -> Report:
        return sensor_report(
            sensor.name,
            sensor.topic,
            sensor.type_name,
            self._node.publishers(sensor.topic),
            writers=sensor.writers.active(now_s, REPORT_PERIOD_S),
            problem=self._node.problem(sensor.topic),
        )


def _push(inbox: Inbox[RawArrival], payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
    inbox.push(RawArrival(payload, attachment, arrival_s))


def _base_text(reason: BaseReason) -> str:
    return "follows the supervisor" if reason is BaseReason.OK else str(reason)
