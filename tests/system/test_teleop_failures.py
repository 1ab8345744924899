"""After any failure of teleop or its terminal, the robot stops, the terminal is restored, and no process remains."""

import asyncio
import itertools
import os
import select
import shlex
import signal
import sys
import termios
from collections.abc import AsyncGenerator, Callable, Generator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path

import pytest

from teleop.screen.view import Control
from tests.system.operators import (
    DELETE_LINE,
    HANG_LIMIT_S,
    LIMIT_S,
    PATIENT,
    TELEOP,
    TOLERANT,
    ZERO,
    Hub,
    Operator,
    driving,
    free_endpoint,
    hub,
    operator,
    press,
    press_steps,
    ready,
    until,
)
from tests.system.process_state import children_of, state_of

ALL_KITTY_FLAGS = 31
BROKEN = """
import asyncio
from teleop import __main__, service
service.HANG_S = 10.0  # a key that is typed while the machine holds it up would be void
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
        await ready(h, op)
        await press(lambda: op.type(b"w"), lambda: op.process.poll() is not None)
        code, errors = await op.ended()
        assert code == 1
        assert "RuntimeError: broken on purpose" in errors
        await until(lambda: h.is_left() and op.is_restored)


@pytest.mark.smoke
async def test_a_picture_that_nobody_reads_stops_the_robot_and_it_can_still_be_ended() -> None:
    async with driving() as (h, op):
        op.look(at=False)
        widths = itertools.cycle((99, 100))
        await until(lambda: op.resize(next(widths), 30) or h.asks(*ZERO))  # each is drawn whole
        op.send(signal.SIGTERM)
        await until(lambda: op.process.poll() is not None)
        op.look(at=True)
        await until(lambda: h.is_left() and op.is_restored)


@pytest.mark.timed
async def test_a_terminal_that_answers_no_more_stops_the_robot() -> None:
    async with driving(command=TELEOP) as (h, op):
        await asks_on(h, op, b"w", 0.1)
        op.answers = False
        assert await until(lambda: h.asks(*ZERO)) < 3.0


OLD = "screen was not seen"  # the picture breaks the line before


async def void_until_a_later_picture_is_answered(h: Hub, op: Operator) -> None:
    """Deliver keys and then the answers to all requests, as a link that held both back; then type on the live screen."""
    seen = len(h.velocities)
    op.type(b"www")
    op.answer_all()
    await until(lambda: OLD in op.picture)
    answered = op.answered
    await until(lambda: op.answered > answered + 1)
    assert set(h.velocities[seen:]) <= {ZERO}
    op.type(b"ww")
    await until(lambda: h.asks(0.2, 0.0))


@pytest.mark.timed
async def test_keys_typed_on_a_frozen_screen_are_void_and_the_next_one_on_the_live_screen_counts() -> None:
    async with driving(command=TELEOP) as (h, op):
        op.answers = False
        await until(lambda: h.asks(*ZERO))
        await void_until_a_later_picture_is_answered(h, op)
        await asks_on(h, op, b"ww", 0.2)


@pytest.mark.timed
async def test_keys_that_a_link_delivers_after_a_stop_of_teleop_are_void_although_they_are_read_later() -> (
    None
):
    async with driving(command=TELEOP) as (h, op):
        op.answers = False
        op.send(signal.SIGSTOP)
        await until(lambda: state_of(op.process.pid) == "T")
        await asyncio.sleep(0.3)  # the hang itself
        op.send(signal.SIGCONT)
        await until(lambda: "teleop hung" in op.output and h.asks(*ZERO))
        await void_until_a_later_picture_is_answered(h, op)


async def test_a_key_typed_before_the_first_picture_was_seen_requests_no_motion() -> None:
    """It was typed blind, for example after the command line over a slow link."""
    settle = (
        f"from teleop import __main__, guards, service; guards.SETTLING_S = service.HANG_S = {2 * LIMIT_S}"
    )
    endpoint = free_endpoint()
    command = ("-c", f"{settle}; __main__.main()")
    async with hub(endpoint) as h, operator(endpoint, command=command, answers=False) as op:
        await ready(h, op)
        op.type(b"w")
        await until(lambda: "while the screen was not seen" in op.picture)
        assert set(h.velocities) == {ZERO}
        op.answer_all()
        await until(lambda: op.type(b"w") or not h.asks(*ZERO))


@pytest.mark.timed
@pytest.mark.parametrize("stalled_s", [0.05, 0.2, 0.5])
async def test_keys_typed_during_a_short_stall_of_the_link_all_count(stalled_s: float) -> None:
    async with driving(command=TOLERANT) as (h, op):
        for _ in range(4):
            op.type(b"s")
            await until(lambda: h.asks(*ZERO))
            op.look(at=False)
            await asyncio.sleep(stalled_s)  # the stall itself
            op.type(b"www")
            op.look(at=True)
            await until(lambda: h.asks(0.3, 0.0))


async def asks_on(h: Hub, op: Operator, keys: bytes, linear_m_s: float) -> None:
    """Drive for a second. This loop answers the terminal's requests; if a busy machine delays it, the operator starts again."""
    for left in reversed(range(4)):
        await asyncio.sleep(1.0)
        if h.asks(linear_m_s, 0.0):
            return
        assert left
        op.type(keys)
        await until(lambda: h.asks(linear_m_s, 0.0))


async def test_a_hang_leaves_the_keys_typed_meanwhile_without_effect() -> None:
    async with driving(command=TOLERANT) as (h, op):
        op.send(signal.SIGSTOP)
        await until(lambda: state_of(op.process.pid) == "T")
        op.type(b"www")
        await asyncio.sleep(HANG_LIMIT_S + 0.5)  # the hang itself
        seen = len(h.velocities)
        op.send(signal.SIGCONT)
        await until(lambda: "teleop hung" in op.picture)
        assert set(h.velocities[seen + 1 :]) <= {ZERO}
        op.type(b"q")
        assert (await op.ended())[0] == 0
        await until(lambda: op.is_restored)


async def test_ctrl_backslash_ends_also_a_teleop_whose_loop_hangs(tmp_path: Path) -> None:
    endpoint, hangs = free_endpoint(), tmp_path / "hangs"
    command = ("-c", BROKEN.format(failure=f"import time; open({str(hangs)!r}, 'w'); time.sleep(60)"))
    async with hub(endpoint) as h, operator(endpoint, command=command) as op:
        await ready(h, op)
        await press(lambda: op.type(b"w"), hangs.exists)
        op.type(b"\x1c")
        await op.ended()
        await until(lambda: op.is_restored and not h.sees_teleop())


class Job:
    """A teleop that an interactive shell has started."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.terminal = Operator("bash", "--norc", "--noprofile", "-i")
        self.terminal.type(shlex.join([sys.executable, *PATIENT, "--endpoint", endpoint]).encode() + b"\n")

    @property
    def pid(self) -> int:
        """The exit code; 0 if the shell has seen it end."""
        return next(iter(children_of(self.terminal.process.pid)), 0)

    @property
    def is_stopped(self) -> bool:
        return state_of(self.pid) == "T"


@asynccontextmanager
async def ready_job() -> AsyncGenerator[tuple[Hub, Job]]:
    """A job that is connected to a hub."""
    endpoint = free_endpoint()
    async with hub(endpoint) as h:
        job = Job(endpoint)
        try:
            await ready(h, job.terminal, 2 * LIMIT_S)
            yield h, job
        finally:
            job.terminal.close()


@pytest.mark.parametrize("how", ["Ctrl-Z", "kill -TSTP"])
async def test_suspended_it_leaves_the_shell_a_terminal_and_comes_back_neutral(how: str) -> None:
    async with ready_job() as (h, job):
        op = job.terminal
        await press_steps(h, op, b"ww", 0.2)
        if how == "Ctrl-Z":
            op.type(b"\x1a")
        else:
            os.kill(job.pid, signal.SIGTSTP)
        await until(lambda: job.is_stopped)
        # The token's end stops the robot: a starved process may be suspended before its last zero has left it.
        await until(lambda: not h.sees_teleop())
        await until(lambda: not op.modes_on & {"1049", "1004"})
        op.type(DELETE_LINE + b"echo it is the $((6*7)) shell\n")
        await until(lambda: "it is the 42 shell" in op.picture)
        op.type(DELETE_LINE + b"fg\n")
        await until(lambda: "back again: the setpoint is zero" in op.picture)
        await ready(h, op)
        await press_steps(h, op, b"w", 0.1)
        op.type(b"q")
        await until(h.is_left)
        await until(lambda: job.pid == 0)  # before its end it discards typed keys
        op.type(DELETE_LINE + b"echo over=$?\n")
        await until(lambda: "over=0" in op.picture)


async def test_a_kill_while_it_is_suspended_leaves_the_shell_its_terminal() -> None:
    async with ready_job() as (_, job):
        op = job.terminal
        op.type(b"\x1a")
        await until(lambda: job.is_stopped)
        op.type(DELETE_LINE + b"echo it is the $((6*7)) shell\n")
        await until(lambda: "it is the 42 shell" in op.picture)
        with guard_of(job.pid) as has_ended:
            left = op.output.count("\x1b[?1049l")
            op.type(DELETE_LINE + b"kill -9 %1\n")
            await until(has_ended)
        op.type(DELETE_LINE + b"echo still the $((6*7)) shell\n")
        await until(lambda: "still the 42 shell" in op.picture)
        assert op.output.count("\x1b[?1049l") == left


async def test_the_guard_of_a_stopped_teleop_leaves_alone_a_program_that_was_started_since() -> None:
    """Its modes look like teleop's: it is a teleop as well."""
    async with ready_job() as (_, job):
        op, first = job.terminal, job.pid
        os.kill(first, signal.SIGSTOP)
        await until(lambda: job.is_stopped)
        op.type(DELETE_LINE + b"echo it is the $((6*7)) shell\n")
        await until(lambda: "it is the 42 shell" in op.picture)
        second = [sys.executable, *TELEOP, "--view-only", "--endpoint", job.endpoint]
        op.type(DELETE_LINE + shlex.join(second).encode() + b"\n")
        await until(lambda: Control.VIEW_ONLY.value in op.picture, 2 * LIMIT_S)
        with guard_of(first) as has_ended:
            os.kill(first, signal.SIGKILL)
            await until(has_ended)
        op.type(b"q")
        await until(lambda: job.pid == 0)


def guards_of(pid: int) -> list[int]:
    """Return the processes that guard teleop's terminal: one or none."""
    return [p for p in children_of(pid) if b"terminal_guard" in Path(f"/proc/{p}/cmdline").read_bytes()]


@contextmanager
def guard_of(pid: int) -> Generator[Callable[[], bool]]:
    """Return whether the process that guards teleop's terminal has ended."""
    (guard,) = guards_of(pid)
    pidfd = os.pidfd_open(guard)
    try:
        yield lambda: bool(select.select([pidfd], [], [], 0)[0])
    finally:
        os.close(pidfd)


@pytest.mark.smoke
@pytest.mark.parametrize("options", [(), ("--plain",), ("--mode", "hold")], ids=["screen", "plain", "hold"])
async def test_a_kill_leaves_the_terminal_as_it_was(options: tuple[str, ...]) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *options, kitty=ALL_KITTY_FLAGS) as op:
        await ready(h, op)
        await until(lambda: bool(op.kitty_flags) == ("hold" in options))
        assert not op.is_restored
        op.process.kill()
        await until(lambda: op.is_restored)


async def test_a_guard_that_was_stopped_restores_the_terminal_all_the_same() -> None:
    """The kernel continues it when teleop ends, with SIGHUP first, like every orphaned stopped process group."""
    async with driving() as (_, op):
        (guard,) = guards_of(op.process.pid)
        os.kill(guard, signal.SIGSTOP)
        await until(lambda: state_of(guard) == "T")
        op.process.kill()
        await until(lambda: op.is_restored)


async def test_a_terminal_that_nobody_reads_when_teleop_is_killed_is_restored_once_somebody_does() -> None:
    async with driving() as (_, op):
        op.look(at=False)
        os.set_blocking(op.slave, False)
        with suppress(BlockingIOError):
            while True:
                os.write(op.slave, b" ")
        op.process.kill()
        await until(lambda: termios.tcgetattr(op.slave)[3] & termios.ICANON)
        op.look(at=True)
        await until(lambda: op.is_restored)


async def test_after_a_kill_the_guard_leaves_alone_modes_that_somebody_else_has_set() -> None:
    async with driving() as (_, op):
        os.kill(op.process.pid, signal.SIGSTOP)  # a running teleop sets its own modes again
        await until(lambda: state_of(op.process.pid) == "T")
        modes = termios.tcgetattr(op.slave)
        modes[3] |= termios.ECHO
        termios.tcsetattr(op.slave, termios.TCSANOW, modes)
        with guard_of(op.process.pid) as has_ended:
            op.process.kill()
            await until(has_ended)
        assert termios.tcgetattr(op.slave)[3] == modes[3]


def obeys_ctrl_c(pid: int) -> bool:
    """Return whether teleop's own code runs: Python prints a traceback on SIGINT while it starts.

    Python ignores SIGPIPE and catches SIGINT from its start on; teleop first restores the default of SIGINT.
    """
    status = dict(line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    ignored, caught = (int(status[name], 16) for name in ("SigIgn", "SigCgt"))
    return bool(ignored >> signal.SIGPIPE - 1 & 1) and not caught >> signal.SIGINT - 1 & 1


async def test_ctrl_c_in_its_first_moments_ends_it_quietly() -> None:
    endpoint = free_endpoint()
    for delay_s in (0.0, 0.15, 0.4):
        async with operator(endpoint, command=TELEOP) as op:
            await until(lambda pid=op.process.pid: obeys_ctrl_c(pid))
            await asyncio.sleep(delay_s)
            op.send(signal.SIGINT)
            code, errors = await op.ended()
            assert (code in (0, -signal.SIGINT), errors) == (True, "")
            assert op.modes() == op.modes_before


@pytest.mark.smoke
async def test_a_second_operator_is_shown_who_holds_the_name() -> None:
    async with driving() as (h, op):
        async with operator(op.endpoint) as second:
            code, errors = await second.ended()
            assert code == 2
            assert f"pid {op.process.pid}" in errors
            assert "--source" in errors
            await until(lambda: second.is_restored)
        await until(h.sees_teleop)
        assert h.asks(0.1, 0.0)


async def test_of_two_that_start_at_once_one_drives_and_the_other_ends() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as one, operator(endpoint) as two:
        await until(lambda: all("nothing heard" in op.picture for op in (one, two)))
        async with hub(endpoint) as h:
            await until(lambda: 2 in (one.process.poll(), two.process.poll()))
            await until(h.is_neutral)
            assert [one.process.poll(), two.process.poll()].count(None) == 1


async def test_another_source_takes_another_name() -> None:
    endpoint = free_endpoint()
    async with (
        hub(endpoint, "joy") as h,
        operator(endpoint) as one,
        operator(endpoint, "--source", "joy") as two,
    ):
        await ready(h, two)
        await press_steps(h, two, b"w", 0.1)
        assert (one.process.poll(), two.process.poll()) == (None, None)
