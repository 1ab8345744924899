"""Lateness and losses of the robot's messages, and stops without a cause."""

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from wire.messages import SafetyStatus
from wire.stamp import Stamp

PROVOKED = frozenset({"OBSTACLE"})
"""The operator drives at obstacles on purpose; no other stop is expected."""


class Gaps(NamedTuple):
    """Times between samples of a stream [ms], and the number of lost ones; NaN without samples."""

    samples: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    lost: int


class Stream:
    """The arrivals of one topic, from any number of runs of its senders.

    Args:
        period_s: if given, lateness beyond this period is measured instead of the gap.
    """

    def __init__(self, period_s: float | None = None) -> None:
        self._beyond_s = period_s
        self._gaps_s: list[float] = []
        self._samples = self._lost = 0
        self._last_s: float | None = None
        self._epoch = b""
        self._sequence = 0

    def hear(self, arrival_s: float, stamp: Stamp | None) -> None:
        """Add a sample; the first sample of an epoch is never late."""
        self._samples += 1
        if stamp is not None:
            if stamp.gid == self._epoch:
                self._lost += max(0, stamp.sequence - self._sequence - 1)
            self._epoch, self._sequence = stamp.gid, stamp.sequence
        if self._last_s is not None:
            self._gaps_s.append(arrival_s - self._last_s)
        self._last_s = arrival_s

    def take(self) -> Gaps:
        """Return the results since the last call."""
        gaps_ms = 1000.0 * np.array(self._gaps_s)
        if self._beyond_s is not None:
            gaps_ms = np.maximum(gaps_ms - 1000.0 * self._beyond_s, 0.0)
        p50, p99, most = np.percentile(gaps_ms, (50, 99, 100)) if len(gaps_ms) else (math.nan,) * 3
        gaps = Gaps(self._samples, float(p50), float(p99), float(most), self._lost)
        self._samples = self._lost = 0
        self._gaps_s.clear()
        return gaps


class Stops:
    """Distinguishes stops that the operator provoked from all others, from the first status without a stop on."""

    def __init__(self) -> None:
        self._is_watching = False
        self._reasons: frozenset[str] = frozenset()
        self.provoked = 0

    def look(self, status: SafetyStatus) -> Sequence[str]:
        """Return the new reasons of this status, except provoked ones."""
        if not self._is_watching:
            self._is_watching = status.mode == SafetyStatus.READY
            return ()
        new: Collection[str] = [reason for reason in status.reasons if reason not in self._reasons]
        self._reasons = frozenset(status.reasons)
        self.provoked += any(reason in PROVOKED for reason in new)
        return [reason for reason in new if reason not in PROVOKED]
