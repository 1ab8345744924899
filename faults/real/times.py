"""The times of a real fault, from an observer's samples. Pure. All times are of one monotonic clock."""

import itertools
from bisect import bisect_left
from collections.abc import Sequence

from faults.measure import BaseReport
from faults.seen import Command, Motion, Seen

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
