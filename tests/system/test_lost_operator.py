"""What a lost operator costs: the time to zero and the requested distance, for each kind of control and terminal."""

import asyncio
import signal
import sys
import time
from contextlib import AsyncExitStack
from dataclasses import dataclass

import pytest

from teleop.pilots.vigilance import DEAD_LINK_M, DEMAND_S, unanswered_limit_m_s
from teleop.screen.view import Control
from teleop.service import Setup
from tests.system.multiplexers import behind, needs
from tests.system.operators import (
    LIMIT_S,
    TOLERANT,
    ZERO,
    Hub,
    Operator,
    free_endpoint,
    hold_down,
    hub,
    operator,
    press,
    press_steps,
    ready,
    until,
)

pytestmark = pytest.mark.timed
TRIALS = 3
DEFAULTS = Setup("", "", Control.INCREMENTAL)
STEPS_M_S, HOLD_M_S = 0.3, 0.5
SLOW_M_S = unanswered_limit_m_s(DEFAULTS.vigilance_s, DEFAULTS.round_trip_limit_s)
PICTURE_S, VIGILANCE_END_S, REPEATS_S = 1.0, DEFAULTS.vigilance_s + DEMAND_S, 0.3
"""The longest times to zero, computed from the constants (docs/crash-safety.md)."""
ARRIVAL_S = 0.1
"""From a tick of teleop to the arrival of its command."""


@dataclass(frozen=True)
class Loss:
    """How a person drives, and what is between this person and teleop; then the link to the person dies."""

    control: str
    terminal: str
    bound_s: float
    speed_m_s: float = STEPS_M_S
    options: tuple[str, ...] = ()
    term: str = "xterm-256color"
    kitty: int | None = None
    answers: bool = True
    program: str = ""
    """What answers the status requests for the person."""

    async def drive(self, h: Hub, op: Operator) -> None:
        match self.control:
            case "steps" if self.answers:
                await press_steps(h, op, b"www", self.speed_m_s)
            case "steps":  # the first keys may be void, and the limit keeps the speed
                await until(lambda: h.asks(self.speed_m_s, 0.0) or op.type(b"w"))
            case "hold, releases":
                await until(lambda: "releases reported" in op.picture)
                await press(lambda: op.hold("i"), lambda: h.asks(self.speed_m_s, 0.0))
            case _:
                await hold_down(op, b"i", lambda: h.asks(self.speed_m_s, 0.0))

    def lose(self, op: Operator) -> None:
        """From now on, no key and no answer arrives; the output is still accepted."""
        if self.program:
            op.send(signal.SIGKILL)
        op.answers = False


ANSWERS, SILENT = "answers status requests", "never answers"
PLAIN, DUMB, HOLD = ("--plain",), "TERM=dumb", ("--mode", "hold")
LOSSES = (
    Loss("steps", ANSWERS, PICTURE_S),
    Loss("steps", f"{ANSWERS}, --plain", PICTURE_S, options=PLAIN),
    *(Loss("steps", f"{program}, client killed", VIGILANCE_END_S, program=program) for program in ("tmux", "screen", "mosh")),
    Loss("steps", SILENT, VIGILANCE_END_S, SLOW_M_S, answers=False),
    Loss("steps", f"{SILENT}, --plain", VIGILANCE_END_S, SLOW_M_S, options=PLAIN, answers=False),
    Loss("steps", DUMB, VIGILANCE_END_S, SLOW_M_S, term="dumb", answers=False),
    Loss("hold, releases", ANSWERS, PICTURE_S, HOLD_M_S, options=HOLD, kitty=31),
    Loss("hold, repeats", ANSWERS, REPEATS_S, HOLD_M_S, options=HOLD),
    Loss("hold, repeats", SILENT, REPEATS_S, HOLD_M_S, options=HOLD, answers=False),
    Loss("hold, repeats", f"{SILENT}, --plain", REPEATS_S, HOLD_M_S, options=HOLD + PLAIN, answers=False),
    Loss("hold, repeats", DUMB, REPEATS_S, HOLD_M_S, options=HOLD, term="dumb", answers=False),
)  # fmt: skip


async def cost(loss: Loss) -> tuple[float, float]:
    """Return the time from the loss to zero [s], and the distance that was requested meanwhile [m]."""
    endpoint = free_endpoint()
    async with AsyncExitStack() as stack:
        h = await stack.enter_async_context(hub(endpoint))
        if loss.program:
            op = stack.enter_context(behind(loss.program, sys.executable, *TOLERANT, "--endpoint", endpoint))
        else:
            terminal = operator(
                endpoint,
                *loss.options,
                command=TOLERANT,
                term=loss.term,
                kitty=loss.kitty,
                answers=loss.answers,
            )
            op = await stack.enter_async_context(terminal)
        await ready(h, op, 2 * LIMIT_S)
        await loss.drive(h, op)
        lost_s = time.monotonic()
        loss.lose(op)
        await until(lambda: h.asks(*ZERO))
        return h.requested_since(lost_s)


@pytest.mark.parametrize(
    "loss",
    [
        pytest.param(
            loss, id=f"{loss.control}; {loss.terminal}", marks=needs(loss.program) if loss.program else ()
        )
        for loss in LOSSES
    ],
)
async def test_a_lost_operator_costs_no_more_than_the_bound(loss: Loss) -> None:
    trials = await asyncio.gather(*(cost(loss) for _ in range(TRIALS)))
    times_s, distances_m = zip(*trials, strict=True)
    print(
        f"\n| {loss.control} | {loss.terminal} | {TRIALS} | {loss.speed_m_s:g} "
        f"| {max(times_s):.2f} | {loss.bound_s:g} | {max(distances_m):.2f} |"
    )
    assert max(times_s) <= loss.bound_s + ARRIVAL_S
    if not loss.answers:
        assert max(distances_m) <= DEAD_LINK_M
