"""`lifeline record` beside a real robot: its losses when it is killed and when its disk is full."""

import asyncio
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from recordings.recording import RecordingReader
from tests.system.harness import PATIENCE_S, Robot, free_endpoint, robot

pytestmark = pytest.mark.timeout(120)
ODOM = "/robot/odom"
FLUSHED_BYTES = 1000


def say(text: str) -> None:
    print(f"\n    measured: {text}")


def lifeline(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "lifeline.cli.app", *arguments]


def size_of(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


class Recording:
    """A recorder in a separate process."""

    def __init__(self, subject: Robot, file: Path) -> None:
        self.subject, self.file = subject, file
        self.process = subprocess.Popen(
            lifeline("record", str(file), "--endpoint", subject.endpoint),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    async def flushed(self, times: int = 1) -> None:
        """Wait until the file has grown this many times, once per second."""
        for _ in range(times):
            wanted = size_of(self.file) + FLUSHED_BYTES
            await self.subject.until(lambda size=wanted: size_of(self.file) > size, "a flush")

    async def ended(self) -> tuple[int, str, str]:
        output, errors = await asyncio.to_thread(self.process.communicate, timeout=PATIENCE_S)
        return self.process.returncode, output, errors

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


def odometry_times_ns(file: Path) -> list[int]:
    """Read a truncated recording."""
    reader = RecordingReader(file)
    times_ns = [m.log_time_ns for m in reader.messages() if m.topic == ODOM]
    assert reader.cut
    return times_ns


@pytest.mark.timed
async def test_a_recorder_that_is_killed_or_has_no_room_loses_about_a_second_and_the_rest_can_be_read(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: bool(subject.travel), "odometry")
        killed, full = (Recording(subject, tmp_path / f"{name}.mcap") for name in ("killed", "full"))
        try:
            await full.flushed()
            limit = size_of(full.file) + 20_000
            resource.prlimit(full.process.pid, resource.RLIMIT_FSIZE, (limit, limit))
            await killed.flushed(3)  # two whole seconds between the first and the last
            seen = len(subject.travel)
            await subject.until(lambda: len(subject.travel) > seen + 40, "most of the next second")
            killed_ns = time.time_ns()
            killed.process.send_signal(signal.SIGKILL)
            await killed.ended()
            code, output, errors = await full.ended()
        finally:
            killed.close()
            full.close()
    times_ns = odometry_times_ns(killed.file)
    lost_s = (killed_ns - times_ns[-1]) * 1e-9
    kept_s = (times_ns[-1] - times_ns[0]) * 1e-9
    say(f"SIGKILL: the last {lost_s:.2f} s lost, {len(times_ns)} samples of odometry in {kept_s:.2f} s kept")
    assert -0.1 < lost_s < 2.0
    assert kept_s > 1.0
    assert len(times_ns) > 0.8 * 50 * kept_s

    assert code == 1
    assert errors.count("\n") == 1
    assert "cannot write the file any further (File too large)" in errors
    assert ODOM in output
    assert len(odometry_times_ns(full.file)) > 25


@pytest.mark.smoke
def test_without_a_robot_it_says_so_and_makes_no_file(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    command = lifeline("record", str(file), "--endpoint", free_endpoint())
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 3
    assert "no supervisor answers at tcp/127.0.0.1:" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not file.exists()
