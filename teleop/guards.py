"""Guards: conditions that forbid motion although the operator requests it. Pure.

Refusals     the supervisor refuses all commands of this program
Supervisors  two robots have one namespace
RoundTrip    the robot answers too late
Pulse        the terminal no longer shows the output; a key may have been typed before it showed the present picture
"""

import math
from collections import deque

from wire.messages import SourceStatus

LOCKED_OUT_S = 0.5
"""Time without an accepted command after which a program is locked out: ten heartbeats."""


class Refusals:
    """Detects from the status counters that the supervisor refuses all commands of this program.

    The supervisor never accepts an ended epoch again (docs/decisions/0020). An epoch ends if another program
    uses this name, or a copy of the epoch, while this program is silent. Then only a new epoch is accepted,
    which begins neutral like a restarted program.
    """

    def __init__(self) -> None:
        self._before: SourceStatus | None = None
        self._since_s = 0.0
        """Time of the last status with accepted commands, or without refused ones."""

    def another_speaks(self, own: SourceStatus) -> bool:
        """Return whether commands of another epoch arrived since the previous status."""
        return self._before is not None and own.refused_epoch > self._before.refused_epoch

    def all_refused(self, own: SourceStatus, now_s: float) -> bool:
        """Return whether commands were refused and none accepted for `LOCKED_OUT_S`; then the time starts again.

        Args:
            own: this source in a new status; it becomes the previous one.
            now_s: the time of any monotonic clock.
        """
        before, self._before = self._before, own
        if before is None or own.accepted != before.accepted or _refused(own) == _refused(before):
            self._since_s = now_s
        if now_s - self._since_s < LOCKED_OUT_S:
            return False
        self._since_s = now_s
        return True


def _refused(own: SourceStatus) -> int:
    return own.refused_epoch + own.refused_sequence


HOLD_S = 1.0
"""How long a conflict holds after its last evidence: ten statuses."""
KEPT_RUNS = 8


class Supervisors:
    """Detects two supervisors in one namespace: two robots that would both obey this program.

    Behind a router, two robots with one namespace, such as copies of one disk, look like one. A supervisor that was
    restarted speaks as a new run, and its earlier run never speaks again; if it does, there are two.
    """

    def __init__(self) -> None:
        self._runs: deque[bytes] = deque(maxlen=KEPT_RUNS)
        """The last run that spoke is at the end."""
        self._evidence_s = -math.inf

    def heard(self, run: bytes, now_s: float) -> None:
        """Take the run of a status, which its stamp contains, and its arrival time [s]."""
        if run in self._runs:
            if run != self._runs[-1]:
                self._evidence_s = now_s
            self._runs.remove(run)
        self._runs.append(run)

    def are_several(self, now_s: float) -> bool:
        """Return whether two supervisors spoke within `HOLD_S`."""
        return now_s - self._evidence_s < HOLD_S


WINDOW_S = 1.0
"""The shortest round trip of the statuses that span this time counts: of ten, nine may be late. It is not the time since
then, because the first status after a cut confirms a command from before the cut."""
KEPT_COMMANDS = 2000
"""Ten seconds at the highest rate; a link that is slower opens no session."""


class RoundTrip:
    """The round trip of a command to the supervisor and back, by the clock of this program alone.

    The age of a command at the supervisor does not contain a delay that the link has from the start, because the clocks of
    two hosts are not compared. The status repeats the stamp of each source's newest command, so that its sender can
    measure the time until the robot obeys and the operator sees that it does (docs/decisions/0057).

    Args:
        limit_s: the maximum round trip; above it, the robot obeys too late.
    """

    def __init__(self, limit_s: float = 0.5) -> None:
        self._limit_s = limit_s
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

    @property
    def lateness(self) -> str:
        """How late the robot answers, as the beginning of a sentence; empty within the limit."""
        shortest_s = self.shortest_s
        if not shortest_s > self._limit_s:
            return ""
        if math.isinf(shortest_s):
            return "the robot has not answered a command yet"
        return f"the robot answers after {shortest_s:.2f} s, and the limit is {self._limit_s:g} s"


def _rounded_us(time_ns: int) -> int:
    """Return a stamp in whole microseconds: the supervisor's float64 times are not exact to the nanosecond."""
    return round(time_ns, -3) // 1000


ANSWER_LIMIT_S = 0.3
"""Without a reply for longer than this, the operator does not see the output."""
TRIES = 20
"""Number of requests to a terminal that never replies, and of requests that are remembered."""
LOST_PERIOD_S = 1.0
"""Period of the requests to a terminal that no longer replies."""
SETTLING_S = 1.0
"""On a terminal that never replies, or too often, keys count as old for this long after a doubt: a link that comes back
delivers them at once."""


class Pulse:
    """Detects a terminal that no longer shows the output, from missing replies to status requests.

    A hung ssh session accepts output until its buffers are full. Meanwhile the operator sees a frozen picture, and the
    keys do not arrive. Therefore each picture includes a status request (DSR), which practically every terminal answers.
    A terminal that has never replied cannot be checked. One that replies more often than it is asked, such as a terminal that
    two browsers show, proves less: its surplus may count for requests that it has not received.

    Keys and replies arrive in one stream. A key behind the reply to a request was typed after the terminal had received
    this request and the picture before it. After a doubt, only keys behind the reply to a later request are live
    (docs/decisions/0061). A lost reply delays this by one request.
    """

    def __init__(self) -> None:
        self._open_s: deque[float] = deque(maxlen=TRIES)
        """Send times of the requests without a reply, the oldest first."""
        self._answered_s, self._proven_s = math.nan, math.nan
        """Arrival of the newest reply, and the send time of its request."""
        self._asked_s, self._doubted_s = -math.inf, -math.inf
        self._has_surplus = False
        """Whether a reply came that no request explains."""

    @property
    def answers(self) -> bool:
        """Whether the terminal has ever replied."""
        return not math.isnan(self._proven_s)

    @property
    def open(self) -> int:
        """Number of requests without a reply."""
        return len(self._open_s)

    def is_due(self, now_s: float) -> bool:
        """Return whether the next picture should include a request."""
        if not self.answers:
            return self.open < TRIES
        return not self.is_lost(now_s) or now_s - self._asked_s >= LOST_PERIOD_S

    def ask(self, now_s: float) -> None:
        self._asked_s = now_s
        self._open_s.append(now_s)

    def answer(self, now_s: float) -> None:
        """Take a reply; one without a request proves nothing."""
        if self._open_s:
            self._answered_s, self._proven_s = now_s, self._open_s.popleft()
        else:
            self._has_surplus = True

    def is_lost(self, now_s: float) -> bool:
        """Return whether a terminal that has replied before no longer does."""
        if not (self.answers and self._open_s):
            return False
        return now_s - max(self._answered_s, self._open_s[0]) > ANSWER_LIMIT_S

    def doubt(self, now_s: float) -> None:
        """Require a new proof: the operator may not have seen the pictures until now."""
        self._doubted_s = now_s

    def is_live(self, now_s: float) -> bool:
        """Return whether a key that arrives next in the stream was typed after the newest doubt."""
        is_settled = now_s - self._doubted_s > SETTLING_S
        if not self.answers:
            return is_settled
        return self._proven_s > self._doubted_s and (is_settled or not self._has_surplus)
