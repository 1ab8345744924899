"""An interactive shell in namespaces of its own: its robot has the default port, and affects no other robot."""

import asyncio
import os
import re
import shlex
import shutil
import subprocess
import time
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.system.operators import DELETE_LINE, ROOT, Operator, until
from tests.system.process_state import children_of
from wire.host.installation import ENVIRONMENT

NAMESPACES = ("unshare", "--net", "--pid", "--fork", "--mount-proc", "--kill-child")
COMMAND_LIMIT_S = 30.0
PROMPT = "your command: "
DRIVE_TRIES = 4
LATE_S = 3.0
"""A robot that rests this long after the keys has been stopped."""
BARS = str.maketrans(dict.fromkeys("─━╾╼┼", " "))
"""The drawing between the numbers of a row of teleop's screen."""


def _exist() -> bool:
    tools = all(shutil.which(tool) for tool in ("ip", "unshare", "nsenter", "pgrep"))
    return tools and subprocess.run([*NAMESPACES, "true"], capture_output=True, check=False).returncode == 0


needs_namespaces = pytest.mark.skipif(not _exist(), reason="needs root, ip, unshare, nsenter and pgrep")


class Shell(Operator):
    """An interactive bash as the first process of its own namespaces.

    Args:
        state_dir: Lifeline's state directory.
        directory: the directory in which it starts.
    """

    def __init__(self, state_dir: Path, directory: Path) -> None:
        self._state_dir, self._directory = state_dir, directory
        environment = shlex.join([f"--chdir={directory}", f"PS1={PROMPT}", f"{ENVIRONMENT}={state_dir}"])
        bash = f"ip link set lo up; exec env {environment} bash --norc --noprofile -i 2>&1"
        super().__init__(*NAMESPACES, "sh", "-c", bash)

    async def run(self, line: str, *, until_says: str, limit_s: float = COMMAND_LIMIT_S) -> None:
        """Type a line and wait for its output."""
        begin = len(self.output)
        self.type(DELETE_LINE + f"{line}\n".encode())
        await until(lambda: re.search(until_says, self.output[begin + len(line) :]), limit_s)

    async def prompt(self) -> None:
        """Wait until the shell takes the next line."""
        await until(lambda: self.output.endswith(PROMPT), COMMAND_LIMIT_S)

    def press(self, keys: Sequence[str]) -> None:
        for key in keys:
            self.type(key.encode())

    async def until_shows(self, *texts: str, keys: Sequence[str]) -> None:
        """Wait until teleop's screen shows some texts; if a busy machine has stopped the robot, press the keys again."""
        for _ in range(DRIVE_TRIES):
            late_s = time.monotonic() + LATE_S
            await until(
                lambda late_s=late_s: (
                    self._shows(*texts) or (keys and time.monotonic() > late_s and self._is_at_rest())
                )
            )
            if self._shows(*texts):
                return
            self.press(["s", *keys])
        pytest.fail(f"the screen does not show {texts}")

    def _shows(self, *texts: str) -> bool:
        picture = " ".join(self.picture.translate(BARS).split())
        return all(text in picture for text in texts)

    def _is_at_rest(self) -> bool:
        return self._shows("STOPPED") or self._shows("READY")

    async def elsewhere(self, line: str, limit_s: float = COMMAND_LIMIT_S) -> tuple[int, str]:
        """Run a line in a second terminal of the same namespaces; return its exit code and output."""
        (bash,) = children_of(self.process.pid)
        there = f"cd {shlex.quote(str(self._directory))} && {line}"  # nsenter begins at the root
        process = await asyncio.create_subprocess_exec(
            *("nsenter", f"--target={bash}", "--net", "--pid", "--mount", "bash", "-c", there),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            env=os.environ | {ENVIRONMENT: str(self._state_dir)},
        )
        output, _ = await asyncio.wait_for(process.communicate(), limit_s)
        assert process.returncode is not None
        return process.returncode, output.decode()


@asynccontextmanager
async def shell(state_dir: Path, directory: Path = ROOT) -> AsyncGenerator[Shell]:
    made = Shell(state_dir, directory)
    try:
        await made.prompt()
        yield made
    finally:
        made.close()
