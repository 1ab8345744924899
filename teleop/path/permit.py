"""Conditions for driving: what a source lacks before it may drive, and what stops it.

The supervisor's status is one condition; a key press of the operator is the other. Text from the network is converted to
plain ASCII, so that no payload can send control sequences to the terminal.
"""

from collections import deque

from teleop.screen.view import nearest_in_words, plain
from wire.messages import SafetyStatus
from wire.stamp import Stamp

HEARD_S = 0.2
"""A command older than this has timed out at the supervisor."""
REMEMBERED = 10
"""Number of remembered samples. Even on a busy machine, some of them were sent on time; after a hang, the rhythm is known
again after as many."""
LEARNT = 5
"""Number of samples after which the rhythm is known."""
TOLERANCE = 0.3
"""Tolerance as a share of the period. If all remembered heartbeats were later than this, one on time would count as a
key press."""


def what_is_missing(status: SafetyStatus, source: str) -> str | None:
    """Return why a neutral source must not begin to drive; None if it may."""
    own = status.source(source)
    if own is None:
        return f"the supervisor ignores source {source}: add it to [supervisor] sources"
    if status.mode == SafetyStatus.STOPPED:
        return _stopped(status)
    if status.mode != SafetyStatus.READY:
        return f"{plain(status.owner)} drives; it must stop first"
    if not own.armed:
        return f"{source} is not armed: {plain(', '.join(own.reasons))}"
    if not own.neutral or not own.age_s <= HEARD_S:
        return f"the supervisor does not hear {source}"
    return None


def what_stops(status: SafetyStatus, source: str) -> str | None:
    """Return why a driving source must stop; None if it may continue.

    A status that was sent before the supervisor received the motion has the previous owner: that is not a take-over.
    """
    if status.mode == SafetyStatus.STOPPED:
        return _stopped(status)
    own = status.source(source)
    if own is not None and not own.neutral and status.owner != source:
        return f"{plain(status.owner)} took over"
    return None


def _stopped(status: SafetyStatus) -> str:
    """Return a text of the stop with its reasons, and the nearest obstacle if that is a reason."""
    causes, _ = status.causes_and_latched()
    nearest = nearest_in_words(status) if "OBSTACLE" in causes else ""
    where = f" ({nearest})" if nearest else ""
    return plain(f"STOPPED: {status.why() or 'no reason given'}{where}")


class OffBeat:
    """Detects key presses of the operator from extra samples between the heartbeats of a source.

    A source sends at a fixed rate, and immediately on each key press. The wire has no message for a key press, but each
    press adds a sample to the regular ones. The times are from the sender's clock, so network jitter has no effect, and
    the sequence numbers include lost samples.

    This is a convenience, not a safety function: a press that the sender's loop handles together with a heartbeat adds no
    sample and is not detected (2 of 60 on a loaded machine). A motion command takes control in any case, and
    SPACE is the emergency stop.

    Args:
        period_s: the period of the heartbeat.
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
