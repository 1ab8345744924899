"""Measure the consequences of a fault: detection, time to zero, and the stopping place. Pure."""

import itertools
import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

from faults.seen import Seen
from lifeline.incidents.braking import braking

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
