"""Detect a held key from its repeats alone.

A terminal without release reports sends a held key once, then nothing for its initial delay (a quarter to two thirds of
a second), then repeatedly at short intervals. A key counts as held as soon as it arrives twice within a time shorter
than a finger needs. It counts as released after a pause longer than its repeat interval explains (docs/decisions/0014).
"""

import math
from collections import deque

PROOF_S = 0.11
"""The same key again within this time is a repeat by the terminal: a finger needs longer."""
MIN_WINDOW_S = 0.1
WINDOW_INTERVALS = 2.5
"""A key counts as released after this many repeat intervals without a repeat."""
REMEMBERED = 20
"""Number of recent intervals of which the longest is used, to allow for a link with uneven delivery."""


class Repeats:
    """Detects which key is held."""

    def __init__(self) -> None:
        self._key = ""
        self._last_s = -math.inf
        self._until_s = -math.inf
        self._void_key, self._void_s = "", -math.inf
        """The key that was held when it was forgotten, and its newest repeat since then."""
        self._intervals_s: deque[float] = deque(maxlen=REMEMBERED)

    @property
    def window_s(self) -> float:
        """Time after its last repeat for which a key counts as held."""
        return max(MIN_WINDOW_S, WINDOW_INTERVALS * max(self._intervals_s, default=0.0))

    @property
    def until_s(self) -> float:
        """Time until which the key counts as held; `-math.inf` if none does."""
        return self._until_s

    def press(self, key: str, now_s: float) -> None:
        if key == self._void_key and now_s - self._void_s <= self.window_s:
            self._void_s = now_s
            return
        self._void_key = ""
        interval_s = now_s - self._last_s
        if key == self._key and interval_s <= PROOF_S:
            self._intervals_s.append(interval_s)
            self._until_s = now_s + self.window_s
        elif key != self._key or now_s >= self._until_s:
            self._until_s = -math.inf
        self._key, self._last_s = key, now_s

    def held(self, now_s: float) -> str | None:
        """Return the key that is held at `now_s`; None if none is."""
        return self._key if now_s < self._until_s else None

    def forget(self) -> None:
        """Release the held key, whose further repeats are void until a pause; keep the learned repeat intervals."""
        if self._until_s > -math.inf:
            self._void_key, self._void_s = self._key, self._last_s
        self._key, self._last_s, self._until_s = "", -math.inf, -math.inf
