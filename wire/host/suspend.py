"""Measurement of the time that the machine was suspended; the monotonic clock does not include it.

All ages are measured with CLOCK_MONOTONIC, which stops while the machine is suspended. After a resume, everything
received before therefore looks fresh. CLOCK_BOOTTIME continues, and without a suspend the difference is constant.

The two clocks cannot be read simultaneously. Each reading therefore gives bounds of the difference, from the monotonic
clock before and after it. Only growth beyond these bounds counts, so that a process that is descheduled during a
reading does not report a suspend.
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
    """Return a reading that shows no suspend, for a system without CLOCK_BOOTTIME."""
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
