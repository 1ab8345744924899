"""How long the machine was suspended, which the monotonic clock does not show.

CLOCK_MONOTONIC, the clock of every age here, stands still while the machine sleeps: on resume everything that was
heard before looks fresh. CLOCK_BOOTTIME goes on. Without a suspend their difference is constant.

The two clocks cannot be read at one moment. Each reading therefore gives bounds of the difference, from the monotonic
clock before and after, and only growth between the bounds of two readings counts: a process that is descheduled in
the middle of a reading shows no suspend.
"""

import math
import sys
import time
from collections.abc import Callable
from typing import NamedTuple


class Clocks(NamedTuple):
    """One reading of both clocks [ns]."""

    before_ns: int
    """CLOCK_MONOTONIC before the other one was read."""
    boottime_ns: int
    after_ns: int
    """CLOCK_MONOTONIC after the other one was read."""


def _read_none() -> Clocks:
    """Where there is no CLOCK_BOOTTIME, no suspend shows."""
    return Clocks(0, 0, 0)


if sys.platform == "linux":

    def _read() -> Clocks:
        return Clocks(time.monotonic_ns(), time.clock_gettime_ns(time.CLOCK_BOOTTIME), time.monotonic_ns())

    read_clocks: Callable[[], Clocks] = _read
else:
    read_clocks = _read_none


class SuspendMeter:
    """Measures the time in suspend between two calls.

    Args:
        read: reads both clocks.
    """

    def __init__(self, read: Callable[[], Clocks] = read_clocks) -> None:
        self._read = read
        self._at_most_ns = math.inf
        """An upper bound of the difference of the clocks since the last suspend."""
        self.suspended_s()

    def suspended_s(self) -> float:
        """How long the machine slept since the last call, at least [s]; never more than it did."""
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
    """In place of a meter, for a machine that does not sleep: a simulated one."""
    return 0.0
