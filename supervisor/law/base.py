"""What is known of the base: its odometry, how it follows and brakes, and what it was last commanded.

The functions of `Base` are called in this order at each step: `brake`, `observe`, `causes`; then `commanded`, with the decision.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from supervisor.law.base_braking import (
    LATE_S,
    UNMEASURED,
    WEAK_SHARE,
    Braking,
    Stop,
    bound_dead_s,
    bound_m_s2,
    measure,
    slipped,
)
from supervisor.law.base_motion import FOLLOWING, PATIENCE_S, Following, follow, moves
from supervisor.law.base_rolling import Rest, watch
from supervisor.law.model import Inputs, LawConfig, Odometry
from supervisor.law.reckoning import STANDSTILL, Odometer, Velocity, reckon, remembered
from supervisor.law.writers import Sensor, Writer, heard
from wire.reasons import StopReason

RUNAWAY_GRACE_S = 0.3
"""Grace after the braking time, for the delay of odometry and the residual rocking of the wheels."""


class Base(NamedTuple):
    """State of the base."""

    odometry: Odometry | None = None
    """The newest sample; None without odometry."""
    writers: tuple[Writer, ...] = ()
    odometer: Odometer = Odometer()
    odometers: tuple[Odometer, ...] = ()
    """Recent odometers, for the robot's pose at the time a scan was taken."""
    way_m: float = 0.0
    """Upper bound of the distance that any point of the hull has moved, measured or commanded."""
    proven_way_m: float = 0.0
    """The same distance without what was commanded so recently that the base need not have followed."""
    following: Following = FOLLOWING
    braking: Braking = UNMEASURED
    output: Velocity = STANDSTILL
    """What it was last commanded."""
    stopped_s: float | None = None
    """Since when zero has been commanded; None while driving."""
    moving_s: float | None = None
    """Since when motion has been commanded without a pause; None while zero is commanded."""
    rest: Rest | None = None
    """Where it stands; None while it is commanded to move, or may still be braking."""
    runaway: bool = False

    @property
    def measured(self) -> Velocity | None:
        """The velocity by odometry; None without odometry."""
        return None if self.odometry is None else self.odometer.velocity


def suspended(base: Base, suspended_s: float) -> Base:
    """Return the state after a suspend of the machine: odometry that was received before is required again after it."""
    if base.odometry is None:
        return base
    odometry = replace(base.odometry, arrival_s=base.odometry.arrival_s - suspended_s)
    return base._replace(odometry=odometry)


def brake(
    base: Base, config: LawConfig, odometry: Odometry | None, slip_m: float | None
) -> tuple[Base, LawConfig]:
    """Measure how the base brakes; what it shows replaces better configured numbers everywhere in the law.

    Args:
        base: the state after the last step.
        config: the configuration of the law.
        odometry: the newest sample; None if none has arrived since the last step.
        slip_m: by how much the present stop is longer than odometry shows; NaN if the scans do not show it, None if not known yet.
    """
    if odometry is None or not config.odometry or moves(odometry.velocity, config.believable):
        return base, config
    braking = measure(
        base.braking,
        config.rim_speed_m_s(odometry.velocity),
        odometry.arrival_s,
        commanded_m_s=config.rim_speed_m_s(base.output),
        stopped_s=base.stopped_s,
        standing_m_s=config.residual.linear_m_s,
    )
    if slip_m is not None:
        braking = slipped(braking, slip_m)
    return base._replace(braking=braking), shown_by(braking, config)


def measured_stop(base: Base) -> Stop | None:
    """Return the present stop if the scans may still show how long it is; else None."""
    braking = base.braking
    if base.stopped_s is None:
        return None
    if braking.ended is not None:
        return Stop(base.stopped_s, braking.ended.speed_m_s)
    return Stop(base.stopped_s, braking.mean_m_s) if braking.stopping else None


def shown_by(braking: Braking, config: LawConfig) -> LawConfig:
    """Return the configuration with what the base has shown at its stops."""
    shown_m_s2, shown_dead_s = bound_m_s2(braking), bound_dead_s(braking)
    if (shown_m_s2, shown_dead_s) == (config.shown_m_s2, config.shown_dead_s):
        return config
    return replace(config, shown_m_s2=shown_m_s2, shown_dead_s=shown_dead_s)


def weakness(config: LawConfig, shown_slip_m: tuple[float, ...]) -> str:
    """Return what the base has shown to do worse than configured, as part of a sentence; empty if nothing.

    Args:
        config: the configuration of the law, with what the base has shown.
        shown_slip_m: by how much its last stops were longer than odometry shows.
    """
    worse: list[str] = []
    if config.shown_m_s2 < WEAK_SHARE * config.deceleration_m_s2:
        worse.append(f"brakes with {config.shown_m_s2:.2f} m/s² instead of {config.deceleration_m_s2:.2f}")
        slips = sum(slip_m > 0.0 for slip_m in shown_slip_m)
        if slips:
            worse.append(
                f"slid up to {max(shown_slip_m):.2f} m farther than odometry shows in {slips} of {len(shown_slip_m)} stops"
            )
    if config.shown_dead_s > config.base_dead_time_s + LATE_S:
        worse.append(f"slows down after {config.shown_dead_s:.2f} s instead of {config.base_dead_time_s:.2f}")
    return f"the base {', and '.join(worse)}" if worse else ""


def observe(base: Base, config: LawConfig, now_s: float, before_s: float | None, inputs: Inputs) -> Base:
    """Process odometry, and compare it with the last command.

    Args:
        base: the state after the last step.
        config: the configuration of the law.
        now_s: the present time.
        before_s: the time of the last step; None at the first.
        inputs: everything received since then.
    """
    odometry = base.odometry if inputs.odometry is None or not config.odometry else inputs.odometry
    dt_s = 0.0 if before_s is None else now_s - before_s
    if odometry is None:  # without odometry, the base is assumed to move as commanded
        odometer = reckon(base.odometer, base.output, now_s, config.believable)
    elif inputs.odometry is not None:
        # A spike counts as zero here; `odometry` keeps it for the runaway check.
        odometer = reckon(base.odometer, odometry.velocity, odometry.arrival_s, config.believable)
    else:
        odometer = base.odometer
    is_still = _has_braked(base, config, now_s) and not moves(odometer.velocity, config.residual)
    measured_m_s = 0.0 if is_still else config.hull_speed_m_s(odometer.velocity)
    odometers = base.odometers
    if odometer is not base.odometer:
        odometers = remembered(odometers, base.odometer, now_s - config.longest_timeout_s)
    commanded_m_s = config.hull_speed_m_s(base.output)
    proven_m_s = 0.0 if odometry is None else measured_m_s
    follows_after_s = config.dead_time_s if odometry is None else max(PATIENCE_S, config.dead_time_s)
    if base.moving_s is not None and now_s - base.moving_s > follows_after_s:
        proven_m_s = max(proven_m_s, commanded_m_s)
    writers = base.writers
    if config.odometry:
        for gid in inputs.odometry_writers:
            writers = heard(writers, gid, now_s)
    runs_away, rest = _runs_away(base, config, now_s, odometry), None
    if not runs_away and _has_braked(base, config, min(now_s, odometer.at_s)):
        rest = watch(base.rest, odometer.pose, odometer.at_s, config.hull.radius_m)
    return base._replace(
        odometry=odometry,
        writers=writers,
        odometer=odometer,
        odometers=odometers,
        way_m=base.way_m + dt_s * max(measured_m_s, commanded_m_s),
        proven_way_m=base.proven_way_m + dt_s * proven_m_s,
        following=follow(
            base.following,
            base.output,
            None if odometry is None else odometry.velocity,
            now_s,
            dt_s,
            config.slowest,
            config.trusted,
            config.dead_time_s,
        ),
        rest=rest,
        runaway=runs_away or (rest is not None and rest.rolls),
    )


def _runs_away(base: Base, config: LawConfig, now_s: float, odometry: Odometry | None) -> bool:
    """Return whether the base still moves although zero has been commanded for longer than braking takes."""
    if odometry is None:
        return False
    moving = moves(odometry.velocity, Velocity(config.runaway_linear_m_s, config.runaway_angular_rad_s))
    return moving and _has_braked(base, config, min(now_s, odometry.arrival_s))


def _has_braked(base: Base, config: LawConfig, now_s: float) -> bool:
    """Return whether zero has been commanded for longer than braking takes."""
    braking_s = config.max_linear_m_s / config.braking_m_s2 + config.dead_time_s + RUNAWAY_GRACE_S
    return base.stopped_s is not None and now_s - base.stopped_s > braking_s


def causes(base: Base, config: LawConfig, now_s: float) -> Iterator[StopReason]:
    """Yield the causes of the base that prevent every source from driving now."""
    if base.odometry is not None and now_s - base.odometry.arrival_s > config.odom_timeout_s:
        yield StopReason.ODOM_STALE
    if base.following.unresponsive:
        yield StopReason.BASE_UNRESPONSIVE
    if base.runaway:
        yield StopReason.BASE_RUNAWAY


def sensor(base: Base, config: LawConfig) -> Sensor:
    """Return odometry as a sensor with its writers."""
    return Sensor("odometry", base.writers, config.odom_timeout_s)


def fastest_m_s(base: Base, config: LawConfig, commanded: Velocity) -> float:
    """Return an upper bound of the hull's speed [m/s] under every twist from now until the base reaches the command."""
    twists = (commanded, base.following.least, base.following.most, base.odometer.velocity)
    return config.hull_speed_m_s(
        Velocity(
            max(abs(twist.linear_m_s) for twist in twists), max(abs(twist.angular_rad_s) for twist in twists)
        )
    )


def commanded(base: Base, output: Velocity, now_s: float) -> Base:
    """Return the state after a decision."""
    stopped_s = now_s if base.stopped_s is None else base.stopped_s
    moving_s = now_s if base.moving_s is None else base.moving_s
    if output == STANDSTILL:
        return base._replace(output=output, stopped_s=stopped_s, moving_s=None)
    return base._replace(output=output, stopped_s=None, moving_s=moving_s)
