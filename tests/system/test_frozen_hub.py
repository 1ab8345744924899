"""A hub whose routing is deadlocked: the kernel ends it, and its restart needs no person.

Zenoh answers a query of its admin space for each declaration while it holds the read lock of its tables. A declaration that
arrives meanwhile stops its routing (pull request 2619 of eclipse-zenoh/zenoh).
"""

import asyncio
import signal
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, Robot, robot
from tests.system.ports import participants
from tests.system.rogue import open_rogue
from wire import topics
from wire.host.notify import TURN_LIMIT_S

MARGIN_S = 0.5
ASKED = "@/*/peer/subscriber/**"


@contextmanager
def freezing(endpoint: str) -> Generator[None]:
    """Let two programs declare and ask without end, until one of them gets no answer."""
    over = threading.Event()
    there = participants(endpoint)

    def declare() -> None:
        writer = open_rogue(there)
        while not over.is_set():
            writer.declare_subscriber("robot/2/scan", lambda _: None).undeclare()  # pyright: ignore[reportUnknownMemberType]

    def ask() -> None:
        reader = open_rogue(there)
        while not over.is_set():
            list(reader.get(ASKED, timeout=0.2))

    threads = [threading.Thread(target=work, daemon=True) for work in (declare, ask)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        over.set()


async def ended(subject: Robot) -> float:
    """Return when the supervisor has ended, by the monotonic clock."""
    process = subject.processes[topics.SUPERVISOR]
    await asyncio.wait_for(asyncio.to_thread(process.wait), PATIENCE_S)
    return time.monotonic()


@pytest.mark.timed
async def test_a_deadlocked_hub_is_ended_within_its_limit_the_base_stands_and_neutral_makes_it_drivable(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        with freezing(subject.endpoint):
            ended_s = await ended(subject)
        heard_s = subject.outputs[-1][0]
        print(f"\n    measured: last cmd_vel to the end of the process: {ended_s - heard_s:.3f} s")
        assert subject.processes[topics.SUPERVISOR].returncode == -signal.SIGALRM
        assert ended_s - heard_s < TURN_LIMIT_S + MARGIN_S
        assert "base: COMMAND_TIMEOUT" in (tmp_path / "sim.log").read_text().rpartition("follows cmd_vel")[2]

        subject.travel.clear()
        subject.start(topics.SUPERVISOR)
        await subject.until(lambda: bool(subject.travel), "odometry over the new hub")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 1.0)
        await subject.drive()
