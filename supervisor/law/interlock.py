"""The restart interlock: the command sources, their latches, the owner of the wheels, and the e-stop.

The functions of `Interlock` are called in this order at each step: `press`, `causes`, `take_commands`, `reset`; then `stop_at`,
if the barrier stops the owner.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from supervisor.law.clearance import Block
from supervisor.law.estop_stations import Station, Stations, hear, refusal
from supervisor.law.estop_stations import suspended as suspended_stations
from supervisor.law.model import Command, Counts, Inputs, LawConfig, Liveliness, Reasons, SourceConfig
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.stop_rules import RaisedBy, raised_by
from wire.freshness import Track, Verdict, judge
from wire.reasons import StopReason

IMPLAUSIBLE_FACTOR = 10.0
"""A command above the limits by more than this factor is invalid; a smaller one is clamped."""

REMEMBERED_STRANGERS = 8

NONE: Reasons = frozenset()
BARRIER_REASONS = raised_by(RaisedBy.BARRIER)


class Source(NamedTuple):
    """State of one command source."""

    config: SourceConfig
    track: Track = Track()
    velocity: Velocity | None = None
    """Its last accepted command, clamped to the limits; None before the first, and after the source left while neutral."""
    sent_s: float = -math.inf
    """When that command was sent, by the local clock: arrival time minus transport time."""
    neutral_s: float = -math.inf
    """When its last accepted neutral command was sent, as `sent_s`: one that waited for this process came before the stop ended."""
    refused_s: float = -math.inf
    """When one of its commands was last refused as not fresh."""
    stamped: bool = False
    alive: bool | None = None
    """Whether its liveliness token exists; None if it never had one."""
    lost: bool = False
    """Whether the token of the run whose commands arrived last was deleted, and is not back."""
    invalid: bool = False
    """Whether its last command was invalid."""
    latched: Reasons = frozenset({StopReason.NO_COMMAND})
    """Latched stop reasons; the source is armed if there are none."""
    caused_s: float = -math.inf
    """Time of the last step at which a cause prevented it from driving; only a later neutral arms it."""
    block: Block | None = None
    """The point that it was approaching when the barrier latched a stop."""
    counts: Counts = Counts()

    @property
    def armed(self) -> bool:
        return not self.latched

    @property
    def neutral(self) -> bool:
        return self.velocity is None or self.velocity == STANDSTILL


class Interlock(NamedTuple):
    """State of the command sources and of the e-stop."""

    sources: tuple[Source, ...]
    """In order of their priority, the highest first."""
    owner: str = ""
    """Name of the source that owns the wheels; empty before the first."""
    estop: bool = False
    stations: Stations = Stations()
    """The leases of the e-stop stations."""
    strangers: tuple[str, ...] = ()
    """Sources that sent commands but are not configured."""

    @property
    def is_estop_latched(self) -> bool:
        """Whether only a reset permits motion again."""
        return self.estop or self.stations.latched

    @property
    def owning(self) -> Source | None:
        """The source that owns the wheels; None before the first owner."""
        return next((s for s in self.sources if s.config.name == self.owner), None)


class Reply(NamedTuple):
    """The answer to a reset."""

    success: bool
    message: str


def initial(config: LawConfig, *, estop: bool) -> Interlock:
    """Return the state at the start: each source has to send a first, neutral command."""
    sources = tuple(Source(source) for source in sorted(config.sources, key=lambda s: (-s.priority, s.name)))
    stations = Stations(tuple(Station(station) for station in config.estop_stations))
    return Interlock(sources, estop=estop, stations=stations)


def suspended(interlock: Interlock, suspended_s: float) -> Interlock:
    """Return the state after a suspend of the machine, in which the clock stood still: commands and leases are older."""
    sources = tuple(s._replace(sent_s=s.sent_s - suspended_s) for s in interlock.sources)
    return interlock._replace(sources=sources, stations=suspended_stations(interlock.stations, suspended_s))


def press(interlock: Interlock, config: LawConfig, now_s: float, inputs: Inputs) -> Interlock:
    """Process the e-stop with its stations, and unknown sources."""
    stations = interlock.stations
    if config.estop_stations:
        stations = hear(stations, now_s, inputs.presences, inputs.station_ends, inputs.station_challenge)
    return interlock._replace(
        estop=interlock.estop or _is_pressed(inputs),
        stations=stations,
        strangers=tuple(dict.fromkeys((*interlock.strangers, *inputs.strangers)))[:REMEMBERED_STRANGERS],
    )


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.estop or any(presence.stop for presence in inputs.presences)


def causes(interlock: Interlock, inputs: Inputs) -> Iterator[StopReason]:
    """Yield the causes of the e-stop that prevent every source from driving now."""
    if inputs.estop_unrecorded:
        yield StopReason.ESTOP_UNRECORDED
    if interlock.stations.latched or interlock.stations.missing:
        yield StopReason.ESTOP_STATION_LOST
    if interlock.estop:
        yield StopReason.ESTOP


def take_commands(
    interlock: Interlock, config: LawConfig, now_s: float, inputs: Inputs, shared: Reasons
) -> tuple[Interlock, list[Source]]:
    """Process commands and liveliness; update the causes, the latches and the owner.

    When the owner stops, its latches are copied to all sources.

    Args:
        interlock: the state after the last step.
        config: the configuration of the law.
        now_s: the present time.
        inputs: everything received since the last step.
        shared: the causes that prevent every source from driving now.

    Returns:
        the new state, and the live sources: those without a cause of their own.
    """
    sources, passing = _hear(interlock.sources, config, inputs)
    settled: dict[str, Source] = {}
    live: list[str] = []
    for name, source in sources.items():
        own = own_causes(source, now_s, config)
        if not own:
            live.append(name)
        settled[name] = _latch(source, now_s, shared.union(own, passing.get(name, NONE)), config)

    before = interlock.owning
    if before is not None and before.armed and not settled[interlock.owner].armed:
        stopped = settled[interlock.owner]
        settled = {name: _share_stop(source, stopped) for name, source in settled.items()}
    alive = [settled[name] for name in live]
    owner = _owner(interlock.owner, alive)
    return interlock._replace(sources=tuple(settled.values()), owner=owner), alive


def _hear(
    before: tuple[Source, ...], config: LawConfig, inputs: Inputs
) -> tuple[dict[str, Source], dict[str, list[StopReason]]]:
    """Process the commands and liveliness changes of each source.

    Returns:
        the sources by name; and by source, the causes that occurred in this step, even if they have ended since.
    """
    sources = {s.config.name: s for s in before}
    passing: dict[str, list[StopReason]] = {}
    for command in inputs.commands:
        if command.source in sources:
            source = accept(sources[command.source], command, config)
            sources[command.source] = source
            if source.invalid:
                passing.setdefault(command.source, []).append(StopReason.COMMAND_INVALID)
    for change in inputs.liveliness:  # after the commands, because a source sends zero before it leaves
        if change.source in sources:
            source, is_end = _mark_alive(sources[change.source], change)
            if is_end:
                if source.neutral and not source.invalid:
                    source = source._replace(velocity=None)
                else:
                    passing.setdefault(change.source, []).append(StopReason.SOURCE_LOST)
            sources[change.source] = source
    return sources, passing


def _mark_alive(source: Source, change: Liveliness) -> tuple[Source, bool]:
    """Remember a change of a token; return also whether it ends the source.

    The source's token may be held by others as well, and then outlives it. The token of the run that commands ends with
    it; the tokens of other runs prove nothing about it.
    """
    if not change.epoch:
        return source._replace(alive=change.alive), not change.alive
    if not _commands(source, change.epoch):
        return source, False
    return source._replace(lost=not change.alive), not change.alive


def _commands(source: Source, epoch: bytes) -> bool:
    """Return whether the newest commands of a source are from this epoch."""
    return source.track.last is not None and source.track.last.epoch == epoch


def accept(source: Source, command: Command, config: LawConfig) -> Source:
    """Process one command; a refused command does not refresh the age of the last accepted one."""
    stamped, velocity = command.sent is not None, _plausible(command.velocity, config)
    if velocity is None:
        counts = source.counts._replace(invalid=source.counts.invalid + 1)
        return source._replace(stamped=stamped, invalid=True, counts=counts)
    track, verdict, on_way_s = judge(source.track, command.sent, command.arrival_s, config.command_timeout_s)
    if track.last is not None and not _commands(source, track.last.epoch):
        source = source._replace(lost=False)  # another run commands now
    stamped, counts = stamped or (verdict is Verdict.EPOCH and source.stamped), source.counts.add(verdict)
    if verdict is not Verdict.FRESH:
        refused_s = source.refused_s if verdict is Verdict.UNPROVEN else command.arrival_s
        return source._replace(stamped=stamped, track=track, counts=counts, refused_s=refused_s)
    sent_s = command.arrival_s - on_way_s
    return source._replace(
        stamped=stamped,
        track=track,
        counts=counts,
        velocity=velocity,
        sent_s=sent_s,
        neutral_s=sent_s if velocity == STANDSTILL else source.neutral_s,
        invalid=False,
    )


def _plausible(velocity: Velocity | None, config: LawConfig) -> Velocity | None:
    """Return the velocity clamped to the limits; None if it is missing, not finite or implausibly large."""
    if velocity is None or not (math.isfinite(velocity.linear_m_s) and math.isfinite(velocity.angular_rad_s)):
        return None
    if (
        abs(velocity.linear_m_s) > IMPLAUSIBLE_FACTOR * config.max_linear_m_s
        or abs(velocity.angular_rad_s) > IMPLAUSIBLE_FACTOR * config.max_angular_rad_s
    ):
        return None
    return Velocity(
        _clamp(velocity.linear_m_s, config.max_linear_m_s),
        _clamp(velocity.angular_rad_s, config.max_angular_rad_s),
    )


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def own_causes(source: Source, now_s: float, config: LawConfig) -> Reasons:
    """Return the causes that prevent this source alone from driving now."""
    causes: set[StopReason] = set()
    if (source.alive is False or source.lost) and source.velocity is not None:
        causes.add(StopReason.SOURCE_LOST)
    if source.invalid:
        causes.add(StopReason.COMMAND_INVALID)
    if source.velocity is None:
        causes.add(StopReason.NO_COMMAND)
    elif now_s - source.sent_s > config.command_timeout_s:
        refused_lately = now_s - source.refused_s <= config.command_timeout_s
        causes.add(StopReason.COMMAND_STALE if refused_lately else StopReason.COMMAND_TIMEOUT)
    return frozenset(causes)


def _latch(source: Source, now_s: float, causes: Reasons, config: LawConfig) -> Source:
    """Latch the causes; without causes, clear all latches if a neutral command arrived after the last cause."""
    if causes:
        return source._replace(latched=source.latched | causes, caused_s=now_s)
    if source.armed:
        return source
    if source.neutral_s > source.caused_s:
        return source._replace(latched=NONE, block=None)
    if (
        source.block is not None
        and source.velocity is not None
        and not source.block.is_approached_by(*config.useful(source.velocity))
    ):
        return source._replace(latched=source.latched - BARRIER_REASONS, block=None)
    return source


def _share_stop(source: Source, stopped: Source) -> Source:
    """Latch the owner's stop on another source, which must then send neutral before it can drive."""
    return source._replace(latched=source.latched | stopped.latched, caused_s=stopped.caused_s, block=None)


def reset(interlock: Interlock, inputs: Inputs, live: list[Source]) -> tuple[Interlock, Reply | None]:
    """Release the e-stop unless a station prevents it, or a live source requests motion: a reset must not move the robot."""
    if not inputs.reset:
        return interlock, None
    if not interlock.is_estop_latched:
        return interlock, Reply(success=True, message="there was no emergency stop to reset")
    refused = refusal(interlock.stations)
    if refused is not None:
        return interlock, Reply(success=False, message=refused)
    if _is_pressed(inputs):
        return interlock, Reply(success=False, message="the emergency stop is being pressed")
    driving = [s.config.name for s in live if not s.neutral]
    if driving:
        names = ", ".join(driving)
        return interlock, Reply(success=False, message=f"{names} still requests motion; stop it first")
    interlock = interlock._replace(estop=False, stations=interlock.stations._replace(latched=False))
    return interlock, Reply(success=True, message="the emergency stop is reset")


def _owner(owner: str, live: list[Source]) -> str:
    """Return the name of the owner: the armed source of the highest priority that requests motion.

    A neutral or dead owner stays until another live source requests motion, so that the status explains its stop.
    """
    asking = [s for s in live if not s.neutral]
    if asking:
        return max(asking, key=lambda s: (s.armed, s.config.priority, s.config.name)).config.name
    if live and all(s.config.name != owner for s in live):
        return live[0].config.name
    return owner


def stop_at(interlock: Interlock, now_s: float, block: Block, reason: StopReason) -> Interlock:
    """Latch the barrier's stop on every source; the owner also keeps the block until a command does not approach it."""
    return interlock._replace(
        sources=tuple(
            s._replace(
                latched=s.latched | {reason},
                caused_s=now_s,
                block=block if s.config.name == interlock.owner else None,
            )
            for s in interlock.sources
        ),
    )
