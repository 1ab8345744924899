"""Rates, sizes, ages and writers of the samples that were heard, for each key. Pure: arrival times are arguments.

Writers are distinguished by the epoch in their stamps; all samples without a stamp count as one writer. Everything is
bounded: a flood of keys or epochs takes no more memory than `MAX_KEYS` and `MAX_WRITERS` allow.
"""

import math
import statistics
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from wire.bus import Overheard
from wire.stamp import parse_stamp

MAX_KEYS = 1024
MAX_WRITERS = 16
WINDOW = 4096
"""Number of samples that the figures of a key are computed from."""
CLOCK_TOLERANCE_S = 0.005
"""An age below minus this, or above `OLDEST_S`, shows a clock that is not this machine's."""
OLDEST_S = 60.0


@dataclass(slots=True)
class Writer:
    """One writer of a key."""

    first_s: float
    last_s: float
    sequence: int | None = None
    is_copied: bool = False
    """Whether its sequence numbers did not increase: another program uses its epoch."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Statistics of some durations [s]; NaN without any."""

    number: int
    mean_s: float
    minimum_s: float
    maximum_s: float
    deviation_s: float


@dataclass(slots=True)
class KeyTraffic:
    """The samples of one key."""

    samples: int = 0
    arrivals_s: deque[float] = field(default_factory=lambda: deque[float](maxlen=WINDOW))
    sizes: deque[int] = field(default_factory=lambda: deque[int](maxlen=WINDOW))
    ages_s: deque[float] = field(default_factory=lambda: deque[float](maxlen=WINDOW))
    writers: dict[bytes | None, Writer] = field(default_factory=dict[bytes | None, Writer])
    """By epoch; None: without a stamp."""
    is_flooded: bool = False
    """Whether there were more writers than are counted."""

    def add(self, sample: Overheard) -> None:
        """Count a sample."""
        self.samples += 1
        self.arrivals_s.append(sample.arrival_s)
        self.sizes.append(len(sample.payload))
        stamp = parse_stamp(sample.attachment)
        if stamp is not None:
            self.ages_s.append(sample.arrival_s - stamp.source_time_ns * 1e-9)
        self._count(
            None if stamp is None else stamp.gid, None if stamp is None else stamp.sequence, sample.arrival_s
        )

    @property
    def rate_hz(self) -> float:
        """Mean rate between the first and the last arrival; NaN with fewer than two."""
        duration_s = self.arrivals_s[-1] - self.arrivals_s[0] if self.arrivals_s else 0.0
        return (len(self.arrivals_s) - 1) / duration_s if duration_s > 0.0 else math.nan

    @property
    def bytes_s(self) -> float:
        """Mean rate of payload bytes; NaN with fewer than two samples."""
        return self.rate_hz * statistics.fmean(self.sizes) if self.sizes else math.nan

    @property
    def gaps(self) -> Spread:
        """The times between successive arrivals."""
        return spread([after_s - before_s for before_s, after_s in pairwise(self.arrivals_s)])

    @property
    def ages(self) -> Spread:
        """The ages of stamped samples at their arrival."""
        return spread(list(self.ages_s))

    @property
    def is_other_clock(self) -> bool:
        """Whether the ages show that a sender's clock is not this machine's, so that they mean nothing."""
        return any(not -CLOCK_TOLERANCE_S <= age_s <= OLDEST_S for age_s in self.ages_s)

    def concurrent(self) -> int:
        """Return the largest number of writers that were active at the same time.

        A writer is active from its first sample to its last one. A program that is restarted is a new writer, but its
        predecessor has ended by then. A copied epoch has two writers. With more epochs than are counted, there are at
        least two writers: one program does not restart so often.
        """
        writers = self.writers.values()
        active = (
            sum(1 + one.is_copied for one in writers if one.first_s <= other.first_s <= one.last_s)
            for other in writers
        )
        return max(active, default=0) if not self.is_flooded else max(2, *active)

    def _count(self, epoch: bytes | None, sequence: int | None, arrival_s: float) -> None:
        writer = self.writers.get(epoch)
        if writer is None:
            if len(self.writers) < MAX_WRITERS:
                self.writers[epoch] = Writer(arrival_s, arrival_s, sequence=sequence)
            else:
                self.is_flooded = True
            return
        if sequence is not None and writer.sequence is not None:
            writer.is_copied |= sequence <= writer.sequence
        writer.last_s, writer.sequence = arrival_s, sequence


def spread(values_s: list[float]) -> Spread:
    """Return the statistics of some durations."""
    if not values_s:
        return Spread(0, math.nan, math.nan, math.nan, math.nan)
    return Spread(
        len(values_s),
        statistics.fmean(values_s),
        min(values_s),
        max(values_s),
        statistics.pstdev(values_s),
    )


class Traffic:
    """All samples that were heard, by full key."""

    def __init__(self) -> None:
        self.keys: dict[str, KeyTraffic] = {}
        self.uncounted = 0
        """Samples that arrived faster than they could be counted."""

    def add(self, sample: Overheard) -> None:
        """Count a sample, unless there are too many keys."""
        if sample.key in self.keys or len(self.keys) < MAX_KEYS:
            self.keys.setdefault(sample.key, KeyTraffic()).add(sample)

    def foreign(self, namespace: str) -> Iterator[str]:
        """Yield the keys outside of a robot's namespace."""
        return (key for key in sorted(self.keys) if not key.startswith(f"{namespace}/"))
