"""The attachment of each sample, in rmw_zenoh's layout: sequence, source time, epoch.

A Twist has no time stamp, and TCP delivers the backlog of a stalled link in one burst, so only the sender can tell the
age of a command. The source time is from the sender's *monotonic* clock, because a step of the wall clock must not look
like a late command. Receivers use only differences (docs/decisions/0005).
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
    """A sample's sender, its sequence number in the sender's run, and its source time by the sender's clock."""

    sequence: int
    source_time_ns: int
    gid: bytes
    """The epoch: 16 bytes, new for each run of a source."""

    def pack(self) -> bytes:
        return _LAYOUT.pack(self.sequence, self.source_time_ns, GID_BYTES, self.gid)

    def sent(self) -> Sent:
        """Return the stamp in the form that `wire.freshness` uses."""
        return Sent(self.gid, self.sequence, self.source_time_ns * 1e-9)


def parse_stamp(attachment: bytes | None) -> Stamp | None:
    """Return the stamp in an attachment; None if there is no attachment, or if its layout differs."""
    if attachment is None or len(attachment) != _LAYOUT.size:
        return None
    sequence, source_time_ns, gid_bytes, gid = _LAYOUT.unpack(attachment)
    return Stamp(sequence, source_time_ns, gid) if gid_bytes == GID_BYTES else None


class Stamper:
    """Stamps the samples of one run of a publisher.

    Args:
        gid: the epoch, or its beginning, which random bytes complete.
    """

    def __init__(self, gid: bytes = b"") -> None:
        self.gid = gid + os.urandom(GID_BYTES - len(gid))
        """The epoch."""
        self._sequence = count(1)

    def next(self, true_at_s: float | None = None) -> Stamp:
        """Return the next stamp of this run.

        Args:
            true_at_s: the time of the sample's content by `time.monotonic`; None: now.
        """
        source_time_ns = time.monotonic_ns() if true_at_s is None else round(true_at_s * 1e9)
        return Stamp(next(self._sequence), source_time_ns, self.gid)
