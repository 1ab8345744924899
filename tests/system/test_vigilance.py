"""The operator's presence: keys on demand, terminals that answer no status requests, and programs that answer for a person."""

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from teleop.pilots.vigilance import DEAD_LINK_M, DEMAND_S, unanswered_limit_m_s
from tests.system.multiplexers import behind, needs
from tests.system.operators import (
    HEARTBEAT_S,
    LIMIT_S,
    PATIENT,
    ZERO,
    Operator,
    free_endpoint,
    hub,
    operator,
    press,
    press_steps,
    ready,
    until,
)
from wire.messages import SafetyStatus

VIGILANCE_S = 2.0
LATE_S = 2.0
"""Delay of a busy machine. A program that no longer reads output also stops teleop, but 5 s later, when its buffers are full."""
LIMIT_M_S = unanswered_limit_m_s(VIGILANCE_S, 0.5)


@pytest.fixture
def config(tmp_path: Path) -> str:
    path = tmp_path / "robot.toml"
    path.write_text(f"[teleop]\nvigilance_s = {VIGILANCE_S}\n")
    return str(path)


async def test_without_a_key_the_robot_stops_after_a_demand_with_the_bell_and_enter_lets_it_drive_on(
    config: str,
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--config", config) as op:
        await ready(h, op)
        await press_steps(h, op, b"w", 0.1)
        seen = len(h.velocities)
        for _ in range(3):
            await until(lambda: h.tell(SafetyStatus.DRIVING, owner="teleop") or "PRESS ENTER" in op.picture)
            op.type(b"\r")
            await until(
                lambda: h.tell(SafetyStatus.DRIVING, owner="teleop") or "PRESS ENTER" not in op.picture
            )
        assert set(h.velocities[seen:]) == {(0.1, 0.0)}
        assert op.bells == 3
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "no key was pressed on demand" in op.picture)
        await press_steps(h, op, b"w", 0.1)


@pytest.mark.parametrize(
    ("term", "options"), [("xterm-256color", ()), ("xterm-256color", ("--plain",)), ("dumb", ())]
)
async def test_behind_a_dead_link_to_a_terminal_that_answers_nothing_the_robot_drives_at_most_a_metre(
    config: str, term: str, options: tuple[str, ...]
) -> None:
    endpoint = free_endpoint()
    async with (
        hub(endpoint) as h,
        operator(endpoint, "--config", config, *options, term=term, answers=False) as op,
    ):
        await ready(h, op)
        await until(lambda: h.asks(LIMIT_M_S, 0.0) or op.type(b"w"))
        await until(lambda: f"at most {LIMIT_M_S} m/s" in op.output or str(LIMIT_M_S) in op.picture)
        await until(lambda: h.asks(*ZERO))
        assert LIMIT_M_S * HEARTBEAT_S * h.velocities.count((LIMIT_M_S, 0.0)) <= DEAD_LINK_M
        await until(
            lambda: (
                "no key was pressed on demand" in op.output or "no key was pressed on demand" in op.picture
            )
        )


async def test_the_display_of_one_line_asks_the_terminal_too_and_drives_at_full_speed_if_it_answers() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--plain") as op:
        await ready(h, op)
        await until(lambda: op.answered > 0)
        await press_steps(h, op, b"wwww", 0.4)


@pytest.mark.smoke
async def test_key_releases_of_a_terminal_that_answers_no_status_requests_do_not_hold_a_motion() -> None:
    """The release that a dead link keeps back would never end it."""
    endpoint = free_endpoint()
    async with (
        hub(endpoint) as h,
        operator(endpoint, "--mode", "hold", kitty=31, answers=False) as op,
    ):
        await ready(h, op)
        await until(lambda: op.kitty_flags == [15])
        await until(lambda: "by key repeat" in op.picture)
        seen = len(h.velocities)
        await press(lambda: op.key("i", 1), lambda: "a tap is too short to move" in op.picture)
        assert set(h.velocities[seen:]) == {ZERO}


# --- tmux, screen and mosh


def _type(keys: bytes) -> Callable[[Operator], object]:
    return lambda client: client.type(keys)


LOST_CLIENT: dict[str, Callable[[Operator], object]] = {
    "client killed": lambda client: client.send(signal.SIGKILL),
    "client stopped": lambda client: client.send(signal.SIGSTOP),
    "terminal not read": lambda client: client.look(at=False),
}
TMUX, SCREEN = b"\x02", b"\x01"
"""Prefix keys."""
LOSSES = {
    "tmux": LOST_CLIENT
    | {
        "copy mode, which takes SPACE": _type(TMUX + b"[ "),
        "choose-tree, which takes SPACE": _type(TMUX + b"w "),
        "command prompt, which takes SPACE": _type(TMUX + b": "),
        "another window": _type(TMUX + b"c"),
        "detached": _type(TMUX + b"d"),
    },
    "screen": LOST_CLIENT
    | {
        "copy mode, which takes SPACE": _type(SCREEN + b"[ "),
        "command prompt, which takes SPACE": _type(SCREEN + b": "),
        "another window": _type(SCREEN + b"c"),
        "detached": _type(SCREEN + b"d"),
    },
    "mosh": LOST_CLIENT,
}


@pytest.mark.parametrize(
    ("program", "loss"),
    [
        pytest.param(program, loss, marks=needs(program), id=f"{program}, {loss}")
        for program, losses in LOSSES.items()
        for loss in losses
    ],
)
async def test_where_a_program_answers_for_the_person_the_robot_stops_when_vigilance_ends(
    config: str, program: str, loss: str
) -> None:
    endpoint = free_endpoint()
    command = (sys.executable, *PATIENT, "--endpoint", endpoint, "--config", config)
    async with hub(endpoint) as h:
        with behind(program, *command) as client:
            await ready(h, client, 2 * LIMIT_S)
            await press_steps(h, client, b"w", 0.1)
            LOSSES[program][loss](client)
            driven_s = await until(lambda: h.asks(*ZERO))
            assert driven_s > VIGILANCE_S, "until then, the program answers for the person"
            assert driven_s < VIGILANCE_S + DEMAND_S + LATE_S
            assert not h.got_estop()
