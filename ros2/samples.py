"""The messages of one topic, separated by writer.

A message of DDS does not name its writer before Kilted, but it has the writer's sequence number. Each run of a writer
counts from 1, so the messages of two writers, or of a restarted one, form separate sequences. Each sequence gets an
identity of its own, which becomes the epoch of the messages on the wire. A message of rmw_zenoh names its writer.
"""

from collections.abc import Callable
from typing import NamedTuple

LONGEST_GAP = 1000
"""Messages that may be lost without the next one counting as another writer's."""
MAX_WRITERS = 8
ACTIVE_S = 1.0
"""A message goes to a writer that was silent for longer only if it continues none of those heard since."""


class Sample(NamedTuple):
    """One received message."""

    payload: bytes
    """CDR with its encapsulation header."""
    arrival_s: float
    """By the local monotonic clock."""
    source_time_ns: int
    """When it was published, by a clock with a constant difference to the local monotonic one.

    ROS stamps it with the writer's wall clock. The node subtracts its age by the local wall clock from the arrival time, so
    that a step of a clock that both share has no effect.
    """
    sequence: int
    """Number of the message in the run of its writer."""
    gid: bytes | None = None
    """The identity of its writer (16 bytes); None if the message does not name it."""
    clock_ns: int = 0
    """The wall clock of this computer less its monotonic clock, at arrival."""


class _Writer(NamedTuple):
    gid: bytes
    sequence: int
    heard_s: float


class Writers:
    """Finds the writer of each message from its sequence number.

    Args:
        new_gid: returns the identity of another writer (16 bytes).
    """

    def __init__(self, new_gid: Callable[[], bytes]) -> None:
        self._new_gid = new_gid
        self._writers: list[_Writer] = []

    def forget(self) -> None:
        """Forget all writers: another program begins, and its sequence may pass those of earlier ones."""
        self._writers = []

    def gid_of(self, sample: Sample) -> bytes:
        """Return the identity of the writer (16 bytes)."""
        gid = sample.gid or self._continued_by(sample) or self._new_gid()
        others = [w for w in self._writers if w.gid != gid]
        self._writers = [_Writer(gid, sample.sequence, sample.arrival_s), *others[: MAX_WRITERS - 1]]
        return gid

    def _continued_by(self, sample: Sample) -> bytes | None:
        """Return the identity of the writer whose sequence a message continues; None if it continues none."""
        continued = [w for w in self._writers if 0 < sample.sequence - w.sequence <= LONGEST_GAP]
        active = [w for w in continued if sample.arrival_s - w.heard_s <= ACTIVE_S]
        if active:  # the nearest sequence; of equal ones, the one that was heard longest ago
            return max(active, key=lambda w: (w.sequence, -w.heard_s)).gid
        before = max(continued, key=lambda w: w.heard_s, default=None)
        return None if before is None else before.gid

    def active(self, now_s: float, window_s: float) -> int:
        """Return how many writers were heard within the last `window_s`."""
        return sum(now_s - w.heard_s <= window_s for w in self._writers)
