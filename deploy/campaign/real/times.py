"""What a real fault took, from what an observer saw. Pure. Times are of one monotonic clock."""

import itertools
from bisect import bisect_left
from collections.abc import Sequence

from deploy.campaign.measure import BaseReport
from deploy.campaign.seen import Command, Motion, Seen

STALL_S = 0.03
"""A simulation that stood longer than this does not brake as the clock on the wall goes: its deceleration is
not judged then, and when its wheels were asked for zero is judged without the time in which it did not run. The
record says how long it stood."""


def to_lasting_zero_s(commands: Sequence[Command], fault_s: float, until_s: float) -> float | None:
    """From the fault to the first zero on cmd_vel that is followed by zeros only.

    Args:
        commands: of the whole trial, by time of arrival.
        fault_s: the instant of the injection.
        until_s: when somebody was neutral again; what follows does not count.

    Returns:
        None: nothing but zero was commanded when it happened, or the zeros did not last.
    """
    start = bisect_left(commands, fault_s, key=lambda command: command.arrival_s)
    if start == 0 or commands[start - 1].is_zero:
        return None
    after = list(itertools.takewhile(lambda c: c.arrival_s < until_s, commands[start:]))
    zeros = list(itertools.takewhile(lambda c: c.is_zero, reversed(after)))
    return zeros[-1].arrival_s - fault_s if zeros else None


def to_lasting_rest_s(driven: Sequence[tuple[float, bool]], fault_s: float, until_s: float) -> float | None:
    """From the fault to the wheels being asked for zero, and for nothing else until then.

    Args:
        driven: whether the drive is asked for anything but zero, each time that it changed.
        fault_s: as above.
        until_s: as above.

    Returns:
        None: they were not asked for anything, or still are.
    """
    before = [is_driven for at_s, is_driven in driven if at_s < fault_s]
    after = [(at_s, is_driven) for at_s, is_driven in driven if fault_s <= at_s < until_s]
    if not before or not before[-1] or not after or after[-1][1]:
        return None
    return after[-1][0] - fault_s


def longest_gap_s(times_s: Sequence[float], from_s: float, until_s: float) -> float:
    """The longest time between two of these moments, from the last one before the beginning to the end."""
    start = max(0, bisect_left(times_s, from_s) - 1)
    within = list(itertools.takewhile(lambda time_s: time_s < until_s, times_s[start:]))
    return max((b - a for a, b in itertools.pairwise(within)), default=0.0)


def stood_s(motions: Sequence[Motion], from_s: float, until_s: float) -> float:
    """For how long the simulation did not run between two moments: it tells its motion every 10 ms while it does."""
    times_s = [from_s, *(motion.time_s for motion in motions if from_s < motion.time_s < until_s), until_s]
    return sum(max(0.0, b - a - STALL_S) for a, b in itertools.pairwise(times_s))


def since(began_s: float, seen: Seen, base: Sequence[BaseReport]) -> tuple[Seen, list[BaseReport]]:
    """The same with all times from there on."""
    shifted = Seen(
        commands=[one._replace(arrival_s=one.arrival_s - began_s) for one in seen.commands],
        statuses=[one._replace(arrival_s=one.arrival_s - began_s) for one in seen.statuses],
        motions=[one._replace(time_s=one.time_s - began_s) for one in seen.motions],
        asked=[one._replace(sent_s=one.sent_s - began_s) for one in seen.asked],
        driven=[(at_s - began_s, is_driven) for at_s, is_driven in seen.driven],
    )
    return shifted, [one._replace(time_s=one.time_s - began_s) for one in base]
