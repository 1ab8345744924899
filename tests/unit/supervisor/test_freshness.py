"""How old a command is: backlogs, replays, skewed and stepping clocks."""

import math

import pytest

from supervisor.freshness import FALL_TOLERANCE_S, REMEMBERED_EPOCHS, Sent, Track, Verdict, judge

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


def test_an_epoch_that_returns_is_refused() -> None:
    stream = Stream().settle()
    stream.epoch = b"B"
    assert stream.send() is Verdict.UNPROVEN
    stream.epoch = b"A"
    assert stream.send() is Verdict.EPOCH


def test_only_so_many_ended_epochs_are_remembered() -> None:
    stream = Stream()
    for n in range(REMEMBERED_EPOCHS + 20):
        stream.epoch = n.to_bytes(16, "little")
        stream.send()
    assert len(stream.track.ended) == REMEMBERED_EPOCHS


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
    for n in range(60):  # three seconds of commands, all at once
        sent = Sent(b"A", n + 1, sent_s + n * PERIOD_S)
        stream.track, verdict, _ = judge(stream.track, sent, sent_s + 3.0, TIMEOUT_S)
        assert verdict in {Verdict.UNPROVEN, Verdict.LATE}


def test_a_quick_backlog_does_not_creep_under_the_tolerance() -> None:
    track = Track()
    for n in range(500):  # 100 Hz: each step falls by less than the tolerance, all together do not
        track, verdict, _ = judge(track, Sent(b"A", n + 1, n * 0.01), 10.0, TIMEOUT_S)
        assert verdict is not Verdict.FRESH
    assert math.isfinite(track.baseline_s)
