"""Whether anybody at the other end of the terminal still draws: what it is asked, it answers.

A hung ssh session takes output for a long time before its buffers are full; meanwhile the operator sees a still
picture and none of his keys arrive. So the terminal is asked for its state with each picture (DSR, answered by
practically every terminal). One that never answered is not held to it.
"""

import math

ANSWER_LIMIT_S = 0.3
"""Without an answer for longer, the operator does not see what is drawn."""
TRIES = 20
"""Questions to a terminal that never answers."""


class Pulse:
    """Takes note of questions and answers."""

    def __init__(self) -> None:
        self._answered_s = math.nan
        self._asked_s = -math.inf
        self.open = 0
        """Questions without an answer."""

    @property
    def answers(self) -> bool:
        """It has answered before."""
        return not math.isnan(self._answered_s)

    @property
    def is_worth_asking(self) -> bool:
        """It has answered, or not been asked often."""
        return self.answers or self.open < TRIES

    def ask(self, now_s: float) -> None:
        if now_s - self._asked_s > ANSWER_LIMIT_S and self.answers:
            self._answered_s = now_s  # after a pause of ours, not of the terminal's
        self._asked_s = now_s
        self.open += 1

    def answer(self, now_s: float) -> None:
        self._answered_s = now_s
        self.open = max(0, self.open - 1)

    def is_lost(self, now_s: float) -> bool:
        """It has answered before, and does not any more."""
        return self.answers and now_s - self._answered_s > ANSWER_LIMIT_S
