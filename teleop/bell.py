"""When to ring the terminal's bell: at the start of a collision warning, then while the obstacle comes closer."""

import math

PAUSE_S = 2.0
"""Minimum time between two rings: operators switch off a bell that rings all the time."""
CLOSER_M = 0.02
"""Minimum decrease of the distance that counts as closer; smaller changes are noise of the lidar."""


class WarningBell:
    """Decides from each status whether to ring."""

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
