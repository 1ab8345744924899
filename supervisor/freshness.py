"""How old a command is, whatever the network did to it.

The sender's clock is never compared with ours: only differences count. Of each epoch (one run of a source)
the smallest (arrival − source time) heard is its baseline, the quickest way that a message has taken; what
exceeds it is this message's time on the way. So after a stall the backlog that TCP delivers in one burst
shows its true age.

A baseline is itself unproven while it still falls: the first messages of an epoch may be a backlog, and a
sender's clock may step forward. Until it has stood for a whole command timeout, no command counts.
A clock that steps back shows as a source time that goes back while the sequence goes on, and starts the
proof anew. Slow drift is followed at `DRIFT`.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

FALL_TOLERANCE_S = 0.04
"""A baseline that falls by more within one command timeout was no baseline. Below one 20 Hz period, so that
each message of a backlog betrays it; above the jitter of a loaded machine's first messages."""

DRIFT = 2e-4
"""The baseline may rise by this share of the time: above what two quartz clocks drift apart."""

REMEMBERED_EPOCHS = 64


class Verdict(StrEnum):
    """What becomes of a command on arrival."""

    FRESH = "fresh"
    UNPROVEN = "unproven"
    LATE = "late"
    SEQUENCE = "sequence"
    EPOCH = "epoch"


@dataclass(frozen=True, slots=True)
class Sent:
    """What a command's attachment says: its epoch, place and time in the sender's run."""

    epoch: bytes
    sequence: int
    source_time_s: float


class Track(NamedTuple):
    """What is known of one source's stream of stamped commands."""

    last: Sent | None = None
    arrival_s: float = 0.0
    baseline_s: float = 0.0
    anchor_s: float = 0.0
    """The baseline when the current proof began."""
    anchored_at_s: float = 0.0
    proven: bool = False
    ended: tuple[bytes, ...] = ()


def judge(
    track: Track,
    sent: Sent,
    arrival_s: float,
    timeout_s: float,
    fall_tolerance_s: float = FALL_TOLERANCE_S,
    *,
    may_return: bool = False,
) -> tuple[Track, Verdict, float]:
    """Take note of a stamped command, or scan.

    Args:
        track: what is known of its source.
        sent: its attachment.
        arrival_s: when it came, by our monotonic clock.
        timeout_s: the age from which a command is stale, and the time that a baseline must stand.
        fall_tolerance_s: how far a baseline may fall within that time and still have been one.
        may_return: whether an epoch counts again after another one, once it is proven anew. A command's must not:
            it may be what was wished long ago. A lidar's may, or one foreign scan would blind the robot for good.

    Returns:
        The new track, the verdict, and the time that the command spent on the way [s].
    """
    offset = arrival_s - sent.source_time_s
    if track.last is None or sent.epoch != track.last.epoch:
        if sent.epoch in track.ended:
            return track, Verdict.EPOCH, 0.0
        ended = track.ended if track.last is None or may_return else (*track.ended, track.last.epoch)
        return _anchor(sent, arrival_s, ended[-REMEMBERED_EPOCHS:]), Verdict.UNPROVEN, 0.0
    if sent.sequence <= track.last.sequence:
        return track, Verdict.SEQUENCE, 0.0
    if sent.source_time_s < track.last.source_time_s:
        return _anchor(sent, arrival_s, track.ended), Verdict.SEQUENCE, 0.0

    baseline = min(offset, track.baseline_s + DRIFT * (arrival_s - track.arrival_s))
    if track.anchor_s - baseline > fall_tolerance_s:
        return _anchor(sent, arrival_s, track.ended), Verdict.LATE, 0.0
    track = Track(sent, arrival_s, baseline, track.anchor_s, track.anchored_at_s, track.proven, track.ended)
    if arrival_s - track.anchored_at_s >= timeout_s:
        track = track._replace(anchor_s=baseline, anchored_at_s=arrival_s, proven=True)
    on_way_s = offset - baseline
    if on_way_s > timeout_s:
        return track, Verdict.LATE, on_way_s
    return track, Verdict.FRESH if track.proven else Verdict.UNPROVEN, on_way_s


def _anchor(sent: Sent, arrival_s: float, ended: tuple[bytes, ...]) -> Track:
    """Begin the proof of a baseline with this command."""
    offset = arrival_s - sent.source_time_s
    return Track(sent, arrival_s, offset, offset, arrival_s, proven=False, ended=ended)
