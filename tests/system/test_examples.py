"""The examples, run as their how-to pages say."""

import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, robot
from tests.system.operators import ROOT
from wire import topics

PAGE = ROOT / "docs/how-to/command-source.md"

pytestmark = pytest.mark.timeout(120)


async def test_a_command_source_drives_forward_and_back_and_is_lost_when_it_is_killed(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    (fragment,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    config.write_text(textwrap.dedent(fragment))
    async with robot(tmp_path, teleop=False, config=config) as subject:
        command = [sys.executable, "examples/command_source.py", subject.endpoint]
        with subprocess.Popen(command, cwd=ROOT) as source:
            try:
                await subject.until(lambda: subject.speed_m_s > 0.09, "ahead")
                assert subject.status.owner == "patrol"
                await subject.until(lambda: subject.speed_m_s < -0.09, "back")
                source.kill()
                await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "the lost source")
            finally:
                source.kill()


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
