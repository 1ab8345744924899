"""Counts the false stops of a flow of commands as the supervisor would stop, and the moments that the bench disturbed (pure)."""

import math
from array import array
from collections.abc import Iterable, Sequence

from faults.report import statistics
from wire.freshness import Sent, Track, Verdict, judge

TIMEOUT_S = 0.2
"""The supervisor's default command timeout."""
LATE_S = 0.02
"""If a part of the bench itself is later than this, a stop near this moment is not the link's."""
AROUND_S = 0.05
PARTS = 10_000_000


class Flow:
    """The commands of one source, with the verdicts of the law.

    The age of the newest fresh command is the time since its arrival plus its time in transit. When the age exceeds the
    timeout, the robot stops; the next stop can come only after another fresh command.
    """

    def __init__(self) -> None:
        self.stops_s: list[float] = []
        """When the age exceeded the timeout."""
        self.worst_age_s = 0.0
        self.arrived = 0
        self.refused = 0
        """Commands that were not fresh: late, out of order, or of a session whose delay was not proven yet."""
        self._track = Track()
        self._sent_s = math.nan
        self.begin_s = math.inf

    @property
    def is_fresh(self) -> bool:
        """Whether a fresh command has ever arrived."""
        return not math.isnan(self._sent_s)

    def begin(self, now_s: float) -> None:
        """Count from now on."""
        self.begin_s = now_s
        if not self.is_fresh:
            self._sent_s = now_s

    def hear(self, sent: Sent | None, arrival_s: float) -> None:
        """Take a command.

        Args:
            sent: its stamp.
            arrival_s: its arrival by this machine's monotonic clock.
        """
        self._track, verdict, on_way_s = judge(self._track, sent, arrival_s, TIMEOUT_S)
        counts = arrival_s >= self.begin_s
        self.arrived += counts
        if verdict is not Verdict.FRESH:
            self.refused += counts
            return
        if counts:
            self._look(arrival_s)
        self._sent_s = arrival_s - on_way_s

    def end(self, now_s: float) -> None:
        """Count the age at the end, too."""
        self._look(now_s)
        self.begin_s = math.inf

    def _look(self, now_s: float) -> None:
        """Count a stop if the newest fresh command became too old before now."""
        age_s = now_s - self._sent_s
        self.worst_age_s = max(self.worst_age_s, age_s)
        if age_s > TIMEOUT_S:
            self.stops_s.append(self._sent_s + TIMEOUT_S)


class Lateness:
    """The lateness of all acts, and the moments of the late ones."""

    def __init__(self) -> None:
        self._late_s = array("d")
        self.moments: list[tuple[float, float]] = []
        """For each act that was later than `LATE_S`: when it was due, and how late it was [s]."""

    def add(self, due_s: float, at_s: float) -> None:
        late_s = at_s - due_s
        self._late_s.append(late_s)
        if late_s > LATE_S:
            self.moments.append((due_s, late_s))

    def percentile(self, percent: float) -> float:
        """Return a percentile [s]; 0 without acts."""
        return statistics.quantile(sorted(self._late_s), percent / 100) if self._late_s else 0.0

    def report(self) -> dict[str, object]:
        """Return p99, maximum and the late moments, for JSON."""
        return {
            "p99_s": self.percentile(99),
            "max_s": max(self._late_s, default=0.0),
            "acts": len(self._late_s),
            "moments": self.moments,
        }


Span = tuple[float, float]
"""Begin and end of an interval [s]."""


def disturbed(late: Iterable[tuple[float, float]], window: Span) -> list[Span]:
    """Return the intervals in which the bench itself may have caused a stop, without overlaps.

    Args:
        late: for each delay of a part of the bench: when it was due, and how late it was [s].
        window: the measurement; the parts outside it are cut off.
    """
    found: list[Span] = []
    spans = sorted((due_s - AROUND_S, due_s + late_s + TIMEOUT_S + AROUND_S) for due_s, late_s in late)
    for span in spans:
        begin_s, end_s = max(span[0], window[0]), min(span[1], window[1])
        if begin_s >= end_s:
            continue
        if found and begin_s <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end_s)
        else:
            found.append((begin_s, end_s))
    return found


def outside(stops_s: Iterable[float], spans: Sequence[Span]) -> list[float]:
    """Return the stops that lie in none of the intervals."""
    return [stop_s for stop_s in stops_s if not any(begin_s <= stop_s <= end_s for begin_s, end_s in spans)]


def length_s(spans: Iterable[Span]) -> float:
    """Return the length of all intervals together [s]."""
    return sum(end_s - begin_s for begin_s, end_s in spans)


def upper_rate(events: int, time: float) -> float:
    """Return the upper bound of a rate, 95 %, from the number of independent events in a time (Poisson)."""
    # The time is divided into so many parts that none contains two events.
    return statistics.upper_rate(PARTS, events) * PARTS / time
