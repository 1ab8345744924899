"""The turns of a service, in a real event loop."""

import asyncio
import math
from collections.abc import Callable

import pytest

from wire.host.turns import Turns
from wire.inbox import Inbox


def _turns_until(count: int, due_s: Callable[[], float]) -> tuple[Turns, asyncio.Event, list[float]]:
    """Return turns that stop after `count` of them, the stop event, and the list of the times at which they ran."""
    loop, stop, ran_s = asyncio.get_running_loop(), asyncio.Event(), list[float]()

    def turn() -> float:
        ran_s.append(loop.time())
        if len(ran_s) == count:
            stop.set()
        return due_s()

    return Turns(turn, lambda: True), stop, ran_s


async def test_turns_come_at_their_times_and_not_before() -> None:
    loop = asyncio.get_running_loop()
    due_s = [loop.time() + 0.01 * number for number in range(1, 5)]
    turns, stop, ran_s = _turns_until(4, iter(due_s).__next__)
    await turns.run_until(stop)
    assert len(ran_s) == 4
    assert all(ran + 1e-6 >= due for ran, due in zip(ran_s[1:], due_s, strict=False))


async def test_an_arrival_runs_a_turn_before_its_time() -> None:
    turns, stop, ran_s = _turns_until(2, lambda: math.inf)
    asyncio.get_running_loop().call_later(0.01, turns.set)
    await asyncio.wait_for(turns.run_until(stop), 5.0)
    assert len(ran_s) == 2


async def test_items_that_arrive_together_in_several_inboxes_take_one_turn() -> None:
    stop, taken = asyncio.Event(), list[list[int]]()

    def turn() -> float:
        taken.append([item for inbox in inboxes for item in inbox.take()])
        if len(taken) == 2:
            stop.set()
        return math.inf

    turns = Turns(turn, lambda: any(not inbox.is_empty for inbox in inboxes))
    inboxes = [Inbox[int](4, turns) for _ in range(3)]

    def arrive(number: int) -> None:
        for inbox in inboxes:
            inbox.push(number)

    asyncio.get_running_loop().call_later(0.01, arrive, 1)
    await asyncio.wait_for(turns.run_until(stop), 5.0)
    assert taken == [[], [1, 1, 1]]


async def test_before_run_until_no_turn_runs() -> None:
    turns, stop, ran_s = _turns_until(1, lambda: math.inf)
    turns.set()
    turns.run_now()
    assert not ran_s
    await turns.run_until(stop)
    assert len(ran_s) == 1


async def test_after_the_stop_no_turn_runs() -> None:
    turns, stop, ran_s = _turns_until(1, lambda: 0.0)
    await turns.run_until(stop)
    turns.set()
    turns.run_now()
    await asyncio.sleep(0)
    assert len(ran_s) == 1


async def test_the_error_of_a_turn_is_raised_and_no_later_turn_runs() -> None:
    count = 0

    def turn() -> float:
        nonlocal count
        count += 1
        if count == 2:
            raise ZeroDivisionError("the second turn")
        return 0.0

    turns = Turns(turn, lambda: True)
    with pytest.raises(ZeroDivisionError, match="the second turn"):
        await asyncio.wait_for(turns.run_until(asyncio.Event()), 5.0)
    turns.set()
    assert count == 2


class Panic(BaseException):
    """The kind of error that pyo3 raises for a panic in Rust: not an `Exception`."""


@pytest.mark.parametrize("error", [Panic("in Rust"), GeneratorExit(), StopIteration()], ids=repr)
async def test_an_error_that_is_not_an_exception_is_raised_by_run_until_too(error: BaseException) -> None:
    """Otherwise the process would stay alive, with its token, without a timer for its next turn."""

    def turn() -> float:
        raise error

    with pytest.raises((Panic, GeneratorExit, RuntimeError)):
        await asyncio.wait_for(Turns(turn, lambda: True).run_until(asyncio.Event()), 5.0)


async def test_no_turn_runs_if_the_stop_is_already_set() -> None:
    turns, stop, ran_s = _turns_until(1, lambda: 0.0)
    stop.set()
    await turns.run_until(stop)
    assert not ran_s
