"""Ctrl-C ends each command within moments and without a traceback: while it starts, waits, and works."""

import asyncio
import os
import signal
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, free_endpoint, robot

pytestmark = [pytest.mark.timeout(240), pytest.mark.timed]

LIFELINE = str(Path(sys.executable).with_name("lifeline"))
BOUND_S = 1.0
"""Generous, for a busy machine; the measured time is printed."""
WORK_S = 1.0
TAKEDOWN_S = 20.0
"""These commands have started a robot, and stop its processes first."""
ENDS = {0, 1, 130, -signal.SIGINT}
"""Streams that Ctrl-C is meant to end exit with their result; others die of the signal, or exit with 130."""

ON_A_ROBOT = (
    ("topic", "echo", "scan", "odom", "cmd_vel", "imu"),
    ("topic", "hz", "scan"),
    ("topic", "bw", "scan"),
    ("topic", "delay", "scan"),
    ("topic", "list", "--seconds", "60"),
    ("topic", "info", "scan", "--seconds", "60"),
    ("topic", "pub", "path/cmd_vel", "{}"),
    ("topic", "pub", "estop", "{}", "--rate", "2"),
    ("node", "info", "sim", "--seconds", "60"),
    ("graph", "--seconds", "60"),
    ("doctor", "--seconds", "60"),
    ("watch",),
    ("metrics", "--listen", "127.0.0.1:0"),
    ("record", "a.mcap"),
    ("render", "--out", "b.mp4", "--seconds", "60"),
    ("path", "circle"),
)
# `status` waits for a second, the others for longer.
WITHOUT_A_ROBOT = (("topic", "list"), ("status",), ("watch",), ("record", "b.mcap"), ("path", "square"))
ALONE = (
    ("render", "--fresh", "--out", "a.mp4", "--size", "160x90", "--seconds", "60"),
    ("faults", "--virtual", "--seeds", "1000"),
)
WITH_A_ROBOT_OF_ITS_OWN = (("demo",), ("faults", "--classes", "teleop_sigkill"))


async def took_s(
    arguments: tuple[str, ...], directory: Path, until: Callable[[int], Awaitable[None]]
) -> float:
    """Send SIGINT to a command and its children, as a terminal does, and return how long it took to end."""
    process = await asyncio.create_subprocess_exec(
        LIFELINE,
        *arguments,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=directory,
        process_group=0,
    )
    said = asyncio.ensure_future(process.communicate())
    await until(process.pid)
    assert process.returncode is None, (arguments, await said)
    began_s = time.monotonic()
    # The workers of a campaign belong to its process group.
    os.killpg(process.pid, signal.SIGINT)
    _, errors = await asyncio.wait_for(said, PATIENCE_S)
    ended_s = time.monotonic() - began_s
    print(f"\n    measured: Ctrl-C ends lifeline {' '.join(arguments[:4])} in {1000 * ended_s:.0f} ms")
    assert b"Traceback" not in errors, errors.decode()
    assert process.returncode in ENDS, (arguments, errors)
    return ended_s


async def subscribed(pid: int) -> None:
    """Wait until a process listens or talks on a socket, and give it time to begin its work."""
    end_s = time.monotonic() + PATIENCE_S
    while not _has_socket(pid):
        assert time.monotonic() < end_s, "the command opened no connection"
        await asyncio.sleep(0.02)
    await asyncio.sleep(WORK_S)


def _has_socket(pid: int) -> bool:
    with suppress(OSError):  # one was closed meanwhile
        return any(str(one.readlink()).startswith("socket:") for one in Path(f"/proc/{pid}/fd").iterdir())
    return False


def after(duration_s: float) -> Callable[[int], Awaitable[None]]:
    """Return a wait; the commands are interrupted at arbitrary moments."""
    return lambda _: asyncio.sleep(duration_s)


async def test_at_work_on_a_robot(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: bool(subject.travel), "odometry")
        for arguments in ON_A_ROBOT:
            named = (*arguments, "--endpoint", subject.endpoint)
            assert await took_s(named, tmp_path, subscribed) < BOUND_S


@pytest.mark.parametrize("duration_s", [0.3, 0.6, 0.9])
async def test_while_it_starts_or_waits_for_a_robot(tmp_path: Path, duration_s: float) -> None:
    for arguments in WITHOUT_A_ROBOT:
        named = (*arguments, "--endpoint", free_endpoint())
        assert await took_s(named, tmp_path, after(duration_s)) < BOUND_S


@pytest.mark.parametrize("duration_s", [0.5, 2.0, 4.0])
async def test_at_work_alone(tmp_path: Path, duration_s: float) -> None:
    for arguments in ALONE:
        assert await took_s(arguments, tmp_path, after(duration_s)) < BOUND_S


@pytest.mark.parametrize("arguments", WITH_A_ROBOT_OF_ITS_OWN)
async def test_with_a_robot_of_its_own_that_it_takes_down(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    assert await took_s(arguments, tmp_path, after(6.0)) < TAKEDOWN_S
