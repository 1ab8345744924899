"""Detect a terminal that no longer shows the output, from missing replies to status requests.

A hung ssh session accepts output until its buffers are full. Meanwhile the operator sees a frozen picture, and the keys
do not arrive. Therefore each picture includes a status request (DSR), which practically every terminal answers. A
terminal that has never replied is not checked.
"""

import math

ANSWER_LIMIT_S = 0.3
"""Without a reply for longer than this, the operator does not see the output."""
TRIES = 20
"""Number of requests to a terminal that never replies."""


class Pulse:
    """Tracks requests and replies."""

    def __init__(self) -> None:
        self._answered_s = math.nan
        self._asked_s = -math.inf
        self.open = 0
        """Number of requests without a reply."""

    @property
    def answers(self) -> bool:
        """Whether the terminal has ever replied."""
        return not math.isnan(self._answered_s)

    @property
    def is_worth_asking(self) -> bool:
        """Whether the terminal has ever replied, or has received fewer than `TRIES` requests."""
        return self.answers or self.open < TRIES

    def ask(self, now_s: float) -> None:
        if now_s - self._asked_s > ANSWER_LIMIT_S and self.answers:
            self._answered_s = now_s  # the pause before this request was not the terminal's
        self._asked_s = now_s
        self.open += 1

    def answer(self, now_s: float) -> None:
        self._answered_s = now_s
        self.open = max(0, self.open - 1)

    def is_lost(self, now_s: float) -> bool:
        """Return whether a terminal that has replied before no longer does."""
        return self.answers and now_s - self._answered_s > ANSWER_LIMIT_S
