"""The recipe of the README, typed key by key in separate namespaces, so that no other robot is affected."""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.system.namespaces import needs_namespaces, shell
from tests.system.operators import ROOT, until

START_LIMIT_S = 60.0

pytestmark = needs_namespaces


def recipe() -> list[str]:
    """The lines of README that kill a teleop and start another one."""
    blocks: list[str] = re.findall(
        r"^```\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL
    )
    (block,) = [block for block in blocks if "kill -9" in block]
    return block.splitlines()


def keys_of(line: str) -> Sequence[str]:
    """The keys that a comment such as `# drive: w w w` names."""
    return line.rpartition(":")[2].split()


async def test_the_recipe_does_what_its_comments_say() -> None:
    up, drive, _, kill, status, again, down = recipe()
    with tempfile.TemporaryDirectory() as directory:
        async with shell(Path(directory)) as one:
            await one.run(up, until_says="running at .*down", limit_s=START_LIMIT_S)
            await one.run(drive, until_says="READY")
            one.press(keys_of(drive))
            await one.until_shows("DRIVING", "+0.50", keys=keys_of(drive))

            assert (await one.elsewhere(kill))[0] == 0
            await until(lambda: not one.modes_on & {"1049", "1004"})
            await one.run("stty -a", until_says=r"(?s)\sicanon\s.*\secho\s")
            await one.run(status, until_says="SOURCE_LOST")

            await one.run(again, until_says="READY")
            seen = len(one.output)
            await until(lambda: len(one.output) > seen + 2000)
            assert "DRIVING" not in one.output[seen:]
            one.press("w")
            await one.until_shows("DRIVING", keys="w")
            one.type(b"q")
            await one.prompt()
            await one.run(down, until_says="everything is stopped")
