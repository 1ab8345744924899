"""The age of a command from its stamp, despite network delays.

The sender's clock is not compared with the local clock; only differences are used. The baseline of an epoch (one run of
a source) is the smallest (arrival − source time) received, which is the shortest delay. The excess of a message over
the baseline is its transport time. After a stall, the backlog that TCP delivers in one burst therefore shows its true
age.

A baseline is unproven while it still falls, because the first messages of an epoch may be a backlog, and the sender's
clock may step forward. No command is accepted until the baseline has been stable for a whole command timeout.
If the sender's clock steps back, the source time decreases while the sequence increases, and the proof starts again.
Slow drift is followed at the rate `DRIFT`.

An epoch keeps its source as long as its messages arrive. Another epoch may begin its proof only after a silence longer
than the timeout. Only a completed proof ends the previous epoch permanently; until then, the previous epoch may return.
A stray message therefore cannot take a source away from its active sender (docs/decisions/0020).

A message without a stamp has no age. A backlog arrives in a burst, so unstamped commands are unproven until they have
arrived for a whole timeout, and again after each gap that is longer than the timeout (docs/decisions/0043).
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

FALL_TOLERANCE_S = 0.04
"""If the baseline falls by more than this within one command timeout, its proof starts again. Less than one 20 Hz
period, so that each message of a backlog is detected; more than the jitter of the first messages on a loaded machine."""

DRIFT = 2e-4
"""Rate at which the baseline may rise; more than the relative drift of two quartz clocks."""

JUMP = 1_000_000
"""Maximum forward jump of the sequence. Without it, one message with a copied epoch and a huge sequence would lock its
source out. Each second of silence permits the same again, because a disconnected source continues to count."""

REMEMBERED_EPOCHS = 64


class Verdict(StrEnum):
    """Result of the check of a command on arrival."""

    FRESH = "fresh"
    UNPROVEN = "unproven"
    LATE = "late"
    SEQUENCE = "sequence"
    EPOCH = "epoch"


@dataclass(frozen=True, slots=True)
class Sent:
    """A command's stamp: epoch, sequence number, and source time by the sender's clock."""

    epoch: bytes
    sequence: int
    source_time_s: float


class Heard(NamedTuple):
    """The newest message of an epoch, and its arrival time."""

    sent: Sent
    arrival_s: float


class Track(NamedTuple):
    """State of one source's stream of commands."""

    last: Sent | None = None
    arrival_s: float = 0.0
    baseline_s: float = 0.0
    anchor_s: float = 0.0
    """The baseline when the current proof began."""
    anchored_at_s: float = 0.0
    proven: bool = False
    replaced: Heard | None = None
    """The newest message of the previous epoch, which may return until the present epoch is proven."""
    ended: tuple[bytes, ...] = ()
    unstamped_since_s: float = 0.0
    """Arrival of the first unstamped command after the last gap."""
    unstamped_at_s: float = -math.inf
    """Arrival of the newest unstamped command."""


def judge(
    track: Track,
    sent: Sent | None,
    arrival_s: float,
    timeout_s: float,
    fall_tolerance_s: float = FALL_TOLERANCE_S,
    *,
    may_return: bool = False,
    trusts_arrival: bool = False,
) -> tuple[Track, Verdict, float]:
    """Check the freshness of a command or scan.

    Args:
        track: the state of its source.
        sent: its stamp; None: it has no stamp. It is refused while stamped messages of the source arrive.
        arrival_s: its arrival time by the local monotonic clock.
        timeout_s: the maximum age of a command, the time for which a baseline must be stable, and the silence after
            which another epoch may begin.
        fall_tolerance_s: how far a baseline may fall within this time and still be proven.
        may_return: whether an ended epoch may be proven again after another epoch was proven. False for commands,
            which may be from an outdated intention. True for lidars: a driver without attachments has the same epoch
            in every run, and after another lidar's epoch, it would be refused permanently.
        trusts_arrival: whether a message without a stamp is fresh on arrival. False for commands, of which a burst may
            be a backlog. True for lidars: a scan alone moves nothing, and its returns must not be discarded.

    Returns:
        The new track, the verdict, and the transport time of the command [s].
    """
    if sent is None:
        return *_hear_unstamped(track, arrival_s, timeout_s, trusts_arrival=trusts_arrival), 0.0
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


def _hear_unstamped(
    track: Track, arrival_s: float, timeout_s: float, *, trusts_arrival: bool
) -> tuple[Track, Verdict]:
    """Handle an unstamped message: it is proven by messages that arrive for one timeout without a longer gap."""
    if _speaks(track, arrival_s, timeout_s):
        return track, Verdict.EPOCH
    goes_on = arrival_s - track.unstamped_at_s <= timeout_s
    since_s = track.unstamped_since_s if goes_on else arrival_s
    track = track._replace(unstamped_since_s=since_s, unstamped_at_s=arrival_s)
    proven = trusts_arrival or arrival_s - since_s >= timeout_s
    return track, Verdict.FRESH if proven else Verdict.UNPROVEN


def _take_turns(
    track: Track, newest: Heard, sent: Sent, arrival_s: float, timeout_s: float
) -> tuple[Track, Verdict]:
    """Handle a message of another epoch: begin its proof, unless it has ended or the present epoch is active."""
    if sent.epoch in track.ended or _speaks(track, arrival_s, timeout_s):
        return track, Verdict.EPOCH
    before = track.replaced or newest
    comes_back = sent.epoch == before.sent.epoch
    if comes_back and not _goes_on(before, sent, arrival_s):
        return track, Verdict.SEQUENCE
    return _anchor(sent, arrival_s, None if comes_back else before, track.ended), Verdict.UNPROVEN


def _speaks(track: Track, now_s: float, timeout_s: float) -> bool:
    """Return whether the last stamped message arrived within the timeout."""
    return track.last is not None and now_s - track.arrival_s <= timeout_s


def _goes_on(newest: Heard, sent: Sent, arrival_s: float) -> bool:
    """Return whether a message continues its epoch: with a later sequence number, and no implausible jump."""
    forward = sent.sequence - newest.sent.sequence
    return 0 < forward <= JUMP * (1.0 + arrival_s - newest.arrival_s)


def _anchor(
    sent: Sent, arrival_s: float, replaced: Heard | None = None, ended: tuple[bytes, ...] = ()
) -> Track:
    """Begin the proof of a baseline with this command."""
    offset = arrival_s - sent.source_time_s
    return Track(sent, arrival_s, offset, offset, arrival_s, replaced=replaced, ended=ended)


def _prove(track: Track, *, may_return: bool) -> Track:
    """Mark the epoch as proven and the previous epoch as ended, after the baseline has been stable for long enough."""
    ended = track.ended
    if track.replaced is not None and not may_return:
        ended = (*ended, track.replaced.sent.epoch)[-REMEMBERED_EPOCHS:]
    return track._replace(
        anchor_s=track.baseline_s, anchored_at_s=track.arrival_s, proven=True, replaced=None, ended=ended
    )
