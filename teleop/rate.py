"""A fixed rate that neither drifts nor catches up."""

import math

TOLERANCE_S = 1e-5
"""A timer may fire this much early: that is the tick, not a reason to wait again."""


class Rate:
    """Ticks at start, start + period, ... : a late tick does not move the next ones, a missed one is gone."""

    def __init__(self, period_s: float, start_s: float) -> None:
        self.period_s = period_s
        self._start_s = start_s
        self._count = 0

    @property
    def next_s(self) -> float:
        """When the next tick is due."""
        return self._start_s + self._count * self.period_s

    def lateness_s(self, now_s: float) -> float:
        """How long the next tick has been due; negative: not yet."""
        return now_s - self.next_s

    def tick(self, now_s: float) -> bool:
        """Whether a tick is due at `now_s`; however late it is, it is one."""
        if self.lateness_s(now_s) < -TOLERANCE_S:
            return False
        self._count = math.floor((now_s - self._start_s + TOLERANCE_S) / self.period_s) + 1
        return True
