"""Whether a key is held, told by nothing but its repeats.

A terminal that reports no releases sends a held key once, then nothing for its initial delay (a quarter to two
thirds of a second), then again and again in short intervals. A key counts as held from the moment that it comes
twice faster than a finger types, until it has been missing for longer than its interval explains
(docs/decisions/0014).
"""

import math
from collections import deque

PROOF_S = 0.11
"""The same key again within this time is the terminal's doing: a finger needs longer."""
MIN_WINDOW_S = 0.1
WINDOW_INTERVALS = 2.5
"""A repeat that is lost or late for less than this is no release."""
REMEMBERED = 20
"""Intervals that the longest is taken of: a link that delivers unevenly is given the time it needs."""


class Repeats:
    """Which key is held by its repeats."""

    def __init__(self) -> None:
        self._key = ""
        self._last_s = -math.inf
        self._until_s = -math.inf
        self._intervals_s: deque[float] = deque(maxlen=REMEMBERED)

    @property
    def window_s(self) -> float:
        """How long after its last repeat a key counts as held."""
        return max(MIN_WINDOW_S, WINDOW_INTERVALS * max(self._intervals_s, default=0.0))

    @property
    def until_s(self) -> float:
        """Until when the key counts as held; `-math.inf`: none does."""
        return self._until_s

    def press(self, key: str, now_s: float) -> None:
        interval_s = now_s - self._last_s
        if key == self._key and interval_s <= PROOF_S:
            self._intervals_s.append(interval_s)
            self._until_s = now_s + self.window_s
        elif key != self._key or now_s >= self._until_s:
            self._until_s = -math.inf
        self._key, self._last_s = key, now_s

    def held(self, now_s: float) -> str | None:
        """The key that is held at `now_s`."""
        return self._key if now_s < self._until_s else None

    def forget(self) -> None:
        """Nothing is held; what was learned of the terminal's interval stays."""
        self._key, self._last_s, self._until_s = "", -math.inf, -math.inf
