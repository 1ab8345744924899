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
from dataclasses import replace

from supervisor.law import base as bases
from supervisor.law import interlock as interlocks
from supervisor.law import sight as sights
from supervisor.law.agreement import Agreement
from supervisor.law.base import Base
from supervisor.law.base_braking import UNMEASURED, Braking
from supervisor.law.clearance import Block, Kind
from supervisor.law.decision import Decision, Mode, by_severity, detail_of
from supervisor.law.estop_stations import detail_of as detail_of_stations
from supervisor.law.interlock import BARRIER_REASONS, Reply
from supervisor.law.model import Inputs, LawConfig, Reasons
from supervisor.law.permission import barrier, confirmed, in_the_open, measured, points_in_reach, renewed
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.sight import LidarState, Sight, Usable
from supervisor.law.state import Clock, State
from supervisor.law.writers import conflicts
from wire.reasons import Limit, StopReason

ROUNDING_S = 1e-6
"""Larger than the rounding error of sums and differences of times."""

RELEASED_FACTOR = 5.0
"""Hysteresis: a block ends when the barrier would permit this many times the minimum useful speed; readings are noisy."""


def initial_state(
    config: LawConfig, *, estop: bool = False, braking: Braking = UNMEASURED, mounts_confirmed: bool = False
) -> State:
    """Return the state at the start: stopped, without any command or scan.

    Args:
        config: the law's configuration.
        estop: whether an earlier e-stop has not been reset.
        braking: what the base has shown at earlier stops.
        mounts_confirmed: whether motion has confirmed the mounting of every lidar before.
    """
    agreement = Agreement(not_ruled_out=frozenset()) if mounts_confirmed else Agreement()
    sight = Sight(tuple(LidarState(agreement=agreement) for _ in config.lidars))
    config = bases.shown_by(braking, config)
    return State(config, interlocks.initial(config, estop=estop), Base(braking=braking), sight, Clock())


def step(state: State, now_s: float, inputs: Inputs) -> tuple[State, Decision]:
    """Process the inputs and decide the velocity of the wheels.

    Args:
        state: the state after the last step.
        now_s: the supervisor's monotonic clock, not before the last step's time.
        inputs: everything received since the last step; arrival times are not after `now_s`.
    """
    state, inputs = _resume(state, now_s, inputs)
    config, interlock, base, sight, clock = state
    base, config = bases.brake(base, config, inputs.odometry, sights.slip_m(sight, base))
    base = bases.observe(base, config, now_s, clock.now_s, inputs)
    for place in inputs.undecodable_lidars:
        sight = sights.spoil(sight, place)
    for scan in inputs.scans:
        sight = sights.see(sight, config, scan, base)
    usable = sights.usable(sight, config, now_s)
    sight = sights.seek_hidden(sight, config, usable, moved_on=bool(inputs.scans))
    interlock = interlocks.press(interlock, config, now_s, inputs)
    state = State(config, interlock, base, sight, clock)
    shared = _shared_causes(state, now_s, inputs, usable)
    interlock, live = interlocks.take_commands(interlock, config, now_s, inputs, shared)
    interlock, reply = interlocks.reset(interlock, inputs, live)
    return _decide(State(config, interlock, base, sight, clock), now_s, shared, usable, reply)


def runs_out_s(state: State) -> float:
    """Return the time at which the present motion expires if nothing new arrives; infinite while zero is commanded.

    The caller calls `step` at this time, so that the robot stops without waiting for the next tick.
    """
    config, interlock, base, sight, clock = state
    if base.output == STANDSTILL:
        return math.inf
    owner = interlock.owning
    assert owner is not None  # without an owner, zero is commanded
    assert clock.now_s is not None  # zero is commanded before the first step
    usable = sights.usable(sight, config, clock.now_s)
    scans_s = [scan.taken_s + config.lidars[place].timeout_s for place, scan in usable]
    return min(owner.sent_s + config.command_timeout_s, interlock.stations.expires_s, *scans_s) + ROUNDING_S


def _resume(state: State, now_s: float, inputs: Inputs) -> tuple[State, Inputs]:
    """After a suspend, discard everything received before it: the monotonic clock does not show its true age.

    The inputs of this step may be from before the suspend as well. Older messages still in transit arrive within the
    timeouts. OVERRUN therefore stays a cause for the longest timeout, and only a neutral command after that arms.
    """
    config, interlock, base, sight, clock = state
    if inputs.suspended_s <= config.overrun_s:
        return state, inputs
    state = State(
        config,
        interlocks.suspended(interlock, inputs.suspended_s),
        bases.suspended(base, inputs.suspended_s),
        sights.suspended(sight, config),
        clock._replace(resumed_s=now_s),
    )
    return state, replace(inputs, commands=(), scans=(), odometry=None)


def _shared_causes(state: State, now_s: float, inputs: Inputs, usable: Usable) -> Reasons:
    """Return the causes that prevent every source from driving now.

    They are determined before a reset, so an e-stop that is reset is still a cause in the step of the reset.
    """
    config, interlock, base, sight, clock = state
    causes = {
        *sights.causes(sight, config, now_s, usable),
        *bases.causes(base, config, now_s),
        *interlocks.causes(interlock, inputs),
    }
    if _conflicts(state, now_s):
        causes.add(StopReason.SENSOR_CONFLICT)
    late = clock.now_s is not None and now_s - clock.now_s > config.overrun_s
    if late or now_s - clock.resumed_s <= config.longest_timeout_s:
        causes.add(StopReason.OVERRUN)
    return frozenset(causes)


def _conflicts(state: State, now_s: float) -> tuple[str, ...]:
    """Return a text for each sensor with several active writers: its name and theirs."""
    config = state.config
    return conflicts((*sights.sensors(state.sight, config), bases.sensor(state.base, config)), now_s)


def _decide(
    state: State, now_s: float, shared: Reasons, usable: Usable, reply: Reply | None
) -> tuple[State, Decision]:
    """Decide the output velocity, with the stop reasons of the owner."""
    config, interlock, base, sight, clock = state
    owner = interlock.owning
    reasons = shared | ({StopReason.NO_COMMAND} if owner is None else owner.latched)
    commanded = STANDSTILL if owner is None or owner.velocity is None else owner.velocity
    causes = shared | (
        {StopReason.NO_COMMAND} if owner is None else interlocks.own_causes(owner, now_s, config)
    )
    scale, block, limit = 1.0, None, None
    if not reasons and commanded != STANDSTILL:
        scale, block = _passes(state, now_s, usable, commanded, config.creep_m_s)
        if block is not None and sights.is_confirmed(sight, config, block, base.odometer, now_s):
            interlock = interlocks.stop_at(interlock, now_s, block, _reason_of(block))
            reasons = frozenset({_reason_of(block)})
    elif reasons & BARRIER_REASONS and usable and commanded != STANDSTILL:
        block = _passes(state, now_s, usable, commanded, RELEASED_FACTOR * config.creep_m_s)[1]
    if block is not None:
        causes |= {_reason_of(block)}
    output = STANDSTILL
    if not reasons and commanded != STANDSTILL:
        assert owner is not None  # without one, there is a reason
        for permitted, reduces in (
            (renewed(now_s - owner.sent_s, commanded, config), Limit.COMMAND_AGE),
            (measured(commanded, config), Limit.BASE_UNMEASURED),
            (in_the_open(usable, commanded, config), Limit.IN_THE_OPEN),
            (confirmed(sight, commanded, config), Limit.MOUNT_UNCONFIRMED),
        ):
            if permitted < scale:
                scale, limit = permitted, reduces
        output = Velocity(scale * commanded.linear_m_s, scale * commanded.angular_rad_s)
    if not reasons and limit is None and bases.weakness(config, base.braking.shown_slip_m):
        limit = Limit.BASE_WEAK
    base = bases.commanded(base, output, now_s)
    state = State(config, interlock, base, sight, Clock(now_s, clock.resumed_s))
    advice = "" if block is None else sights.advice(config, usable, block)
    return state, _explain(state, now_s, reasons, causes, block, advice, limit, commanded, scale, reply)


def _passes(
    state: State, now_s: float, usable: Usable, commanded: Velocity, useful_m_s: float
) -> tuple[float, Block | None]:
    """Return the share of a command that the barrier permits, and the blocking point if it is not worth moving.

    Args:
        state: the state with the newest scans.
        now_s: the present time.
        usable: the usable scans, at least one.
        commanded: the command of the owner.
        useful_m_s: the lowest speed at which moving is worth it; below, the share is zero.
    """
    config, _, base, sight, _ = state
    useful = config.useful(commanded)
    worth = useful_m_s / max(useful_m_s, config.hull_speed_m_s(commanded))
    known = points_in_reach(sight, base, config, now_s, usable, useful)
    scale, block = barrier(base, config, known, useful, worth)
    return 0.0 if scale < worth else scale, block


def _reason_of(block: Block) -> StopReason:
    return StopReason.SCAN_BLIND if block.kind is Kind.HIDDEN else StopReason.OBSTACLE


def _explain(
    state: State,
    now_s: float,
    reasons: Reasons,
    causes: Reasons,
    block: Block | None,
    advice: str,
    limit: Limit | None,
    commanded: Velocity,
    scale: float,
    reply: Reply | None,
) -> Decision:
    config, interlock, base, sight, _ = state
    if reasons:
        mode = Mode.STOPPED
    elif commanded == STANDSTILL:
        mode = Mode.READY
    else:
        mode = Mode.DRIVING if scale == 1.0 else Mode.LIMITED
    scan_problem = sights.problems(sight, config)
    nearest_m, bearing_rad = sights.nearest(sight)
    return Decision(
        mode=mode,
        output=base.output,
        reasons=by_severity(reasons),
        owner=interlock.owner,
        commanded=commanded,
        scale=0.0 if reasons else scale,
        nearest_m=nearest_m,
        nearest_bearing_rad=bearing_rad,
        warning=nearest_m < config.warning_distance_m,
        alarm=base.runaway,
        scan_age_s=max((now_s - scan.taken_s for scan in sights.newest(sight)), default=math.nan),
        scan_problem=scan_problem,
        scan_counts=sights.counts(sight),
        sources=interlock.sources,
        strangers=interlock.strangers,
        reset_reply=reply,
        causes=by_severity(causes),
        latched=by_severity(reasons - causes),
        limit=limit,
        detail=""  # the texts are a twelfth of a step on a free path
        if not causes and limit is None
        else detail_of(
            causes,
            limit,
            is_too_fast=limit is Limit.COMMAND_AGE and renewed(0.0, commanded, config) < 1.0,
            scan_problem=scan_problem,
            block_bearing_rad=math.nan if block is None else math.atan2(block.y_m, block.x_m),
            advice=advice,
            writers=_conflicts(state, now_s) if StopReason.SENSOR_CONFLICT in causes else (),
            mismatch=sights.mismatches(sight, config),
            stations=detail_of_stations(interlock.stations),
            weakness=bases.weakness(config, base.braking.shown_slip_m),
            open_m_s=config.open_m_s,
        ),
        stations=interlock.stations.stations,
    )
