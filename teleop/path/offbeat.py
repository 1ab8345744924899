"""Hears a key of the operator in the rhythm of their heartbeat.

A source sends at a fixed rate, and at once on each key. The wire has no word for "a key was pressed", but a
sample that is one too many for the time that has passed is one. The times are the sender's own, so that the
network's jitter does not matter, and its sequence counts also what got lost on the way.

It is a courtesy, no safety function: a key that the sender's loop takes in one turn with a beat is one sample
with it, and not heard (2 of 60 on a loaded machine). What asks for motion takes the wheels in any case, and SPACE
is the emergency stop.
"""

from collections import deque

from wire.stamp import Stamp

REMEMBERED = 10
"""Samples. Some of them were sent in time, even on a busy machine; after a hang the rhythm is known anew as soon."""
LEARNT = 5
"""Before so many the rhythm is not known."""
TOLERANCE = 0.3
"""Of a period. Were all remembered beats later than this, one in time would be taken for a key."""


class OffBeat:
    """Listens to one source.

    Args:
        period_s: of its heartbeat.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._epoch = b""
        self._offsets_s: deque[float] = deque(maxlen=REMEMBERED)

    def hears_key(self, stamp: Stamp) -> bool:
        """Take the stamp of its next sample; whether there have been more samples than beats.

        A key shortly before a beat is noticed with that beat.
        """
        if stamp.gid != self._epoch:
            self._epoch = stamp.gid
            self._offsets_s.clear()
        # Of samples on the beat this is one constant, and what is late is above it: one too many lowers it by a period.
        offset_s = stamp.source_time_ns * 1e-9 - stamp.sequence * self._period_s
        learnt = len(self._offsets_s) >= LEARNT
        extra = learnt and offset_s < min(self._offsets_s) - TOLERANCE * self._period_s
        if extra:
            self._offsets_s.clear()
        self._offsets_s.append(offset_s)
        return extra
