"""The attachment of each sample, in rmw_zenoh's layout: sequence, source time, epoch.

A Twist carries no time, and TCP delivers a stalled link's backlog in one burst: only the sender can
say how old a command is. The source time is the sender's *monotonic* clock: receivers use differences
only, and a step of the wall clock must not look like a late command (docs/decisions/0005).
"""

import os
import struct
import time
from dataclasses import dataclass
from itertools import count

from wire.freshness import Sent

_LAYOUT = struct.Struct("<qqB16s")
GID_BYTES = 16


@dataclass(frozen=True, slots=True)
class Stamp:
    """Who sent a sample, as which of its run, and when by the sender's own clock."""

    sequence: int
    source_time_ns: int
    gid: bytes
    """16 bytes, new for each run of a source: its epoch."""

    def pack(self) -> bytes:
        return _LAYOUT.pack(self.sequence, self.source_time_ns, GID_BYTES, self.gid)

    def sent(self) -> Sent:
        """As freshness is judged by."""
        return Sent(self.gid, self.sequence, self.source_time_ns * 1e-9)


def parse_stamp(attachment: bytes | None) -> Stamp | None:
    """The stamp in an attachment; None where there is none, or it is not in this layout."""
    if attachment is None or len(attachment) != _LAYOUT.size:
        return None
    sequence, source_time_ns, gid_bytes, gid = _LAYOUT.unpack(attachment)
    return Stamp(sequence, source_time_ns, gid) if gid_bytes == GID_BYTES else None


class Stamper:
    """Stamps the samples of one run of a publisher.

    Args:
        gid: its epoch; None: one that nobody else has.
    """

    def __init__(self, gid: bytes | None = None) -> None:
        self._gid = gid or os.urandom(GID_BYTES)
        self._sequence = count(1)

    def next(self, true_at_s: float | None = None) -> Stamp:
        """The next one of this run.

        Args:
            true_at_s: when what it says was true, by `time.monotonic`; None: now.
        """
        source_time_ns = time.monotonic_ns() if true_at_s is None else round(true_at_s * 1e9)
        return Stamp(next(self._sequence), source_time_ns, self._gid)
