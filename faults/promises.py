"""The promises of Lifeline, checked on every sample of a run. Pure.

The consequences that a fault requires are given as `Demand`s: when zero must be commanded, when the base must brake,
or when the robot must be drivable again.
"""

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from faults.seen import Asked, Command, Motion, Seen, Status
from faults.trial import BrokenPromise

KILL_MEDIAN_S, KILL_LIMIT_S = 0.010, 0.025
"""From the death of a process to the stop: the median, and the upper 95 % limit of the 95 % quantile, under the campaign's load."""
_KILL = f"within {1000 * KILL_MEDIAN_S:.0f} ms (median) and {1000 * KILL_LIMIT_S:.0f} ms (upper 95 % limit of the 95 % quantile)"
PROMISES = {
    1: "cmd_vel is never outside the limits, never NaN, and zero while a stop reason holds",
    2: f"teleop dead: zero {_KILL}",
    3: "teleop hung or cut off: zero within 0.2 s and one tick",
    4: f"supervisor dead: the base brakes {_KILL}; hung: within 0.15 s and a step",
    5: "scan missing or invalid: zero within 0.25 s and one tick",
    6: "the robot's own motion never brings its hull within 0.29 m of an object, or into contact",
    7: "after every stop, no motion without a neutral command",
    8: "after any process is killed, the operator's neutral command alone makes the robot drivable again",
}
"""The promises by number, with the default limits."""

BARRIER_REASONS = frozenset({"OBSTACLE", "SCAN_BLIND"})
"""Stops that a command away from the obstacle ends without a neutral: the robot can leave its stop zone by itself."""

ROUNDING = 1e-9
SURPRISE_S = 1.5
"""Time for which the approach of an object excuses a small clearance."""
NOTICED_M = 0.001
"""Smaller motions between two samples count as standstill."""
SUDDEN_M = 0.05
"""No person or forklift moves this far between two samples; a larger change means that an object was placed."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """The limits of the promises."""

    max_linear_m_s: float = 1.0
    max_angular_rad_s: float = 2.0
    stop_distance_m: float = 0.30
    tolerance_m: float = 0.01
    """Permitted shortfall of the clearance against the stop distance."""
    trusted_braking_m_s2: float = 1.5
    trusted_braking_rad_s2: float = 6.0
    reaction_s: float = 0.30
    """Reaction time to an object that moves by itself: two scans and their transport."""
    hull_radius_m: float = 0.25
    status_leeway_s: float = 0.0
    """Maximum time between the arrivals of a command and of the status that explains it."""
    neutral_leeway_s: float = 0.0
    """Time before a stop within which a neutral command counts as sent after it."""
    asked_age_s: float = math.inf
    """Maximum age of the request for a motion; infinity if the times of the requests are unknown."""


class Kind(StrEnum):
    """The kinds of demands after a fault."""

    ZERO = "zero"
    """Every command in the window is zero."""
    BRAKE = "brake"
    """The base slows down from the start of the window until it stands, and stands until the end of the window."""
    DRIVABLE = "drivable"
    """No stop holds at some moment of the window."""
    STOPPED = "stopped"
    """A stop holds at some moment of the window."""
    NAMED = "named"
    """One of the demand's reasons is among the reasons of a stop at some moment of the window."""
    UNHINDERED = "unhindered"
    """No stop for an obstacle lasts in the window, because there is no obstacle."""


class Demand(NamedTuple):
    """What must hold in a window of time because of a fault."""

    kind: Kind
    promise: int
    because: str
    from_s: float
    until_s: float
    reasons: tuple[str, ...] = ()


def violations(
    seen: Seen, demands: Iterable[Demand] = (), bounds: Bounds | None = None
) -> list[BrokenPromise]:
    """Return the broken promises, each at most once per occasion, in order of time.

    Args:
        seen: all observations of the run.
        demands: the demands of its faults.
        bounds: the limits of the promises.
    """
    bounds = bounds or Bounds()
    found = [
        *_beyond_limits(seen.commands, bounds),
        *_motion_despite_a_stop(seen, bounds),
        *_moved_unasked(seen, bounds),
        *_set_off_unasked(seen, bounds),
        *_came_too_near(seen.motions, bounds),
        *_moved_without_neutral(seen, bounds),
    ]
    for demand in demands:
        check = {
            Kind.ZERO: _not_zero,
            Kind.BRAKE: _not_braked,
            Kind.DRIVABLE: _not_drivable,
            Kind.STOPPED: _not_stopped,
            Kind.NAMED: _not_named,
            Kind.UNHINDERED: _hindered,
        }[demand.kind]
        found += check(seen, demand, bounds)
    return sorted(found, key=lambda violation: (violation.time_s, violation.promise))


# --- 1: cmd_vel


def _beyond_limits(commands: Sequence[Command], bounds: Bounds) -> Iterator[BrokenPromise]:
    for command in commands:
        linear, angular = command.linear_m_s, command.angular_rad_s
        if not (
            abs(linear) <= bounds.max_linear_m_s + ROUNDING
            and abs(angular) <= bounds.max_angular_rad_s + ROUNDING
        ):
            sentence = f"cmd_vel requests {linear:g} m/s, {angular:g} rad/s: beyond the limits"
            yield BrokenPromise(1, command.arrival_s, sentence)
            return  # later violations have the same cause


def _motion_despite_a_stop(seen: Seen, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that nothing moves after a status that reports a stop, until the next status."""
    for status, following in itertools.pairwise(seen.statuses):
        if not status.is_stopped:
            continue
        window = (status.arrival_s + bounds.status_leeway_s, following.arrival_s - bounds.status_leeway_s)
        for command in _between(seen.commands, *window):
            if not command.is_zero:
                yield BrokenPromise(
                    1,
                    command.arrival_s,
                    f"cmd_vel is {command.linear_m_s:.3f} m/s, {command.angular_rad_s:.3f} rad/s "
                    f"despite {', '.join(status.reasons)}",
                )
                break


# --- 2, 3, 5: zero in time


def _not_zero(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:  # noqa: ARG001
    for command in _between(seen.commands, demand.from_s, demand.until_s):
        if not command.is_zero:
            yield BrokenPromise(
                demand.promise,
                command.arrival_s,
                f"cmd_vel is still {command.linear_m_s:.3f} m/s, {command.angular_rad_s:.3f} rad/s "
                f"{1000 * (command.arrival_s - demand.from_s):.0f} ms too late: {demand.because}",
            )
            return


def _moved_unasked(seen: Seen, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that a recent command for motion precedes every motion."""
    if math.isinf(bounds.asked_age_s):
        return
    wishes = _wishes_s(seen.asked)
    is_reported = False
    for command in seen.commands:
        age_s = _age_s(wishes, command.arrival_s)
        is_late = not command.is_zero and age_s > bounds.asked_age_s
        if is_late and not is_reported:
            sentence = f"the robot moves on a request that is {age_s:.3f} s old"
            yield BrokenPromise(3, command.arrival_s, sentence)
        is_reported = is_late


def _set_off_unasked(seen: Seen, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check the same at the wheels, because the network may deliver an old command late."""
    wishes = _wishes_s(seen.asked)
    for (_, before), (at_s, is_driven) in itertools.pairwise(seen.driven):
        age_s = _age_s(wishes, at_s)
        if is_driven and not before and age_s > bounds.asked_age_s:
            yield BrokenPromise(3, at_s, f"the base starts to move on a request that is {age_s:.3f} s old")


def _wishes_s(asked: Sequence[Asked]) -> list[float]:
    """Return the times at which a source requested motion."""
    return [one.sent_s for one in asked if not one.is_neutral]


def _age_s(wishes_s: Sequence[float], at_s: float) -> float:
    """Return the age of the last request before a time; infinity if there was none."""
    index = bisect_right(wishes_s, at_s)
    return at_s - wishes_s[index - 1] if index else math.inf


# --- 4: the base by itself


def _not_braked(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that both axes slow down at the trusted decelerations; both may take the time of the slower one."""
    within = list(_motions_between(seen.motions, demand.from_s, demand.until_s))
    if not within:
        return
    first = within[0]
    braking_s = max(
        abs(first.linear_m_s) / bounds.trusted_braking_m_s2,
        abs(first.angular_rad_s) / bounds.trusted_braking_rad_s2,
    )
    for motion in within:
        left = max(0.0, 1.0 - (motion.time_s - first.time_s) / braking_s) if braking_s > 0.0 else 0.0
        if (
            abs(motion.linear_m_s) > left * abs(first.linear_m_s) + BRAKING_TOLERANCE_M_S
            or abs(motion.angular_rad_s) > left * abs(first.angular_rad_s) + BRAKING_TOLERANCE_RAD_S
        ):
            yield BrokenPromise(
                demand.promise,
                motion.time_s,
                f"the base moves at {motion.linear_m_s:.3f} m/s, {motion.angular_rad_s:.3f} rad/s "
                f"{1000 * (motion.time_s - demand.from_s):.0f} ms after it had to brake: {demand.because}",
            )
            return


BRAKING_TOLERANCE_M_S = 0.05
BRAKING_TOLERANCE_RAD_S = 0.25
"""Tolerance for wheels that follow the ramp with a delay and rock as they stop."""


# --- 6: distance


def _came_too_near(motions: Sequence[Motion], bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that the robot's own motion does not reduce the clearance within the stop distance.

    An object that moves, or that is placed too near to stop in time, may reduce the clearance without limit, and the
    robot may brake toward it. The check therefore adds up only the robot's own motion within the stop distance: its
    approach to the object, less its motion away from the object.
    """
    surprised_s = excused_until_s = -math.inf
    own_m = allowed_m = 0.0
    inside = is_reported = False
    for before, motion in itertools.pairwise(motions):
        by_itself_m = before.clearance_m - motion.clearance_m - motion.own_approach_m
        if by_itself_m > NOTICED_M or motion.appeared_m < bounds.stop_distance_m + _stopping_m(
            motion, bounds
        ):
            surprised_s = motion.time_s
        if motion.clearance_m >= bounds.stop_distance_m:
            inside = is_reported = False
            continue
        if not inside:
            inside, own_m, allowed_m = True, 0.0, bounds.tolerance_m
            excused_until_s = -math.inf
            is_surprised = motion.time_s - surprised_s < SURPRISE_S
        else:
            # A passing object can turn a motion away into an approach: each new approach is judged from its start.
            begins = own_m == 0.0 < motion.own_approach_m
            is_surprised = by_itself_m > SUDDEN_M or (begins and motion.time_s - surprised_s < SURPRISE_S)
        if is_surprised:
            allowed_m = max(allowed_m, own_m + bounds.tolerance_m + _stopping_m(before, bounds))
            excused_until_s = motion.time_s + SURPRISE_S
        elif motion.time_s > excused_until_s > 0.0:
            excused_until_s, allowed_m = -math.inf, own_m + bounds.tolerance_m
        own_m = max(0.0, own_m + motion.own_approach_m)
        too_near = own_m > allowed_m and motion.clearance_m < bounds.stop_distance_m - bounds.tolerance_m
        if too_near and not is_reported:
            is_reported = True
            touching = ", touching" if motion.is_touching else ""
            yield BrokenPromise(
                6,
                motion.time_s,
                f"the clearance of the hull fell to {100 * motion.clearance_m:.1f} cm{touching}, "
                f"{100 * own_m:.1f} cm of this by the robot's own motion",
            )


def _stopping_m(motion: Motion, bounds: Bounds) -> float:
    speed_m_s = abs(motion.linear_m_s) + bounds.hull_radius_m * abs(motion.angular_rad_s)
    return speed_m_s * bounds.reaction_s + speed_m_s**2 / (2.0 * bounds.trusted_braking_m_s2)


# --- 7: neutral first


def _moved_without_neutral(seen: Seen, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that after every stop except the barrier's, the moving source has sent neutral since the stop began."""
    for since_s, reasons, released in _stops(seen.statuses):
        neutral_s = _first_neutral_s(seen.asked, released.owner, since_s - bounds.neutral_leeway_s)
        if neutral_s <= released.arrival_s:
            continue
        for command in _from(seen.commands, released.arrival_s):
            if command.arrival_s > neutral_s:
                break
            if not command.is_zero:
                yield BrokenPromise(
                    7,
                    command.arrival_s,
                    f"{released.owner or 'nobody'} moves the robot after {', '.join(reasons)} "
                    "without a neutral command first",
                )
                break


def _stops(statuses: Sequence[Status]) -> Iterator[tuple[float, tuple[str, ...], Status]]:
    """Yield each stop that requires a neutral command: its beginning, its reasons, and the status that ends it.

    A stop that begins while the robot is not stopped applies to all sources. A reason that appears during a stop applies
    only to the source that the status names.
    """
    everybody: tuple[float, tuple[str, ...]] | None = None
    own: dict[str, tuple[float, tuple[str, ...]]] = {}
    before = Status(-math.inf, ())
    for status in statuses:
        if not status.is_stopped:
            stops = [stop for stop in (everybody, own.pop(status.owner, None)) if stop is not None]
            if stops:
                yield *max(stops), status
            everybody = None
        elif not BARRIER_REASONS.issuperset(status.reasons):
            stop = (status.arrival_s, status.reasons)
            if not before.is_stopped:
                everybody = stop
            elif status.owner == before.owner and not set(status.reasons).issubset(before.reasons):
                own[status.owner] = stop
        before = status


def _first_neutral_s(asked: Sequence[Asked], source: str, since_s: float) -> float:
    """Return the time of the source's first neutral command from a time on; infinity if there is none."""
    start = bisect_left(asked, since_s, key=lambda one: one.sent_s)
    return next(
        (
            one.sent_s
            for one in itertools.islice(asked, start, None)
            if one.source == source and one.is_neutral
        ),
        math.inf,
    )


# --- 8: drivable again


def _not_drivable(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:  # noqa: ARG001
    statuses = [s for s in seen.statuses if demand.from_s <= s.arrival_s <= demand.until_s]
    if not any(not status.is_stopped for status in statuses):
        why = ", ".join(statuses[-1].reasons) if statuses else "no status arrived"
        yield BrokenPromise(demand.promise, demand.until_s, f"not drivable again ({why}): {demand.because}")


# --- required and forbidden consequences of sensor faults


def _in_force(seen: Seen, demand: Demand) -> list[Status]:
    """Return the statuses in the window, and the last one before it."""
    start = bisect_right(seen.statuses, demand.from_s, key=lambda status: status.arrival_s)
    later = itertools.islice(seen.statuses, start, None)
    return [
        *seen.statuses[max(0, start - 1) : start],
        *itertools.takewhile(lambda status: status.arrival_s <= demand.until_s, later),
    ]


def _not_stopped(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:  # noqa: ARG001
    if not any(status.is_stopped for status in _in_force(seen, demand)):
        took = f"{1000 * (demand.until_s - demand.from_s):.0f} ms"
        yield BrokenPromise(
            demand.promise, demand.until_s, f"nothing stops the robot within {took}: {demand.because}"
        )


def _not_named(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:  # noqa: ARG001
    named = {reason for status in _in_force(seen, demand) for reason in status.reasons}
    if named.isdisjoint(demand.reasons):
        wanted, instead = " or ".join(demand.reasons), ", ".join(sorted(named)) or "no reason"
        yield BrokenPromise(
            demand.promise, demand.until_s, f"{instead} instead of {wanted}: {demand.because}"
        )


def _hindered(seen: Seen, demand: Demand, bounds: Bounds) -> Iterator[BrokenPromise]:
    """Check that no stop for an obstacle lasts longer than `MOMENT_S` unless a real object is near."""
    since_s: float | None = None
    for status in _in_force(seen, demand):
        if status.reasons != ("OBSTACLE",):
            since_s = None
        elif since_s is None:
            since_s = max(status.arrival_s, demand.from_s)
        elif status.arrival_s - since_s > MOMENT_S + ROUNDING:
            motions = _motions_between(seen.motions, since_s, status.arrival_s)
            clearance_m = min((motion.clearance_m for motion in motions), default=0.0)
            if clearance_m > bounds.stop_distance_m + NOTHING_NEAR_M + ROUNDING:
                sentence = (
                    f"stopped for an obstacle with {clearance_m:.2f} m free all around: {demand.because}"
                )
                yield BrokenPromise(demand.promise, status.arrival_s, sentence)
                return


MOMENT_S = 0.12
"""Longest permitted stop for a single false reading: two scans and a status."""
NOTHING_NEAR_M = 0.15
"""Nothing is near if the clearance exceeds the stop distance by this much."""


# --- windows of time


def _between(commands: Sequence[Command], after_s: float, before_s: float) -> Iterator[Command]:
    """Return the commands strictly within the window."""
    later = itertools.dropwhile(lambda c: c.arrival_s <= after_s, _from(commands, after_s))
    return itertools.takewhile(lambda c: c.arrival_s < before_s, later)


def _from(commands: Sequence[Command], time_s: float) -> Iterator[Command]:
    return itertools.islice(commands, bisect_left(commands, time_s, key=lambda c: c.arrival_s), None)


def _motions_between(motions: Sequence[Motion], from_s: float, until_s: float) -> Iterator[Motion]:
    start = bisect_left(motions, from_s, key=lambda motion: motion.time_s)
    return itertools.takewhile(lambda motion: motion.time_s < until_s, itertools.islice(motions, start, None))
