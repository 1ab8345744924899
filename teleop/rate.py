"""A fixed rate without drift and without catching up."""

import math

TOLERANCE_S = 1e-5
"""A timer may fire this much too early; it still counts as the tick."""


class Rate:
    """Ticks at start, start + period, ... : a late tick does not shift the next ones, and missed ticks are skipped."""

    def __init__(self, period_s: float, start_s: float) -> None:
        self.period_s = period_s
        self._start_s = start_s
        self._count = 0

    @property
    def next_s(self) -> float:
        """Time at which the next tick is due."""
        return self._start_s + self._count * self.period_s

    def lateness_s(self, now_s: float) -> float:
        """Return how long the next tick has been due; negative if it is not due yet."""
        return now_s - self.next_s

    def tick(self, now_s: float) -> bool:
        """Return whether a tick is due at `now_s`, and take it; several missed ticks count as one."""
        if self.lateness_s(now_s) < -TOLERANCE_S:
            return False
        self._count = math.floor((now_s - self._start_s + TOLERANCE_S) / self.period_s) + 1
        return True
