"""A hub whose routing is deadlocked: the kernel ends it, and its restart needs no person."""

import signal
import time
from pathlib import Path

import pytest

from tests.system.harness import robot
from tests.system.rogue import freezing
from wire import topics
from wire.host.notify import TURN_LIMIT_S

MARGIN_S = 0.5


@pytest.mark.timed
async def test_a_deadlocked_hub_is_ended_within_its_limit_the_base_stands_and_neutral_makes_it_drivable(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        process = subject.processes[topics.SUPERVISOR]
        with freezing(subject.endpoint):
            await subject.until(lambda: process.poll() is not None, "the end of the supervisor")
            ended_s = time.monotonic()
        heard_s = subject.outputs[-1][0]
        print(f"\n    measured: last cmd_vel to the end of the process: {ended_s - heard_s:.3f} s")
        assert process.returncode == -signal.SIGALRM
        assert ended_s - heard_s < TURN_LIMIT_S + MARGIN_S
        assert "base: COMMAND_TIMEOUT" in (tmp_path / "sim.log").read_text().rpartition("follows cmd_vel")[2]

        subject.start(topics.SUPERVISOR)
        await subject.until(lambda: subject.travel[-1][0] > ended_s, "odometry over the new hub")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 1.0)
        await subject.drive()
