"""`python -m teleop` on a real pseudo-terminal, against a hub on a real link: what it says, and what it leaves behind."""

import asyncio
import fcntl
import os
import pty
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from wire import topics
from wire.messages import SafetyStatus, TriggerResponse, Twist, header
from wire.zenoh_bus import BusConfig, ZenohBus, open_bus

LIMIT_S = 8.0
ROOT = Path(__file__).parents[2]
ZERO = (0.0, 0.0)
ALL_MODES = tuple[Any, ...]


async def until(condition: Callable[[], object], limit_s: float = LIMIT_S) -> float:
    """Wait for `condition`, and no longer than it takes; returns how long it took."""
    start_s = time.monotonic()
    while not condition():
        if time.monotonic() - start_s > limit_s:
            pytest.fail(f"not within {limit_s} s")
        await asyncio.sleep(0.005)
    return time.monotonic() - start_s


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class Hub:
    """What the supervisor's side of the wire sees of teleop."""

    def __init__(self, bus: ZenohBus) -> None:
        self._commands = bus.subscribe(topics.source_cmd_vel("teleop"), depth=1000)
        self._estops = bus.subscribe(topics.ESTOP, depth=1000)
        self._changes = bus.watch_alive()
        self._status = bus.publisher(topics.STATUS)
        self._alive: set[str] = set()
        self._twists: list[Twist] = []
        bus.serve(topics.SUPERVISOR_RESET, self._refuse)

    async def _refuse(self, _: str) -> TriggerResponse:
        return TriggerResponse(success=False, message="joy is not neutral")

    @property
    def velocities(self) -> list[tuple[float, float]]:
        self._twists += [a.message for a in self._commands.take() if a.message is not None]
        return [(twist.linear.x, twist.angular.z) for twist in self._twists]

    def asks(self, linear_m_s: float, angular_rad_s: float) -> bool:
        return self.velocities[-1:] == [(linear_m_s, angular_rad_s)]

    def sees_teleop(self) -> bool:
        for change in self._changes.take():
            (self._alive.add if change.alive else self._alive.discard)(change.node)
        return "teleop" in self._alive

    def got_estop(self) -> bool:
        return any(a.message is not None and a.message.data for a in self._estops.take())

    def tell(self, mode: int, *reasons: str) -> None:
        self._status.put(SafetyStatus(header("base_link"), mode=mode, reasons=list(reasons)))


@asynccontextmanager
async def hub(endpoint: str) -> AsyncGenerator[Hub]:
    bus = await open_bus(BusConfig(endpoint), "hub")
    try:
        yield Hub(bus)
    finally:
        await bus.close()


class Operator:
    """A teleop in a terminal of its own, as its controlling one, and the hands and eyes in front of it."""

    def __init__(self, *command: str, term: str = "xterm-256color") -> None:
        self._master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.modes_before = self.modes()
        self.process = subprocess.Popen(
            ["setsid", "--ctty", sys.executable, *command],
            stdin=self.slave,
            stdout=self.slave,
            stderr=subprocess.PIPE,
            env=os.environ | {"TERM": term},
            cwd=ROOT,
        )
        self.output = ""
        self._hung_up = False
        os.set_blocking(self._master, False)
        asyncio.get_running_loop().add_reader(self._master, self._read)

    def _read(self) -> None:
        self.output += os.read(self._master, 4096).decode()

    def modes(self) -> ALL_MODES:
        return tuple(termios.tcgetattr(self.slave))

    def type(self, keys: bytes) -> None:
        os.write(self._master, keys)

    def hang_up(self) -> None:
        """The terminal goes away, as a closed window or a lost connection."""
        if not self._hung_up:
            self._hung_up = True
            asyncio.get_running_loop().remove_reader(self._master)
            os.close(self._master)

    async def ended(self, limit_s: float = LIMIT_S) -> tuple[int, str]:
        """The exit code, and everything that was said on standard error."""
        await until(lambda: self.process.poll() is not None, limit_s)
        _, errors = self.process.communicate()
        return self.process.returncode, errors.decode()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()
        self.hang_up()
        os.close(self.slave)


@asynccontextmanager
async def operator(endpoint: str, *command: str, term: str = "xterm-256color") -> AsyncGenerator[Operator]:
    made = Operator(*(command or ("-m", "teleop")), "--endpoint", endpoint, term=term)
    try:
        yield made
    finally:
        made.close()


@asynccontextmanager
async def driving() -> AsyncGenerator[tuple[Hub, Operator]]:
    """A teleop that is connected and asks for 0.1 m/s."""
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint) as op:
        await until(lambda: h.sees_teleop() and h.asks(*ZERO))
        op.type(b"w")
        await until(lambda: h.asks(0.1, 0.0))
        yield h, op


async def test_keys_arrive_as_twists_and_the_heartbeat_repeats_them() -> None:
    async with driving() as (h, op):
        op.type(b"wa")
        await until(lambda: h.asks(0.2, 0.2))
        seen = len(h.velocities)
        took_s = await until(lambda: len(h.velocities) >= seen + 20)
        assert 0.8 < took_s < 2.0
        assert set(h.velocities[seen:]) == {(0.2, 0.2)}
        op.type(b"s")
        await until(lambda: h.asks(*ZERO))


async def test_cursor_keys_do_not_drive_and_a_stray_escape_does_not_hide_the_emergency_stop() -> None:
    async with driving() as (h, op):
        op.type(b"\x1b[A\x1b[D\x1bOA\x1b[1;5D\xc3\xa4")
        op.type(b"\x1b ")
        await until(h.got_estop)
        assert h.velocities[-1] == ZERO
        assert set(h.velocities) == {ZERO, (0.1, 0.0)}


async def test_the_line_shows_what_the_supervisor_says_and_a_reset_its_answer() -> None:
    async with driving() as (h, op):
        assert "SPACE" in op.output
        assert "waiting for the supervisor" in op.output
        h.tell(SafetyStatus.STOPPED, "COMMAND_TIMEOUT")
        await until(lambda: "STOPPED: COMMAND_TIMEOUT - press s to re-arm" in op.output)
        await until(lambda: "supervisor: silent for" in op.output)
        op.type(b"r")
        await until(lambda: "reset refused: joy is not neutral" in op.output)


@pytest.mark.parametrize("key", [b"q", b"\x03"], ids=["q", "Ctrl-C"])
async def test_a_key_to_quit_leaves_zero_no_token_and_the_terminal_as_it_was(key: bytes) -> None:
    async with driving() as (h, op):
        assert op.modes() != op.modes_before
        op.type(key)
        assert await op.ended() == (0, "")
        await until(lambda: not h.sees_teleop() and h.asks(*ZERO))
        assert op.modes() == op.modes_before
        assert "ended; the last command was zero\r\n" in op.output
        assert op.output.endswith("\r\x1b[K")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_a_signal_to_stop_does_the_same(number: signal.Signals) -> None:
    async with driving() as (h, op):
        op.process.send_signal(number)
        assert await op.ended() == (0, "")
        await until(lambda: not h.sees_teleop() and h.asks(*ZERO))
        assert op.modes() == op.modes_before


async def test_a_terminal_that_goes_away_ends_it_in_silence() -> None:
    async with driving() as (h, op):
        op.hang_up()
        assert await op.ended() == (0, "")
        await until(lambda: not h.sees_teleop() and h.asks(*ZERO))


async def test_keys_that_nobody_took_do_not_reach_the_shell() -> None:
    async with driving() as (_, op):
        op.type(b"qwww")
        assert (await op.ended())[0] == 0
        assert fcntl.ioctl(op.slave, termios.FIONREAD, bytes(4)) == bytes(4)


async def test_ctrl_z_and_ctrl_s_hang_nothing() -> None:
    async with driving() as (h, op):
        op.type(b"\x1a\x13")
        op.type(b"w")
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
        await until(lambda: not h.sees_teleop(), 1.0)


async def test_an_error_of_its_own_ends_it_with_code_1_and_restores_the_terminal() -> None:
    broken = """
import sys
from teleop import __main__, service
def show(self, now_s):
    if not self._setpoint.is_neutral:
        raise RuntimeError("broken on purpose")
service.Teleop._show = show
__main__.main()
"""
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "-c", broken) as op:
        await until(lambda: h.sees_teleop() and h.asks(*ZERO))
        op.type(b"w")
        code, errors = await op.ended()
        assert code == 1
        assert "RuntimeError: broken on purpose" in errors
        await until(lambda: not h.sees_teleop() and h.asks(*ZERO))
        assert op.modes() == op.modes_before


async def test_a_dumb_terminal_gets_no_control_sequences() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, term="dumb") as op:
        await until(h.sees_teleop)
        h.tell(SafetyStatus.READY)
        await until(lambda: "READY" in op.output)
        op.type(b"q")
        await op.ended()
        assert "\x1b" not in op.output


async def test_it_waits_for_the_hub_and_drives_when_it_comes() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as op:
        await until(lambda: f"waiting for the supervisor at {endpoint}" in op.output)
        op.type(b" www")
        await until(lambda: "emergency stop NOT sent" in op.output)
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
        await until(lambda: "waiting for the supervisor" in op.output)
        op.type(key)
        assert await op.ended(2.0) == (0, "")
        assert op.modes() == op.modes_before


async def test_a_hang_up_ends_it_while_it_waits_for_the_hub() -> None:
    endpoint = free_endpoint()
    async with operator(endpoint) as op:
        await until(lambda: "waiting for the supervisor" in op.output)
        op.hang_up()
        assert await op.ended(2.0) == (0, "")


async def run(*arguments: str, stdin: int, stdout: int = subprocess.PIPE) -> tuple[int | None, str]:
    """Run teleop with this input and output: its exit code and standard error."""
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
    for words in (b"w / x", b"a / d", b"SPACE", b"re", b"--source", b"--endpoint", b"--config"):
        assert words in output
