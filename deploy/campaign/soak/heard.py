"""What is heard of the robot: how late it speaks, what is lost on the way, and which stops nobody provoked."""

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from wire.messages import SafetyStatus
from wire.stamp import Stamp

PROVOKED = frozenset({"OBSTACLE"})
"""The operator drives at things; every other reason to stop is nobody's wish."""


class Gaps(NamedTuple):
    """Times between samples of a stream [ms], and how many were lost; NaN where there were none."""

    samples: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    lost: int


class Stream:
    """The arrivals of one topic, from any number of its senders' runs.

    Args:
        period_s: None: what counts is the gap; else how much longer than this it is.
    """

    def __init__(self, period_s: float | None = None) -> None:
        self._beyond_s = period_s
        self._gaps_s: list[float] = []
        self._samples = self._lost = 0
        self._last_s: float | None = None
        self._epoch = b""
        self._sequence = 0

    def hear(self, arrival_s: float, stamp: Stamp | None) -> None:
        """A sample came; one of a new epoch is no later than what it is."""
        self._samples += 1
        if stamp is not None:
            if stamp.gid == self._epoch:
                self._lost += max(0, stamp.sequence - self._sequence - 1)
            self._epoch, self._sequence = stamp.gid, stamp.sequence
        if self._last_s is not None:
            self._gaps_s.append(arrival_s - self._last_s)
        self._last_s = arrival_s

    def take(self) -> Gaps:
        """What was heard since the last time."""
        gaps_ms = 1000.0 * np.array(self._gaps_s)
        if self._beyond_s is not None:
            gaps_ms = np.maximum(gaps_ms - 1000.0 * self._beyond_s, 0.0)
        p50, p99, most = np.percentile(gaps_ms, (50, 99, 100)) if len(gaps_ms) else (math.nan,) * 3
        told = Gaps(self._samples, float(p50), float(p99), float(most), self._lost)
        self._samples = self._lost = 0
        self._gaps_s.clear()
        return told


class Stops:
    """Tells stops that the operator provoked from those that nobody did; from the first time that all is well."""

    def __init__(self) -> None:
        self._is_watching = False
        self._reasons: frozenset[str] = frozenset()
        self.provoked = 0

    def look(self, status: SafetyStatus) -> Sequence[str]:
        """The reasons that this status adds to those that held, but for the provoked ones."""
        if not self._is_watching:
            self._is_watching = status.mode == SafetyStatus.READY
            return ()
        new: Collection[str] = [reason for reason in status.reasons if reason not in self._reasons]
        self._reasons = frozenset(status.reasons)
        self.provoked += any(reason in PROVOKED for reason in new)
        return [reason for reason in new if reason not in PROVOKED]
