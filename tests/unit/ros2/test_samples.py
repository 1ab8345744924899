"""The writer of each message, from its sequence number."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros2.samples import ACTIVE_S, LONGEST_GAP, MAX_WRITERS, Sample, Writers


class Topic:
    """Names the writers w0, w1, … in the order of their appearance; a message comes every 0.1 s."""

    def __init__(self) -> None:
        names = map("w{}".format, itertools.count())
        self.writers = Writers(lambda: next(names).encode())
        self.now_s = 0.0

    def hear(self, *sequences: int) -> list[str]:
        heard: list[str] = []
        for sequence in sequences:
            self.now_s += 0.1
            heard.append(self.writers.gid_of(Sample(b"", self.now_s, 0, sequence)).decode())
        return heard


def test_the_messages_of_one_run_have_one_writer() -> None:
    assert Topic().hear(1, 2, 3, 4) == ["w0"] * 4


def test_a_writer_that_was_there_before_is_one_writer() -> None:
    assert Topic().hear(5000, 5001, 5002) == ["w0"] * 3


@pytest.mark.parametrize(("lost", "gid"), [(LONGEST_GAP - 1, "w0"), (LONGEST_GAP, "w1")])
def test_a_gap_longer_than_the_longest_is_another_writer(lost: int, gid: str) -> None:
    assert Topic().hear(1, 2 + lost) == ["w0", gid]


@pytest.mark.parametrize("again", [1, 7, 8])
def test_a_sequence_that_stands_still_or_goes_back_is_another_run(again: int) -> None:
    topic = Topic()
    topic.hear(7, 8)
    assert topic.hear(again, again + 1)[0] == "w1"


def test_two_writers_are_separated_whatever_their_order() -> None:
    topic = Topic()
    assert topic.hear(100, 1, 2, 101, 102, 3, 103, 4) == ["w0", "w1", "w1", "w0", "w0", "w1", "w0", "w1"]


def test_two_writers_with_the_same_sequence_take_turns() -> None:
    topic = Topic()
    assert topic.hear(1, 1, 2, 2, 3, 3) == ["w0", "w1", "w0", "w1", "w0", "w1"]


@pytest.mark.parametrize("lost", [0, 3])
def test_a_restarted_writer_that_counts_past_its_previous_run_is_not_taken_for_it(lost: int) -> None:
    topic = Topic()
    topic.hear(*range(1, 41))
    again = [n for n in range(1, 80) if not 40 - lost < n <= 40]
    assert set(topic.hear(*again)) == {"w1"}


def test_a_writer_that_pauses_continues_its_own_run_and_not_an_earlier_one() -> None:
    topic = Topic()
    topic.hear(1, 2, 3)
    assert topic.hear(1, 2, 3) == ["w1"] * 3
    topic.now_s += ACTIVE_S
    assert topic.hear(4) == ["w1"]


def test_after_forget_the_next_message_begins_another_run() -> None:
    topic = Topic()
    topic.hear(1, 2)
    topic.writers.forget()
    assert topic.hear(3, 4) == ["w1", "w1"]


def test_a_middleware_without_sequence_numbers_shows_another_writer_each_time() -> None:
    assert len(set(Topic().hear(*[0] * 20))) == 20


def test_a_writer_is_forgotten_after_as_many_others_as_are_remembered() -> None:
    topic = Topic()
    assert topic.hear(10) == ["w0"]
    others = [1_000_000 * n for n in range(1, MAX_WRITERS)]
    topic.hear(*others)
    assert topic.hear(11) == ["w0"]
    topic.hear(*[n + 500_000 for n in [0, *others]])
    assert topic.hear(12) == [f"w{2 * MAX_WRITERS}"]


def test_a_writer_is_active_until_its_last_message_is_older_than_the_window() -> None:
    topic = Topic()
    assert topic.writers.active(0.0, 1.0) == 0
    topic.writers.gid_of(Sample(b"", 1.0, 0, 1))
    topic.writers.gid_of(Sample(b"", 1.5, 0, 1))
    assert topic.writers.active(2.0, 1.0) == 2
    assert topic.writers.active(2.25, 1.0) == 1
    assert topic.writers.active(2.5, 1.0) == 1
    assert topic.writers.active(2.75, 1.0) == 0


@given(st.lists(st.integers(-(2**63), 2**63 - 1), max_size=60))
def test_within_a_writer_the_sequence_always_increases(sequences: list[int]) -> None:
    newest: dict[str, int] = {}
    topic = Topic()
    for sequence in sequences:
        (gid,) = topic.hear(sequence)
        assert gid not in newest or 0 < sequence - newest[gid] <= LONGEST_GAP
        newest[gid] = sequence
