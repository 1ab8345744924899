"""A loop whose time jumps, shared by processes that can be held and killed."""

import asyncio

import pytest

from virtual.loop import VirtualLoop, VirtualProcess, VirtualTimeError


def beats(loop: VirtualLoop, process: VirtualProcess, period_s: float) -> list[float]:
    """Times at which a process woke up from sleeps of this duration."""
    times: list[float] = []

    async def beat() -> None:
        while True:
            await asyncio.sleep(period_s)
            times.append(loop.time())

    loop.create_task(beat(), context=process.context)
    return times


def run(loop: VirtualLoop, seconds: float) -> None:
    loop.run_until_complete(asyncio.sleep(seconds))


def test_time_jumps_to_a_timer_exactly() -> None:
    loop = VirtualLoop()
    run(loop, 0.1 + 0.2)
    assert loop.time() == 0.1 + 0.2
    run(loop, 3600.0)
    assert loop.time() == 0.1 + 0.2 + 3600.0


def test_at_one_time_first_scheduled_is_first_run() -> None:
    loop, order = VirtualLoop(), list[str]()
    for name in "abc":
        loop.call_at(1.0, order.append, name)
    loop.call_at(0.5, loop.call_at, 1.0, order.append, "d")
    loop.call_at(1.0, order.append, "x").cancel()
    run(loop, 2.0)
    assert "".join(order) == "abcd"


def test_a_held_process_makes_up_for_it_when_it_is_let_go() -> None:
    loop, process = VirtualLoop(), VirtualProcess("held")
    times = beats(loop, process, 0.1)
    run(loop, 0.25)
    process.hold()
    process.hold()  # a second call has no effect
    assert process.is_held
    run(loop, 1.0)
    assert len(times) == 2
    loop.resume(process)
    run(loop, 0.21)
    assert times[2:] == pytest.approx([1.25, 1.35, 1.45])


def test_a_killed_process_has_no_last_word_until_all_ends() -> None:
    loop, process, said = VirtualLoop(), VirtualProcess("killed"), list[str]()

    async def speak() -> None:
        try:
            await asyncio.sleep(1.0)
        finally:
            said.append("goodbye")
            await asyncio.sleep(1.0)

    loop.create_task(speak(), context=process.context)
    run(loop, 0.5)
    process.is_dead = True
    run(loop, 5.0)
    assert said == []
    loop.close()
    assert said == ["goodbye"]
    assert loop.is_closed()


def test_slack_moves_timers_to_its_multiples_and_never_before() -> None:
    loop, process = VirtualLoop(), VirtualProcess("lazy", slack_s=0.01)
    times = beats(loop, process, 0.013)
    run(loop, 0.101)
    assert times == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])


def test_a_loop_in_which_nothing_can_happen_says_so() -> None:
    loop = VirtualLoop()
    with pytest.raises(VirtualTimeError, match="no timer is left"):
        loop.run_until_complete(loop.create_future())


def test_a_loop_that_spins_at_one_time_says_so() -> None:
    loop = VirtualLoop()

    def again() -> None:
        loop.call_soon(again)

    again()
    with pytest.raises(VirtualTimeError, match="time stands still"):
        run(loop, 1.0)


def test_an_error_that_nobody_awaits_is_reported_with_its_process() -> None:
    loop, told = VirtualLoop(), list[tuple[str, str]]()
    loop.on_error = lambda name, error: told.append((name, str(error)))
    process = VirtualProcess("clumsy")

    def fail() -> None:
        raise ValueError("oops")

    loop.call_soon(fail, context=process.context)
    loop.call_soon(fail)
    run(loop, 0.1)
    assert told == [("clumsy", "oops"), ("", "oops")]


def test_advancing_is_a_hang_of_everything() -> None:
    loop = VirtualLoop()
    times = beats(loop, VirtualProcess("any"), 0.1)
    loop.call_at(0.15, loop.advance, 1.0)
    run(loop, 1.3)
    assert times == pytest.approx([0.1, 1.15, 1.25])
