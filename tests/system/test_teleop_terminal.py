"""`python -m teleop` on a real pseudo-terminal, against a hub on a real link: its output, and the state that it leaves."""

import asyncio
import fcntl
import os
import pty
import signal
import statistics
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from tests.system.operators import (
    LIMIT_S,
    ROOT,
    ZERO,
    drive_after_estop,
    driving,
    free_endpoint,
    hub,
    operator,
    press,
    press_steps,
    until,
)
from wire.messages import SafetyStatus


@pytest.mark.smoke
async def test_keys_arrive_as_twists_and_the_heartbeat_repeats_them() -> None:
    async with driving() as (h, op):
        op.type(b"wa")
        await until(lambda: h.asks(0.2, 0.2))
        seen = len(h.velocities)
        await until(lambda: len(h.velocities) >= seen + 20)
        assert set(h.velocities[seen:]) == {(0.2, 0.2)}
        op.type(b"s")
        await until(lambda: h.asks(*ZERO))


@pytest.mark.timed
async def test_the_heartbeat_keeps_its_rate_while_all_keys_are_shown_too() -> None:
    async with driving() as (h, op):
        for shown in ("faster forward", "forward by one step"):
            await until(lambda shown=shown: shown in op.picture)
            seen = len(h.velocities)
            await until(lambda seen=seen: len(h.velocities) >= seen + 20)
            # The median: the machine delivers some of them late.
            assert 0.04 < statistics.median(h.gaps_s[seen:]) < 0.1
            op.type(b"?")


async def test_cursor_keys_do_not_drive_and_a_stray_escape_does_not_hide_the_emergency_stop() -> None:
    async with driving() as (h, op):
        seen = len(h.velocities)
        op.type(b"\x1b[A\x1b[D\x1bOA\x1b[1;5D\xc3\xa4")
        op.type(b"\x1b ")
        await until(lambda: h.got_estop() and h.asks(*ZERO))
        assert set(h.velocities[seen:]) <= {ZERO, (0.1, 0.0)}


async def test_of_the_keys_of_the_lab_none_is_ignored() -> None:
    async with driving() as (h, op):
        for keys, velocity in (("ww", (0.3, 0.0)), ("aa", (0.3, 0.4)), ("s", ZERO), ("xx", (-0.2, 0.0))):
            for key in keys:
                op.type(key.encode())
            await until(lambda velocity=velocity: h.asks(*velocity))
        for keys, shown in (("ddd", "-0.60"), ("?", "forward by one step"), ("3", "3 of 5"), ("5", "5 of 5")):
            op.type(keys.encode())
            await until(lambda shown=shown: shown in op.picture)
        await until(lambda: h.asks(-0.2, -0.6))
        op.type(b" ")
        await until(h.got_estop)
        op.type(b"r")
        await until(lambda: "reset refused" in op.output)
        op.type(b"q")
        assert await op.ended() == (0, "")
        assert "ignored" not in op.output


KEY_S = 0.15
"""Between two keys of a person who types quickly."""

STOP_SIGNS = (b"^", b"~", "´".encode(), b"\x1b", b"\x13", b"\x1b[A")
"""The first three are a dead key before SPACE."""


@pytest.mark.parametrize("key", STOP_SIGNS, ids=["^", "~", "acute", "Escape", "Ctrl-S", "cursor"])
async def test_a_key_without_a_function_stops_the_robot_and_is_shown(key: bytes) -> None:
    async with driving() as (h, op):
        op.type(key)
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "ignored" in op.picture)
        assert not h.got_estop()


@pytest.mark.parametrize("options", [(), ("--plain",)], ids=["screen", "line"])
@pytest.mark.parametrize("text", [b"www.example.org", b"r", b"w", b"wwq"])
async def test_pasted_text_stops_the_robot_and_requests_no_motion_and_no_reset(
    text: bytes, options: tuple[str, ...]
) -> None:
    async with driving(*options) as (h, op):
        seen = len(h.velocities)
        op.paste(text)
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "ignored pasted text" in op.output)
        assert set(h.velocities[seen:]) <= {ZERO, (0.1, 0.0)}
        await press_steps(h, op, b"w", 0.1)
        assert "reset refused" not in op.output
        op.type(b"\x03")
        assert await op.ended() == (0, "")
        await until(lambda: op.is_restored)


async def test_a_paste_that_the_terminal_does_not_mark_stops_the_robot() -> None:
    async with driving() as (h, op):
        seen = len(h.velocities)
        op.type(b"www.example.org")
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "ignored different keys at once" in op.picture)
        assert set(h.velocities[seen:]) <= {ZERO, (0.1, 0.0)}


async def test_equal_keys_that_a_slow_link_delivers_at_once_all_count() -> None:
    async with driving() as (h, op):
        op.type(b"wwa")
        await until(lambda: h.asks(0.3, 0.2))


async def test_keys_that_are_typed_over_a_slow_link_to_the_terminal_all_count() -> None:
    async with driving() as (h, op):

        def typed() -> None:
            for number, key in enumerate((b"s", b"w", b"w", b"w")):
                asyncio.get_running_loop().call_later(number * KEY_S, op.type, key)

        for round_trip_s in (0.05, 0.2, 0.5):
            op.buffers_s = round_trip_s / 2.0
            await press(typed, lambda: h.asks(0.3, 0.0))
            await press(lambda: op.type(b"s"), lambda: h.asks(*ZERO))


SPACES = (b"\xc2\xa0", b"\xe3\x80\x80", b"\xe2\x80\xaf", b"\xa0", b"\x1b[160;4u")
CTRL_SPACES = (b"\0", b"\x1b[27;5;32~", b"\x1b[32;5u", b"\x1b[32;57;32;1;8;1_")


@pytest.mark.smoke
async def test_every_kind_of_space_and_ctrl_space_in_each_coding_is_the_emergency_stop() -> None:
    async with driving() as (h, op):
        for space in (*SPACES, *CTRL_SPACES):
            op.type(space)
            await until(h.got_estop)
            await until(lambda: h.asks(*ZERO))
            await drive_after_estop(h, op)


@pytest.mark.smoke
async def test_the_line_shows_what_the_supervisor_says_and_a_reset_its_answer() -> None:
    async with driving("--plain") as (h, op):
        await until(lambda: "SPACE" in op.output and "waiting for the supervisor" in op.output)
        await until(
            lambda: (
                h.tell(SafetyStatus.STOPPED, "COMMAND_TIMEOUT")
                or "STOPPED: COMMAND_TIMEOUT - press s to re-arm" in op.output
            )
        )
        await until(lambda: "supervisor: silent for" in op.output)
        op.type(b"r")
        await until(lambda: "reset refused: joy is not neutral" in op.output)


@pytest.mark.parametrize("key", [b"q", b"\x03"], ids=["q", "Ctrl-C"])
async def test_a_key_to_quit_leaves_zero_no_token_and_the_terminal_as_it_was(key: bytes) -> None:
    async with driving() as (h, op):
        assert op.modes() != op.modes_before
        op.type(key)
        assert await op.ended() == (0, "")
        await until(h.is_left)
        await until(lambda: op.is_restored and "ended; the last command was zero" in op.picture)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_a_signal_to_stop_does_the_same(number: signal.Signals) -> None:
    async with driving() as (h, op):
        op.process.send_signal(number)
        assert await op.ended() == (0, "")
        await until(lambda: h.is_left() and op.is_restored)


async def test_a_terminal_that_goes_away_ends_it_in_silence() -> None:
    async with driving() as (h, op):
        op.hang_up()
        assert await op.ended() == (0, "")
        await until(h.is_left)


async def test_keys_that_nobody_took_do_not_reach_the_shell() -> None:
    async with driving() as (_, op):
        op.type(b"qwww")
        assert (await op.ended())[0] == 0
        assert fcntl.ioctl(op.slave, termios.FIONREAD, bytes(4)) == bytes(4)


async def test_ctrl_s_freezes_nothing() -> None:
    async with driving("--plain") as (h, op):
        op.type(b"\x13ww")
        await until(lambda: h.asks(0.2, 0.0))
        await until(lambda: "v +0.20 m/s" in op.output)


async def test_a_terminal_that_takes_no_output_stops_the_robot_and_can_still_be_ended() -> None:
    async with driving() as (h, op):
        h.tell(SafetyStatus.READY)
        termios.tcflow(op.slave, termios.TCOOFF)
        await until(lambda: h.asks(*ZERO))
        op.process.send_signal(signal.SIGTERM)
        assert await op.ended() == (0, "")
        assert op.modes() == op.modes_before
        await until(lambda: not h.sees_teleop())


async def test_a_kill_withdraws_the_token() -> None:
    async with driving() as (h, op):
        op.process.kill()
        await until(lambda: not h.sees_teleop())


async def test_a_dumb_terminal_gets_no_control_sequences() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, term="dumb") as op:
        await until(h.sees_teleop)
        await until(lambda: h.tell(SafetyStatus.READY) or "READY" in op.output)
        op.type(b"q")
        await op.ended()
        assert "\x1b" not in op.output
        assert "one line instead of a screen" in op.output


@pytest.mark.smoke
async def test_it_waits_for_the_hub_and_drives_when_it_comes() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as op:
        await until(lambda: f"nothing heard from the supervisor at {endpoint}" in op.picture)
        answered = op.answered
        # It draws twice per second: the answer to a picture is no reason for the next one.
        assert await until(lambda: op.answered >= answered + 5) > 1.0
        op.type(b" www")
        await until(lambda: "emergency stop NOT sent" in op.picture)
        async with hub(endpoint) as h:
            await until(h.sees_teleop)
            await until(lambda: len(h.velocities) > 5)
            assert set(h.velocities) == {ZERO}
            op.type(b"q")
            assert await op.ended() == (0, "")


@pytest.mark.parametrize("key", [b"q", b"\x03"], ids=["q", "Ctrl-C"])
async def test_it_can_be_ended_while_it_waits_for_the_hub(key: bytes) -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as op:
        await until(lambda: "waiting for the supervisor" in op.picture)
        op.type(key)
        assert await op.ended() == (0, "")
        assert op.modes() == op.modes_before


OPENS_WITH_A_KEY = """
import pathlib, select
from teleop import __main__
open_bus = __main__.open_bus
async def opened(*arguments, **options):
    bus = await open_bus(*arguments, **options)
    pathlib.Path({opened!r}).touch()
    select.select([0], [], [])
    return bus
__main__.open_bus = opened
__main__.main()
"""


async def test_it_can_be_ended_at_the_moment_at_which_the_connection_opens(tmp_path: Path) -> None:
    endpoint, opened = free_endpoint(), tmp_path / "opened"
    command = ("-c", OPENS_WITH_A_KEY.format(opened=str(opened)))
    async with hub(endpoint) as h, operator(endpoint, command=command, answers=False) as op:
        await until(opened.exists)
        op.type(b"q")
        assert await op.ended() == (0, "")
        assert not h.velocities


async def test_a_hang_up_ends_it_while_it_waits_for_the_hub() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as op:
        await until(lambda: "waiting for the supervisor" in op.picture)
        op.hang_up()
        assert await op.ended() == (0, "")


async def run(*arguments: str, stdin: int, stdout: int = subprocess.PIPE) -> tuple[int | None, str]:
    """Run teleop with this input and output; return its exit code and standard error."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "teleop",
        *arguments,
        stdin=stdin,
        stdout=stdout,
        stderr=subprocess.PIPE,
        cwd=ROOT,
    )
    _, errors = await asyncio.wait_for(process.communicate(), LIMIT_S)
    return process.returncode, errors.decode()


async def test_without_a_terminal_it_says_so_in_one_line_and_publishes_nothing() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h:
        code, errors = await run("--endpoint", endpoint, stdin=subprocess.DEVNULL)
        assert code == 2
        assert errors.count("\n") == 1
        assert "terminal" in errors
        assert (h.velocities, h.sees_teleop()) == ([], False)


async def test_a_terminal_on_one_side_alone_is_none() -> None:
    master, slave = pty.openpty()
    try:
        assert (await run(stdin=slave))[0] == 2
        assert (await run(stdin=subprocess.DEVNULL, stdout=slave))[0] == 2
    finally:
        os.close(master)
        os.close(slave)


async def test_it_drives_where_the_locale_has_only_ascii(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("LC_ALL", "C"), ("PYTHONUTF8", "0"), ("PYTHONCOERCECLOCALE", "0")):
        monkeypatch.setenv(name, value)
    async with driving() as (h, op):
        op.type("\N{LATIN SMALL LETTER E WITH ACUTE}".encode())
        await until(lambda: h.asks(*ZERO))


async def test_a_wrong_configuration_is_refused_with_every_fault_named(tmp_path: Path) -> None:
    toml = tmp_path / "robot.toml"
    toml.write_text("[teleop]\nrate_hz = 0\nspeed = 3\n")
    code, errors = await run("--config", str(toml), "--source", "no/name", stdin=subprocess.DEVNULL)
    assert code == 2
    for fault in ("teleop.rate_hz = 0", "teleop.speed", "teleop.source = 'no/name'"):
        assert fault in errors
    assert "Traceback" not in errors


async def test_the_help_teaches_the_keys() -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "teleop", "--help", stdout=subprocess.PIPE, cwd=ROOT
    )
    output, _ = await asyncio.wait_for(process.communicate(), LIMIT_S)
    for words in (
        b"w       forward by one step",
        b"i up    forward",
        b"SPACE",
        b"? shows all keys",
        b"--mode",
        b"--source",
        b"--endpoint",
        b"--config",
        b"--view-only",
    ):
        assert words in output


async def test_the_question_mark_shows_all_keys_while_driving_goes_on_and_hides_them_again() -> None:
    async with driving() as (h, op):
        h.tell(SafetyStatus.DRIVING, owner="teleop")
        await until(lambda: "all keys" in op.picture)
        op.type(b"?")
        await until(lambda: "forward by one step" in op.picture and "Ctrl-Z" in op.picture)
        seen = len(h.velocities)
        await until(lambda: len(h.velocities) >= seen + 20)
        assert set(h.velocities[seen:]) == {(0.1, 0.0)}
        op.type(b"w3")
        await until(lambda: h.asks(0.2, 0.0))
        await until(lambda: "up to   0.60 m/s, 1.20 rad/s" in op.picture)
        await until(lambda: h.tell(SafetyStatus.STOPPED, "ESTOP") or "STOPPED: " in op.picture)
        assert "forward by one step" in op.picture
        op.type(b"h")
        await until(lambda: "forward by one step" not in op.picture)
        op.type(b"q")
        assert await op.ended() == (0, "")


async def test_the_line_is_preceded_by_all_keys_and_the_speed_level_on_request() -> None:
    async with driving("--plain") as (h, op):
        op.type(b"?")
        await until(lambda: op.output.count("show or hide all keys") == 2)
        await until(lambda: "speed level 5: up to 1.00 m/s, 2.00 rad/s" in op.output)
        assert h.asks(0.1, 0.0)
