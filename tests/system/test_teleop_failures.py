"""Whatever happens to teleop or its terminal: the robot stops, the terminal is restored where there is one, nothing stays."""

import asyncio
import itertools
import os
import signal
import sys
from pathlib import Path

import pytest

from tests.system.operators import (
    LIMIT_S,
    ZERO,
    Operator,
    driving,
    free_endpoint,
    hub,
    operator,
    until,
)
from tests.system.process_state import state_of

BROKEN = """
import asyncio
from teleop import __main__, service
async def fail():
    raise RuntimeError("broken on purpose")
def turn(self, now_s, turn=service.Teleop._turn):
    if not self._sent.is_neutral:
        {failure}
    return turn(self, now_s)
service.Teleop._turn = turn
__main__.main()
"""


@pytest.mark.parametrize(
    "failure",
    [
        'raise RuntimeError("broken on purpose")',
        "self._task = asyncio.ensure_future(fail()); self._task = None",
    ],
    ids=["in the loop", "in a task that nobody awaits"],
)
async def test_an_error_of_its_own_ends_it_with_code_1(failure: str) -> None:
    endpoint = free_endpoint()
    command = ("-c", BROKEN.format(failure=failure))
    async with hub(endpoint) as h, operator(endpoint, command=command) as op:
        await until(h.is_ready)
        op.type(b"w")
        code, errors = await op.ended()
        assert code == 1
        assert "RuntimeError: broken on purpose" in errors
        await until(lambda: h.is_left() and op.is_restored)


async def test_a_picture_that_nobody_reads_stops_the_robot_and_it_can_still_be_ended() -> None:
    async with driving() as (h, op):
        op.look(at=False)
        widths = itertools.cycle((99, 100))
        await until(lambda: op.resize(next(widths), 30) or h.asks(*ZERO))  # each is drawn whole
        op.send(signal.SIGTERM)
        await until(lambda: op.process.poll() is not None)
        op.look(at=True)
        await until(lambda: h.is_left() and op.is_restored)


async def test_a_terminal_that_answers_no_more_stops_the_robot() -> None:
    async with driving(answers=True) as (h, op):
        await asyncio.sleep(1.0)
        assert h.asks(0.1, 0.0)
        op.answers = False
        assert await until(lambda: h.asks(*ZERO)) < 3.0
        op.answers = True
        await asyncio.sleep(0.5)
        op.type(b"ww")
        await until(lambda: h.asks(0.2, 0.0))
        await asyncio.sleep(1.0)
        assert h.asks(0.2, 0.0)


async def test_a_hang_leaves_the_keys_typed_meanwhile_without_effect() -> None:
    async with driving() as (h, op):
        op.send(signal.SIGSTOP)
        op.type(b"www")
        await asyncio.sleep(0.5)
        seen = len(h.velocities)
        op.send(signal.SIGCONT)
        await until(lambda: "teleop hung" in op.picture)
        assert set(h.velocities[seen + 1 :]) <= {ZERO}
        op.type(b"q")
        assert (await op.ended())[0] == 0
        await until(lambda: op.is_restored)


async def test_ctrl_backslash_ends_also_a_teleop_whose_loop_hangs() -> None:
    endpoint = free_endpoint()
    command = ("-c", BROKEN.format(failure="import time; time.sleep(60)"))
    async with hub(endpoint) as h, operator(endpoint, command=command) as op:
        await until(h.is_ready)
        op.type(b"w")
        await asyncio.sleep(0.3)
        op.type(b"\x1c")
        await op.ended()
        await until(lambda: op.is_restored and not h.sees_teleop())


class Job:
    """A teleop that an interactive shell has started."""

    def __init__(self, endpoint: str) -> None:
        self.terminal = Operator("bash", "--norc", "--noprofile", "-i")
        self.terminal.type(f"{sys.executable} -m teleop --endpoint {endpoint}\n".encode())

    @property
    def pid(self) -> int:
        shell = self.terminal.process.pid
        children = Path(f"/proc/{shell}/task/{shell}/children").read_text().split()
        return int(children[0]) if children else 0

    @property
    def is_stopped(self) -> bool:
        return state_of(self.pid) == "T"


@pytest.mark.parametrize("how", ["Ctrl-Z", "kill -TSTP"])
async def test_suspended_it_leaves_the_shell_a_terminal_and_comes_back_neutral(how: str) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h:
        job = Job(endpoint)
        op = job.terminal
        try:
            await until(h.is_ready, 2 * LIMIT_S)
            op.type(b"ww")
            await until(lambda: h.asks(0.2, 0.0))
            if how == "Ctrl-Z":
                op.type(b"\x1a")
            else:
                os.kill(job.pid, signal.SIGTSTP)
            await until(lambda: job.is_stopped)
            await until(lambda: h.asks(*ZERO) and not h.sees_teleop())
            assert not op.modes_on & {"1049", "1004"}
            op.type(b"echo it is the $((6*7)) shell\n")
            await until(lambda: "it is the 42 shell" in op.picture)
            op.type(b"fg\n")
            await until(lambda: h.is_ready() and "back again: the setpoint is zero" in op.picture)
            op.type(b"w")
            await until(lambda: h.asks(0.1, 0.0))
            op.type(b"q")
            await until(h.is_left)
            op.type(b"echo over=$?\n")
            await until(lambda: "over=0" in op.picture)
        finally:
            op.close()


async def test_ctrl_c_in_its_first_moments_ends_it_quietly() -> None:
    endpoint = free_endpoint()
    for delay_s in (0.15, 0.3, 0.5):
        async with operator(endpoint) as op:
            await asyncio.sleep(delay_s)
            op.send(signal.SIGINT)
            code, errors = await op.ended()
            assert (code in (0, -signal.SIGINT), errors) == (True, "")
            assert op.modes() == op.modes_before


async def test_a_second_operator_is_told_who_holds_the_name() -> None:
    async with driving() as (h, op):
        async with operator(op.endpoint) as second:
            code, errors = await second.ended()
            assert code == 2
            assert f"pid {op.process.pid}" in errors
            assert "--source" in errors
            await until(lambda: second.is_restored)
        assert h.sees_teleop()
        assert h.asks(0.1, 0.0)


async def test_of_two_that_start_at_once_one_drives_and_the_other_ends() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as one, operator(endpoint) as two:
        await until(lambda: all("nothing heard" in op.picture for op in (one, two)))
        async with hub(endpoint) as h:
            await until(lambda: 2 in (one.process.poll(), two.process.poll()))
            await until(h.is_ready)
            assert [one.process.poll(), two.process.poll()].count(None) == 1


async def test_another_source_takes_another_name() -> None:
    endpoint = free_endpoint()
    async with (
        hub(endpoint, "joy") as h,
        operator(endpoint) as one,
        operator(endpoint, "--source", "joy") as two,
    ):
        await until(h.is_ready)
        two.type(b"w")
        await until(lambda: h.asks(0.1, 0.0))
        assert (one.process.poll(), two.process.poll()) == (None, None)
