"""`lifeline path` with real processes: a square, its replay from a recording, and its pauses."""

import asyncio
import re
import signal
import subprocess
import time
from collections import Counter
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path

import pexpect
import pytest
from rosbags.highlevel import AnyReader

from tests.system.harness import PATIENCE_S, Robot, robot
from tests.system.test_record import ODOM, Recording, lifeline, say
from wire import topics
from wire.messages import Bool

pytestmark = pytest.mark.timeout(120)
KEY_PRESSES = 5
OFF_PATH = re.compile(r"distance from the path, by odometry: (\d+) mm rms, (\d+) mm at most")


@asynccontextmanager
async def path(subject: Robot, *arguments: str) -> AsyncGenerator[subprocess.Popen[str]]:
    """A path without a terminal."""
    process = subprocess.Popen(
        lifeline("path", *arguments, "--endpoint", subject.endpoint),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


async def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    output, errors = await asyncio.to_thread(process.communicate, timeout=60)
    assert "Traceback" not in errors
    return process.returncode, output, errors


async def drive_to_the_end(subject: Robot, *arguments: str) -> None:
    async with path(subject, *arguments) as process:
        code, output, errors = await ended(process)
    assert (code, errors) == (0, ""), output
    for line in output.splitlines()[1:]:
        say(f"{arguments[0]}: {line.removeprefix('lifeline: ')}")
    found = OFF_PATH.search(output)
    assert found is not None
    rms_mm, most_mm = map(int, found.groups())
    assert rms_mm < 15
    assert most_mm < 50


async def moving(subject: Robot) -> None:
    await subject.until(lambda: subject.speed_m_s > 0.2, "the robot on its path")


async def at_rest(subject: Robot) -> None:
    await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")


@pytest.mark.timed
async def test_a_square_is_driven_recorded_and_driven_again(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        recording = Recording(subject, tmp_path / "square.mcap")
        try:
            await recording.flushed()
            await drive_to_the_end(subject, "square", "--side", "0.3", "--speed", "0.6")
            recording.process.send_signal(signal.SIGINT)
            code, output, errors = await recording.ended()
            assert (code, errors) == (0, "")
            say(output.splitlines()[-1])
        finally:
            recording.close()
        await drive_to_the_end(subject, "follow", str(recording.file), "--speed", "0.8")
        subject.look()
        assert subject.x_m == pytest.approx(0.0, abs=0.05)
    with AnyReader([recording.file]) as bag:
        counts = Counter(connection.topic for connection, _, _ in bag.messages())
    everyone = {ODOM, "/robot/scan", "/robot/cmd_vel", "/robot/path/cmd_vel", "/robot/supervisor/status"}
    assert everyone <= counts.keys()
    assert f"{sum(counts.values()):,} messages" in output
    assert f"{counts[ODOM]:,}" in output


async def pausing(subject: Robot, terminal: "pexpect.spawn[bytes]", key: str, said: bytes) -> None:
    """Press a key until the path pauses: one that falls together with a beat, or on an old picture, is not heard."""
    for _ in range(KEY_PRESSES):
        subject.type(key)
        if await asyncio.to_thread(terminal.expect, [said, pexpect.TIMEOUT], timeout=0.5) == 0:
            return
    pytest.fail(f"none of {KEY_PRESSES} keys paused the path")


@pytest.mark.timed  # a path whose program gets no processor for 0.2 s pauses, as it should
async def test_the_operator_takes_over_and_enter_goes_on(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.until(lambda: subject.status.owner == topics.TELEOP, "teleop's heartbeat")
        command = lifeline("path", "circle", "--radius", "0.6", "--endpoint", subject.endpoint)
        terminal: pexpect.spawn[bytes] = pexpect.spawn(command[0], command[1:], dimensions=(24, 100))
        try:
            await moving(subject)
            await pausing(subject, terminal, "x", b"paused: .*Enter continues")
            subject.type("s")
            await at_rest(subject)
            await subject.ready()
            await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it went on by itself", 0.7)
            terminal.send("\r")
            await moving(subject)
            await pausing(subject, terminal, "s", b"paused: a key was pressed at teleop")
            terminal.sendintr()
            await asyncio.to_thread(terminal.expect, pexpect.EOF, timeout=PATIENCE_S)
            assert b"interrupted: " in (terminal.before or b"")
            terminal.close()
            assert terminal.exitstatus == 130
        finally:
            terminal.close(force=True)


@pytest.mark.timed
async def test_whatever_ends_a_path_without_a_terminal_stops_the_robot(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        async with path(subject, "circle", "--radius", "0.6") as first:
            await moving(subject)
            async with path(subject, "square") as second:
                code, _, errors = await ended(second)
                assert code == 2
                assert "a path is driven already, by " in errors
                assert f"pid {first.pid}" in errors
            sent_s = time.monotonic()
            first.send_signal(signal.SIGINT)
            to_zero_s = await subject.zero_after(sent_s)
            assert (await ended(first))[0] == 130
            await at_rest(subject)
        async with path(subject, "circle", "--radius", "0.6") as killed:
            await moving(subject)
            sent_s = time.monotonic()
            killed.send_signal(signal.SIGKILL)
            killed_to_zero_s = await subject.zero_after(sent_s)
            await at_rest(subject)
        async with path(subject, "circle", "--radius", "0.6") as last:
            await moving(subject)
            assert subject.bus is not None
            subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
            code, output, errors = await ended(last)
            assert (code, errors) == (1, "")
            assert "ended early, STOPPED: ESTOP" in output
            await at_rest(subject)
    say(
        f"zero on cmd_vel {to_zero_s * 1e3:.1f} ms after SIGINT, {killed_to_zero_s * 1e3:.1f} ms after SIGKILL"
    )
    assert max(to_zero_s, killed_to_zero_s) < 0.2
