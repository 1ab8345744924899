"""The round trip of a command to the supervisor and back, by the clock of this program alone. Pure.

The age of a command at the supervisor does not contain a delay that the link has from the start, because the clocks of
two hosts are not compared. The status repeats the stamp of each source's newest command, so that its sender can measure
the time until the robot obeys and the operator sees that it does (docs/decisions/0057).
"""

import math
from collections import deque

WINDOW_S = 1.0
"""The shortest round trip of the statuses that span this time counts: of ten, nine may be late. It is not the time since
then, because the first status after a cut confirms a command from before the cut."""
KEPT_COMMANDS = 2000
"""Ten seconds at the highest rate; a link that is slower opens no session."""


class RoundTrip:
    """The round trips of the newest commands."""

    def __init__(self) -> None:
        self._sent_s: dict[int, float] = {}
        """Send time [s] of the newest confirmed command and of all later ones, by the stamp [µs], the oldest first."""
        self._measured: deque[tuple[float, float]] = deque()
        """Arrival of a status [s], and its round trip [s]."""
        self._is_reported = True
        """Whether the newest status reports stamps; before the first status, motion must wait for one."""

    def sent(self, source_time_ns: int, now_s: float) -> None:
        """Record the time at which a command with this stamp is sent."""
        if len(self._sent_s) >= KEPT_COMMANDS:
            del self._sent_s[next(iter(self._sent_s))]
        self._sent_s[_rounded_us(source_time_ns)] = now_s

    def heard(self, source_time_ns: int | None, arrival_s: float) -> None:
        """Measure the round trip of the command that a status confirms.

        Args:
            source_time_ns: the stamp of this source's newest command in the status. 0: the supervisor has received no
                command with a stamp. None: the status cannot report it, because it is from an older supervisor, or from
                one that does not know this source.
            arrival_s: arrival of the status, by the clock of `sent`.
        """
        self._is_reported = source_time_ns is not None
        stamp_us = _rounded_us(source_time_ns or 0)
        # A stamp of another program or host is not among those that were sent here.
        if stamp_us not in self._sent_s:
            return
        measured = self._measured
        measured.append((arrival_s, arrival_s - self._sent_s[stamp_us]))
        while len(measured) > 2 and measured[-1][0] - measured[1][0] >= WINDOW_S:
            measured.popleft()
        while next(iter(self._sent_s)) != stamp_us:
            del self._sent_s[next(iter(self._sent_s))]

    @property
    def shortest_s(self) -> float:
        """The shortest of the newest round trips [s], which span WINDOW_S.

        It includes the wait for the next status, up to one period of the commands. It is infinite before the first
        confirmation, and NaN if the supervisor cannot report it.
        """
        if not self._is_reported:
            return math.nan
        return min((round_trip_s for _, round_trip_s in self._measured), default=math.inf)


def _rounded_us(time_ns: int) -> int:
    """Return a stamp in whole microseconds: the supervisor's float64 times are not exact to the nanosecond."""
    return round(time_ns, -3) // 1000
