"""The round trip of a command to the supervisor and back, by the clock of this program alone. Pure.

The age of a command at the supervisor does not contain a delay that the link has from the start, because the clocks of
two hosts are not compared. The status repeats the stamp of each source's newest command, so that its sender can measure
how late the robot obeys, and how late its operator sees that (docs/decisions/0057).
"""

import math
from collections import deque

WINDOW_S = 1.0
"""The shortest round trip of this time counts: ten statuses, of which some may be lost or late."""
KEPT_COMMANDS = 2000
"""Ten seconds at the highest rate; a link that is slower opens no session."""


class RoundTrip:
    """The round trips of the newest commands."""

    def __init__(self) -> None:
        self._sent_s: dict[int, float] = {}
        """When each command was sent whose confirmation has not arrived, by its stamp [µs], the oldest first."""
        self._measured: deque[tuple[float, float]] = deque()
        """Arrival of a status [s], and its round trip [s]."""
        self._is_reported = False

    def sent(self, source_time_ns: int, now_s: float) -> None:
        """Note a command with this stamp that is sent now."""
        if len(self._sent_s) >= KEPT_COMMANDS:
            del self._sent_s[next(iter(self._sent_s))]
        self._sent_s[_rounded_us(source_time_ns)] = now_s

    def heard(self, source_time_ns: int | None, arrival_s: float) -> None:
        """Take the stamp of this source's newest command in a status that arrived at this time.

        Args:
            source_time_ns: 0 if the supervisor has received no command with a stamp; None if the status cannot report it:
                from an older supervisor, or one that does not know this source.
            arrival_s: by the clock of `sent`.
        """
        self._is_reported = source_time_ns is not None
        stamp_us = _rounded_us(source_time_ns or 0)
        # The stamp of another program, or of another host's clock, is none of those that were sent here.
        if stamp_us not in self._sent_s:
            return
        self._measured.append((arrival_s, arrival_s - self._sent_s[stamp_us]))
        while next(iter(self._sent_s)) != stamp_us:
            del self._sent_s[next(iter(self._sent_s))]

    def shortest_s(self, now_s: float) -> float:
        """Return the shortest round trip [s] within WINDOW_S.

        It contains up to one period of the commands. It is infinite if none was measured, and NaN if the supervisor
        cannot report it.
        """
        if not self._is_reported:
            return math.nan
        while self._measured and now_s - self._measured[0][0] > WINDOW_S:
            self._measured.popleft()
        return min((round_trip_s for _, round_trip_s in self._measured), default=math.inf)


def _rounded_us(time_ns: int) -> int:
    """The supervisor computes with times in float64, which are not exact to the nanosecond."""
    return round(time_ns, -3) // 1000
