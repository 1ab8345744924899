"""The examples, run as their how-to pages say."""

import asyncio
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, patiently, robot
from tests.system.operators import ROOT
from wire import topics

PAGE = ROOT / "docs/how-to/command-source.md"

pytestmark = pytest.mark.timeout(120)


@pytest.mark.smoke
async def test_a_command_source_drives_forward_and_back_and_is_lost_when_it_is_killed(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    (fragment,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    config.write_text(textwrap.dedent(fragment))
    async with robot(tmp_path, teleop=False, config=config) as subject:

        async def attempt() -> None:
            """The source sends zero only in its first second, so any later stop ends the attempt."""
            await subject.until(
                lambda: "SCAN_STALE" not in subject.status.reasons and bool(subject.travel), "scans"
            )
            command = [sys.executable, "examples/command_source.py", subject.endpoint]
            with subprocess.Popen(command, cwd=ROOT) as source:
                try:
                    await subject.until_it_drives(0.1)
                    assert subject.status.owner == "patrol"
                    await subject.until(lambda: subject.speed_m_s < -0.09, "back", PATIENCE_S / 2)
                finally:
                    source.kill()

        await patiently(attempt)
        await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "the lost source")


async def test_a_command_source_that_receives_sigint_exits_with_0_and_without_an_error(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False) as subject:
        command = [sys.executable, "examples/command_source.py", subject.endpoint]
        with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as source:
            try:
                await subject.until(lambda: "patrol" in subject.status.unknown_sources, "an unknown source")
                source.send_signal(signal.SIGINT)
                _, errors = source.communicate(timeout=PATIENCE_S)
                assert (source.returncode, errors) == (0, "")
            finally:
                source.kill()


async def test_the_profile_finder_reports_what_each_profile_explains(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: subject.status.scan_age_s < 1.0, "scans")
        assert subject.bus is not None
        assert (await subject.bus.call(topics.SIM_FAULTS, "blocked -0.5 0.5", timeout_s=5.0)).success
        answer = await _printed("examples/lidar_profile.py", subject.endpoint)
        lines = dict(line.split(maxsplit=1) for line in answer.splitlines())
        assert lines["neato_xv"] == "explains 100.00%"
        assert lines["rep117"].endswith("but not NaN")
        assert "no scan came on scan_rear" in await _printed(
            "examples/lidar_profile.py", subject.endpoint, "scan_rear", returns=1
        )


async def test_the_teller_of_stops_says_each_in_words(tmp_path: Path) -> None:
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False) as subject:
        command = [sys.executable, "examples/why_stopped.py", subject.endpoint]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as teller:
            try:
                assert teller.stdout is not None
                line = await asyncio.to_thread(teller.stdout.readline)
                assert "SCAN_STALE: there is no fresh scan (cleared by: a fresh scan; then neutral)" in line
                teller.send_signal(signal.SIGINT)
                await asyncio.to_thread(teller.communicate, timeout=PATIENCE_S)
                assert teller.returncode == 0
            finally:
                teller.kill()


async def _printed(*command: str, returns: int = 0) -> str:
    """What an example prints, on both streams."""
    example = await asyncio.create_subprocess_exec(
        sys.executable, *command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    output, _ = await asyncio.wait_for(example.communicate(), PATIENCE_S)
    assert example.returncode == returns, output.decode()
    return output.decode()
