"""Only a key that a person presses moves the robot: the wheel, other programs on the terminal, and terminals that misreport do not."""

import asyncio
import signal
import sys
import termios
import time
from collections.abc import Callable
from typing import Any

import pytest

from teleop.terminal import WHEEL_TRIES
from tests.system.multiplexers import behind, needs
from tests.system.operators import (
    HEARTBEAT_S,
    INTERVAL_S,
    LIMIT_S,
    PATIENT,
    ZERO,
    Hub,
    Operator,
    driving,
    free_endpoint,
    hold_down,
    hub,
    operator,
    press,
    ready,
    until,
)

HOLD = ("--mode", "hold")
ALL_FLAGS = 31
NOTCHES = 40
"""Of the wheel, one every `INTERVAL_S`."""
UNPROVEN_LIMIT_S = 1.5
"""A held key counts for 1 s at most before the first release, in heartbeats: a busy machine may delay them."""
ESTOP_LIMIT_S = 0.2
BYTE_S = 0.05
"""Pause between two bytes, so that answers arrive between them."""
CUT_S = 0.15
"""Pause between the two parts of a sequence on a slow link."""


async def scroll(op: Operator) -> None:
    for _ in range(NOTCHES):
        op.scroll()
        await asyncio.sleep(INTERVAL_S)


async def held(h: Hub, op: Operator) -> None:
    """Wait until teleop relies on key releases, and hold a key."""
    await ready(h, op)
    await until(lambda: "releases reported" in op.picture)
    await press(lambda: op.hold("i"), lambda: h.asks(0.5, 0.0))


# --- the wheel


@pytest.mark.parametrize("program", [pytest.param(p, marks=needs(p)) for p in ("tmux", "screen", "mosh")])
async def test_behind_a_program_that_hides_the_terminal_the_wheel_moves_nothing_and_a_letter_does(
    program: str,
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h:
        with behind(program, sys.executable, *PATIENT, "--endpoint", endpoint, *HOLD) as client:
            await ready(h, client, 2 * LIMIT_S)
            assert "1007" in client.modes_on
            await scroll(client)
            await until(lambda: "ignored an arrow" in client.picture)
            assert set(h.velocities) == {ZERO}
            await hold_down(client, b"i", lambda: h.asks(0.5, 0.0))
            await until(lambda: h.asks(*ZERO))


@pytest.mark.parametrize("kitty", [None, ALL_FLAGS])
@pytest.mark.parametrize("options", [(), ("--plain",)])
async def test_the_wheel_of_a_terminal_that_always_converts_it_moves_nothing(
    options: tuple[str, ...], kitty: int | None
) -> None:
    endpoint = free_endpoint()
    async with (
        hub(endpoint) as h,
        operator(endpoint, *HOLD, *options, kitty=kitty, obeys_1007=False) as op,
    ):
        await ready(h, op)
        op.type(b"\x1b[A" * NOTCHES)
        op.type(b"\x1b[1;1:1A\x1b[1;1:2A")
        await until(lambda: "ignored an arrow" in op.output)
        assert set(h.velocities) == {ZERO}


async def test_an_arrow_drives_on_a_terminal_whose_wheel_sends_none_until_another_program_changes_it() -> (
    None
):
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD) as op:
        await ready(h, op)
        await hold_down(op, b"\x1b[A", lambda: h.asks(0.5, 0.0))
        await until(lambda: h.asks(*ZERO))
        answered = op.answered
        op.modes_on.add("1007")
        await until(lambda: op.answered >= answered + 2)
        seen = len(h.velocities)
        await scroll(op)
        await until(lambda: "ignored an arrow" in op.picture)
        assert set(h.velocities[seen:]) == {ZERO}


async def test_a_terminal_that_does_not_report_its_wheel_is_asked_only_a_few_times() -> None:
    """Some terminals print a part of the question."""
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, obeys_1007=None) as op:
        await ready(h, op)
        await until(lambda: op.answered >= WHEEL_TRIES + 5)
        assert op.output.count("\x1b[?1007$p") == WHEEL_TRIES
        op.type(b"\x1b[A" * NOTCHES)
        await until(lambda: "ignored an arrow" in op.output)
        assert set(h.velocities) == {ZERO}


# --- key releases


@pytest.mark.smoke
async def test_a_held_key_ends_when_teleop_is_stopped_and_continued() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await held(h, op)
        op.send(signal.SIGSTOP)
        op.send(signal.SIGCONT)
        await until(lambda: h.asks(*ZERO))
        await held(h, op)


def reset_flags(op: Operator) -> None:
    op.kitty_flags[:] = [0]


def reattach(op: Operator) -> None:
    """Go on in a terminal without the protocol, as with dtach."""
    op.kitty = None


@pytest.mark.parametrize("change", [reset_flags, reattach])
async def test_a_held_key_ends_when_the_terminal_no_longer_reports_releases(
    change: Callable[[Operator], None],
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await held(h, op)
        change(op)
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "by key repeat" in op.picture)


async def test_before_the_first_release_a_held_key_counts_for_a_second() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await ready(h, op)
        await until(lambda: "releases reported" in op.picture)
        await press(lambda: op.key("i", 1), lambda: (0.5, 0.0) in h.velocities)
        await until(lambda: h.asks(*ZERO))
        assert h.velocities.count((0.5, 0.0)) * HEARTBEAT_S < UNPROVEN_LIMIT_S
        await until(lambda: "no key release" in op.picture)


@pytest.mark.parametrize(
    ("pressed", "released"),
    [(b"\x1b[105;1:1u", b"\x1b[99::105;1:3u"), (b"\x1b[57419;1:1u", b"\x1b[57407;1:3u")],
    ids=["layout", "Num Lock"],
)
async def test_a_held_key_ends_with_its_release_if_the_layout_or_num_lock_has_renamed_it(
    pressed: bytes, released: bytes
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await held(h, op)
        op.key("i", 3)
        await press(lambda: op.type(pressed), lambda: h.asks(0.5, 0.0))
        op.type(released)
        await until(lambda: h.asks(*ZERO), 1.0)
        await held(h, op)


# --- pasted text


@pytest.mark.parametrize(("mode", "key"), [((), b"w"), (HOLD, b"i")], ids=["steps", "hold"])
async def test_pasted_text_inside_whose_mark_the_terminal_answers_moves_nothing(
    mode: tuple[str, ...], key: bytes
) -> None:
    """A program that answers for the terminal, as mosh does, inserts its answers between any two bytes."""
    pasted = b"\x1b[200~" + 9 * key + b"\x1b[201~"
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *mode) as op:
        await ready(h, op)
        seen = len(h.velocities)
        for cut in range(1, 6):
            op.type(pasted[:cut] + b"\x1b[0n" + pasted[cut:])
            answered = op.answered
            await until(lambda answered=answered: op.answered >= answered + 5)
        for byte in pasted:
            op.type(bytes([byte]))
            await asyncio.sleep(BYTE_S)
        assert set(h.velocities[seen:]) == {ZERO}


async def test_pasted_text_that_contains_its_own_end_moves_nothing() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint) as op:
        await ready(h, op)
        seen = len(h.velocities)
        op.paste(b"ls\x1b[201~wwww")
        await until(lambda: "ignored pasted text" in op.picture)
        answered = op.answered
        await until(lambda: op.answered >= answered + 5)
        assert set(h.velocities[seen:]) == {ZERO}


async def test_a_terminal_is_told_again_to_mark_pasted_text_after_another_program_ended_it() -> None:
    async with driving() as (_, op):
        op.modes_on.discard("2004")
        await until(lambda: "2004" in op.modes_on)


# --- other programs on the terminal


@pytest.mark.parametrize(("mode", "key"), [((), b"w"), (HOLD, b"i")], ids=["steps", "hold"])
async def test_keys_of_another_window_that_a_program_copies_move_nothing_but_space_is_the_emergency_stop(
    mode: tuple[str, ...], key: bytes
) -> None:
    """For example "broadcast input" of a terminal, or synchronize-panes of tmux with focus-events."""
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *mode) as op:
        await ready(h, op)
        assert "1004" in op.modes_on
        op.type(b"\x1b[O")
        seen = len(h.velocities)
        for _ in range(NOTCHES):
            op.type(key)
            await asyncio.sleep(INTERVAL_S)
        await until(lambda: "does not have the keyboard focus" in op.picture)
        assert set(h.velocities[seen:]) == {ZERO}
        op.type(b" ")
        await until(h.got_estop)
        op.type(b"\x1b[I")
        await hold_down(op, key, lambda: not h.asks(*ZERO))


def sane(op: Operator) -> list[Any]:
    return list(op.modes_before)


def min_10(op: Operator) -> list[Any]:
    modes = termios.tcgetattr(op.slave)
    modes[6][termios.VMIN] = 10
    return modes


@pytest.mark.timed
@pytest.mark.parametrize("changed", [sane, min_10])
async def test_space_is_the_emergency_stop_at_once_after_another_program_has_changed_the_terminal(
    changed: Callable[[Operator], list[Any]],
) -> None:
    async with driving() as (h, op):
        ours = op.modes()
        termios.tcsetattr(op.slave, termios.TCSANOW, changed(op))  # like `stty sane`, `stty min 10`
        pressed_s = time.monotonic()
        op.type(b" ")
        await until(h.got_estop)
        assert time.monotonic() - pressed_s <= ESTOP_LIMIT_S
        await until(lambda: op.modes() == ours)


async def test_mouse_modes_that_an_earlier_program_left_on_are_switched_off() -> None:
    async with driving() as (_, op):
        assert all(f"\x1b[?{mode}l" in op.output for mode in (9, 1000, 1001, 1002, 1003))


# --- keys in the coding of other programs


OTHER_KEYS = {
    "F1 of the Linux console": (b"\x1b[[", b"A"),
    "Ctrl-Left of an old xterm": (b"\x1bO5", b"D"),
    "X10 mouse at column 87": (b"\x1b[M`", b"ww"),
    "F8 of an HP terminal": (b"\x1bw", b""),
    "keypad of VT52 mode": (b"\x1b?", b"w"),
    "text without marks": (b"forward", b"www"),
    "Shift-Delete of rxvt": (b"\x1b[3$", b"D"),
}


@pytest.mark.parametrize("sequence", OTHER_KEYS.values(), ids=OTHER_KEYS)
async def test_a_key_of_another_terminal_moves_nothing_if_a_slow_link_cuts_it(
    sequence: tuple[bytes, bytes],
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint) as op:
        await ready(h, op)
        seen = len(h.velocities)
        op.type(sequence[0])
        await asyncio.sleep(CUT_S)
        op.type(sequence[1])
        await until(lambda: "ignored" in op.picture)
        answered = op.answered
        await until(lambda: op.answered >= answered + 5)
        assert set(h.velocities[seen:]) == {ZERO}


@pytest.mark.parametrize("key", [b"\x1b[1;5R", b"\x1b[1;2R", b"\x1bOR"], ids=["Ctrl-F3", "Shift-F3", "F3"])
async def test_f3_stops_with_any_modifier(key: bytes) -> None:
    async with driving() as (h, op):
        op.type(key)
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "ignored f3" in op.picture)


async def test_a_shifted_digit_of_a_french_keyboard_sets_the_level() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await held(h, op)
        op.type(b"\x1b[34:51:51;2:1u")  # Shift and the key of 3
        await until(lambda: "3 of 5" in op.picture)
        assert h.asks(0.5, 0.0)


async def test_a_key_that_is_held_through_a_stop_is_reported_once() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *HOLD, kitty=ALL_FLAGS) as op:
        await held(h, op)
        op.key("k", 1)
        await until(lambda: h.asks(*ZERO))
        seen = len(h.velocities)
        for _ in range(20):
            op.key("i", 2)
            await asyncio.sleep(INTERVAL_S)
        await until(lambda: "held at a stop" in op.picture)
        assert op.output.count("held at a stop") == 1
        assert set(h.velocities[seen:]) == {ZERO}
