"""How old a command is, whatever the network did to it.

The sender's clock is never compared with ours: only differences count. Of each epoch (one run of a source)
the smallest (arrival − source time) heard is its baseline, the quickest way that a message has taken; what
exceeds it is this message's time on the way. So after a stall the backlog that TCP delivers in one burst
shows its true age.

A baseline is itself unproven while it still falls: the first messages of an epoch may be a backlog, and a
sender's clock may step forward. Until it has stood for a whole command timeout, no command counts.
A clock that steps back shows as a source time that goes back while the sequence goes on, and starts the
proof anew. Slow drift is followed at `DRIFT`.

An epoch keeps its source for as long as it speaks. Only once it has been silent for longer than the timeout may
another one begin its proof, and only a proof ends the epoch before, for good; until then that one may come back.
So a stray message takes no source away from whoever speaks (docs/decisions/0020).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

FALL_TOLERANCE_S = 0.04
"""A baseline that falls by more within one command timeout was no baseline. Below one 20 Hz period, so that
each message of a backlog betrays it; above the jitter of a loaded machine's first messages."""

DRIFT = 2e-4
"""The baseline may rise by this share of the time: above what two quartz clocks drift apart."""

JUMP = 1_000_000
"""A sequence that jumps forward by more is refused, or one message with a copied epoch and a huge sequence would
lock its source out. Each second of silence allows as much again: who was cut off for days has gone on counting."""

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


class Heard(NamedTuple):
    """The newest message of an epoch, and when it came."""

    sent: Sent
    arrival_s: float


class Track(NamedTuple):
    """What is known of one source's stream of stamped commands."""

    last: Sent | None = None
    arrival_s: float = 0.0
    baseline_s: float = 0.0
    anchor_s: float = 0.0
    """The baseline when the current proof began."""
    anchored_at_s: float = 0.0
    proven: bool = False
    replaced: Heard | None = None
    """Of the epoch that ends once this one is proven, and may come back until then."""
    ended: tuple[bytes, ...] = ()


def judge(
    track: Track,
    sent: Sent | None,
    arrival_s: float,
    timeout_s: float,
    fall_tolerance_s: float = FALL_TOLERANCE_S,
    *,
    may_return: bool = False,
) -> tuple[Track, Verdict, float]:
    """Take note of a command, or scan.

    Args:
        track: what is known of its source.
        sent: its attachment; None: it has none, and counts by its arrival alone, unless somebody who stamps is heard.
        arrival_s: when it came, by our monotonic clock.
        timeout_s: the age from which a command is stale, the time that a baseline must stand, and the silence after
            which another epoch may begin.
        fall_tolerance_s: how far a baseline may fall within that time and still have been one.
        may_return: whether an epoch counts again after another one was proven, once it is proven anew itself. A
            command's must not: it may be what was wished long ago. A lidar's may: a driver that stamps headers only
            is the same epoch in every run, and another lidar would blind the robot for good.

    Returns:
        The new track, the verdict, and the time that the command spent on the way [s].
    """
    if sent is None:
        return track, Verdict.EPOCH if _speaks(track, arrival_s, timeout_s) else Verdict.FRESH, 0.0
    if track.last is None:
        return _anchor(sent, arrival_s), Verdict.UNPROVEN, 0.0
    newest = Heard(track.last, arrival_s=track.arrival_s)
    if sent.epoch != newest.sent.epoch:
        return *_take_turns(track, newest, sent, arrival_s, timeout_s), 0.0
    if not _goes_on(newest, sent, arrival_s):
        return track, Verdict.SEQUENCE, 0.0
    if sent.source_time_s < newest.sent.source_time_s:
        return _anchor(sent, arrival_s, track.replaced, track.ended), Verdict.SEQUENCE, 0.0

    offset = arrival_s - sent.source_time_s
    baseline = min(offset, track.baseline_s + DRIFT * (arrival_s - track.arrival_s))
    if track.anchor_s - baseline > fall_tolerance_s:
        return _anchor(sent, arrival_s, track.replaced, track.ended), Verdict.LATE, 0.0
    track = track._replace(last=sent, arrival_s=arrival_s, baseline_s=baseline)
    if arrival_s - track.anchored_at_s >= timeout_s:
        track = _prove(track, may_return=may_return)
    on_way_s = offset - baseline
    if on_way_s > timeout_s:
        return track, Verdict.LATE, on_way_s
    return track, Verdict.FRESH if track.proven else Verdict.UNPROVEN, on_way_s


def _take_turns(
    track: Track, newest: Heard, sent: Sent, arrival_s: float, timeout_s: float
) -> tuple[Track, Verdict]:
    """Another epoch speaks: it begins its proof, unless it has ended or the newest one is still heard."""
    if sent.epoch in track.ended or _speaks(track, arrival_s, timeout_s):
        return track, Verdict.EPOCH
    before = track.replaced or newest
    comes_back = sent.epoch == before.sent.epoch
    if comes_back and not _goes_on(before, sent, arrival_s):
        return track, Verdict.SEQUENCE
    return _anchor(sent, arrival_s, None if comes_back else before, track.ended), Verdict.UNPROVEN


def _speaks(track: Track, now_s: float, timeout_s: float) -> bool:
    """Whether somebody who stamps is heard."""
    return track.last is not None and now_s - track.arrival_s <= timeout_s


def _goes_on(newest: Heard, sent: Sent, arrival_s: float) -> bool:
    """Whether this follows in its epoch: later in the sequence, and no further than a source can count."""
    forward = sent.sequence - newest.sent.sequence
    return 0 < forward <= JUMP * (1.0 + arrival_s - newest.arrival_s)


def _anchor(
    sent: Sent, arrival_s: float, replaced: Heard | None = None, ended: tuple[bytes, ...] = ()
) -> Track:
    """Begin the proof of a baseline with this command."""
    offset = arrival_s - sent.source_time_s
    return Track(sent, arrival_s, offset, offset, arrival_s, replaced=replaced, ended=ended)


def _prove(track: Track, *, may_return: bool) -> Track:
    """The baseline has stood for long enough: the epoch counts, and the one before has ended."""
    ended = track.ended
    if track.replaced is not None and not may_return:
        ended = (*ended, track.replaced.sent.epoch)[-REMEMBERED_EPOCHS:]
    return track._replace(
        anchor_s=track.baseline_s, anchored_at_s=track.arrival_s, proven=True, replaced=None, ended=ended
    )
