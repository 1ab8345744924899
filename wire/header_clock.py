"""Whether the stamps of a topic run like real time.

A bridge, a recording or a simulation may stamp messages with a clock that stands, that has only whole seconds, that runs
slower than real time, or that goes back. The messages are then refused as late or out of order, although the link delays none.
This module finds the cause for reports and the status.
"""

from itertools import pairwise

WINDOW_S = 2.0
"""Time over which stamps are compared with arrivals."""
MIN_MESSAGES = 5
"""Fewer messages in a window show nothing."""
RATE_TOLERANCE = 0.01
"""A smaller deviation in a window may be the jitter of two arrivals. A deviation counts if two windows in sequence have it."""
STEPS_BACK = 3
"""Of the stamps in a window; fewer may be a clock that was set, or messages that overtook each other."""
SECOND_NS = 1_000_000_000
SIMULATED_BEFORE_NS = 1_000_000_000 * SECOND_NS
"""No clock of a computer shows a time before September 2001; the clock of a simulation, or since a start, does."""


class HeaderClock:
    """Follows the stamps of one topic."""

    def __init__(self) -> None:
        self.stamp_ns = 0
        """The newest stamp; 0: the header has none."""
        self.problem = ""
        """How the stamps differ from real time, as a predicate; empty if they do not."""
        self._window: list[tuple[int, float]] = []
        """Stamp and arrival of each message of the present window."""
        self._rate = 1.0
        """Rate of the stamps in the previous window."""

    @property
    def is_simulated(self) -> bool:
        return 0 < self.stamp_ns < SIMULATED_BEFORE_NS

    def hear(self, stamp_ns: int, arrival_s: float) -> None:
        """Process the stamp of a message.

        Args:
            stamp_ns: the stamp of its header; 0: it has none.
            arrival_s: its arrival time by the local monotonic clock.
        """
        self.stamp_ns = stamp_ns
        if stamp_ns == 0:
            self.problem, self._rate, self._window = "", 1.0, []
            return
        self._window.append((stamp_ns, arrival_s))
        first_ns, first_s = self._window[0]
        if arrival_s - first_s < WINDOW_S or len(self._window) < MIN_MESSAGES:
            return
        rate = (stamp_ns - first_ns) / SECOND_NS / (arrival_s - first_s)
        self.problem = self._compare(rate)
        if self.problem and self.is_simulated:
            self.problem += " (simulated time)"
        self._rate, self._window = rate, self._window[-1:]

    def _compare(self, rate: float) -> str:
        """Return how the stamps of this window and of the previous one differ from real time; empty if they do not."""
        steps_back_ns = [
            before - after for (before, _), (after, _) in pairwise(self._window) if after < before
        ]
        if len(steps_back_ns) >= STEPS_BACK:
            return f"go back again and again, by up to {max(steps_back_ns) / SECOND_NS:.2f} s"
        if rate == 0.0:
            return "do not change"
        if all(stamp_ns % SECOND_NS == 0 for stamp_ns, _ in self._window):
            return "are whole seconds"
        if max(rate, self._rate) < 1.0 - RATE_TOLERANCE:
            return f"run at {rate:.2f} of real time, or their delay grows"
        return f"run at {rate:.2f} of real time" if min(rate, self._rate) > 1.0 + RATE_TOLERANCE else ""


def in_words(ahead_s: float) -> str:
    """Return in words by how much a clock or a stamp differs from the clock of this computer."""
    return f"{abs(ahead_s):.2f} s {'ahead of' if ahead_s > 0.0 else 'behind'} this computer's clock"
