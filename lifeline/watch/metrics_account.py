"""The accounting of `lifeline metrics`: counters and histograms of statuses, odometry and arrivals.

Counters never decrease, also if the supervisor restarts and its own counts begin at zero again.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from deploy.stack.formatting import HEARD_LIMIT_S, mode_name
from wire.freshness import DRIFT
from wire.message_types import MODES
from wire.messages import SafetyStatus, SourceStatus, Twist
from wire.reasons import StopReason
from wire.stamp import Stamp

AGE_BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
GAP_BOUNDS_S = (0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)
"""Bounds of the buckets; they contain the time limits of the default configuration: 0.15, 0.2, 0.25 and 0.3 s."""

REASONS = frozenset(str(reason) for reason in StopReason)
UNKNOWN = "UNKNOWN"
"""Name under which the reasons that this version does not know are counted."""

MAX_SOURCES = 64
"""Maximum number of command sources that are counted, because each adds series to the database."""


class Histogram:
    """Counts observations in buckets.

    Args:
        bounds: the upper bounds of the buckets, ascending; a value on a bound is in the lower bucket.
    """

    def __init__(self, bounds: Sequence[float]) -> None:
        self.bounds = tuple(bounds)
        self.counts = [0] * (len(self.bounds) + 1)
        """Observations of each bucket, not cumulative; the last one has no upper bound."""
        self.sum = 0.0

    def observe(self, value: float) -> None:
        self.counts[bisect_left(self.bounds, value)] += 1
        self.sum += value

    def cumulative(self) -> list[tuple[str, float]]:
        """Return each upper bound with the number of observations up to it, as Prometheus expects."""
        total, buckets = 0, list[tuple[str, float]]()
        for bound, count in zip((*map(str, self.bounds), "+Inf"), self.counts, strict=True):
            total += count
            buckets.append((bound, total))
        return buckets


class Timing:
    """Ages at arrival and gaps between arrivals of one topic.

    The clocks of sender and receiver may differ. Therefore the age is the excess over the smallest difference of arrival
    and source time in the sender's run, as in wire/freshness.py.
    """

    def __init__(self) -> None:
        self.ages = Histogram(AGE_BOUNDS_S)
        self.gaps = Histogram(GAP_BOUNDS_S)
        self._arrival_s: float | None = None
        self._stamp: Stamp | None = None
        self._baseline_s = 0.0
        self._stamped_s = 0.0

    def arrive(self, arrival_s: float, stamp: Stamp | None) -> None:
        """Account for one sample; without a stamp its age is not known, and only the gap counts."""
        if self._arrival_s is not None:
            self.gaps.observe(max(0.0, arrival_s - self._arrival_s))
        self._arrival_s = arrival_s
        if stamp is not None:
            self.ages.observe(self._age_s(arrival_s, stamp))

    def _age_s(self, arrival_s: float, stamp: Stamp) -> float:
        offset_s = arrival_s - stamp.source_time_ns * 1e-9
        before, self._stamp = self._stamp, stamp
        goes_on = (
            before is not None and before.gid == stamp.gid and before.source_time_ns <= stamp.source_time_ns
        )
        if goes_on:
            drifted_s = self._baseline_s + DRIFT * max(0.0, arrival_s - self._stamped_s)
            self._baseline_s = min(offset_s, drifted_s)
        else:
            self._baseline_s = offset_s
        self._stamped_s = arrival_s
        return offset_s - self._baseline_s


class RunCounters:
    """Sums counts that begin at zero in each run of their sender."""

    def __init__(self) -> None:
        self.totals: Counter[tuple[str, ...]] = Counter()
        self._last: dict[tuple[str, ...], int] = {}

    def begin_run(self) -> None:
        """The sender restarted: its counts begin at zero."""
        self._last.clear()

    def update(self, key: tuple[str, ...], count: int) -> None:
        """Account for a new value; a smaller one than before also means that the sender restarted."""
        last = self._last.get(key, 0)
        self.totals[key] += count - last if count >= last else count
        self._last[key] = count


@dataclass(slots=True)
class Account:
    """All counters of one robot; times are by the monotonic clock [s]."""

    stops: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys((*REASONS, UNKNOWN), 0)))
    """Rising edges of each stop reason. The reasons of the first status that is heard are older than the account."""
    mode_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(MODES, 0.0))
    """Time in each mode [s]. Time in which no supervisor was heard is in none."""
    accepted: RunCounters = field(default_factory=RunCounters)
    """Accepted commands; key (source,)."""
    refused: RunCounters = field(default_factory=RunCounters)
    """Refused commands; key (source, kind)."""
    status: SafetyStatus | None = None
    twist: Twist | None = None
    _status_s: float = 0.0
    _twist_s: float = 0.0
    _counted_s: float = 0.0
    _epoch: bytes | None = None

    def hear_status(self, status: SafetyStatus, arrival_s: float, stamp: Stamp | None) -> None:
        """Account for a status; its stamp shows whether the supervisor restarted."""
        self.advance(arrival_s)
        epoch = None if stamp is None else stamp.gid
        if epoch != self._epoch:
            self._epoch = epoch
            self.accepted.begin_run()
            self.refused.begin_run()
        if self.status is not None:
            for name in set(status.reasons).difference(self.status.reasons):
                self.stops[name if name in REASONS else UNKNOWN] += 1
        for source in status.sources:
            self._count(source)
        self.status, self._status_s = status, arrival_s
        self._counted_s = max(self._counted_s, arrival_s)

    def hear_odometry(self, twist: Twist, arrival_s: float) -> None:
        """Keep the newest velocity."""
        self.twist, self._twist_s = twist, arrival_s

    def advance(self, now_s: float) -> None:
        """Add the time until `now_s` to the present mode, up to the time at which the supervisor counts as silent."""
        if self.status is None:
            return
        until_s = min(now_s, self._status_s + HEARD_LIMIT_S)
        if until_s > self._counted_s:
            self.mode_s[mode_name(self.status)] += until_s - self._counted_s
            self._counted_s = until_s

    def status_at(self, now_s: float) -> SafetyStatus | None:
        """Return the last status; None if it is older than `HEARD_LIMIT_S`."""
        return self.status if now_s - self._status_s <= HEARD_LIMIT_S else None

    def twist_at(self, now_s: float) -> Twist | None:
        """Return the last velocity; None if it is older than `HEARD_LIMIT_S`."""
        return self.twist if now_s - self._twist_s <= HEARD_LIMIT_S else None

    def _count(self, source: SourceStatus) -> None:
        if (source.name,) not in self.accepted.totals and len(self.accepted.totals) >= MAX_SOURCES:
            return
        self.accepted.update((source.name,), source.accepted)
        for kind, count in (
            ("late", source.refused_late),
            ("sequence", source.refused_sequence),
            ("epoch", source.refused_epoch),
            ("invalid", source.refused_invalid),
        ):
            self.refused.update((source.name, kind), count)
