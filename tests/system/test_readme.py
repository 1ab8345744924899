"""The recipe of the README, typed key by key in separate namespaces, so that no other robot is affected."""

import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.system.operators import ROOT, Operator, until
from tests.system.process_state import children_of
from wire.state_directory import ENVIRONMENT

NAMESPACES = ("unshare", "--net", "--pid", "--fork", "--mount-proc", "--kill-child")
START_LIMIT_S = 60.0
COMMAND_LIMIT_S = 30.0
PROMPT = "your command: "


def has_namespaces() -> bool:
    tools = all(shutil.which(tool) for tool in ("ip", "unshare", "nsenter", "pgrep"))
    return tools and subprocess.run([*NAMESPACES, "true"], capture_output=True, check=False).returncode == 0


pytestmark = pytest.mark.skipif(not has_namespaces(), reason="needs root, ip, unshare, nsenter and pgrep")


def recipe() -> list[str]:
    """The lines of README that kill a teleop and start another one."""
    blocks: list[str] = re.findall(
        r"^```\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL
    )
    (block,) = [block for block in blocks if "kill -9" in block]
    return block.splitlines()


class Shell(Operator):
    """The first process of its own namespaces, at the project's root."""

    async def run(self, line: str, *, until_says: str, limit_s: float = COMMAND_LIMIT_S) -> None:
        """Type a line and wait for its output."""
        begin = len(self.output)
        self.type(f"{line}\n".encode())
        await until(lambda: re.search(until_says, self.output[begin + len(line) :]), limit_s)

    async def prompt(self) -> None:
        """Wait until the shell takes the next line."""
        await until(lambda: self.output.endswith(PROMPT), COMMAND_LIMIT_S)

    def elsewhere(self, line: str) -> None:
        """Run a line in a second terminal of the same namespaces."""
        (bash,) = children_of(self.process.pid)
        subprocess.run(
            ["nsenter", f"--target={bash}", "--net", "--pid", "--mount", "bash", "-c", line], check=True
        )


@asynccontextmanager
async def shell(state_dir: Path) -> AsyncGenerator[Shell]:
    environment = shlex.join([f"PS1={PROMPT}", f"{ENVIRONMENT}={state_dir}"])
    bash = f"ip link set lo up; exec env {environment} bash --norc --noprofile -i 2>&1"
    made = Shell(*NAMESPACES, "sh", "-c", bash)
    try:
        await made.prompt()
        yield made
    finally:
        made.close()


def keys_of(line: str) -> Sequence[str]:
    """The keys that a comment such as `# drive: w w w` names."""
    return line.rpartition(":")[2].split()


async def test_the_recipe_does_what_its_comments_say() -> None:
    up, drive, _, kill, status, again, down = recipe()
    with tempfile.TemporaryDirectory() as directory:
        async with shell(Path(directory)) as one:
            await one.run(up, until_says="running at .*down", limit_s=START_LIMIT_S)
            await one.run(drive, until_says="READY")
            for key in keys_of(drive):
                one.type(key.encode())
            await until(lambda: "DRIVING" in one.picture and "+0.50" in one.picture)

            one.elsewhere(kill)
            await until(lambda: not one.modes_on & {"1049", "1004"})
            await one.run("stty -a", until_says=r"(?s)\sicanon\s.*\secho\s")
            await one.run(status, until_says="SOURCE_LOST")

            await one.run(again, until_says="READY")
            seen = len(one.output)
            await until(lambda: len(one.output) > seen + 2000)
            assert "DRIVING" not in one.output[seen:]
            one.type(b"w")
            await until(lambda: "DRIVING" in one.picture)
            one.type(b"q")
            await one.prompt()
            await one.run(down, until_says="everything is stopped")
