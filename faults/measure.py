"""Measure the consequences of a fault: detection, time to zero, and the stopping place. Pure.

The last part is for real processes only: all times are of one monotonic clock.
"""

import itertools
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from faults.seen import Command, Motion, Seen
from faults.trial import Injected
from recordings.incidents.braking import braking

NOTICED_WITHIN_S = 2.0
"""A stop that begins later than this is not a consequence of the fault."""
MOVING_M_S = 0.05

BASE = "base: "
"""Prefix of the base's own stop reasons."""


class BaseReport(NamedTuple):
    """A change of the base's own stop reason."""

    time_s: float
    reason: str
    """`OK` while the base follows cmd_vel."""


class Stop(NamedTuple):
    """A stop after a fault; fields are None if there was no stop, or if the robot did not move before."""

    detector: str | None
    speed_m_s: float
    to_zero_s: float | None
    """Time to zero on cmd_vel; if the base stops by itself, to its own stop."""
    to_standstill_s: float | None
    distance_m: float | None


def stop_after(
    seen: Seen, fault_s: float, base: Sequence[BaseReport] = (), within_s: float = NOTICED_WITHIN_S
) -> Stop:
    """Return how a robot stopped after a fault.

    Args:
        seen: the whole run.
        fault_s: the time of the fault [s].
        base: the base's own reasons, as they changed.
        within_s: a stop that begins later than this is not a consequence of the fault.
    """
    start = bisect_left(seen.motions, fault_s, key=lambda motion: motion.time_s)
    before = seen.motions[start - 1] if start else None
    speed_m_s = 0.0 if before is None else abs(before.linear_m_s)
    noticed_s, detector = _noticed(seen, fault_s, fault_s + within_s, base)
    if detector is None:
        return Stop(None, speed_m_s, None, None, None)
    to_zero_s = noticed_s - fault_s if detector.startswith(BASE) else _to_zero_s(seen, fault_s)
    rest = braking(seen.motions, fault_s) if speed_m_s >= MOVING_M_S else None
    if rest is None:
        return Stop(detector, speed_m_s, to_zero_s, None, None)
    return Stop(detector, speed_m_s, to_zero_s, rest.to_standstill_s, rest.distance_m)


def _noticed(
    seen: Seen, fault_s: float, until_s: float, base: Sequence[BaseReport]
) -> tuple[float, str | None]:
    """Return when and by which reason a robot that was free to drive was stopped first."""
    start = bisect_left(seen.statuses, fault_s, key=lambda status: status.arrival_s)
    if start > 0 and seen.statuses[start - 1].is_stopped:
        return math.nan, None
    stops = [(s.arrival_s, s.reasons[0]) for s in seen.statuses[start:] if s.is_stopped][:1]
    braked = [one for one in base if one.time_s >= fault_s and one.reason != "OK"][:1]
    stops += [(one.time_s, BASE + one.reason) for one in braked]
    return min((stop for stop in stops if stop[0] <= until_s), default=(math.nan, None))


def _to_zero_s(seen: Seen, fault_s: float) -> float | None:
    """Return the time to the first zero after a commanded motion."""
    start = bisect_left(seen.commands, fault_s, key=lambda command: command.arrival_s)
    if start == 0 or seen.commands[start - 1].is_zero:
        return None
    zero = next((c for c in itertools.islice(seen.commands, start, None) if c.is_zero), None)
    return None if zero is None else zero.arrival_s - fault_s


def injected(fault: str, at_s: float, parameters: Mapping[str, float | str], stop: Stop) -> Injected:
    """Return the record of a fault and of the stop after it."""
    return Injected(
        fault=fault,
        time_s=round(at_s, 4),
        parameters=dict(parameters),
        detector=stop.detector,
        speed_m_s=round(stop.speed_m_s, 4),
        to_zero_s=_rounded(stop.to_zero_s),
        to_standstill_s=_rounded(stop.to_standstill_s),
        distance_m=_rounded(stop.distance_m),
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 5)


# --- real processes

STALL_S = 0.03
"""If the simulation stood still for longer than this, its deceleration by the real clock is not judged, and the time to
zero at the wheels is judged without the standstill. The record contains its duration."""


def to_lasting_zero_s(commands: Sequence[Command], fault_s: float, until_s: float) -> float | None:
    """Return the time from the fault to the first zero on cmd_vel that is followed by zeros only.

    Args:
        commands: all commands of the trial, by time of arrival.
        fault_s: the time of the injection.
        until_s: the time of the next neutral command; later commands do not count.

    Returns:
        the time [s]; None if zero was commanded at the fault already, or the zeros did not last.
    """
    start = bisect_left(commands, fault_s, key=lambda command: command.arrival_s)
    if start == 0 or commands[start - 1].is_zero:
        return None
    after = list(itertools.takewhile(lambda c: c.arrival_s < until_s, commands[start:]))
    zeros = list(itertools.takewhile(lambda c: c.is_zero, reversed(after)))
    return zeros[-1].arrival_s - fault_s if zeros else None


def to_lasting_rest_s(driven: Sequence[tuple[float, bool]], fault_s: float, until_s: float) -> float | None:
    """Return the time from the fault until the drive's target is zero, and remains zero.

    Args:
        driven: whether the drive's target is not zero, at each change.
        fault_s: as above.
        until_s: as above.

    Returns:
        the time [s]; None if the target was zero before, or is not zero at the end.
    """
    before = [is_driven for at_s, is_driven in driven if at_s < fault_s]
    after = [(at_s, is_driven) for at_s, is_driven in driven if fault_s <= at_s < until_s]
    if not before or not before[-1] or not after or after[-1][1]:
        return None
    return after[-1][0] - fault_s


def longest_gap_s(times_s: Sequence[float], from_s: float, until_s: float) -> float:
    """Return the longest time between two of these times, from the last one before the beginning to the end."""
    start = max(0, bisect_left(times_s, from_s) - 1)
    within = list(itertools.takewhile(lambda time_s: time_s < until_s, times_s[start:]))
    return max((b - a for a, b in itertools.pairwise(within)), default=0.0)


def stood_s(motions: Sequence[Motion], from_s: float, until_s: float) -> float:
    """Return for how long the simulation stood still between two times; it reports its motion every 10 ms while it runs."""
    times_s = [from_s, *(motion.time_s for motion in motions if from_s < motion.time_s < until_s), until_s]
    return sum(max(0.0, b - a - STALL_S) for a, b in itertools.pairwise(times_s))


def since(began_s: float, seen: Seen, base: Sequence[BaseReport]) -> tuple[Seen, list[BaseReport]]:
    """Return the observations with all times relative to `began_s`."""
    shifted = Seen(
        commands=[one._replace(arrival_s=one.arrival_s - began_s) for one in seen.commands],
        statuses=[one._replace(arrival_s=one.arrival_s - began_s) for one in seen.statuses],
        motions=[one._replace(time_s=one.time_s - began_s) for one in seen.motions],
        asked=[one._replace(sent_s=one.sent_s - began_s) for one in seen.asked],
        driven=[(at_s - began_s, is_driven) for at_s, is_driven in seen.driven],
    )
    return shifted, [one._replace(time_s=one.time_s - began_s) for one in base]
