"""The asyncio shell of the law: gathers the inputs, runs a step, publishes the decision.

It runs on its own timer, so that it notices missing messages without waiting for one. Nothing blocks the loop:
publishing drops samples instead of waiting, and the caller of a reset waits on its own thread.
"""

import asyncio
import logging
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

from supervisor.base_record import BaseRecord, Shown
from supervisor.blackbox.people import People
from supervisor.blackbox.recorder import StepRecorder
from supervisor.config import SupervisorSection
from supervisor.estop_record import NO_DISK, PRESSED, MemoryRecord, Record
from supervisor.law.certificate import Certificate, certify, foreseen
from supervisor.law.decision import Decision, Mode
from supervisor.law.estop_stations import Presence, TokenEnd
from supervisor.law.interlock import Reply
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, runs_out_s, step
from supervisor.law.scan import LaserScan
from supervisor.law.sight import mounts_confirmed
from supervisor.law.state import State
from supervisor.messages import (
    CommandStamps,
    ForeignNodes,
    ScanHeaders,
    to_challenge,
    to_command,
    to_odometry,
    to_presence,
    to_scan,
    to_status,
    to_twist,
)
from wire import topics
from wire.bus import Bus
from wire.host.notify import Notifier
from wire.host.pauses import StallMeter, never_suspended
from wire.host.turns import Turns
from wire.lease import CHALLENGE_PERIOD_S
from wire.messages import TriggerResponse, decode_motion, zero_twist
from wire.reasons import StopReason
from wire.runs import Runs
from wire.stamp import Stamp

_log = logging.getLogger(__name__)

COMMAND_DEPTH = 32
"""Commands of one source kept between two steps; only a flood exceeds it, and then the newest are kept."""
ESTOP_DEPTH = 32
STALLED = "the supervisor was stopped meanwhile: reset again in a second"
UNHEARD = frozenset({StopReason.NO_COMMAND, StopReason.COMMAND_STALE, StopReason.COMMAND_TIMEOUT})
"""The stops of a source of which no command was accepted lately; the stamps may show why."""
STATION_STOPS = frozenset({StopReason.ESTOP, StopReason.ESTOP_STATION_LOST})
"""The stops that a station shows."""
RESET_ON_DISK_S = 0.3
"""Maximum time that the reply to a reset waits for the disk."""


class SupervisorService:
    """One supervisor on one Bus.

    Args:
        bus: the bus for all messages.
        config: `[supervisor]`.
        black_box: records every step; None disables recording.
        estop_record: keeps a pressed e-stop across restarts; with None, the robot does not move.
        suspended_s: returns how long the machine was suspended since the last call [s].
        notifier: reports that the loop runs, after each decision; None reports nothing.
        law: the configuration of the law; None: that of `config`, which then describes the base.
        base_record: keeps what motion shows of the robot across restarts; None keeps nothing.
        people: keeps what people did, for the black box; None asks nobody.
    """

    def __init__(
        self,
        bus: Bus,
        config: SupervisorSection,
        black_box: StepRecorder | None = None,
        estop_record: Record | None = None,
        suspended_s: Callable[[], float] = never_suspended,
        notifier: Notifier | None = None,
        law: LawConfig | None = None,
        base_record: BaseRecord | None = None,
        people: People | None = None,
    ) -> None:
        self._bus, self._people = bus, people
        self._notifier = Notifier() if notifier is None else notifier
        self._black_box = black_box
        self._suspended_s = suspended_s
        self._estop_record = MemoryRecord(problem=NO_DISK) if estop_record is None else estop_record
        self._tick_s = 1.0 / config.tick_hz
        self._status_s = 1.0 / config.status_hz
        self._loop = asyncio.get_running_loop()
        self._base_record = base_record
        shown = Shown() if base_record is None else base_record.at_start
        self._state = initial_state(
            law or config.law(),
            estop=self._estop_record.latched_at_start,
            braking=shown.braking,
            mounts_confirmed=shown.mounts_confirmed,
        )
        self._turns = Turns(self._turn, self._has_news)
        self._next_tick_s = 0.0
        self._stall = StallMeter(self._loop.time())
        self._resets: list[asyncio.Future[Reply]] = []
        self._estop_overflowed = self._alive_overflowed = 0
        self._last: Decision | None = None
        self._certificate: Certificate | None = None
        """What the last step has proven about the next one."""
        self._commanded: Velocity | None = None
        """The velocity that was published last."""
        self._is_foresight_wrong = False
        """Whether a step has decided otherwise than foreseen: then every command waits for its step, until a restart."""
        self._published: tuple[object, ...] | None = None
        """The outline of the last published status."""
        self._next_status_s = self._next_challenge_s = 0.0
        self._recording_since_s: float | None = None
        self._record_changed = asyncio.Event()
        self._estop_record.watch(self._on_record)

        # An unchanged command only extends a permission and can wait for the next tick. So can a command of an unknown
        # source, which cannot move the robot.
        self._commands, self._strangers = bus.subscribe_sources(
            [source.name for source in config.sources], depth=COMMAND_DEPTH, wake=self._turns
        )
        self._lidars = [
            (
                bus.subscribe(topics.lidar_scan(lidar.topic), wake=self._turns, per_writer=True),
                config.scan_timeout_of(lidar),
            )
            for lidar in config.all_lidars()
        ]
        self._command_stamps = CommandStamps([source.name for source in config.sources])
        self._scan_headers = ScanHeaders([lidar.name for lidar in config.all_lidars()])
        self._odometry = bus.subscribe(topics.ODOM, per_writer=True)  # read at the next tick: not urgent
        self._estops = bus.subscribe(topics.ESTOP, depth=ESTOP_DEPTH, wake=self._turns)
        stations = config.station_names()
        # Not urgent: a press also comes on `estop`, and the end of a lease has a time of its own (`runs_out_s`).
        self._presences = {
            name: bus.subscribe(topics.estop_presence(name), per_writer=True) for name in stations
        }
        self._challenges = {name: bus.publisher(topics.estop_challenge(name)) for name in stations}
        self._station_of = {topics.estop_node(name): name for name in stations}
        self._alive = bus.watch_alive(self._turns, [*self._commands, *self._station_of, topics.ROS2])
        self._runs = Runs()
        """Of these nodes, to name the one that presses the e-stop."""
        self._pressing = ""
        """Who sent the press that was gathered last; empty: none, or a flood hides it."""
        self._urgent = (
            self._estops,
            self._alive,
            *self._commands.values(),
            *(subscription for subscription, _ in self._lidars),
        )
        self._foreign_tokens = bus.watch_foreign_nodes()  # read at each status: it concerns the display only
        self._foreign_nodes = ForeignNodes()
        self._cmd_vel = bus.publisher(topics.CMD_VEL)
        self._status = bus.publisher(topics.STATUS)
        bus.serve(topics.SUPERVISOR_RESET, self._on_reset)

    async def run(self, stop: asyncio.Event) -> None:
        """Supervise until `stop` is set; then command zero and return."""
        tokens = [self._bus.declare_alive(topics.SUPERVISOR, epoch) for epoch in (b"", self._bus.run_id)]
        self._next_tick_s = self._loop.time()
        try:
            await self._turns.run_until(stop)
        finally:
            self._cmd_vel.put(zero_twist())
            self._notifier.stopping()
            for token in tokens:
                token.withdraw()
            self._estop_record.close()
            if self._base_record is not None:
                self._base_record.close()
            if self._people is not None:
                self._people.close()
            if self._black_box is not None:
                self._black_box.close()

    def _turn(self) -> float:
        """Run a step of the law; return the time of the next one [s]."""
        self._stall.turn(self._loop.time())
        inputs = self._gather()
        now_s = self._loop.time()
        challenge = 0
        if self._challenges and now_s >= self._next_challenge_s:
            self._next_challenge_s = max(self._next_challenge_s + CHALLENGE_PERIOD_S, now_s)
            challenge = secrets.randbits(63) + 1
            inputs = replace(inputs, station_challenge=challenge)
        on_tick = now_s >= self._next_tick_s
        if on_tick:
            self._next_tick_s = max(self._next_tick_s + self._tick_s, now_s)
        early = foreseen(self._certificate, now_s, inputs) if inputs.commands else None
        if early is not None and (on_tick or early != self._commanded):
            self._command(early, now_s)  # before the step, which takes longer than the rest of the turn
        before = self._state
        self._state, decision = step(before, now_s, inputs)
        self._note_people(inputs, before)
        self._publish(decision, now_s, is_due=on_tick and early is None)
        if early is not None and early != decision.output:
            self._distrust(early, decision)
        if challenge:
            self._challenge(decision, challenge)
        if self._base_record is not None:
            self._base_record.keep(Shown(self._state.base.braking, mounts_confirmed(self._state.sight)))
        if self._black_box is not None:
            self._black_box.record(now_s, inputs, before, decision)
        self._certificate = None if self._is_foresight_wrong else certify(self._state, decision)
        self._notifier.running(now_s)  # last: a turn that hangs anywhere reports nothing
        return min(self._next_tick_s, runs_out_s(self._state))

    def _has_news(self) -> bool:
        """Return whether something has arrived that cannot wait for the next tick."""
        return any(not inbox.is_empty for inbox in self._urgent)

    def _gather(self) -> Inputs:
        """Return everything received since the last step."""
        estops = self._estops.take()
        # A flood on this key may hide a press, and an undecodable message may be one: unproven means stop.
        estop = any(e.message is None or e.message.data for e in estops)
        if self._estops.overflowed > self._estop_overflowed:
            self._estop_overflowed = self._estops.overflowed
            estop = True
        commands: list[Command] = []
        for name, subscription in self._commands.items():
            taken = subscription.take()
            self._command_stamps.hear(name, taken)
            commands += [to_command(name, arrival) for arrival in taken]
        changes = self._alive.take()
        for change in changes:
            if change.epoch and change.alive:
                self._runs.token(change.node, change.epoch, exists=True)
        self._pressing = next(
            (self._name_of(e.stamp) for e in estops if e.message is None or e.message.data), ""
        )
        for change in changes:
            if change.epoch and not change.alive:
                self._runs.token(change.node, change.epoch, exists=False)
        liveliness = [
            Liveliness(change.node, change.alive, change.epoch)
            for change in changes
            if change.node in self._commands
        ]
        station_ends = [
            TokenEnd(self._station_of[change.node], change.epoch)
            for change in changes
            if change.node in self._station_of and not change.alive
        ]
        if self._alive.overflowed > self._alive_overflowed:  # a flood of tokens may hide a death
            self._alive_overflowed = self._alive.overflowed
            # It stops every source. The token that is not deleted will not come again, so it counts as back.
            liveliness += [Liveliness(name, alive) for name in self._commands for alive in (False, True)]
            station_ends += [TokenEnd(name) for name in self._presences]
            self._runs = Runs()
        scans: list[LaserScan] = []
        undecodable: list[int] = []
        for place, (subscription, timeout_s) in enumerate(self._lidars):
            arrivals = subscription.take()
            self._scan_headers.hear(place, arrivals)
            heard = [to_scan(arrival, timeout_s, place) for arrival in arrivals]
            scans.extend(scan for scan in heard if scan is not None)
            if arrivals and arrivals[-1].message is None:
                undecodable.append(place)
        motions = self._odometry.take_as(decode_motion)
        odometry = [heard for heard in map(to_odometry, motions) if heard is not None]
        return Inputs(
            commands=tuple(commands),
            liveliness=tuple(liveliness),
            scans=tuple(scans),
            undecodable_lidars=tuple(undecodable),
            odometry=odometry[-1] if odometry else None,
            odometry_writers=tuple(heard.writer for heard in odometry),
            strangers=tuple(self._strangers.take()),
            estop=estop,
            estop_unrecorded=self._is_estop_unrecorded(),
            presences=tuple(self._heard_stations()),
            station_ends=tuple(station_ends),
            reset=bool(self._resets),
            # Evaluated last, so that it covers a suspend while the other inputs were gathered.
            suspended_s=self._suspended_s(),
        )

    def _name_of(self, stamp: Stamp | None) -> str:
        """Return the node whose session has sent a message, for people."""
        names = [] if stamp is None else [node for node, _ in self._runs.of(stamp.gid)]
        name = topics.ROS2 if topics.ROS2 in names else next(iter(names), "another program")
        return self._station_of.get(name, name)

    def _note_people(self, inputs: Inputs, before: State) -> None:
        """Note for people who presses the e-stop and when, until its reset; and who drives, when a run begins or ends."""
        if any(change.epoch for change in inputs.liveliness):
            self._ask_people()
        if self._state.interlock.estop and not before.interlock.estop:
            station = next((one.station for one in inputs.presences if one.stop), "another program")
            when = time.strftime("%Y-%m-%d %H:%M:%S")
            self._estop_record.by = f"{PRESSED} {self._pressing or station}, {when}"
            self._ask_people("e-stop", f"{PRESSED} {self._pressing or station}")
        elif before.interlock.estop and not self._state.interlock.estop:
            self._estop_record.by = ""

    def _ask_people(self, by: str = "", act: str = "") -> None:
        """Keep an act for the black box, unless it is empty, and ask the programs soon what people did."""
        if self._people is not None:
            if act:
                self._people.note(by, act)
            self._people.ask(self._bus, [*self._commands])

    def _is_estop_unrecorded(self) -> bool:
        record = self._estop_record
        # Until a press is recorded, the e-stop itself stops the robot.
        is_pressing = record.is_pending and self._state.interlock.is_estop_latched
        return not is_pressing and record.problem != ""

    def _heard_stations(self) -> Iterator[Presence]:
        for name, subscription in self._presences.items():
            for arrival in subscription.take():
                presence = to_presence(name, arrival)
                if presence is not None:
                    yield presence

    def _challenge(self, decision: Decision, number: int) -> None:
        """Send a challenge to each station, with the response to the newest one of its own."""
        is_stopped = not STATION_STOPS.isdisjoint(decision.causes)
        for station in decision.stations:
            self._challenges[station.config.name].put(to_challenge(station, number, is_stopped=is_stopped))

    def _command(self, velocity: Velocity, now_s: float) -> None:
        self._commanded = velocity
        self._cmd_vel.put(to_twist(velocity), now_s)

    def _distrust(self, early: Velocity, decision: Decision) -> None:
        """Use no certificate any more: one had an error, which the step has corrected."""
        self._is_foresight_wrong = True
        _log.error(
            "certificate: %s m/s, %s rad/s was published, but the step has decided %s m/s, %s rad/s; commands now wait for "
            "their step until a restart: report this with the black box",
            *early,
            *decision.output,
        )

    def _publish(self, decision: Decision, now_s: float, *, is_due: bool) -> None:
        last = self._last
        if is_due or decision.output != self._commanded:
            self._command(decision.output, now_s)
        # After cmd_vel and without waiting: the disk cannot delay the stop.
        self._estop_record.keep(latched=self._state.interlock.is_estop_latched)
        if last is not None and (news := _news_of_stations(last, decision)):
            _log.info("e-stop stations: %s", news)
        if last is None or _outline(decision) != _outline(last):
            _log.info(
                "%s%s%s",
                decision.mode.name,
                f" by {decision.owner}" if decision.owner else "",
                f": {', '.join(decision.reasons)}" if decision.mode is Mode.STOPPED else "",
            )
        self._last = decision
        self._publish_status(decision, now_s)
        if decision.reset_reply is not None:
            for waiting in self._resets:
                if not waiting.done():
                    waiting.set_result(decision.reset_reply)
            self._resets.clear()

    def _publish_status(self, decision: Decision, now_s: float) -> None:
        """Publish a status when it is due, and immediately on a change.

        A press is published once its record survives SIGKILL, and at the latest with the next regular status. A press
        that reaches the disk within a tick is never shown as not recorded.
        """
        record = self._estop_record
        if not record.is_pending:
            self._recording_since_s = None
        elif self._recording_since_s is None:
            self._recording_since_s = now_s
        stations = tuple((station.phase, station.pressed) for station in decision.stations)
        outline = (*_outline(decision), decision.causes, record.problem, stations)
        if now_s < self._next_status_s and outline == self._published:
            return
        since_s = self._recording_since_s
        patience_s = self._tick_s if record.is_marked else self._status_s
        if since_s is not None and now_s - since_s < patience_s and self._published is not None:
            return
        self._published = outline
        # In step with the last one if that was due: ticks come a little late, and the rate must not fall for it.
        due_s = min(self._next_status_s, now_s)
        self._next_status_s = (
            due_s + self._status_s if due_s > now_s - self._tick_s else now_s + self._status_s
        )
        for change in self._foreign_tokens.take():
            self._foreign_nodes.change(change.node, alive=change.alive)
        status = to_status(decision, now_s, record.problem, self._foreign_nodes.names())
        if StopReason.ESTOP in decision.causes and record.by and not self._state.interlock.stations.pressed:
            status.detail = f"{record.by}; {decision.detail}" if decision.detail else record.by
        if decision.causes[:1] == (StopReason.SCAN_STALE,):
            status.detail = self._scan_headers.problem or decision.detail
        if not UNHEARD.isdisjoint(decision.causes[:1]):
            status.detail = self._command_stamps.problem(now_s) or decision.detail
        self._status.put(status)

    async def _on_reset(self, _: str) -> TriggerResponse:
        if self._stall.may_be_old(self._loop.time()):  # its caller may have been informed that it failed
            _log.info("reset: %s", STALLED)
            return TriggerResponse(success=False, message=STALLED)
        waiting: asyncio.Future[Reply] = self._loop.create_future()
        self._resets.append(waiting)
        self._turns.run_now()
        reply = await waiting
        message = reply.message
        if reply.success:
            await self._recorded(RESET_ON_DISK_S)
            problem = self._estop_record.problem
            message += f"; {problem}" if problem else ""
        _log.info("reset: %s", message)
        self._ask_people("reset", message)
        return TriggerResponse(reply.success, message)

    async def _recorded(self, limit_s: float) -> None:
        """Wait at most `limit_s` until the record is written or writing has failed."""
        with suppress(TimeoutError):
            async with asyncio.timeout(limit_s):
                while self._estop_record.is_pending:
                    self._record_changed.clear()
                    await self._record_changed.wait()

    def _on_record(self) -> None:
        """Handle a change of the e-stop record; called on the record's thread."""
        with suppress(RuntimeError):  # the loop has closed
            self._loop.call_soon_threadsafe(self._turns.run_now)
            self._loop.call_soon_threadsafe(self._record_changed.set)


def _news_of_stations(last: Decision, decision: Decision) -> str:
    """Return the stations that are heard again, lost, or have left, as text; empty if there is no such news."""
    return ", ".join(
        f"{station.config.name} {station.phase.name}"
        for was, station in zip(last.stations, decision.stations, strict=True)
        if station.phase is not was.phase
    )


def _outline(decision: Decision) -> tuple[object, ...]:
    """Return the parts of a decision whose change is published immediately."""
    return (decision.mode, decision.reasons, decision.owner, decision.warning, decision.alarm)
