"""The safety law: step(state, now, inputs) -> (state, decision).

Pure: no clock, no I/O, no asyncio, no logging. Time is an argument. The same function runs in the service,
in the tests and in a replay. It is called at every tick, at once on each event, and when a permission runs out;
it never waits.

Unproven means stop. The law in four sentences:

1. A *cause* is what keeps a source from driving now: its own (silent, late, lost, invalid) or everybody's
   (no valid scan, e-stop, overrun, a base that runs away).
2. Every cause is *latched* on the source, and when the owner stops, on every source; all latches fall at a
   neutral command that arrives after the causes went. A source without latches is *armed*.
3. The armed source of the highest priority that asks for motion *owns* the wheels; if it dies, the robot
   stops: nobody inherits.
4. What the owner asks for passes through the speed barrier (clearance.py).
"""

import math
from dataclasses import replace

from supervisor.clearance import Barrier, Block, moved, permitted_scale
from supervisor.model import (
    SEVERITY,
    Command,
    Decision,
    Inputs,
    LaserScan,
    LawConfig,
    Mode,
    Odometry,
    Reasons,
    Reply,
    Source,
    State,
    StopReason,
)
from supervisor.reckoning import STANDSTILL, Odometer, Velocity, displacement, reckon, where
from supervisor.scan import ScanReading, continue_reading, read_scan
from wire.freshness import FALL_TOLERANCE_S, Verdict, judge

IMPLAUSIBLE_FACTOR = 10.0
"""A command this many times beyond the limits is not eager but broken."""

RUNAWAY_GRACE_S = 0.3
"""Beyond the braking time: odometry's own way here, and a wheel's last rocking."""

BELIEVABLE_FACTOR = 2.0
"""Odometry beyond this many times the limits is a spike."""

REMEMBERED_STRANGERS = 8

ROUNDING_S = 1e-6
"""More than what sums and differences of times are rounded by."""

NONE: Reasons = frozenset()
BARRIER_REASONS: Reasons = frozenset({StopReason.OBSTACLE, StopReason.SCAN_BLIND})


def initial_state(config: LawConfig, *, estop: bool = False) -> State:
    """Stopped: nobody has spoken, nothing has been seen.

    Args:
        config: the numbers of the law.
        estop: whether an e-stop was pressed before and not reset.
    """
    sources = tuple(Source(source) for source in sorted(config.sources, key=lambda s: (-s.priority, s.name)))
    return State(config, sources, estop=estop)


def step(state: State, now_s: float, inputs: Inputs) -> tuple[State, Decision]:
    """Take in what came, and decide what goes to the wheels.

    Args:
        state: what was remembered after the last step.
        now_s: the supervisor's monotonic clock, never before the last step's.
        inputs: what came since; arrivals are not after `now_s`.
    """
    state, inputs = _resume(state, now_s, inputs)
    state = _observe(state, now_s, inputs)
    shared = _shared_causes(state, now_s)
    state, live = _take_commands(state, now_s, inputs, shared)
    state, reply = _reset(state, inputs, live)
    return _decide(state, now_s, shared, reply)


def runs_out_s(state: State) -> float:
    """When the present motion is no longer permitted if nothing new comes, by age; infinite while nothing moves.

    Whoever calls `step` then need not wait for a tick in order to stop.
    """
    if state.output == STANDSTILL:
        return math.inf
    owner = _owning(state)
    assert owner is not None  # nothing moves without one,
    assert state.scan is not None  # nor without the other
    config = state.config
    last_s = min(owner.sent_s + config.command_timeout_s, state.scan.taken_s + config.scan_timeout_s)
    return last_s + ROUNDING_S


# --- what everybody shares


def _resume(state: State, now_s: float, inputs: Inputs) -> tuple[State, Inputs]:
    """After a suspend, forget what was heard before it, however fresh it looks by the monotonic clock.

    What came with this step may be from before as well. What is still on its way comes within the timeouts, for which
    OVERRUN stays a cause: only a neutral command that arrives after that arms.
    """
    if inputs.suspended_s <= state.config.overrun_s:
        return state, inputs
    sources = tuple(s._replace(sent_s=s.sent_s - inputs.suspended_s) for s in state.sources)
    state = state._replace(sources=sources, scan=None, odometry=None, resumed_s=now_s)
    return state, replace(inputs, commands=(), scan=None, undecodable_scan=False, odometry=None)


def _observe(state: State, now_s: float, inputs: Inputs) -> State:
    """Take in odometry, scan, e-stop, and who else speaks."""
    odometer = state.odometer if inputs.odometry is None else _move(state, inputs.odometry)
    odometry = state.odometry if inputs.odometry is None else inputs.odometry
    if inputs.scan is not None:
        state = _see(state, inputs.scan, odometer)
    elif inputs.undecodable_scan and state.scan is not None:
        state = state._replace(scan=state.scan._replace(problem="undecodable"))
    strangers = dict.fromkeys((*state.strangers, *inputs.strangers))
    return state._replace(
        odometry=odometry,
        odometer=odometer,
        estop=state.estop or inputs.estop,
        runaway=_runs_away(state, now_s, odometry),
        strangers=tuple(strangers)[:REMEMBERED_STRANGERS],
    )


def _move(state: State, odometry: Odometry) -> Odometer:
    """Reckon with odometry. A spike is no motion there, but it stays to be seen as one."""
    config = state.config
    fastest = Velocity(
        BELIEVABLE_FACTOR * config.max_linear_m_s, BELIEVABLE_FACTOR * config.max_angular_rad_s
    )
    return reckon(state.odometer, odometry.velocity, odometry.arrival_s, fastest)


def _see(state: State, scan: LaserScan, odometer: Odometer) -> State:
    """Take in a scan; one that is late, replayed or older than the one before counts as none."""
    config = state.config
    tolerance_s = FALL_TOLERANCE_S if scan.sent_tolerance_s is None else scan.sent_tolerance_s
    track, verdict, on_way_s = judge(
        state.scan_track, scan.sent, scan.arrival_s, config.scan_timeout_s, tolerance_s, may_return=True
    )
    counts = state.scan_counts.add(verdict)
    if verdict is not Verdict.FRESH:
        return state._replace(scan_track=track, scan_counts=counts)
    surroundings, problem, return_share = read_scan(
        scan.ranges,
        angle_min=scan.angle_min,
        angle_max=scan.angle_max,
        angle_increment=scan.angle_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        mount=config.mount,
        profile=config.profile,
        hull=config.hull,
        stop_distance_m=config.stop_distance_m,
        min_beams=config.min_beams,
        min_valid_share=config.min_valid_share,
    )
    taken_s = scan.arrival_s - on_way_s
    period_s = config.scan_timeout_s
    if state.scan is not None:
        period_s = min(period_s, max(0.0, taken_s - state.scan.taken_s))
    travelled_m = odometer.travelled_m + config.hull.radius_m * odometer.turned_rad
    reading = ScanReading(taken_s, period_s, surroundings, problem, scan.ranges, 0, travelled_m, return_share)
    return state._replace(
        scan=continue_reading(state.scan, reading),
        scan_track=track,
        scan_counts=counts,
        scan_pose=where(odometer, taken_s),
    )


def _runs_away(state: State, now_s: float, odometry: Odometry | None) -> bool:
    """Zero has been commanded for longer than braking takes, and the base still moves."""
    config = state.config
    if odometry is None or state.stopped_s is None:
        return False
    moving = (
        abs(odometry.velocity.linear_m_s) > config.runaway_linear_m_s
        or abs(odometry.velocity.angular_rad_s) > config.runaway_angular_rad_s
    )
    braking_s = config.max_linear_m_s / config.deceleration_m_s2 + RUNAWAY_GRACE_S
    return moving and min(now_s, odometry.arrival_s) - state.stopped_s > braking_s


def _shared_causes(state: State, now_s: float) -> Reasons:
    """What keeps every source from driving now. Taken before a reset: what it releases is a cause once more."""
    causes: set[StopReason] = set()
    if state.scan is None or now_s - state.scan.taken_s > state.config.scan_timeout_s:
        causes.add(StopReason.SCAN_STALE)
    elif state.scan.problem is not None:
        causes.add(StopReason.SCAN_INVALID)
    late = state.now_s is not None and now_s - state.now_s > state.config.overrun_s
    if late or now_s - state.resumed_s <= max(state.config.command_timeout_s, state.config.scan_timeout_s):
        causes.add(StopReason.OVERRUN)
    if state.runaway:
        causes.add(StopReason.BASE_RUNAWAY)
    if state.estop:
        causes.add(StopReason.ESTOP)
    return frozenset(causes)


def _reset(state: State, inputs: Inputs, live: list[Source]) -> tuple[State, Reply | None]:
    """Release the e-stop, if nobody would drive off: a reset moves nothing."""
    if not inputs.reset:
        return state, None
    if not state.estop:
        return state, Reply(success=True, message="there was no emergency stop to reset")
    if inputs.estop:
        return state, Reply(success=False, message="refused: the emergency stop is being pressed")
    driving = [s.config.name for s in live if not s.neutral]
    if driving:
        names = ", ".join(driving)
        return state, Reply(success=False, message=f"refused: {names} still asks for motion; stop it first")
    return state._replace(estop=False), Reply(success=True, message="the emergency stop is reset")


# --- the sources


def _take_commands(state: State, now_s: float, inputs: Inputs, shared: Reasons) -> tuple[State, list[Source]]:
    """Every source's commands, causes and latches; when the owner stops, everybody's latches; who owns now.

    Beside the state: the live sources, those without a cause of their own.
    """
    sources, passing = _hear(state, inputs)
    settled: dict[str, Source] = {}
    live: list[str] = []
    for name, source in sources.items():
        own = _own_causes(source, now_s, state.config)
        if not own:
            live.append(name)
        settled[name] = _latch(source, now_s, shared.union(own, passing.get(name, NONE)))

    before = _owning(state)
    if before is not None and before.armed and not settled[state.owner].armed:
        stopped = settled[state.owner]
        settled = {name: _share_stop(source, stopped) for name, source in settled.items()}
    alive = [settled[name] for name in live]
    return state._replace(sources=tuple(settled.values()), owner=_owner(state.owner, alive)), alive


def _hear(state: State, inputs: Inputs) -> tuple[dict[str, Source], dict[str, list[StopReason]]]:
    """What came from each source, and which causes came with it: what is mended within the same step was there."""
    sources = {s.config.name: s for s in state.sources}
    passing: dict[str, list[StopReason]] = {}
    for change in inputs.liveliness:
        if change.source in sources:
            sources[change.source] = sources[change.source]._replace(alive=change.alive)
            if not change.alive:
                passing.setdefault(change.source, []).append(StopReason.SOURCE_LOST)
    for command in inputs.commands:
        if command.source in sources:
            source = _accept(sources[command.source], command, state.config)
            sources[command.source] = source
            if source.invalid:
                passing.setdefault(command.source, []).append(StopReason.COMMAND_INVALID)
    return sources, passing


def _accept(source: Source, command: Command, config: LawConfig) -> Source:
    """Take note of a command: a refused one never refreshes the age of the last good one."""
    stamped, velocity = command.sent is not None, _plausible(command.velocity, config)
    if velocity is None:
        counts = source.counts._replace(invalid=source.counts.invalid + 1)
        return source._replace(stamped=stamped, invalid=True, counts=counts)
    track, verdict, on_way_s = judge(source.track, command.sent, command.arrival_s, config.command_timeout_s)
    stamped = stamped or (verdict is Verdict.EPOCH and source.stamped)
    source = source._replace(stamped=stamped, track=track, counts=source.counts.add(verdict))
    if verdict is Verdict.UNPROVEN:
        return source
    if verdict is not Verdict.FRESH:
        return source._replace(refused_s=command.arrival_s)
    return source._replace(
        velocity=velocity,
        sent_s=command.arrival_s - on_way_s,
        neutral_s=command.arrival_s if velocity == STANDSTILL else source.neutral_s,
        invalid=False,
    )


def _plausible(velocity: Velocity | None, config: LawConfig) -> Velocity | None:
    """The command clamped to the limits; None where it is no command at all."""
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
    """What keeps this source alone from driving now."""
    causes: set[StopReason] = set()
    if source.alive is False:
        causes.add(StopReason.SOURCE_LOST)
    if source.invalid:
        causes.add(StopReason.COMMAND_INVALID)
    if source.velocity is None:
        causes.add(StopReason.NO_COMMAND)
    elif now_s - source.sent_s > config.command_timeout_s:
        refused_lately = now_s - source.refused_s <= config.command_timeout_s
        causes.add(StopReason.COMMAND_STALE if refused_lately else StopReason.COMMAND_TIMEOUT)
    return frozenset(causes)


def _latch(source: Source, now_s: float, causes: Reasons) -> Source:
    """Latch the causes; without any, a neutral that came after the last of them lets all latches fall."""
    if causes:
        return source._replace(latched=source.latched | causes, caused_s=now_s)
    if source.neutral_s > source.caused_s:
        return source._replace(latched=NONE, block=None)
    if (
        source.block is not None
        and source.velocity is not None
        and not source.block.is_approached_by(*source.velocity)
    ):
        return source._replace(latched=source.latched - BARRIER_REASONS, block=None)
    return source


def _share_stop(source: Source, stopped: Source) -> Source:
    """When the owner stops, nobody else may drive on, not even elsewhere, without being neutral first."""
    return source._replace(latched=source.latched | stopped.latched, caused_s=stopped.caused_s, block=None)


def _owning(state: State) -> Source | None:
    """The source that has the say; None: nobody had it yet."""
    return next((s for s in state.sources if s.config.name == state.owner), None)


def _owner(owner: str, live: list[Source]) -> str:
    """Who has the say: the armed source of the highest priority that asks for motion.

    A neutral or dead owner stays until another live source asks, so that the status explains its stop.
    """
    asking = [s for s in live if not s.neutral]
    if asking:
        return max(asking, key=lambda s: (s.armed, s.config.priority, s.config.name)).config.name
    if live and all(s.config.name != owner for s in live):
        return live[0].config.name
    return owner


# --- the decision


def _decide(state: State, now_s: float, shared: Reasons, reply: Reply | None) -> tuple[State, Decision]:
    """What the owner may do now."""
    config = state.config
    owner = _owning(state)
    reasons = shared | ({StopReason.NO_COMMAND} if owner is None else owner.latched)
    commanded = STANDSTILL if owner is None or owner.velocity is None else owner.velocity
    scale, block = 1.0, None
    if not reasons and owner is not None and commanded != STANDSTILL:
        worth = config.creep_m_s / max(config.creep_m_s, _hull_speed(commanded, config))
        scale, block = _barrier(state, now_s, commanded, worth)
        if block is not None:
            reason = StopReason.SCAN_BLIND if block.blind else StopReason.OBSTACLE
            state = _stop_at(state, now_s, block, reason)
            reasons = frozenset({reason})
    output = STANDSTILL
    if not reasons:
        output = Velocity(scale * commanded.linear_m_s, scale * commanded.angular_rad_s)
    since_s = now_s if state.stopped_s is None else state.stopped_s
    stopped_s = since_s if output == STANDSTILL else None
    state = state._replace(now_s=now_s, output=output, stopped_s=stopped_s)
    return state, _explain(state, now_s, reasons, commanded, scale, reply)


def _barrier(state: State, now_s: float, commanded: Velocity, worth: float) -> tuple[float, Block | None]:
    """The share of the commanded twist that the surroundings permit, and what blocks if that is below `worth`.

    The scan shows where things were when it was taken. They are also looked at from where odometry says
    that the robot is by now, and the more cautious of the two counts: odometry may be wrong. The way ahead
    on an arc begins where the robot is by now.
    """
    config, scan = state.config, state.scan
    assert scan is not None  # without one nothing gets here: it is a stop
    barrier = Barrier(
        stop_distance_m=config.stop_distance_m,
        deceleration_m_s2=config.deceleration_m_s2,
        reaction_s=now_s - scan.taken_s + scan.period_s + config.transport_s,
        blind_creep_m_s=config.blind_creep_m_s,
    )
    way = displacement(state.odometer, state.scan_pose, now_s)
    here = None if way is None else moved(scan.surroundings, way)
    return permitted_scale(scan.surroundings, *commanded, barrier, here, worth=worth)


def _hull_speed(velocity: Velocity, config: LawConfig) -> float:
    """How fast the fastest point of the hull may move, at most [m/s]."""
    return abs(velocity.linear_m_s) + abs(velocity.angular_rad_s) * config.hull.radius_m


def _stop_at(state: State, now_s: float, block: Block, reason: StopReason) -> State:
    """Latch the barrier's stop on every source; what the owner drove at stays known until it drives elsewhere."""
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
    state: State, now_s: float, reasons: Reasons, commanded: Velocity, scale: float, reply: Reply | None
) -> Decision:
    config, scan = state.config, state.scan
    if reasons:
        mode = Mode.STOPPED
    elif state.output == STANDSTILL:
        mode = Mode.READY
    else:
        mode = Mode.DRIVING if scale == 1.0 else Mode.LIMITED
    nearest_m = math.nan if scan is None or scan.problem is not None else scan.surroundings.nearest_m
    return Decision(
        mode=mode,
        output=state.output,
        reasons=tuple(sorted(reasons, key=SEVERITY.__getitem__)),
        owner=state.owner,
        commanded=commanded,
        scale=0.0 if reasons else scale,
        nearest_m=nearest_m,
        nearest_bearing_rad=math.nan if scan is None else scan.surroundings.nearest_bearing_rad,
        warning=nearest_m < config.warning_distance_m,
        alarm=state.runaway,
        scan_age_s=math.nan if scan is None else now_s - scan.taken_s,
        scan_problem="" if scan is None or scan.problem is None else scan.problem,
        scan_counts=state.scan_counts,
        sources=state.sources,
        strangers=state.strangers,
        reset_reply=reply,
    )
