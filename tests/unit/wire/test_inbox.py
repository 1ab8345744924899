"""The inbox between the network's threads and the loop; it keeps known writers' newest samples during any flood."""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wire.inbox import KEEPS_PLACE_S, PLACES, Inbox, Newest, NewestOfEachWriter, wait_until, woken_by


class Sample(NamedTuple):
    writer: str
    arrival_s: float
    number: int = 0


def of_each_writer() -> NewestOfEachWriter[Sample]:
    return NewestOfEachWriter(lambda sample: sample.writer, lambda sample: sample.arrival_s)


def strangers(count: int, arrival_s: float) -> list[Sample]:
    return [Sample(f"stranger {arrival_s} {n}", arrival_s, n) for n in range(count)]


def test_one_place_for_all_keeps_the_newest_and_counts_what_gave_way() -> None:
    kept: Newest[int] = Newest(2)
    assert [kept.add(n) for n in range(4)] == [0, 0, 1, 1]
    assert len(kept) == 2
    assert kept.take() == [2, 3]
    assert kept.take() == []


def test_the_newest_sample_of_each_writer_is_kept_in_the_order_of_arrival() -> None:
    kept = of_each_writer()
    samples = [Sample("a", 1.0), Sample("b", 1.1), Sample("a", 1.2), Sample("c", 1.3), Sample("c", 1.4)]
    assert [kept.add(sample) for sample in samples] == [0, 0, 1, 0, 1]
    assert len(kept) == 3
    assert kept.take() == [Sample("b", 1.1), Sample("a", 1.2), Sample("c", 1.4)]
    assert len(kept) == 0
    assert kept.take() == []


def test_a_flood_by_one_writer_displaces_its_own_samples_only() -> None:
    kept = of_each_writer()
    kept.add(Sample("lidar", 0.0))
    for n in range(1000):
        kept.add(Sample("flood", 0.001, n))
    assert kept.take() == [Sample("lidar", 0.0), Sample("flood", 0.001, 999)]


def test_of_too_many_new_writers_the_first_are_kept() -> None:
    kept = of_each_writer()
    flood = strangers(PLACES + 2, 0.0)
    assert [kept.add(sample) for sample in flood] == [0] * PLACES + [1, 1]
    assert kept.take() == flood[:PLACES]


def test_a_known_writer_finds_its_place_in_a_flood_of_new_ones() -> None:
    kept = of_each_writer()
    kept.add(Sample("lidar", 0.0))
    kept.take()
    flood = strangers(PLACES, 0.01)
    for sample in flood:
        kept.add(sample)
    assert kept.add(Sample("lidar", 0.05)) == 1
    assert kept.take() == [*flood[:-1], Sample("lidar", 0.05)]


def test_a_writer_keeps_its_place_for_as_long_as_it_is_heard() -> None:
    kept = of_each_writer()
    for tick in range(100):
        now_s = tick * 0.05
        if tick > 0:
            for sample in strangers(3 * PLACES, now_s):
                kept.add(sample)
        lidar = Sample("lidar", now_s)
        kept.add(lidar)
        taken = kept.take()
        assert taken[-1] == lidar
        assert len(taken) <= PLACES


def test_a_writer_that_paused_keeps_its_place_until_it_has_been_silent_for_too_long() -> None:
    for silent_s, is_known in ((KEEPS_PLACE_S, True), (KEEPS_PLACE_S + 0.25, False)):
        kept = of_each_writer()
        kept.add(Sample("lidar", 0.0))
        kept.take()
        kept.add(Sample("flood", silent_s))
        kept.take()
        for sample in strangers(PLACES, silent_s):
            kept.add(sample)
        kept.add(Sample("lidar", silent_s))
        assert (Sample("lidar", silent_s) in kept.take()) is is_known


def test_a_new_writer_gets_a_place_once_a_flood_is_over() -> None:
    kept = of_each_writer()
    for sample in strangers(PLACES, 0.0):
        kept.add(sample)
    kept.take()
    later_s = 2 * KEEPS_PLACE_S
    kept.add(Sample("lidar", later_s))
    kept.take()
    for sample in strangers(PLACES, later_s):
        kept.add(sample)
    kept.add(Sample("lidar", later_s))
    assert Sample("lidar", later_s) in kept.take()


KNOWN = [f"known {n}" for n in range(PLACES)]


@given(
    known=st.integers(1, PLACES),
    events=st.lists(
        st.one_of(
            st.just("take"),
            st.sampled_from(KNOWN),
            st.sampled_from(["flood", "unstamped"]),
            st.integers(1, 3 * PLACES),
        ),
        max_size=120,
    ),
)
def test_no_interleaving_of_floods_loses_a_known_writers_newest_sample(
    known: int, events: list[str | int]
) -> None:
    kept = of_each_writer()
    names, now_s, number = KNOWN[:known], 0.0, 0
    expected: dict[str, Sample] = {}
    newest: dict[str, Sample] = {}
    gave_way = 0

    def add(writer: str) -> None:
        nonlocal number, gave_way
        number += 1
        sample = Sample(writer, now_s, number)
        newest[writer] = sample
        if writer in names:
            expected[writer] = sample
        gave_way += kept.add(sample)

    for name in names:
        add(name)
    for event in [*events, "take"]:
        now_s += KEEPS_PLACE_S / 200
        if event == "take":
            added = number
            taken = kept.take()
            assert [s.number for s in taken] == sorted(s.number for s in taken)
            assert len(taken) <= PLACES
            assert all(newest[s.writer] == s for s in taken)
            assert expected.items() <= {s.writer: s for s in taken}.items()
            assert gave_way + len(taken) == added
            number, gave_way = 0, 0
            expected.clear()
            newest.clear()
        elif isinstance(event, int):
            for n in range(event):
                add(f"stranger {now_s} {n}")
        else:
            add(event)


def test_items_wait_within_a_number_and_a_size() -> None:
    kept = Newest[bytes](3, 10, len)
    assert [kept.add(one) for one in (b"1234", b"5678", b"9")] == [0, 0, 0]
    assert kept.add(b"ab") == 1
    assert (len(kept), kept.take()) == (3, [b"5678", b"9", b"ab"])
    assert kept.add(b"x" * 11) == 1
    assert kept.take() == []
    assert [kept.add(b"y" * 10), kept.add(b"z" * 10)] == [0, 1]
    assert kept.take() == [b"z" * 10]


async def test_a_push_from_another_thread_wakes_the_loop_and_nothing_is_lost() -> None:
    wake = asyncio.Event()
    inbox: Inbox[int] = Inbox(10_000, wake)
    pushing = threading.Thread(target=lambda: [inbox.push(n) for n in range(5000)])
    pushing.start()
    taken: list[int] = []
    async with asyncio.timeout(10):
        while len(taken) < 5000:
            await wake.wait()
            wake.clear()
            taken += inbox.take()
    pushing.join()
    assert taken == list(range(5000))


def test_a_push_after_the_loop_has_closed_raises_nothing() -> None:
    async def make() -> Inbox[int]:
        return Inbox(1, asyncio.Event())

    inbox = asyncio.run(make())
    inbox.push(1)


async def test_after_an_item_that_is_too_large_to_keep_the_next_one_wakes_again() -> None:
    wake = asyncio.Event()
    inbox = Inbox(4, wake, Newest[bytes](4, 10, len))
    inbox.push(bytes(11))
    await asyncio.wait_for(wake.wait(), 5.0)
    assert inbox.take() == []
    wake.clear()
    inbox.push(b"small")
    await asyncio.wait_for(wake.wait(), 5.0)
    assert inbox.take() == [b"small"]


async def test_an_inbox_is_empty_until_an_item_arrives() -> None:
    inbox: Inbox[int] = Inbox(1, None)
    assert inbox.is_empty
    inbox.push(1)
    assert not inbox.is_empty


@pytest.mark.parametrize("wait", [wait_until, woken_by])
async def test_a_service_waits_until_it_is_woken_or_the_time_has_come(
    wait: Callable[[asyncio.Event, float], Awaitable[None]],
) -> None:
    wake, loop = asyncio.Event(), asyncio.get_running_loop()
    async with asyncio.timeout(10):
        wake.set()
        await wait(wake, loop.time() + 1e6)
        wake.clear()
        due_s = loop.time() + 0.001
        await wait(wake, due_s)
    assert loop.time() >= due_s
