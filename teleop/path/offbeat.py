"""Detect key presses of the operator from extra samples between heartbeats.

A source sends at a fixed rate, and immediately on each key press. The wire has no message for a key press, but each
press adds a sample to the regular ones. The times are from the sender's clock, so network jitter has no effect, and the
sequence numbers include lost samples.

This is a convenience, not a safety function: a press that the sender's loop handles together with a heartbeat adds no
sample and is not detected (2 of 60 on a loaded machine). A command for motion takes the wheels in any case, and SPACE is
the emergency stop.
"""

from collections import deque

from wire.stamp import Stamp

REMEMBERED = 10
"""Number of remembered samples. Even on a busy machine, some of them were sent on time; after a hang, the rhythm is known
again after as many."""
LEARNT = 5
"""Number of samples after which the rhythm is known."""
TOLERANCE = 0.3
"""Tolerance as a share of the period. If all remembered heartbeats were later than this, one on time would count as a
key press."""


class OffBeat:
    """Detects key presses at one source.

    Args:
        period_s: the period of its heartbeat.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._epoch = b""
        self._offsets_s: deque[float] = deque(maxlen=REMEMBERED)

    def hears_key(self, stamp: Stamp) -> bool:
        """Process the stamp of the next sample; return whether there were more samples than heartbeats.

        A key press shortly before a heartbeat is detected with that heartbeat.
        """
        if stamp.gid != self._epoch:
            self._epoch = stamp.gid
            self._offsets_s.clear()
        # Constant for samples on time and larger for late ones; an extra sample lowers it by one period.
        offset_s = stamp.source_time_ns * 1e-9 - stamp.sequence * self._period_s
        learnt = len(self._offsets_s) >= LEARNT
        extra = learnt and offset_s < min(self._offsets_s) - TOLERANCE * self._period_s
        if extra:
            self._offsets_s.clear()
        self._offsets_s.append(offset_s)
        return extra
