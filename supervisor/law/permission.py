"""Which share of a command is permitted: by the points around the robot, and by the age of the command.

`clearance.py` has the formula of the speed barrier for one twist; here it is applied to every twist that the base may have
until it has reached the command, and to every point that may limit one of them.
"""

import math
from collections.abc import Sequence
from operator import itemgetter

from supervisor.law.base import Base, fastest_m_s
from supervisor.law.base_motion import possible_twists
from supervisor.law.clearance import Barrier, Block, permitted_scale
from supervisor.law.model import LawConfig
from supervisor.law.reach import KnownPoints, Place, in_reach
from supervisor.law.reckoning import Velocity
from supervisor.law.sight import Sight, Usable, is_assumed, mounts_confirmed
from supervisor.law.transition import along, is_on_another_arc, lags, mixtures

PRESENT_SHARE = 0.95
"""The base is too fast on its present arc if a smaller share of its velocity is permitted; below 1, because odometry is
noisy."""

TOUCH_M = 0.05
"""If every process above the base dies, the hull comes no closer than this to a stationary object."""


def renewed(age_s: float, commanded: Velocity, config: LawConfig) -> float:
    """Return the share of a motion that the age of its command permits; more than one if it permits more.

    The permitted speed falls linearly to zero at the command timeout. Its sum over the ticks until then is at most the blind
    budget: this is how far the robot can drive, or its rim can turn, on a command that was not renewed, without braking.
    """
    if math.isinf(config.blind_budget_m):
        return math.inf
    speed_m_s = max(config.creep_m_s, config.rim_speed_m_s(commanded))
    # An output lasts until the next tick, while the permitted speed falls further: `transport_s` includes a tick.
    timeout_s, tick_s = config.command_timeout_s, config.transport_s
    fresh_m_s = 2.0 * config.blind_budget_m * timeout_s / (timeout_s + tick_s / 2.0) ** 2
    permitted_m_s = max(0.0, fresh_m_s * (1.0 - age_s / timeout_s))
    return permitted_m_s / speed_m_s


def measured(commanded: Velocity, config: LawConfig) -> float:
    """Return the share of a motion that is permitted to a base whose stops have shown nothing yet; infinite after the first."""
    if math.isfinite(config.shown_m_s2):
        return math.inf
    return _share(config.unmeasured_m_s, config.rim_speed_m_s(commanded))


def confirmed(sight: Sight, commanded: Velocity, config: LawConfig) -> float:
    """Return the share of a motion that is permitted while the mounting of a lidar is not confirmed; infinite after that."""
    if mounts_confirmed(sight):
        return math.inf
    return _share(config.unconfirmed_m_s, config.hull_speed_m_s(commanded))


def in_the_open(scans: Usable, commanded: Velocity, config: LawConfig) -> float:
    """Return the share of a motion that is permitted while silence counts as free by assumption; infinite otherwise."""
    return _share(config.open_m_s, config.hull_speed_m_s(commanded)) if is_assumed(scans) else math.inf


def _share(permitted_m_s: float, speed_m_s: float) -> float:
    """Return the permitted share of a motion; infinite for one too slow for a float."""
    return permitted_m_s / speed_m_s if speed_m_s > 0.0 else math.inf


def points_in_reach(
    sight: Sight, base: Base, config: LawConfig, now_s: float, scans: Usable, commanded: Velocity
) -> list[KnownPoints]:
    """Return the seen, remembered and hidden points that may limit a twist of the base until it reaches the command."""
    fastest = fastest_m_s(base, config, commanded)
    shown: list[tuple[Place, float, float]] = []
    for _, scan in scans:
        assert scan.view is not None  # a usable scan has one
        age_s = now_s - scan.taken_s
        shown.append((Place(scan.view.pose, scan.around), age_s, age_s + scan.period_s))
    oldest_s = max(age_s for _, age_s, _ in shown)
    latest_s = max(next_s for _, _, next_s in shown)
    shown.extend((place, oldest_s, latest_s) for place in sight.places)
    known: list[KnownPoints] = []
    for place, age_s, next_s in shown:
        for bound in barriers(config, age_s, next_s, fastest):
            points = in_reach(place, base.odometer, now_s, bound, fastest)
            if points is not None:
                known.append(points)
    return known


def barriers(config: LawConfig, age_s: float, next_s: float, fastest_m_s: float) -> tuple[Barrier, ...]:
    """Return the bound that keeps the stop distance, and that of a base that gets no further command, if it may be lower.

    A base whose supervisor dies now keeps its speed for its own timeout, and must not touch. At speeds up to V, the second bound
    follows from the first if V times the difference of the reaction times is at most the difference of the distances.

    Args:
        config: the configuration of the law.
        age_s: age of the points.
        next_s: age that they reach before they are seen again.
        fastest_m_s: an upper bound V of the speed of any point of the hull.
    """
    decided = Barrier(
        stop_distance_m=config.stop_distance_m,
        deceleration_m_s2=config.braking_m_s2,
        reaction_s=next_s + config.late_s,
        hidden_creep_m_s=config.blind_creep_m_s,
        dead_time_s=config.dead_time_s,
    )
    alone_s = age_s + config.base_timeout_s + config.late_s
    farther_m = fastest_m_s * (alone_s - decided.reaction_s)
    if farther_m <= decided.stop_distance_m - TOUCH_M:
        return (decided,)
    return decided, decided._replace(stop_distance_m=TOUCH_M, reaction_s=alone_s)


def barrier(
    base: Base, config: LawConfig, known: Sequence[KnownPoints], commanded: Velocity, worth: float
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
    following, measured = base.following, base.measured
    scale, block = _permitted(known, commanded, worth)
    twists = possible_twists(following, measured)
    present = max(along(has, commanded, config.hull.radius_m) for has in twists)
    if (present - scale) * config.hull_speed_m_s(commanded) > config.residual.linear_m_s:
        scale = min(scale, _permitted(known, commanded, worth, present)[0])
    for has in twists:
        for mixed in mixtures(has, commanded, config.residual):
            scale = min(scale, _permitted(known, mixed, worth)[0])
        if is_on_another_arc(has, commanded, config.hull.radius_m, config.residual.linear_m_s):
            on_its_arc, _ = _permitted(known, has, worth)
            scale = 0.0 if on_its_arc < PRESENT_SHARE else scale
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
