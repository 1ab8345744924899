"""The guards: refusals, two supervisors, the round trip and the terminal's answers."""

import heapq
import math
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.guards import (
    ANSWER_LIMIT_S,
    HOLD_S,
    KEPT_COMMANDS,
    KEPT_RUNS,
    LOCKED_OUT_S,
    LOST_PERIOD_S,
    SETTLING_S,
    TRIES,
    WINDOW_S,
    Pulse,
    Refusals,
    RoundTrip,
    Supervisors,
)
from teleop.screen.view import Control
from teleop.service import Setup
from tests.unit.teleop.views import source

# --- refusals


PERIOD_S, STATUS_PERIOD_S = 0.05, 0.1
OWN = source("teleop")


def told(
    refusals: Refusals, *, epoch: int = 0, sequence: int = 0, accepted: int = 0, count: int = 20
) -> list[float]:
    """Return when everything was refused, for statuses whose counts grow by these numbers."""
    own, times_s = OWN, list[float]()
    for number in range(count):
        own = replace(
            own,
            refused_epoch=own.refused_epoch + epoch,
            refused_sequence=own.refused_sequence + sequence,
            accepted=own.accepted + accepted,
        )
        if refusals.all_refused(own, number * STATUS_PERIOD_S):
            times_s.append(number * STATUS_PERIOD_S)
    return times_s


@pytest.mark.parametrize("grown", [{"epoch": 2}, {"sequence": 2}, {"epoch": 1, "sequence": 1}], ids=str)
def test_a_source_with_all_commands_refused_is_reported_every_half_second(grown: dict[str, int]) -> None:
    assert told(Refusals(), **grown) == pytest.approx([0.5, 1.0, 1.5])


@pytest.mark.parametrize(
    "grown", [{}, {"accepted": 2}, {"accepted": 1, "epoch": 2}, {"accepted": 1, "sequence": 2}], ids=str
)
def test_no_refusal_is_reported_while_some_commands_are_accepted_or_none_are_sent(
    grown: dict[str, int],
) -> None:
    assert told(Refusals(), **grown) == []


def test_refusals_are_reported_exactly_at_the_limit() -> None:
    for time_s, is_told in ((LOCKED_OUT_S, True), (math.nextafter(LOCKED_OUT_S, 0.0), False)):
        refusals = Refusals()
        assert not refusals.all_refused(OWN, 0.0)
        assert refusals.all_refused(replace(OWN, refused_epoch=1), time_s) is is_told


def test_the_counts_of_a_restarted_supervisor_begin_at_zero() -> None:
    refusals = Refusals()
    assert not refusals.all_refused(replace(OWN, accepted=500, refused_epoch=80), 0.0)
    assert not refusals.all_refused(replace(OWN, accepted=0, refused_epoch=0), 10.0)
    assert not refusals.all_refused(replace(OWN, accepted=0, refused_epoch=1), 10.1)


def test_another_program_is_detected_by_a_refused_epoch_since_the_last_status() -> None:
    refusals = Refusals()
    heard = replace(OWN, refused_epoch=3)
    assert not refusals.another_speaks(heard), "the first status does not show when"
    refusals.all_refused(heard, 0.0)
    assert not refusals.another_speaks(heard)
    assert not refusals.another_speaks(replace(heard, refused_sequence=1)), "its own late command"
    assert refusals.another_speaks(replace(heard, refused_epoch=4))


def test_a_restarted_supervisor_does_not_count_as_another_program() -> None:
    refusals = Refusals()
    refusals.all_refused(replace(OWN, refused_epoch=3), 0.0)
    assert not refusals.another_speaks(OWN)


# --- supervisors


A, B, C = b"a" * 16, b"b" * 16, b"c" * 16


def heard(*runs: bytes) -> Supervisors:
    """Return what is known after these runs have spoken, one each `STATUS_PERIOD_S` from 0."""
    supervisors = Supervisors()
    for number, run in enumerate(runs):
        supervisors.heard(run, STATUS_PERIOD_S * number)
    return supervisors


def test_one_supervisor_and_its_restarts_are_no_conflict() -> None:
    assert not heard().are_several(0.0)
    assert not heard(A, A, B, B, C, C, C).are_several(0.6)


def test_a_run_that_speaks_again_after_another_is_a_second_robot() -> None:
    assert heard(A, B, A).are_several(0.2)


def test_the_conflict_ends_a_second_after_one_of_the_two_is_silent() -> None:
    supervisors = heard(A, B, A, *[A] * 20)
    assert supervisors.are_several(0.2 + HOLD_S - 1e-9)
    assert not supervisors.are_several(0.2 + HOLD_S)


@given(st.lists(st.binary(min_size=16, max_size=16), unique=True))
def test_any_number_of_restarts_in_succession_is_no_conflict(runs: list[bytes]) -> None:
    assert not heard(*runs).are_several(STATUS_PERIOD_S * len(runs))


def test_many_runs_of_strangers_take_no_memory() -> None:
    runs = [bytes([number]) * 16 for number in range(100)]
    assert not heard(*runs, runs[0]).are_several(0.0), "forgotten"
    assert heard(*runs, runs[-KEPT_RUNS + 1]).are_several(0.0)


# --- the round trip


BOOT_NS = 3 * 86400 * 10**9 + 123_456_789


def stamp_ns(time_s: float) -> int:
    return BOOT_NS + round(time_s * 1e9)


def drive(
    up_s: float,
    down_s: float,
    *,
    seconds: float = 3.0,
    loss: float = 0.0,
    clock_step_s: float = 0.0,
    seed: int = 0,
) -> RoundTrip:
    """Simulate a link with these delays, with a step of the stamps' clock halfway; return the measure."""
    random, measure = Random(seed), RoundTrip()
    events: list[tuple[float, int, int]] = []
    for beat in range(round(seconds / PERIOD_S)):
        at_s = beat * PERIOD_S
        stamp = stamp_ns(at_s + (clock_step_s if at_s > seconds / 2 else 0.0))
        events.append((at_s, 0, stamp))
        if random.random() >= loss:
            events.append((at_s + up_s, 1, stamp))
    events += [(beat * STATUS_PERIOD_S + 0.013, 2, 0) for beat in range(round(seconds / STATUS_PERIOD_S))]
    newest, heard = 0, list[tuple[float, int]]()
    for at_s, kind, stamp in sorted(events):
        if kind == 1:
            newest = stamp
        elif kind == 2 and random.random() >= loss:
            heard.append((at_s + down_s, newest))
    arrivals = [(at_s, 1, stamp) for at_s, stamp in heard]
    for at_s, kind, stamp in sorted(
        [(at_s, 0, stamp) for at_s, kind, stamp in events if kind == 0] + arrivals
    ):
        if at_s > seconds:
            break
        if kind == 0:
            measure.sent(stamp, at_s)
        else:
            measure.heard(stamp, at_s)
    return measure


def test_before_the_first_status_nothing_is_proven() -> None:
    assert RoundTrip().shortest_s == math.inf


@pytest.mark.parametrize("confirmed", [0, 77])
def test_a_status_that_confirms_none_of_its_commands_proves_nothing(confirmed: int) -> None:
    measure = RoundTrip()
    measure.sent(stamp_ns(1.0), 1.0)
    measure.heard(confirmed, 1.1)
    assert measure.shortest_s == math.inf


def test_the_round_trip_is_unknown_if_the_supervisor_does_not_report_stamps() -> None:
    measure = RoundTrip()
    measure.sent(stamp_ns(1.0), 1.0)
    measure.heard(stamp_ns(1.0), 1.1)
    measure.heard(None, 1.2)
    assert math.isnan(measure.shortest_s)


def test_the_sum_of_both_delays_is_measured_however_it_is_divided() -> None:
    for up_s, down_s in ((0.0, 0.0), (0.7, 0.0), (0.0, 0.7), (0.35, 0.35), (1.2, 0.3)):
        measure = drive(up_s, down_s)
        assert up_s + down_s <= measure.shortest_s <= up_s + down_s + PERIOD_S


@given(
    up_s=st.floats(0.0, 0.3), down_s=st.floats(0.0, 0.3), loss=st.floats(0.0, 0.5), seed=st.integers(0, 1000)
)
def test_the_round_trip_is_never_shorter_than_both_delays(
    up_s: float, down_s: float, loss: float, seed: int
) -> None:
    measure = drive(up_s, down_s, loss=loss, seed=seed)
    assert measure.shortest_s >= up_s + down_s - 1e-9


@given(step_s=st.floats(-20.0, 20.0))
def test_a_step_of_the_stamps_clock_changes_nothing(step_s: float) -> None:
    measure = drive(0.02, 0.02, seconds=6.0, clock_step_s=step_s)
    assert measure.shortest_s <= 0.04 + 2 * PERIOD_S


def confirmed(*samples: tuple[float, float]) -> RoundTrip:
    """Return the measure after statuses that arrived at these times and confirmed commands sent at these times."""
    measure = RoundTrip()
    for sent_s, arrival_s in samples:
        measure.sent(stamp_ns(sent_s), sent_s)
        measure.heard(stamp_ns(sent_s), arrival_s)
    return measure


def test_a_shorter_round_trip_counts_until_the_later_ones_span_the_window() -> None:
    slow = [(0.2 + number * 0.1, 0.9 + number * 0.1) for number in range(12)]
    assert confirmed((0.0, 0.1), *slow[:-2]).shortest_s == pytest.approx(0.1)
    assert confirmed((0.0, 0.1), *slow).shortest_s == pytest.approx(0.7)
    assert slow[-1][1] - slow[0][1] >= WINDOW_S


def test_the_first_status_after_a_cut_confirms_an_old_command_and_does_not_count_as_a_slow_link() -> None:
    fast = [(number * 0.1, number * 0.1 + 0.05) for number in range(20)]
    after = [(1.95, 5.0), *((5.0 + number * 0.1, 5.05 + number * 0.1) for number in range(20))]
    for count in range(1, len(after)):
        assert confirmed(*fast, *after[:count]).shortest_s == pytest.approx(0.05)


def test_at_the_lowest_status_rate_one_late_status_is_no_slow_link() -> None:
    late = confirmed((0.0, 0.1), (1.0, 1.1), (1.4, 2.1), (3.0, 3.1), (3.4, 4.1))
    assert late.shortest_s == pytest.approx(0.1)


def test_a_confirmation_that_is_repeated_counts_from_the_same_command() -> None:
    measure = RoundTrip()
    measure.sent(stamp_ns(0.0), 0.0)
    for arrival_s in (0.3, 0.2):
        measure.heard(stamp_ns(0.0), arrival_s)
    assert measure.shortest_s == 0.2


def test_an_older_confirmation_after_a_newer_one_proves_nothing_new() -> None:
    measure = RoundTrip()
    measure.sent(stamp_ns(0.0), 0.0)
    measure.sent(stamp_ns(1.0), 1.0)
    measure.heard(stamp_ns(1.0), 1.5)
    measure.heard(stamp_ns(0.0), 1.6)
    assert measure.shortest_s == 0.5


@given(error_ns=st.integers(-400, 400))
def test_a_stamp_that_the_supervisor_rounds_is_found(error_ns: int) -> None:
    measure = RoundTrip()
    measure.sent(1_000_000, 0.0)
    measure.heard(1_000_000 + error_ns, 0.25)
    assert measure.shortest_s == 0.25


def test_only_the_newest_unconfirmed_commands_are_kept() -> None:
    measure = RoundTrip()
    for number in range(KEPT_COMMANDS + 1):
        measure.sent(stamp_ns(number * 0.01), number * 0.01)
    measure.heard(stamp_ns(0.0), 20.0)
    assert measure.shortest_s == math.inf
    measure.heard(stamp_ns(0.01), 20.0)
    assert measure.shortest_s == pytest.approx(19.99)


@pytest.mark.parametrize(
    ("round_trip_s", "sentence"),
    [
        (0.734, "the robot answers after 0.73 s, and the limit is 0.5 s"),
        (math.nextafter(0.5, 1.0), "the robot answers after 0.50 s, and the limit is 0.5 s"),
        (0.5, ""),
        (0.0, ""),
    ],
)
def test_an_answer_is_late_just_after_the_limit(round_trip_s: float, sentence: str) -> None:
    assert confirmed((0.0, round_trip_s)).lateness == sentence


def test_no_answer_is_late_and_one_of_an_older_supervisor_is_not() -> None:
    measure = RoundTrip()
    assert measure.lateness == "the robot has not answered a command yet"
    measure.heard(None, 1.2)
    assert measure.lateness == ""


@pytest.mark.parametrize(
    "loss",
    [0.0, pytest.param(0.02, marks=pytest.mark.proof), pytest.param(0.05, marks=pytest.mark.proof), 0.1],
)
def test_an_hour_over_a_link_of_300_ms_that_loses_packets_never_counts_as_too_slow(loss: float) -> None:
    random, measure = Random(1), RoundTrip()
    limit_s, newest_s = Setup("", "", Control.HOLD).round_trip_limit_s, -1.0
    arriving = list[tuple[float, float]]()
    worst_s = 0.0
    for beat in range(round(3600.0 / PERIOD_S)):
        now_s = beat * PERIOD_S
        while arriving and arriving[0][0] <= now_s:
            at_s, stamp_s = heapq.heappop(arriving)
            measure.heard(stamp_ns(stamp_s), at_s)
        if beat > 20:
            worst_s = max(worst_s, measure.shortest_s)
        measure.sent(stamp_ns(now_s), now_s)
        up_s, down_s = (max(0.0, random.gauss(0.15, 0.015)) for _ in range(2))
        if random.random() >= loss:
            newest_s = max(newest_s, now_s - up_s)  # a command that arrives now was sent earlier by its delay
        if beat % 2 == 0 and random.random() >= loss:
            sent_s = PERIOD_S * math.floor(newest_s / PERIOD_S)
            heapq.heappush(arriving, (now_s + down_s, max(0.0, sent_s)))
    print(f"\n    worst round trip of an hour: {worst_s:.3f} s")
    assert worst_s < limit_s


# --- the terminal's answers


def test_a_terminal_that_never_answered_is_not_reported_as_lost() -> None:
    pulse = Pulse()
    for n in range(50):
        pulse.ask(n / 10)
    assert not pulse.is_lost(5.0)


def test_a_terminal_that_never_answers_is_queried_a_limited_number_of_times() -> None:
    pulse = Pulse()
    for n in range(TRIES):
        assert pulse.is_due(n / 10)
        pulse.ask(n / 10)
    assert not pulse.is_due(9.0)
    pulse.answer(9.0)
    assert pulse.is_due(9.0)


def test_a_terminal_that_answered_is_lost_just_after_the_limit() -> None:
    pulse = Pulse()
    pulse.ask(-1.0)
    pulse.answer(-1.0)
    pulse.ask(0.0)
    assert not pulse.is_lost(ANSWER_LIMIT_S)
    assert pulse.is_lost(math.nextafter(ANSWER_LIMIT_S, 1.0))


def test_slow_but_regular_answers_keep_the_terminal_alive() -> None:
    pulse = Pulse()
    for n in range(40):
        pulse.ask(n / 10)
        if n >= 5:
            pulse.answer(n / 10)
            assert not pulse.is_lost(n / 10 + 0.1)
    assert pulse.open == 5


def test_a_pause_between_queries_does_not_lose_the_terminal() -> None:
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    pulse.ask(60.0)
    assert not pulse.is_lost(60.1)
    pulse.ask(60.1)
    pulse.ask(60.2)
    pulse.ask(60.3)
    assert pulse.is_lost(60.31)


def test_one_answer_restores_a_lost_terminal_and_extra_answers_are_ignored() -> None:
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    pulse.ask(0.1)
    assert pulse.is_lost(9.0)
    pulse.answer(9.0)
    pulse.answer(9.0)
    assert (pulse.is_lost(9.1), pulse.open) == (False, 0)


def test_a_lost_terminal_is_queried_once_in_a_second() -> None:
    pulse = answering()
    pulse.ask(10.0)
    assert pulse.is_due(10.1)
    assert not pulse.is_due(math.nextafter(10.0 + LOST_PERIOD_S, 0.0))
    assert pulse.is_due(10.0 + LOST_PERIOD_S)


# --- keys that may be old


def answering() -> Pulse:
    """A terminal that has answered."""
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    return pulse


def test_an_answer_to_an_earlier_request_does_not_make_keys_live_and_one_to_a_later_request_does() -> None:
    pulse = answering()
    assert pulse.is_live(1.0)
    pulse.ask(2.0)
    pulse.doubt(2.0)
    pulse.ask(math.nextafter(2.0, 3.0))
    assert not pulse.is_live(7.0), "no time is enough without an answer"
    pulse.answer(7.0)
    assert not pulse.is_live(7.0)
    pulse.answer(7.0)
    assert pulse.is_live(7.0)


def test_an_answer_without_a_request_proves_nothing() -> None:
    pulse = Pulse()
    pulse.answer(1.0)
    assert not pulse.answers
    pulse = answering()
    pulse.doubt(2.0)
    pulse.answer(3.0)
    assert not pulse.is_live(3.0)


def test_on_a_terminal_that_never_answers_keys_are_live_just_after_the_settling_time() -> None:
    pulse = Pulse()
    assert pulse.is_live(0.0)
    pulse.doubt(5.0)
    assert not pulse.is_live(5.0 + SETTLING_S)
    assert pulse.is_live(math.nextafter(5.0 + SETTLING_S, 9.0))


def test_keys_on_a_terminal_that_replies_twice_are_live_just_after_the_settling_time() -> None:
    pulse = answering()
    pulse.answer(0.0)
    pulse.doubt(5.0)
    pulse.ask(5.1)
    pulse.answer(5.2)
    assert not pulse.is_live(5.0 + SETTLING_S)
    assert pulse.is_live(math.nextafter(5.0 + SETTLING_S, 9.0))


class DeadLink:
    """A terminal behind a link that is dead for a while; either side's bytes of that time arrive in order once it heals.

    Ten times a second, the program asks if a request is due, and doubts a terminal that is lost.
    """

    def __init__(
        self, delays_s: tuple[float, float], dead_s: tuple[float, float], typed_s: float, *, replies: int = 1
    ) -> None:
        self._replies = replies
        self._delays_s, self._dead_s, self.typed_s = delays_s, dead_s, typed_s
        self._newest_s = [0.0, 0.0]
        self._events, self._count = list[tuple[float, int, str]](), 0
        self.pulse, self.doubted_s = Pulse(), -math.inf
        self.was_live: bool | None = None
        self._at(typed_s, "key typed")
        for number in range(1, round(10 * (dead_s[1] + 8.0))):
            self._at(number / 10, "picture")

    def _at(self, time_s: float, what: str) -> None:
        self._count += 1
        heapq.heappush(self._events, (time_s, self._count, what))

    def _over(self, direction: int, now_s: float, what: str) -> None:
        began_s, healed_s = self._dead_s
        leaves_s = healed_s if began_s <= now_s < healed_s else now_s
        newest_s = max(self._newest_s[direction], leaves_s + self._delays_s[direction])
        self._newest_s[direction] = math.nextafter(newest_s, math.inf)  # the order of the stream
        self._at(newest_s, what)

    def run(self) -> None:
        while self._events:
            now_s, _, what = heapq.heappop(self._events)
            match what:
                case "picture":
                    is_lost = self.pulse.is_lost(now_s)
                    if self.pulse.is_due(now_s):
                        self.pulse.ask(now_s)
                        self._over(0, now_s, "request shown")
                    if is_lost:
                        self.doubted_s = now_s
                        self.pulse.doubt(now_s)
                case "request shown":
                    for _ in range(self._replies):
                        self._over(1, now_s, "reply")
                case "key typed":
                    self._over(1, now_s, "key")
                case "reply":
                    self.pulse.answer(now_s)
                case _:
                    self.was_live = self.pulse.is_live(now_s)
                    assert not self.was_live or self.typed_s >= self.doubted_s


@given(
    delays_s=st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 0.3)),
    dead_s=st.floats(0.0, 30.0),
    typed_s=st.floats(1.0, 35.0),
    replies=st.integers(1, 3),
)
def test_no_key_that_was_typed_before_a_doubt_is_live_whenever_a_dead_link_delivers_it(
    delays_s: tuple[float, float], dead_s: float, typed_s: float, replies: int
) -> None:
    DeadLink(delays_s, (2.0, 2.0 + dead_s), typed_s, replies=replies).run()


@given(dead_s=st.floats(0.5, 30.0), delay_s=st.floats(0.0, 0.3), replies=st.integers(1, 3))
def test_a_key_that_is_typed_on_the_live_screen_counts_again(
    dead_s: float, delay_s: float, replies: int
) -> None:
    healed_s = 2.0 + dead_s
    before = DeadLink((delay_s, delay_s), (2.0, healed_s), math.nextafter(healed_s, 0.0))
    before.run()
    assert before.was_live is False
    after = DeadLink((delay_s, delay_s), (2.0, healed_s), healed_s + 4.0, replies=replies)
    after.run()
    assert after.was_live
