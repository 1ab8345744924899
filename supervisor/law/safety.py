"""The safety law: step(state, now, inputs) -> (state, decision).

Pure: no clock, no I/O, no asyncio, no logging. Time is an argument. The same function runs in the service,
in the tests and in a replay. It is called at every tick, immediately on an event that may stop the robot or bring new
information, and when a permission expires. It never waits.

Unproven means stop. The law in four rules:

1. A *cause* prevents a command source from driving now. It is the source's own (silent, late, lost, invalid) or
   shared by all sources (no valid scan, e-stop, overrun, a base that does not follow).
2. Every cause is *latched* on the source; when the owner stops, its causes are latched on every source. All latches
   of a source clear at a *neutral* command that arrives after the causes ended. A source without latches is *armed*.
3. The armed source of the highest priority that requests motion *owns* the wheels. If it dies, the robot stops;
   control does not pass to the next source.
4. The owner's command passes through the speed barrier (clearance.py).
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter, itemgetter

import numpy as np

from supervisor.law.base_braking import bound_m_s2, measure
from supervisor.law.base_motion import follow, moves, possible_twists
from supervisor.law.clearance import (
    Barrier,
    Block,
    Floats,
    Kind,
    moved,
    nothing_around,
    permitted_scale,
    survey,
)
from supervisor.law.estop_stations import Station, Stations, hear, refusal, suspended
from supervisor.law.estop_stations import detail_of as detail_of_stations
from supervisor.law.explain import detail_of
from supervisor.law.model import (
    Command,
    Counts,
    Decision,
    Inputs,
    LawConfig,
    Liveliness,
    Mode,
    Odometry,
    Past,
    Place,
    Reasons,
    Reply,
    Sight,
    Source,
    State,
    Writer,
)
from supervisor.law.near_memory import Remembered, remember
from supervisor.law.reach import KnownPoints, in_reach
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity, back_then, between, reckon, remembered
from supervisor.law.scan import LaserScan, Lidar, Moment, ScanReading, View, read_scan
from supervisor.law.seen_space import Lookout, hidden_places, lookout
from supervisor.law.stop_rules import RaisedBy, raised_by
from supervisor.law.transition import along, at_least, is_on_another_arc, lags, mixtures
from wire.freshness import FALL_TOLERANCE_S, Verdict, judge
from wire.reasons import SEVERITY, Limit, StopReason

IMPLAUSIBLE_FACTOR = 10.0
"""A command above the limits by more than this factor is invalid; a smaller one is clamped."""

RUNAWAY_GRACE_S = 0.3
"""Grace after the braking time, for the delay of odometry and the residual rocking of the wheels."""

SAME_PLACE_M = 0.15
"""A return within this distance of an earlier one is from the same object; covers a walking person."""

WRITER_WINDOW_S = 0.5
"""A writer that was heard twice within this time is an active publisher; the window is longer for slow lidars."""

REMEMBERED_WRITERS = 8
GID_BYTES = 16
PAST_VIEWS = 10

PRESENT_SHARE = 0.95
"""The base is too fast on its present arc if a smaller share of its velocity is permitted; below 1, because odometry is
noisy."""

TOUCH_M = 0.05
"""If every process above the base dies, the hull comes no closer than this to a stationary object."""

REMEMBERED_STRANGERS = 8

ROUNDING_S = 1e-6
"""Larger than the rounding error of sums and differences of times."""

NONE: Reasons = frozenset()
BARRIER_REASONS = raised_by(RaisedBy.BARRIER)

RELEASED_FACTOR = 5.0
"""Hysteresis: a block ends when the barrier would permit this many times the minimum useful speed; readings are noisy."""


def initial_state(config: LawConfig, *, estop: bool = False) -> State:
    """Return the state at the start: stopped, without any command or scan.

    Args:
        config: the law's configuration.
        estop: whether an earlier e-stop has not been reset.
    """
    sources = tuple(Source(source) for source in sorted(config.sources, key=lambda s: (-s.priority, s.name)))
    stations = Stations(tuple(Station(station) for station in config.estop_stations))
    return State(
        config, sources, sights=tuple(Sight() for _ in config.lidars), estop=estop, stations=stations
    )


def step(state: State, now_s: float, inputs: Inputs) -> tuple[State, Decision]:
    """Process the inputs and decide the velocity of the wheels.

    Args:
        state: the state after the last step.
        now_s: the supervisor's monotonic clock, not before the last step's time.
        inputs: everything received since the last step; arrival times are not after `now_s`.
    """
    state, inputs = _resume(state, now_s, inputs)
    state = _measure(state, inputs)
    state = _observe(state, now_s, inputs)
    usable = _usable(state, now_s)
    state = _seek_hidden(state, usable, moved_on=bool(inputs.scans))
    shared = _shared_causes(state, now_s, inputs, usable)
    state, live = _take_commands(state, now_s, inputs, shared)
    state, reply = _reset(state, inputs, live)
    return _decide(state, now_s, shared, usable, reply)


def runs_out_s(state: State) -> float:
    """Return the time at which the present motion expires if nothing new arrives; infinite while zero is commanded.

    The caller calls `step` at this time, so that the robot stops without waiting for the next tick.
    """
    if state.output == STANDSTILL:
        return math.inf
    owner = _owning(state)
    assert owner is not None  # without an owner, zero is commanded
    config = state.config
    assert state.now_s is not None  # zero is commanded before the first step
    scans_s = [scan.taken_s + config.lidars[place].timeout_s for place, scan in _usable(state, state.now_s)]
    return min(owner.sent_s + config.command_timeout_s, state.stations.expires_s, *scans_s) + ROUNDING_S


# --- inputs and causes that all sources share


def _resume(state: State, now_s: float, inputs: Inputs) -> tuple[State, Inputs]:
    """After a suspend, discard everything received before it: the monotonic clock does not show its true age.

    The inputs of this step may be from before the suspend as well. Older messages still in transit arrive within the
    timeouts. OVERRUN therefore stays a cause for the longest timeout, and only a neutral command after that arms.
    """
    if inputs.suspended_s <= state.config.overrun_s:
        return state, inputs
    for place in range(len(state.sights)):
        state = _keep_shown(state, place)
    sources = tuple(s._replace(sent_s=s.sent_s - inputs.suspended_s) for s in state.sources)
    sights = tuple(s._replace(scan=None) for s in state.sights)
    odometry = state.odometry
    if odometry is not None:  # odometry that was received before the suspend is required again after it
        odometry = replace(odometry, arrival_s=odometry.arrival_s - inputs.suspended_s)
    stations = suspended(state.stations, inputs.suspended_s)
    state = state._replace(
        sources=sources, sights=sights, past=(), odometry=odometry, resumed_s=now_s, stations=stations
    )
    return state, replace(inputs, commands=(), scans=(), odometry=None)


def _measure(state: State, inputs: Inputs) -> State:
    """Measure how the base brakes; what it shows replaces a better configured deceleration everywhere in the law."""
    config, odometry = state.config, inputs.odometry
    if odometry is None or not config.odometry or moves(odometry.velocity, config.believable):
        return state
    v, w = map(abs, odometry.velocity)
    braking = measure(
        state.braking,
        max(v, w * config.hull.radius_m),
        odometry.arrival_s,
        is_driven=state.output != STANDSTILL,
        standing_m_s=config.residual.linear_m_s,
    )
    shown_m_s2 = bound_m_s2(braking)
    if shown_m_s2 != config.shown_m_s2:
        config = replace(config, shown_m_s2=shown_m_s2)
    return state._replace(config=config, braking=braking)


def _observe(state: State, now_s: float, inputs: Inputs) -> State:
    """Process odometry, scans, the e-stop with its stations, and unknown sources."""
    config = state.config
    odometry = state.odometry if inputs.odometry is None or not config.odometry else inputs.odometry
    dt_s = 0.0 if state.now_s is None else now_s - state.now_s
    if odometry is None:  # without odometry, the base is assumed to move as commanded
        odometer = reckon(state.odometer, state.output, now_s, config.believable)
    elif inputs.odometry is not None:
        # A spike counts as zero here; `state.odometry` keeps it for the runaway check.
        odometer = reckon(state.odometer, odometry.velocity, odometry.arrival_s, config.believable)
    else:
        odometer = state.odometer
    is_still = _has_braked(state, now_s) and not moves(odometer.velocity, config.residual)
    measured_m_s = 0.0 if is_still else _hull_speed(odometer.velocity, config)
    odometers = state.odometers
    if odometer is not state.odometer:
        odometers = remembered(odometers, state.odometer, now_s - config.longest_timeout_s)
    odometry_writers = state.odometry_writers
    if config.odometry:
        for gid in inputs.odometry_writers:
            odometry_writers = _heard(odometry_writers, gid, now_s)
    state = state._replace(
        odometry=odometry,
        odometry_writers=odometry_writers,
        odometer=odometer,
        odometers=odometers,
        way_m=state.way_m + dt_s * max(measured_m_s, _hull_speed(state.output, config)),
        following=follow(
            state.following,
            state.output,
            None if odometry is None else odometry.velocity,
            now_s,
            dt_s,
            config.slowest,
            config.trusted,
        ),
        estop=state.estop or _is_pressed(inputs),
        runaway=_runs_away(state, now_s, odometry),
        strangers=tuple(dict.fromkeys((*state.strangers, *inputs.strangers)))[:REMEMBERED_STRANGERS],
    )
    if config.estop_stations:
        stations = hear(
            state.stations, now_s, inputs.presences, inputs.station_ends, inputs.station_challenge
        )
        state = state._replace(stations=stations)
    for place in inputs.undecodable_lidars:
        state = _spoil(state, place)
    for scan in inputs.scans:
        state = _see(state, scan)
    return state


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.estop or any(presence.stop for presence in inputs.presences)


def _spoil(state: State, place: int) -> State:
    """Mark a lidar's newest scan as invalid, because an undecodable message arrived on its key."""
    sight = state.sights[place]
    if sight.scan is None:
        return state
    return _with_sight(state, place, sight._replace(scan=sight.scan._replace(problem="undecodable")))


def _with_sight(state: State, place: int, sight: Sight) -> State:
    return state._replace(sights=_exchanged(state, place, sight))


def _exchanged(state: State, place: int, sight: Sight) -> tuple[Sight, ...]:
    return (*state.sights[:place], sight, *state.sights[place + 1 :])


def _see(state: State, scan: LaserScan) -> State:
    """Process a scan; a scan that is late, replayed or older than the previous one is discarded."""
    config, place = state.config, scan.lidar
    lidar, sight = config.lidars[place], state.sights[place]
    tolerance_s = FALL_TOLERANCE_S if scan.sent_tolerance_s is None else scan.sent_tolerance_s
    track, verdict, on_way_s = judge(
        sight.track,
        scan.sent,
        scan.arrival_s,
        lidar.timeout_s,
        tolerance_s,
        may_return=True,
        trusts_arrival=True,
    )
    before, taken_s = sight.scan, scan.arrival_s - on_way_s - lidar.latency_s
    writers = _heard(sight.writers, scan.writer, scan.arrival_s)
    sight = sight._replace(track=track, counts=sight.counts.add(verdict), writers=writers)
    if verdict is not Verdict.FRESH:
        return _with_sight(state, place, sight)
    period_s = lidar.timeout_s if before is None else min(lidar.timeout_s, max(0.0, taken_s - before.taken_s))
    pose = back_then(state.odometers, state.odometer, taken_s)
    moment = Moment(taken_s, period_s, pose, state.way_m)
    reading = read_scan(
        before, scan, moment, lidar, config.hull, config.reach_m, in_the_open=config.works_in_the_open
    )
    if before is not None and reading.taken_s == before.taken_s:  # it is identical to the previous scan
        return _with_sight(state, place, sight._replace(scan=reading))
    memory = _with_shown(state, before)
    if reading.problem is not None:
        return state._replace(sights=_exchanged(state, place, sight._replace(scan=reading)), memory=memory)
    assert reading.view is not None  # a reading without a problem has one
    memory, earlier = _remember(state, memory, reading.view, lidar)
    return state._replace(
        sights=_exchanged(state, place, sight._replace(scan=reading, earlier=earlier)),
        memory=memory,
        memory_pose=reading.view.pose,
        past=_keep_past(state, lidar, reading.view),
    )


def _heard(writers: tuple[Writer, ...], gid: bytes, arrival_s: float) -> tuple[Writer, ...]:
    """Record that a writer was heard, and return the writers on a sensor's key, the latest first.

    Beyond `REMEMBERED_WRITERS`, writers that were heard only once are dropped first.
    """
    heard_s = next((w.heard_s for w in writers if w.gid == gid), -math.inf)
    others = [w for w in writers if w.gid != gid]
    others.sort(key=attrgetter("before_s"), reverse=True)
    return (Writer(gid, arrival_s, heard_s), *others[: REMEMBERED_WRITERS - 1])


def _keep_shown(state: State, place: int) -> State:
    """Move the returns of a lidar's newest scan to the memory, so that they survive the loss of the scan."""
    sight = state.sights[place]
    if sight.scan is None:
        return state
    kept = sight._replace(scan=sight.scan._replace(around=nothing_around(state.config.hull)))
    return _with_sight(state, place, kept)._replace(memory=_with_shown(state, sight.scan))


def _with_shown(state: State, scan: ScanReading | None) -> Remembered:
    """Return the memory with the returns of a scan added."""
    if scan is None or scan.view is None:
        return state.memory
    shown, pose = scan.around.points, scan.view.pose
    if pose != state.memory_pose:
        shown = moved(shown, between(pose, state.memory_pose))
    points, misses = state.memory
    return Remembered(np.concatenate((points, shown)), np.concatenate((misses, np.zeros(len(shown)))))


def _remember(state: State, shown: Remembered, view: View, lidar: Lidar) -> tuple[Remembered, Floats]:
    """Update the memory with a new view.

    Returns:
        the near points that the view neither replaces nor disproves; and all near points (n, 2) [m] before the
        update, in the base frame of the view.
    """
    config, (points, misses) = state.config, shown
    earlier = moved(points, between(state.memory_pose, view.pose))
    near = np.hypot(earlier[:, 0], earlier[:, 1]) < config.hull.radius_m + config.reach_m
    earlier, misses = earlier[near], misses[near]
    return remember(Remembered(earlier, misses), view, lidar.mount), earlier


def _keep_past(state: State, lidar: Lidar, view: View) -> tuple[Past, ...]:
    """Return the views of the last `unseen_memory_s`, about `PAST_VIEWS` of each lidar."""
    memory_s = state.config.unseen_memory_s
    if memory_s == 0.0:
        return ()
    kept = [p for p in state.past if view.taken_s - p.view.taken_s <= memory_s]
    same = [p for p in kept if p.lidar == lidar.name]
    if not same or view.taken_s - same[-1].view.taken_s >= memory_s / PAST_VIEWS:
        kept.append(Past(lidar.name, view))
    return tuple(kept)


Usable = Sequence[tuple[int, ScanReading]]
"""Pairs of a lidar's index in the configuration and its newest scan."""


def _usable(state: State, now_s: float) -> Usable:
    """Return the newest scans that are valid and not too old, with the indices of their lidars."""
    return [(place, scan) for place, scan in _fresh(state, now_s) if scan.problem is None]


def _fresh(state: State, now_s: float) -> Usable:
    """Return the newest scans that are not too old, valid or not, with the indices of their lidars."""
    return [
        (place, sight.scan)
        for place, sight in enumerate(state.sights)
        if sight.scan is not None and now_s - sight.scan.taken_s <= state.config.lidars[place].timeout_s
    ]


def _seek_hidden(state: State, usable: Usable, *, moved_on: bool) -> State:
    """Update the remembered points and hidden places; a lidar without a usable scan proves no space free."""
    looking = tuple(place for place, _ in usable)
    if not moved_on and looking == state.looking:
        return state
    for place in state.looking:
        state = state if place in looking else _keep_shown(state, place)
    config, places = state.config, list[Place]()
    if len(state.memory.points):
        remembered = survey(config.hull, state.memory.points, Kind.REMEMBERED)
        places.append(Place(state.memory_pose, remembered))
    if usable:
        newest = max((scan.view for _, scan in usable if scan.view is not None), key=attrgetter("taken_s"))
        hidden = np.concatenate([_hidden_from(state, one, usable, newest.pose) for one in usable])
        if len(hidden):
            places.append(Place(newest.pose, survey(config.hull, hidden, Kind.HIDDEN)))
    return state._replace(places=tuple(places), looking=looking)


def _hidden_from(state: State, one: tuple[int, ScanReading], usable: Usable, pose: Pose) -> Floats:
    """Return the hidden places (n, 2) [m] of one lidar that no other view proves free, in the frame of `pose`.

    Each lidar is checked in turn, because the space that no lidar sees borders on the views of several lidars.
    """
    config, (place, scan) = state.config, one
    view = scan.view
    assert view is not None  # a usable scan has one
    others = [other for other in usable if other is not one]
    hidden = hidden_places(
        view,
        config.lidars[place].mount,
        config.hull,
        config.smallest_obstacle_m,
        config.reach_m,
        lambda: _lookouts(state, others, view.pose),
    )
    if view.pose == pose:
        return hidden
    hidden = moved(hidden, between(view.pose, pose))
    return hidden[config.hull.clearance(hidden) > 0.0]  # no object can be inside the hull


def _lookouts(state: State, others: Usable, pose: Pose) -> list[Lookout]:
    """Return the views that may prove one lidar's hidden places free: those of other lidars, and recent ones."""
    lidars = state.config.lidars
    mounts = {lidar.name: lidar.mount for lidar in lidars}
    now = [(lidars[place].mount, scan.view) for place, scan in others]
    past = [(mounts[p.lidar], p.view) for p in state.past]
    return [lookout(view, mount, view.pose, pose) for mount, view in (*now, *past) if view is not None]


def _runs_away(state: State, now_s: float, odometry: Odometry | None) -> bool:
    """Return whether the base still moves although zero has been commanded for longer than braking takes."""
    config = state.config
    if odometry is None:
        return False
    moving = moves(odometry.velocity, Velocity(config.runaway_linear_m_s, config.runaway_angular_rad_s))
    return moving and _has_braked(state, min(now_s, odometry.arrival_s))


def _has_braked(state: State, now_s: float) -> bool:
    """Return whether zero has been commanded for longer than braking takes."""
    config = state.config
    braking_s = config.max_linear_m_s / config.braking_m_s2 + config.base_dead_time_s + RUNAWAY_GRACE_S
    return state.stopped_s is not None and now_s - state.stopped_s > braking_s


def _shared_causes(state: State, now_s: float, inputs: Inputs, usable: Usable) -> Reasons:
    """Return the causes that prevent every source from driving now.

    They are determined before a reset, so an e-stop that is reset is still a cause in the step of the reset.
    """
    config = state.config
    causes: set[StopReason] = set()
    if not usable:
        causes.add(StopReason.SCAN_INVALID if _fresh(state, now_s) else StopReason.SCAN_STALE)
    if _conflicts(state, now_s):
        causes.add(StopReason.SENSOR_CONFLICT)
    late = state.now_s is not None and now_s - state.now_s > config.overrun_s
    if late or now_s - state.resumed_s <= config.longest_timeout_s:
        causes.add(StopReason.OVERRUN)
    if state.odometry is not None and now_s - state.odometry.arrival_s > config.odom_timeout_s:
        causes.add(StopReason.ODOM_STALE)
    if state.following.unresponsive:
        causes.add(StopReason.BASE_UNRESPONSIVE)
    if state.runaway:
        causes.add(StopReason.BASE_RUNAWAY)
    if inputs.estop_unrecorded:
        causes.add(StopReason.ESTOP_UNRECORDED)
    if state.stations.latched or state.stations.missing:
        causes.add(StopReason.ESTOP_STATION_LOST)
    if state.estop:
        causes.add(StopReason.ESTOP)
    return frozenset(causes)


def _conflicts(state: State, now_s: float) -> tuple[str, ...]:
    """Return a text for each sensor with several active writers: its name and theirs."""
    sensors = [
        (lidar.name, state.sights[place].writers, lidar.timeout_s)
        for place, lidar in enumerate(state.config.lidars)
    ]
    sensors.append(("odometry", state.odometry_writers, state.config.odom_timeout_s))
    return tuple(
        f"{name}: {' and '.join(sorted(_name_of(gid) for gid in speaking))}"
        for name, writers, timeout_s in sensors
        if len(speaking := _speaking(writers, timeout_s, now_s)) > 1
    )


def _name_of(gid: bytes) -> str:
    """Return a readable name of a writer: a short hexadecimal gid, or the frame id."""
    return gid.hex()[:8] if len(gid) == GID_BYTES else gid.decode(errors="replace") or "no name"


def _speaking(writers: tuple[Writer, ...], timeout_s: float, now_s: float) -> list[bytes]:
    """Return the active writers on a sensor's key: those heard twice within the window, so not after a stray message."""
    since_s = now_s - max(WRITER_WINDOW_S, 2.5 * timeout_s)
    return [w.gid for w in writers if w.before_s >= since_s]


def _reset(state: State, inputs: Inputs, live: list[Source]) -> tuple[State, Reply | None]:
    """Release the e-stop unless a station prevents it, or a live source requests motion: a reset must not move the robot."""
    if not inputs.reset:
        return state, None
    if not state.is_estop_latched:
        return state, Reply(success=True, message="there was no emergency stop to reset")
    refused = refusal(state.stations)
    if refused is not None:
        return state, Reply(success=False, message=refused)
    if _is_pressed(inputs):
        return state, Reply(success=False, message="the emergency stop is being pressed")
    driving = [s.config.name for s in live if not s.neutral]
    if driving:
        names = ", ".join(driving)
        return state, Reply(success=False, message=f"{names} still requests motion; stop it first")
    state = state._replace(estop=False, stations=state.stations._replace(latched=False))
    return state, Reply(success=True, message="the emergency stop is reset")


# --- the sources


def _take_commands(state: State, now_s: float, inputs: Inputs, shared: Reasons) -> tuple[State, list[Source]]:
    """Process commands and liveliness; update the causes, the latches and the owner.

    When the owner stops, its latches are copied to all sources.

    Returns:
        the new state, and the live sources: those without a cause of their own.
    """
    sources, passing = _hear(state, inputs)
    settled: dict[str, Source] = {}
    live: list[str] = []
    for name, source in sources.items():
        own = _own_causes(source, now_s, state.config)
        if not own:
            live.append(name)
        settled[name] = _latch(source, now_s, shared.union(own, passing.get(name, NONE)), state.config)

    before = _owning(state)
    if before is not None and before.armed and not settled[state.owner].armed:
        stopped = settled[state.owner]
        settled = {name: _share_stop(source, stopped) for name, source in settled.items()}
    alive = [settled[name] for name in live]
    return state._replace(sources=tuple(settled.values()), owner=_owner(state.owner, alive)), alive


def _hear(state: State, inputs: Inputs) -> tuple[dict[str, Source], dict[str, list[StopReason]]]:
    """Process the commands and liveliness changes of each source.

    Returns:
        the sources by name; and by source, the causes that occurred in this step, even if they have ended since.
    """
    sources = {s.config.name: s for s in state.sources}
    passing: dict[str, list[StopReason]] = {}
    for command in inputs.commands:
        if command.source in sources:
            source = _accept(sources[command.source], command, state.config)
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


def _accept(source: Source, command: Command, config: LawConfig) -> Source:
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


def _own_causes(source: Source, now_s: float, config: LawConfig) -> Reasons:
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
    if source.neutral_s > source.caused_s:
        return source._replace(latched=NONE, block=None)
    if (
        source.block is not None
        and source.velocity is not None
        and not source.block.is_approached_by(*_useful(source.velocity, config))
    ):
        return source._replace(latched=source.latched - BARRIER_REASONS, block=None)
    return source


def _share_stop(source: Source, stopped: Source) -> Source:
    """Latch the owner's stop on another source, which must then send neutral before it can drive."""
    return source._replace(latched=source.latched | stopped.latched, caused_s=stopped.caused_s, block=None)


def _owning(state: State) -> Source | None:
    """Return the source that owns the wheels; None before the first owner."""
    return next((s for s in state.sources if s.config.name == state.owner), None)


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


# --- the decision


def _decide(
    state: State, now_s: float, shared: Reasons, usable: Usable, reply: Reply | None
) -> tuple[State, Decision]:
    """Decide the output velocity, with the stop reasons of the owner."""
    config = state.config
    owner = _owning(state)
    reasons = shared | ({StopReason.NO_COMMAND} if owner is None else owner.latched)
    commanded = STANDSTILL if owner is None or owner.velocity is None else owner.velocity
    causes = shared | ({StopReason.NO_COMMAND} if owner is None else _own_causes(owner, now_s, config))
    scale, block, useful, limit = 1.0, None, _useful(commanded, config), None
    if not reasons and commanded != STANDSTILL:
        worth = config.creep_m_s / max(config.creep_m_s, _hull_speed(commanded, config))
        scale, block = _barrier(state, _points_in_reach(state, now_s, usable, useful), useful, worth)
        scale = 0.0 if scale < worth else scale
        if block is not None and _is_confirmed(state, block):
            state = _stop_at(state, now_s, block, _reason_of(block))
            reasons = frozenset({_reason_of(block)})
    elif reasons & BARRIER_REASONS and usable and commanded != STANDSTILL:
        useful_m_s = RELEASED_FACTOR * config.creep_m_s
        worth = useful_m_s / max(useful_m_s, _hull_speed(commanded, config))
        block = _barrier(state, _points_in_reach(state, now_s, usable, useful), useful, worth)[1]
    if block is not None:
        causes |= {_reason_of(block)}
    output = STANDSTILL
    if not reasons and commanded != STANDSTILL:
        assert owner is not None  # without one, there is a reason
        renewed = _renewed(now_s - owner.sent_s, commanded, config)
        if renewed < scale:
            scale, limit = renewed, Limit.COMMAND_AGE
        output = Velocity(scale * commanded.linear_m_s, scale * commanded.angular_rad_s)
    if not reasons and limit is None and config.braking_m_s2 < config.deceleration_m_s2:
        limit = Limit.BASE_WEAK
    since_s = now_s if state.stopped_s is None else state.stopped_s
    stopped_s = since_s if output == STANDSTILL else None
    state = state._replace(now_s=now_s, output=output, stopped_s=stopped_s)
    return state, _explain(state, now_s, reasons, causes, block, limit, commanded, scale, reply)


def _renewed(age_s: float, commanded: Velocity, config: LawConfig) -> float:
    """Return the share of a motion that the age of its command permits; more than one if it permits more.

    The permitted speed falls linearly to zero at the command timeout. Its sum over the ticks until then is at most the blind
    budget: this is how far the robot can drive, or its rim can turn, on a command that was not renewed, without braking.
    """
    if math.isinf(config.blind_budget_m):
        return math.inf
    rim_m_s = abs(commanded.angular_rad_s) * config.hull.radius_m
    speed_m_s = max(config.creep_m_s, abs(commanded.linear_m_s), rim_m_s)
    # An output lasts until the next tick, while the permitted speed falls further: `transport_s` includes a tick.
    timeout_s, tick_s = config.command_timeout_s, config.transport_s
    fresh_m_s = 2.0 * config.blind_budget_m * timeout_s / (timeout_s + tick_s / 2.0) ** 2
    permitted_m_s = max(0.0, fresh_m_s * (1.0 - age_s / timeout_s))
    return permitted_m_s / speed_m_s


def _points_in_reach(state: State, now_s: float, usable: Usable, commanded: Velocity) -> list[KnownPoints]:
    """Return the seen, remembered and hidden points that may limit a twist of the base until it reaches the command."""
    config, fastest_m_s = state.config, _fastest_m_s(state, commanded)
    shown: list[tuple[Place, float, float]] = []
    for _, scan in usable:
        assert scan.view is not None  # a usable scan has one
        age_s = now_s - scan.taken_s
        shown.append((Place(scan.view.pose, scan.around), age_s, age_s + scan.period_s))
    oldest_s = max(age_s for _, age_s, _ in shown)
    latest_s = max(next_s for _, _, next_s in shown)
    shown.extend((place, oldest_s, latest_s) for place in state.places)
    known: list[KnownPoints] = []
    for place, age_s, next_s in shown:
        for barrier in _barriers(config, age_s, next_s, fastest_m_s):
            points = in_reach(place, state.odometer, now_s, barrier, fastest_m_s)
            if points is not None:
                known.append(points)
    return known


def _barriers(config: LawConfig, age_s: float, next_s: float, fastest_m_s: float) -> tuple[Barrier, ...]:
    """Return the bound that keeps the stop distance, and that of a base that gets no further command, if it may be lower.

    A base whose supervisor dies now keeps its speed for its own timeout, and must not touch. At speeds up to V, the second bound
    follows from the first if V times the difference of the reaction times is at most the difference of the distances.

    Args:
        config: the configuration of the law.
        age_s: age of the points.
        next_s: age that they reach before they are seen again.
        fastest_m_s: an upper bound V of the speed of any point of the hull.
    """
    late_s = config.transport_s + config.base_dead_time_s
    decided = Barrier(
        stop_distance_m=config.stop_distance_m,
        deceleration_m_s2=config.braking_m_s2,
        reaction_s=next_s + late_s,
        hidden_creep_m_s=config.blind_creep_m_s,
        dead_time_s=config.base_dead_time_s,
    )
    alone = decided._replace(stop_distance_m=TOUCH_M, reaction_s=age_s + config.base_timeout_s + late_s)
    farther_m = fastest_m_s * (alone.reaction_s - decided.reaction_s)
    return (decided,) if farther_m <= decided.stop_distance_m - TOUCH_M else (decided, alone)


def _fastest_m_s(state: State, commanded: Velocity) -> float:
    """Return an upper bound of the hull's speed under every twist that `_barrier` checks."""
    least, most, measured = state.following.least, state.following.most, state.odometer.velocity
    fastest = Velocity(
        max(map(abs, (commanded.linear_m_s, least.linear_m_s, most.linear_m_s, measured.linear_m_s))),
        max(
            map(
                abs,
                (commanded.angular_rad_s, least.angular_rad_s, most.angular_rad_s, measured.angular_rad_s),
            )
        ),
    )
    return _hull_speed(fastest, state.config)


def _barrier(
    state: State, known: Sequence[KnownPoints], commanded: Velocity, worth: float
) -> tuple[float, Block | None]:
    """Return the permitted share of the commanded twist, and the blocking point if the share is below `worth`.

    A base with another velocity passes through mixtures of both twists. Excess velocity on one axis is therefore
    checked together with the commanded velocity on the other. A base that is faster than permitted along the commanded
    arc drives farther until it has slowed down. A base that is too fast on another arc must brake along that arc first.
    No such check latches a stop, because the base only has to slow down. The base may also reach its command on one axis
    before the other; a point that such a twist closes on does block.
    """
    if not known:
        return 1.0, None
    config, following = state.config, state.following
    scale, block = _permitted(known, commanded, worth)
    measured = None if state.odometry is None else state.odometer.velocity
    twists = possible_twists(following, measured)
    present = max(along(has, commanded, config.hull.radius_m) for has in twists)
    if (present - scale) * _hull_speed(commanded, config) > config.residual.linear_m_s:
        scale = min(scale, _permitted(known, commanded, worth, present)[0])
    for has in twists:
        for mixed in mixtures(has, commanded, config.residual):
            scale = min(scale, _permitted(known, mixed, worth)[0])
        if is_on_another_arc(has, commanded, config.hull.radius_m, config.residual.linear_m_s):
            present, _ = _permitted(known, has, worth)
            scale = 0.0 if present < PRESENT_SHARE else scale
    passed = Velocity(scale * commanded.linear_m_s, scale * commanded.angular_rad_s)
    lagging = lags(following.least if measured is None else measured, passed, config.residual)
    shares = [_permitted(known, twist, worth) for twist in lagging]
    share, blocking = min(shares, key=itemgetter(0), default=(1.0, None))
    return scale * share, block or blocking


def _permitted(
    known: Sequence[KnownPoints], twist: Velocity, worth: float, present: float = 0.0
) -> tuple[float, Block | None]:
    """Return the share of a twist that all points permit, and the blocking point.

    A scan shows where objects were when it was taken. The points are also transformed into the present base frame by
    odometry. The lower of the two shares counts, because odometry may be wrong. The path ahead begins at the
    present pose. `present` is the base's present speed along the twist, as a share of it.
    """
    shares = (
        permitted_scale(s.around, *twist, s.barrier, s.here, worth=worth, present=present) for s in known
    )
    return min(shares, key=itemgetter(0))


def _is_confirmed(state: State, block: Block) -> bool:
    """Return whether the block is confirmed, so that it latches: a hidden place, or a return near an earlier one.

    A single stray return, from dust or rain, stops the robot while it is present, but latches nothing.
    """
    if block.kind is not Kind.SEEN:
        return block.kind is Kind.HIDDEN
    return any(
        bool((np.hypot(s.earlier[:, 0] - block.x_m, s.earlier[:, 1] - block.y_m) < SAME_PLACE_M).any())
        for s in state.sights
    )


def _reason_of(block: Block) -> StopReason:
    return StopReason.SCAN_BLIND if block.kind is Kind.HIDDEN else StopReason.OBSTACLE


def _hull_speed(velocity: Velocity, config: LawConfig) -> float:
    """Return an upper bound of the speed of any point of the hull [m/s]."""
    return abs(velocity.linear_m_s) + abs(velocity.angular_rad_s) * config.hull.radius_m


def _useful(velocity: Velocity, config: LawConfig) -> Velocity:
    """Return the velocity, scaled up to the minimum useful speed if it is slower."""
    return at_least(velocity, config.creep_m_s, config.hull.radius_m)


def _stop_at(state: State, now_s: float, block: Block, reason: StopReason) -> State:
    """Latch the barrier's stop on every source; the owner also keeps the block until a command does not approach it."""
    return state._replace(
        sources=tuple(
            s._replace(
                latched=s.latched | {reason},
                caused_s=now_s,
                block=block if s.config.name == state.owner else None,
            )
            for s in state.sources
        ),
    )


def _explain(
    state: State,
    now_s: float,
    reasons: Reasons,
    causes: Reasons,
    block: Block | None,
    limit: Limit | None,
    commanded: Velocity,
    scale: float,
    reply: Reply | None,
) -> Decision:
    config = state.config
    if reasons:
        mode = Mode.STOPPED
    elif commanded == STANDSTILL:
        mode = Mode.READY
    else:
        mode = Mode.DRIVING if scale == 1.0 else Mode.LIMITED
    scans = [sight.scan for sight in state.sights if sight.scan is not None]
    scan_problem = _problems(state)
    nearest_m, bearing_rad = _nearest(state, scans)
    return Decision(
        mode=mode,
        output=state.output,
        reasons=_by_severity(reasons),
        owner=state.owner,
        commanded=commanded,
        scale=0.0 if reasons else scale,
        nearest_m=nearest_m,
        nearest_bearing_rad=bearing_rad,
        warning=nearest_m < config.warning_distance_m,
        alarm=state.runaway,
        scan_age_s=max((now_s - scan.taken_s for scan in scans), default=math.nan),
        scan_problem=scan_problem,
        scan_counts=_scan_counts(state.sights),
        sources=state.sources,
        strangers=state.strangers,
        reset_reply=reply,
        causes=_by_severity(causes),
        latched=_by_severity(reasons - causes),
        limit=limit,
        detail=detail_of(
            causes,
            limit,
            is_too_fast=limit is Limit.COMMAND_AGE and _renewed(0.0, commanded, config) < 1.0,
            scan_problem=scan_problem,
            block_bearing_rad=math.nan if block is None else math.atan2(block.y_m, block.x_m),
            writers=_conflicts(state, now_s) if StopReason.SENSOR_CONFLICT in causes else (),
            stations=detail_of_stations(state.stations),
            braking_m_s2=(config.braking_m_s2, config.deceleration_m_s2),
        ),
        stations=state.stations.stations,
    )


def _nearest(state: State, scans: list[ScanReading]) -> tuple[float, float]:
    """Return clearance [m] and bearing [rad] of the nearest seen or remembered point; NaN without a valid scan."""
    found = [(scan.nearest_m, scan.nearest_bearing_rad) for scan in scans if scan.problem is None]
    if not found:
        return math.nan, math.nan
    found.extend(place.around.nearest() for place in state.places if place.around.kind is Kind.REMEMBERED)
    return min(found)


def _scan_counts(sights: tuple[Sight, ...]) -> Counts:
    if len(sights) == 1:
        return sights[0].counts
    return Counts(*np.array([sight.counts for sight in sights]).sum(axis=0).tolist())


def _problems(state: State) -> str:
    """Return why the newest scans prove nothing; with several lidars, each problem follows the lidar's name."""
    problems = [
        (state.config.lidars[place].name, sight.scan.problem)
        for place, sight in enumerate(state.sights)
        if sight.scan is not None and sight.scan.problem is not None
    ]
    alone = len(state.sights) == 1
    return "; ".join(problem if alone else f"{name}: {problem}" for name, problem in problems)


def _by_severity(reasons: Reasons) -> tuple[StopReason, ...]:
    return tuple(sorted(reasons, key=SEVERITY.__getitem__))
