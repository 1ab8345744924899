"""When something is due: the ticks of a fixed rate, and the terminal's bell."""

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


PAUSE_S = 2.0
"""Minimum time between two rings: operators switch off a bell that rings all the time."""
CLOSER_M = 0.02
"""Minimum decrease of the distance that counts as closer; smaller changes are noise of the lidar."""


class WarningBell:
    """Rings at the start of a collision warning, then while the obstacle comes closer."""

    def __init__(self) -> None:
        self._warned = False
        self._rang_at_s = -math.inf
        self._rang_at_m = math.inf

    def rings(self, *, warning: bool, nearest_m: float, now_s: float) -> bool:
        """Process the values of a status; return whether to ring now."""
        at_edge = warning and not self._warned
        closer = warning and nearest_m <= self._rang_at_m - CLOSER_M
        if now_s - self._rang_at_s < PAUSE_S:
            self._warned = (
                self._warned and warning
            )  # a warning that begins within the pause rings after the pause, if it still holds
            return False
        self._warned = warning
        if at_edge or closer:
            self._rang_at_s, self._rang_at_m = now_s, nearest_m
            return True
        return False
