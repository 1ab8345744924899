"""Subscriptions: what they keep, when they wake, and undecodable bytes."""

import asyncio
import logging

import pytest

from wire.bus import Subscription
from wire.messages import Twist, encode, planar_twist
from wire.stamp import Stamper

GOOD = encode(planar_twist(0.1, 0.0))


async def test_the_default_depth_keeps_the_latest_and_counts_what_gave_way() -> None:
    subscription = Subscription("k", Twist, depth=1, wake=None)
    for n in range(5):
        subscription.push(encode(planar_twist(n / 10, 0.0)), None, float(n))
    (arrival,) = subscription.take()
    assert arrival.message == planar_twist(0.4, 0.0)
    assert arrival.arrival_s == 4.0
    assert subscription.overflowed == 4
    assert subscription.take() == []


async def test_bytes_that_are_no_message_are_counted_and_reported_with_the_key_once_a_second(
    caplog: pytest.LogCaptureFixture,
) -> None:
    subscription = Subscription("robot/teleop/cmd_vel", Twist, depth=8, wake=None)
    with caplog.at_level(logging.WARNING):
        for n in range(20):
            subscription.push(b"junk", None, n * 0.1)
            assert [a.message for a in subscription.take()] == [None]
    assert subscription.undecodable == 20
    assert len(caplog.records) == 2
    assert "robot/teleop/cmd_vel" in caplog.text


async def test_the_latest_decodable_one_is_found_behind_junk() -> None:
    subscription = Subscription("k", Twist, depth=8, wake=None)
    subscription.push(GOOD, None, 1.0)
    subscription.push(b"junk", None, 2.0)
    arrival = subscription.latest()
    assert arrival is not None
    assert arrival.arrival_s == 1.0


async def test_raw_samples_are_the_bytes_as_they_came() -> None:
    subscription = Subscription("k", Twist, depth=8, wake=None)
    subscription.push(GOOD, b"stamp", 1.0)
    subscription.push(b"junk", None, 2.0)
    assert subscription.take_raw() == [(GOOD, b"stamp", 1.0), (b"junk", None, 2.0)]
    assert subscription.take() == []
    assert subscription.undecodable == 0


async def test_a_repeat_that_shall_not_wake_waits_for_the_next_look_and_a_change_wakes() -> None:
    wake = asyncio.Event()
    subscription = Subscription("k", Twist, depth=8, wake=wake, repeats_wake=False)

    async def wakes(payload: bytes, arrival_s: float) -> bool:
        wake.clear()
        subscription.push(payload, None, arrival_s)
        await asyncio.sleep(0)  # what another thread asked of the loop is done in its next turn
        return wake.is_set()

    other = encode(planar_twist(0.2, 0.0))
    assert await wakes(GOOD, 1.0)
    subscription.take()
    assert not await wakes(GOOD, 2.0)
    assert await wakes(other, 3.0)
    assert [a.arrival_s for a in subscription.take()] == [2.0, 3.0]
    assert await wakes(GOOD, 4.0)


async def test_the_newest_sample_of_each_writer_is_kept_by_the_epoch_of_its_stamp() -> None:
    subscription = Subscription("k", Twist, depth=1, wake=None, per_writer=True)
    lidar, flood = Stamper(b"L" * 16), Stamper(b"F" * 16)
    subscription.push(GOOD, lidar.next(1.0).pack(), 1.0)
    for n in range(100):
        subscription.push(GOOD, flood.next(1.1).pack(), 1.1 + n / 1000)
        subscription.push(GOOD, None, 1.2 + n / 1000)
        subscription.push(GOOD, b"no stamp", 1.2 + n / 1000)
    taken = subscription.take()
    assert [a.stamp and (a.stamp.gid, a.stamp.sequence) for a in taken] == [
        (b"L" * 16, 1),
        (b"F" * 16, 100),
        None,
    ]
    assert subscription.overflowed == 298
