"""The real supervisor writes a black box of each stop, and no tick waits for it."""

import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, Robot, patiently, robot
from wire import topics

pytestmark = pytest.mark.timeout(120)


def say(text: str) -> None:
    print(f"\n    measured: {text}")


def files(tmp_path: Path, end: str = "") -> list[Path]:
    """In their order."""
    return sorted((tmp_path / "blackbox").glob(f"*{end}.jsonl.gz"))


def replay(path: Path) -> str:
    """Return the output of `lifeline replay-decision` in a separate process."""
    command = [sys.executable, "-m", "lifeline.cli.app", "replay-decision", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


async def drive_and_kill_teleop(subject: Robot) -> float:
    await subject.drive()
    return subject.kill(topics.TELEOP)


@pytest.mark.timed
async def test_a_killed_teleop_leaves_a_file_whose_decisions_another_process_finds_the_same(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject:
        killed_s = await drive_and_kill_teleop(subject)
        # On a busy machine it may have stopped before, for another reason.
        await subject.until(lambda: bool(files(tmp_path, "Z-SOURCE_LOST")), "a black box")
        path = files(tmp_path, "Z-SOURCE_LOST")[-1]
        said = replay(path)
        assert "all decisions are the same" in said
        assert "SOURCE_LOST" in said
        zeros = [at_s for at_s, _ in subject.outputs if at_s > killed_s]
    say(
        f"{path.stat().st_size / 1e3:.0f} kB; the longest pause of cmd_vel while it was written: "
        f"{max(b - a for a, b in pairwise(zeros)) * 1e3:.0f} ms"
    )
    assert max(b - a for a, b in pairwise(zeros)) < 0.1


@pytest.mark.smoke
async def test_a_supervisor_that_is_asked_to_end_writes_the_stop_before(tmp_path: Path) -> None:
    # At its end it writes for one second at most, which may be too short on a busy machine.
    config = tmp_path / "robot.toml"
    config.write_text("[supervisor]\nblack_box_s = 4.0\nmounts_confirmed = true\n")
    async with robot(tmp_path, config=config) as subject:

        async def attempt() -> Path:
            if topics.SUPERVISOR not in subject.processes:
                subject.start(topics.SUPERVISOR, "--config", str(config))
            if subject.terminal is None:
                subject.start_teleop()
            await drive_and_kill_teleop(subject)
            # On a busy machine it may have stopped before, for another reason.
            await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "the reason")
            written = files(tmp_path)
            subject.signal(topics.SUPERVISOR, signal.SIGTERM)
            assert subject.processes.pop(topics.SUPERVISOR).wait(PATIENCE_S) == 0
            assert files(tmp_path) != written
            return files(tmp_path)[-1]

        path = await patiently(attempt)
    said = replay(path)
    assert "all decisions are the same" in said
    assert "SOURCE_LOST" in said
    assert sorted(path.parent.iterdir()) == files(tmp_path)
