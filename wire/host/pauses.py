"""The clocks of this process and its pauses: the time that the machine was suspended, and stalls of the event loop.

All ages are measured with CLOCK_MONOTONIC, which stops while the machine is suspended. After a resume, everything
received before therefore looks fresh. CLOCK_BOOTTIME continues, and without a suspend the difference is constant.

The two clocks cannot be read simultaneously. Each reading therefore gives bounds of the difference, from the monotonic
clock before and after it. Only growth beyond these bounds counts, so that a process that is descheduled during a
reading does not report a suspend.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)
"""None on a system without this clock: no suspend shows there."""
STALL_S = 0.2
"""A shorter pause makes no request fail: callers wait for 1 s, or until their link counts as lost, after 0.4 s of silence."""
BACKLOG_S = 1.0
"""After a stall, requests that waited in the network arrive within this time."""


class Clocks(NamedTuple):
    """One reading of both clocks [ns]."""

    before_ns: int
    """CLOCK_MONOTONIC before the other one was read."""
    boottime_ns: int
    after_ns: int
    """CLOCK_MONOTONIC after the other one was read."""


def read_clocks() -> Clocks:
    if BOOTTIME is None:
        return Clocks(0, 0, 0)
    return Clocks(time.monotonic_ns(), time.clock_gettime_ns(BOOTTIME), time.monotonic_ns())


def wall_ahead_ns() -> int:
    """Return the wall clock of this computer less its monotonic clock [ns].

    Both cannot be read at once. Of three readings, the one that took the least time counts: a thread that is descheduled during
    one of them would otherwise see a step of the clock.
    """
    readings = [(time.monotonic_ns(), time.time_ns(), time.monotonic_ns()) for _ in range(3)]
    before_ns, wall_ns, _ = min(readings, key=lambda reading: reading[2] - reading[0])
    return wall_ns - before_ns


class SuspendMeter:
    """Measures the time in suspend between two calls.

    Args:
        read: reads both clocks.
    """

    def __init__(self, read: Callable[[], Clocks] = read_clocks) -> None:
        self._read = read
        self._at_most_ns = math.inf
        """An upper bound of the clocks' difference since the last suspend."""
        self.suspended_s()

    def suspended_s(self) -> float:
        """Return a lower bound of the time in suspend since the last call [s]."""
        clocks = self._read()
        at_least_ns = clocks.boottime_ns - clocks.after_ns
        at_most_ns = clocks.boottime_ns - clocks.before_ns
        grown_ns = at_least_ns - self._at_most_ns
        if grown_ns > 0:
            self._at_most_ns = at_most_ns
            return grown_ns * 1e-9
        self._at_most_ns = min(self._at_most_ns, at_most_ns)
        return 0.0


def never_suspended() -> float:
    """Return zero; replaces a meter on a simulated machine, which is never suspended."""
    return 0.0


@dataclass(slots=True)
class StallMeter:
    """Whether requests may have waited while this process was stopped or starved, by the turns of its event loop.

    A person whose request is not answered in time is informed that it has failed. If the process then goes on and carries
    the request out, an e-stop ends, or a planner is armed, although nobody asks for it any more.

    Args:
        turned_s: time of the last turn [s].
    """

    turned_s: float
    _until_s: float = 0.0

    def turn(self, now_s: float) -> None:
        """Note a turn of the loop, which must come more often than every `STALL_S`."""
        if now_s - self.turned_s > STALL_S:
            self._until_s = now_s + BACKLOG_S
        self.turned_s = now_s

    def may_be_old(self, now_s: float) -> bool:
        """Return whether a request that is read now may be one that waited."""
        return now_s < self._until_s or now_s - self.turned_s > STALL_S
