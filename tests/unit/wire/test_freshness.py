"""How old a command is: backlogs, replays, skewed and stepping clocks."""

import math
import random
from itertools import accumulate

import pytest

from wire.freshness import (
    DRIFT,
    FALL_TOLERANCE_S,
    JUMP,
    REMEMBERED_EPOCHS,
    Sent,
    Track,
    Verdict,
    judge,
)

TIMEOUT_S = 0.2
PERIOD_S = 0.0625  # exact in binary, so that sums are


class Stream:
    """A source at 16 Hz whose clock differs from ours by `skew_s`."""

    def __init__(self, skew_s: float = 1e6, epoch: bytes = b"A") -> None:
        self.track = Track()
        self.now_s = 100.0
        self.skew_s = skew_s
        self.epoch = epoch
        self.sequence = 0

    def send(self, *, late_s: float = 0.0, sequence: int | None = None) -> Verdict:
        self.now_s += PERIOD_S + late_s
        self.sequence = self.sequence + 1 if sequence is None else sequence
        sent = Sent(self.epoch, self.sequence, self.now_s - late_s + self.skew_s)
        self.track, verdict, self.on_way_s = judge(self.track, sent, self.now_s, TIMEOUT_S)
        return verdict

    def settle(self) -> "Stream":
        verdicts = [self.send() for _ in range(10)]
        assert verdicts[-1] is Verdict.FRESH
        return self


@pytest.mark.parametrize("skew_s", [0.0, 1e6, -1e9])
def test_a_steady_source_is_fresh_after_one_timeout_whatever_its_clock_says(skew_s: float) -> None:
    stream = Stream(skew_s)
    verdicts = [stream.send() for _ in range(6)]
    assert verdicts == [Verdict.UNPROVEN] * 4 + [Verdict.FRESH] * 2


def test_the_time_on_the_way_is_what_exceeds_the_quickest() -> None:
    stream = Stream().settle()
    assert stream.send(late_s=0.15) is Verdict.FRESH
    assert stream.on_way_s == pytest.approx(0.15, abs=1e-4)


def test_a_command_is_late_from_just_beyond_the_timeout() -> None:
    assert Stream().settle().send(late_s=TIMEOUT_S - 0.001) is Verdict.FRESH
    assert Stream().settle().send(late_s=TIMEOUT_S + 0.001) is Verdict.LATE


def test_a_sequence_that_stands_still_or_goes_back_is_refused() -> None:
    stream = Stream().settle()
    assert stream.send(sequence=stream.sequence) is Verdict.SEQUENCE
    assert stream.send(sequence=1) is Verdict.SEQUENCE


def test_a_clock_that_steps_forward_starts_the_proof_anew_and_is_fresh_again() -> None:
    stream = Stream().settle()
    stream.skew_s += 5.0
    assert stream.send() is Verdict.LATE
    assert [stream.send() for _ in range(4)] == [Verdict.UNPROVEN] * 3 + [Verdict.FRESH]


def test_a_clock_that_steps_back_does_not_lock_the_source_out() -> None:
    stream = Stream().settle()
    stream.skew_s -= 3600.0
    assert stream.send() is Verdict.SEQUENCE
    assert [stream.send() for _ in range(4)] == [Verdict.UNPROVEN] * 3 + [Verdict.FRESH]


@pytest.mark.parametrize("drift", [1e-4, -1e-4])
def test_a_day_of_clock_drift_is_followed(drift: float) -> None:
    stream = Stream().settle()
    for _ in range(24 * 3600):  # one command each second stands for all
        stream.now_s += 1.0 - PERIOD_S
        stream.skew_s += drift
        assert stream.send() is Verdict.FRESH


def test_jitter_within_the_tolerance_does_not_disturb_a_new_source() -> None:
    stream = Stream()
    verdicts = [stream.send(late_s=late_s) for late_s in (FALL_TOLERANCE_S * 0.9, 0.0, 0.01, 0.03, 0.0)]
    assert verdicts[-1] is Verdict.FRESH


def test_a_backlog_heard_first_proves_nothing_until_it_is_over() -> None:
    stream = Stream()
    sent_s = stream.now_s
    for n in range(60):  # three seconds of commands in one burst
        sent = Sent(b"A", n + 1, sent_s + n * PERIOD_S)
        stream.track, verdict, _ = judge(stream.track, sent, sent_s + 3.0, TIMEOUT_S)
        assert verdict in {Verdict.UNPROVEN, Verdict.LATE}


def test_a_quick_backlog_does_not_creep_under_the_tolerance() -> None:
    track = Track()
    for n in range(500):  # 100 Hz: each step falls by less than the tolerance, all together do not
        track, verdict, _ = judge(track, Sent(b"A", n + 1, n * 0.01), 10.0, TIMEOUT_S)
        assert verdict is not Verdict.FRESH
    assert math.isfinite(track.baseline_s)


@pytest.mark.parametrize(
    ("falls_by_s", "verdict"),
    [(FALL_TOLERANCE_S, Verdict.UNPROVEN), (math.nextafter(FALL_TOLERANCE_S, 1.0), Verdict.LATE)],
)
def test_a_baseline_may_fall_by_its_tolerance(falls_by_s: float, verdict: Verdict) -> None:
    track, _, _ = judge(Track(), Sent(b"A", 1, 0.0), 0.0, TIMEOUT_S)
    assert judge(track, Sent(b"A", 2, falls_by_s), 0.0, TIMEOUT_S)[1] is verdict


def test_a_proven_baseline_may_not_fall_quickly_in_small_steps_either() -> None:
    stream = Stream().settle()
    verdicts: list[Verdict] = []
    for _ in range(4):
        stream.skew_s += 0.75 * FALL_TOLERANCE_S
        verdicts.append(stream.send())
    assert verdicts[0] is Verdict.FRESH
    assert Verdict.LATE in verdicts


@pytest.mark.parametrize(
    ("arrival_s", "verdict"),
    [(math.nextafter(TIMEOUT_S, 0.0), Verdict.UNPROVEN), (TIMEOUT_S, Verdict.FRESH)],
)
def test_a_proof_takes_one_timeout(arrival_s: float, verdict: Verdict) -> None:
    track, _, _ = judge(Track(), Sent(b"A", 1, 0.0), 0.0, TIMEOUT_S)
    assert judge(track, Sent(b"A", 2, arrival_s), arrival_s, TIMEOUT_S)[1] is verdict


@pytest.mark.parametrize(
    ("timeout_s", "verdict"),
    [(TIMEOUT_S, Verdict.FRESH), (math.nextafter(TIMEOUT_S, 0.0), Verdict.LATE)],
)
def test_a_command_may_be_on_its_way_for_one_timeout(timeout_s: float, verdict: Verdict) -> None:
    drifted_s = -DRIFT * TIMEOUT_S  # so that the baseline is zero on arrival
    track = Track(Sent(b"A", 1, 0.0), 0.0, drifted_s, drifted_s, 0.0, proven=True)
    assert judge(track, Sent(b"A", 2, 0.0), TIMEOUT_S, timeout_s)[1:] == (verdict, TIMEOUT_S)


# --- the epoch of a source


PROVEN_S = (-0.25, -0.1875, -0.125, -0.0625, 0.0)
"""Arrivals that prove an epoch; the last one is at zero, so that what follows is exact."""


class Listener:
    """One source; all messages of an epoch have the same delay."""

    def __init__(self, *, may_return: bool = False) -> None:
        self.track = Track()
        self.may_return = may_return

    def hear(self, epoch: bytes, sequence: int, arrival_s: float, *, late_s: float = 0.0) -> Verdict:
        sent = Sent(epoch, sequence, arrival_s - late_s + 7.0)
        self.track, verdict, on_way_s = judge(
            self.track, sent, arrival_s, TIMEOUT_S, may_return=self.may_return
        )
        begins = not self.track.proven and self.track.anchored_at_s == arrival_s
        if begins or verdict in {Verdict.EPOCH, Verdict.SEQUENCE}:
            assert on_way_s == 0.0
        return verdict

    def is_left_as_it_was_by(self, epoch: bytes, sequence: int, arrival_s: float, verdict: Verdict) -> bool:
        """Check that the message is refused for this reason, and has no effect."""
        before = self.track
        return self.hear(epoch, sequence, arrival_s) is verdict and self.track == before

    def prove(self, epoch: bytes, sequence: int, until_s: float) -> int:
        """Send five consecutive messages; return the sequence of the last."""
        verdicts = [self.hear(epoch, sequence + n, until_s + at_s) for n, at_s in enumerate(PROVEN_S)]
        assert verdicts[-1] is Verdict.FRESH
        return sequence + len(PROVEN_S) - 1


def heard(*, may_return: bool = False) -> Listener:
    """A is proven with the sequences 1 to 5, and was heard last at zero."""
    listener = Listener(may_return=may_return)
    listener.prove(b"A", 1, 0.0)
    return listener


def test_an_epoch_keeps_its_source_until_it_has_been_silent_for_longer_than_the_timeout() -> None:
    listener = heard()
    for arrival_s in (0.0, 0.1, math.nextafter(TIMEOUT_S, 0.0), TIMEOUT_S):
        assert listener.is_left_as_it_was_by(b"B", 1, arrival_s, Verdict.EPOCH)
    assert listener.hear(b"B", 1, math.nextafter(TIMEOUT_S, 1.0)) is Verdict.UNPROVEN


def test_an_unproven_epoch_keeps_its_source_just_as_long() -> None:
    listener = Listener()
    assert listener.hear(b"A", 1, 0.0) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"B", 1, TIMEOUT_S, Verdict.EPOCH)
    assert listener.hear(b"B", 1, math.nextafter(TIMEOUT_S, 1.0)) is Verdict.UNPROVEN


def test_one_foreign_message_takes_nothing_from_whoever_speaks() -> None:
    """Formerly, that message ended the epoch permanently, and teleop had to be restarted."""
    listener = heard()
    assert listener.hear(b"F", 1, 0.03) is Verdict.EPOCH
    assert listener.hear(b"A", 6, 0.05) is Verdict.FRESH


def test_of_two_that_speak_as_one_source_the_first_keeps_it() -> None:
    listener = heard()
    for n in range(200):
        assert listener.hear(b"B", 1 + n, 0.025 + n * 0.05) is Verdict.EPOCH
        assert listener.hear(b"A", 6 + n, 0.05 + n * 0.05) is Verdict.FRESH


def test_a_late_message_is_spoken_too_but_a_refused_one_is_not() -> None:
    listener = heard()
    assert listener.hear(b"A", 6, 0.15, late_s=1.0) is Verdict.SEQUENCE  # its clock has stepped back
    assert listener.hear(b"A", 7, 0.15 + 0.0625, late_s=1.0) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"B", 1, 0.4, Verdict.EPOCH)
    assert listener.is_left_as_it_was_by(b"A", 7, 0.41, Verdict.SEQUENCE)
    assert listener.hear(b"B", 1, 0.42) is Verdict.UNPROVEN


@pytest.mark.parametrize("first_s", [0.0, 0.01, 0.05, 0.15, TIMEOUT_S, 0.25, 3.0])
def test_a_source_that_is_started_anew_counts_after_a_timeout_and_a_proof(first_s: float) -> None:
    """However fast it was, even faster than the timeout."""
    listener = heard()
    verdicts = {first_s + n * 0.05: listener.hear(b"B", 1 + n, first_s + n * 0.05) for n in range(20)}
    counted_s = next(arrival_s for arrival_s, verdict in verdicts.items() if verdict is Verdict.FRESH)
    assert counted_s <= max(first_s, TIMEOUT_S + 0.05) + TIMEOUT_S + 0.05 + 1e-9
    for arrival_s, verdict in verdicts.items():
        if arrival_s <= TIMEOUT_S:
            assert verdict is Verdict.EPOCH
        elif arrival_s < counted_s:
            assert verdict is Verdict.UNPROVEN
        else:
            assert verdict is Verdict.FRESH


def test_an_epoch_ends_when_the_next_one_is_proven_and_never_returns() -> None:
    listener = heard()
    for sequence, arrival_s in enumerate((10.0, 10.0625, math.nextafter(10.0 + TIMEOUT_S, 0.0)), start=1):
        assert listener.hear(b"B", sequence, arrival_s) is Verdict.UNPROVEN
        assert listener.track.ended == ()
    assert listener.hear(b"B", 4, 10.0 + 2 * TIMEOUT_S) is Verdict.FRESH
    assert listener.track.ended == (b"A",)
    assert listener.track.replaced is None
    for arrival_s in (10.5, 20.0, 1e6):
        assert listener.is_left_as_it_was_by(b"A", 6, arrival_s, Verdict.EPOCH)


def test_an_epoch_comes_back_with_a_proof_of_its_own_where_the_next_one_proved_nothing() -> None:
    listener = heard()
    assert listener.hear(b"F", 1, 1.0) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"A", 6, 1.0 + TIMEOUT_S, Verdict.EPOCH)
    assert listener.hear(b"A", 7, math.nextafter(1.0 + TIMEOUT_S, 2.0)) is Verdict.UNPROVEN
    assert listener.hear(b"A", 8, 1.3) is Verdict.UNPROVEN
    assert listener.hear(b"A", 9, 1.45) is Verdict.FRESH
    assert listener.track.ended == ()
    assert listener.hear(b"F", 2, 2.0) is Verdict.UNPROVEN, "who proved nothing has not ended either"


@pytest.mark.parametrize("sequence", [0, 1, 5])
def test_what_was_heard_before_is_not_heard_again_when_its_epoch_comes_back(sequence: int) -> None:
    listener = heard()
    assert listener.hear(b"F", 1, 1.0) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"A", sequence, 2.0, Verdict.SEQUENCE)
    assert listener.hear(b"A", 6, 2.0) is Verdict.UNPROVEN


def test_the_proven_epoch_ends_though_several_came_between() -> None:
    listener = heard()
    assert listener.hear(b"B", 1, 1.0) is Verdict.UNPROVEN
    assert listener.hear(b"C", 1, 2.0) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"A", 5, 3.0, Verdict.SEQUENCE)
    listener.prove(b"C", 2, 3.0)
    assert listener.track.ended == (b"A",)
    assert listener.is_left_as_it_was_by(b"A", 6, 4.0, Verdict.EPOCH)


@pytest.mark.parametrize("step_s", [-1.0, 1.0])
@pytest.mark.parametrize("stepping", [b"A", b"B"])
def test_the_proven_epoch_ends_though_a_clock_stepped_meanwhile(stepping: bytes, step_s: float) -> None:
    """A step restarts the observation, and resets only the baseline."""
    refusal = Verdict.LATE if step_s < 0.0 else Verdict.SEQUENCE
    listener = heard()
    if stepping == b"A":
        assert listener.hear(b"A", 6, 0.1, late_s=step_s) is refusal
    assert listener.hear(b"B", 1, 1.0) is Verdict.UNPROVEN
    if stepping == b"B":
        assert listener.hear(b"B", 2, 1.1, late_s=step_s) is refusal
    verdicts: list[Verdict] = []
    for n in range(3, 8):
        late_s = step_s if stepping == b"B" else 0.0
        verdicts.append(listener.hear(b"B", n, 1.0 + n * 0.05, late_s=late_s))
        assert listener.track.ended == ((b"A",) if verdicts[-1] is Verdict.FRESH else ())
    assert {verdicts[0], verdicts[-1]} == {Verdict.UNPROVEN, Verdict.FRESH}


@pytest.mark.parametrize("step_s", [-1.0, 1.0])
def test_an_ended_epoch_stays_ended_though_a_clock_steps(step_s: float) -> None:
    listener = heard()
    sequence = listener.prove(b"B", 1, 1.0)
    listener.hear(b"B", sequence + 1, 1.1, late_s=step_s)
    assert not listener.track.proven
    assert listener.is_left_as_it_was_by(b"A", 6, 2.0, Verdict.EPOCH)


def test_a_backlog_of_the_epoch_before_keeps_the_next_one_off_only_until_it_is_over() -> None:
    listener = heard()
    for n in range(60):  # delayed messages of a teleop that is dead by now
        assert listener.hear(b"A", 6 + n, 3.0, late_s=2.9 - n * 0.045) is not Verdict.FRESH
    assert listener.hear(b"B", 1, 3.1875) is Verdict.EPOCH
    assert listener.hear(b"B", 2, 3.25) is Verdict.UNPROVEN
    assert listener.hear(b"B", 3, 3.5) is Verdict.FRESH


def test_a_backlog_of_the_epoch_before_takes_nothing_from_the_next_one() -> None:
    listener = heard()
    assert listener.hear(b"B", 1, 3.0) is Verdict.UNPROVEN
    for n in range(60):
        assert listener.hear(b"A", 6 + n, 3.1, late_s=2.9 - n * 0.045) is Verdict.EPOCH
    assert listener.hear(b"B", 2, 3.2) is Verdict.FRESH
    for n in range(60):
        assert listener.hear(b"A", 6 + n, 9.0, late_s=2.9 - n * 0.045) is Verdict.EPOCH


def test_a_scans_epoch_may_return_after_another_one_was_proven() -> None:
    listener = heard(may_return=True)
    listener.prove(b"B", 1, 1.0)
    assert listener.track.ended == ()
    assert listener.is_left_as_it_was_by(b"A", 6, 1.0 + TIMEOUT_S, Verdict.EPOCH)
    listener.prove(b"A", 6, 2.0)


def test_only_so_many_ended_epochs_are_remembered_the_latest() -> None:
    listener = Listener()
    epochs = [n.to_bytes(16, "little") for n in range(REMEMBERED_EPOCHS + 3)]
    for n, epoch in enumerate(epochs):
        listener.prove(epoch, 1, float(n))
    assert listener.track.ended == tuple(epochs[2:-1])
    for n, epoch in enumerate(epochs[2:-1]):
        assert listener.hear(epoch, 100, 1000.0 + n) is Verdict.EPOCH


def test_strays_do_not_push_an_ended_epoch_out_of_memory() -> None:
    listener = heard()
    listener.prove(b"B", 1, 1.0)
    for n in range(3 * REMEMBERED_EPOCHS):
        assert listener.hear(b"stray" + bytes([n]), 1, 2.0 + n) is Verdict.UNPROVEN
    assert listener.hear(b"A", 6, 1000.0) is Verdict.EPOCH


# --- a sequence that jumps


def test_a_sequence_that_jumps_too_far_is_refused_and_locks_nobody_out() -> None:
    listener = heard()
    for sequence in (5 + JUMP + 1, 2**63 - 1):
        assert listener.is_left_as_it_was_by(b"A", sequence, 0.0, Verdict.SEQUENCE)
    assert listener.hear(b"A", 6, 0.05) is Verdict.FRESH
    assert listener.hear(b"A", 6 + JUMP, 0.05) is Verdict.FRESH


def test_each_second_of_silence_allows_as_much_again() -> None:
    """A teleop at 20 Hz whose link is cut overnight has counted beyond any constant."""
    assert heard().hear(b"A", 5 + 3 * JUMP, 2.0) is Verdict.FRESH
    assert heard().is_left_as_it_was_by(b"A", 5 + 3 * JUMP + 1, 2.0, Verdict.SEQUENCE)
    assert heard().is_left_as_it_was_by(b"A", 5 + 3 * JUMP, 2.0 - 1e-9, Verdict.SEQUENCE)


def test_the_silence_that_counts_is_that_before_the_jump() -> None:
    listener = Listener()
    listener.prove(b"A", 1, 1000.0)
    assert listener.is_left_as_it_was_by(b"A", 5 + 2 * JUMP, 1000.5, Verdict.SEQUENCE)


def test_an_epoch_comes_back_no_further_on_than_it_may_jump() -> None:
    """Its silence counts from when it was heard itself, not from the one that came between."""
    listener = heard()
    assert listener.hear(b"F", 1, 1.5) is Verdict.UNPROVEN
    assert listener.is_left_as_it_was_by(b"A", 5 + 3 * JUMP + 1, 2.0, Verdict.SEQUENCE)
    assert listener.hear(b"A", 5 + 3 * JUMP, 2.0) is Verdict.UNPROVEN


def test_a_new_epoch_may_begin_at_any_sequence() -> None:
    """As for a restarted supervisor."""
    assert Listener().hear(b"A", 2**62, 0.0) is Verdict.UNPROVEN
    assert heard().hear(b"B", 2**62, 1.0) is Verdict.UNPROVEN


# --- messages without a stamp


class Unstamped:
    """One source that sends no stamps."""

    def __init__(self, track: Track = Track(), *, trusts_arrival: bool = False) -> None:  # noqa: B008 - immutable
        self.track = track
        self.trusts_arrival = trusts_arrival

    def hear(self, *arrivals_s: float) -> list[Verdict]:
        """Return the verdict on each message."""
        verdicts: list[Verdict] = []
        for arrival_s in arrivals_s:
            self.track, verdict, on_way_s = judge(
                self.track, None, arrival_s, TIMEOUT_S, trusts_arrival=self.trusts_arrival
            )
            assert on_way_s == 0.0
            verdicts.append(verdict)
        return verdicts


BEYOND_S = math.nextafter(TIMEOUT_S, 1.0)


def test_a_burst_without_stamps_proves_nothing() -> None:
    burst_s = [5.0 + n * 1e-4 for n in range(1000)]
    assert set(Unstamped().hear(*burst_s)) == {Verdict.UNPROVEN}


@pytest.mark.parametrize(
    ("arrival_s", "verdict"),
    [(math.nextafter(TIMEOUT_S, 0.0), Verdict.UNPROVEN), (TIMEOUT_S, Verdict.FRESH)],
)
def test_messages_without_stamps_are_proven_after_one_timeout(arrival_s: float, verdict: Verdict) -> None:
    assert Unstamped().hear(0.0, 0.1, arrival_s) == [Verdict.UNPROVEN] * 2 + [verdict]


@pytest.mark.parametrize(("gap_s", "verdict"), [(TIMEOUT_S, Verdict.FRESH), (BEYOND_S, Verdict.UNPROVEN)])
def test_a_gap_longer_than_the_timeout_starts_the_proof_anew(gap_s: float, verdict: Verdict) -> None:
    source = Unstamped()
    assert source.hear(-TIMEOUT_S, -0.1, 0.0)[-1] is Verdict.FRESH
    assert source.hear(gap_s) == [verdict]


def test_the_proof_after_a_gap_takes_one_timeout_again() -> None:
    source = Unstamped()
    source.hear(-TIMEOUT_S, -0.1, 0.0)
    assert source.hear(2.0, 2.1, 2.19, 2.2, 2.3) == [Verdict.UNPROVEN] * 3 + [Verdict.FRESH] * 2


def test_an_unproven_gap_starts_the_proof_anew_as_well() -> None:
    assert Unstamped().hear(0.0, BEYOND_S, 0.3) == [Verdict.UNPROVEN] * 3


def test_a_message_without_a_stamp_is_refused_for_one_timeout_after_the_last_stamped_one() -> None:
    heard = Track(Sent(b"A", 1, 0.0), arrival_s=1.0)
    source = Unstamped(heard)
    assert source.hear(1.1, 1.0 + TIMEOUT_S) == [Verdict.EPOCH] * 2
    assert source.track == heard, "what is refused proves nothing"
    assert source.hear(math.nextafter(1.0 + TIMEOUT_S, 2.0), 1.3, 1.4, 1.5) == [
        *[Verdict.UNPROVEN] * 3,
        Verdict.FRESH,
    ]


def test_a_stamped_message_ends_the_proof_of_those_without() -> None:
    source = Unstamped()
    assert source.hear(-TIMEOUT_S, -0.1, 0.0)[-1] is Verdict.FRESH
    source.track, verdict, _ = judge(source.track, Sent(b"A", 1, 0.0), 0.05, TIMEOUT_S)
    assert verdict is Verdict.UNPROVEN
    assert source.hear(0.1, 0.25, 0.26) == [Verdict.EPOCH, Verdict.EPOCH, Verdict.UNPROVEN]


@pytest.mark.parametrize("arrival_s", [0.0, math.nan])
def test_a_message_without_a_stamp_whose_arrival_is_trusted_is_fresh_at_once(arrival_s: float) -> None:
    assert Unstamped(trusts_arrival=True).hear(arrival_s) == [Verdict.FRESH]
    speaks = Unstamped(Track(Sent(b"A", 1, 0.0), arrival_s=1.0), trusts_arrival=True)
    assert speaks.hear(1.1) == [Verdict.EPOCH]


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("seed", range(5))
def test_jitter_does_not_interrupt_a_source_without_stamps(rate_hz: float, seed: int) -> None:
    """Each message is late by up to 90 ms, but stays behind the one before, as on a stream."""
    chance = random.Random(seed)
    sent_s = [n / rate_hz for n in range(2000)]
    arrivals_s = list(accumulate((at_s + chance.uniform(0.0, 0.09) for at_s in sent_s), max))
    verdicts = Unstamped().hear(*arrivals_s)
    first = verdicts.index(Verdict.FRESH)
    assert arrivals_s[first] <= arrivals_s[0] + TIMEOUT_S + 1 / rate_hz + 0.09
    assert set(verdicts[first:]) == {Verdict.FRESH}
