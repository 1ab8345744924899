"""When the terminal's bell rings for something near: at the edge of the warning, then while it still comes closer."""

import math

PAUSE_S = 2.0
"""At least this long between two rings: a bell that never stops is switched off."""
CLOSER_M = 0.02
"""Less is the lidar's noise."""


class WarningBell:
    """Hears each status, and says when to ring."""

    def __init__(self) -> None:
        self._warned = False
        self._rang_at_s = -math.inf
        self._rang_at_m = math.inf

    def rings(self, *, warning: bool, nearest_m: float, now_s: float) -> bool:
        """Take a status in; True: ring now."""
        at_edge = warning and not self._warned
        closer = warning and nearest_m <= self._rang_at_m - CLOSER_M
        if now_s - self._rang_at_s < PAUSE_S:
            self._warned = (
                self._warned and warning
            )  # an edge within the pause rings after it, if it still holds
            return False
        self._warned = warning
        if at_edge or closer:
            self._rang_at_s, self._rang_at_m = now_s, nearest_m
            return True
        return False
