"""Draws three screenshots of docs/lab.md: `python -m docs.generate.draw_lab [--out DIR]`.

A robot with a state directory of its own runs, its keys are pressed, and the commands are typed into a shell.
"""

import argparse
import asyncio
import copy
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pyte

from deploy.stack.launch import free_loopback_endpoint
from docs.generate.screen import Screen, running, teleop
from docs.generate.terminal_picture import draw
from wire.host.installation import ENVIRONMENT

ROOT = Path(__file__).parents[2]
REPORT = Path("lab-report")
"""The student's folder."""
LIFELINE = ".venv/bin/lifeline"
TELEOP_SIZE, SHELL_SIZE = (112, 31), (84, 40)
"""Columns and rows."""
PROMPT = "$ "
PILLAR = "{x: -1.5, y: 0}"
"""In the world: 3 m ahead of the robot's start."""


class Shell(Screen):
    """A terminal in which a shell runs."""

    async def run(self, *lines: str) -> None:
        """Type different lines into the shell, each when the one before has ended.

        Raises:
            TimeoutError: one does not end.
        """
        await self.until(self._is_at_prompt)
        for line in lines:
            self.type(f"{line}\n")
            await self.until(lambda row=f"{PROMPT}{line}": self._is_at_prompt() and row in self.rows)

    def _is_at_prompt(self) -> bool:
        return self.rows[self.screen.cursor.y] == PROMPT.rstrip()


async def take_screens(endpoint: str, graph: Path) -> dict[str, pyte.Screen]:
    """Do the lab's steps, and return the screens by the names of their pictures.

    None is drawn on the way: teleop stops the robot when its terminal is not read for half a second.

    Args:
        endpoint: of the running robot.
        graph: the file for the graph, which `lifeline graph` draws.

    Raises:
        CalledProcessError: the graph was not drawn.
        TimeoutError: a step did not end as expected.
    """
    screens: dict[str, pyte.Screen] = {}
    operator = Screen(*TELEOP_SIZE)
    with teleop(operator, "--endpoint", endpoint):
        await operator.until_shows("READY")
        with shell() as echo:
            await echo.run(f"{LIFELINE} topic pub sim/obstacle '{PILLAR}' --once")
            operator.type("www")
            await operator.until_shows("DRIVING", "permitted +0.30")
            await echo.run(f"{LIFELINE} topic echo cmd_vel --once")
            operator.type("\r")
            await operator.until_shows("nearest 0.6")
            operator.type("\r")
            await operator.until_shows("DRIVING", "measured +0.30")
            screens["lab-teleop.png"] = copy.deepcopy(operator.screen)
            await operator.until_shows("OBSTACLE", "permitted 0.00")
            await echo.run(
                f"{LIFELINE} topic echo teleop/cmd_vel --once --field linear.x",
                f"{LIFELINE} topic echo cmd_vel --once --field linear.x",
            )
            screens["lab-echo.png"] = echo.screen
        await asyncio.to_thread(subprocess.run, [LIFELINE, "graph", "--out", str(graph)], check=True)
    return screens


@contextmanager
def shell() -> Generator[Shell]:
    """A shell at the project's root."""
    made = Shell(*SHELL_SIZE)
    bash = shutil.which("bash")
    assert bash is not None
    with running(made, bash, "--norc", "--noprofile", "-i", PS1=PROMPT):
        yield made


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m docs.generate.draw_lab", description="Draw screenshots of docs/lab.md."
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=REPORT,
        metavar="DIR",
        help=f"write the pictures to this directory (default: {REPORT})",
    )
    out: Path = parser.parse_args().out.resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"cannot create the directory {out}: {error.strerror}; choose another one with --out")
    endpoint = free_loopback_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        os.environ[ENVIRONMENT] = folder
        os.chdir(ROOT)
        lifeline = (sys.executable, "-m", "lifeline.cli.app")
        try:
            subprocess.run([*lifeline, "up", "--detach", "--no-viewer", "--endpoint", endpoint], check=True)
            screens = asyncio.run(take_screens(endpoint, out / "lab-graph.png"))
        except TimeoutError as error:
            sys.exit(
                f"{error}\nA step of the lab did not end as expected: close other programs and try again."
            )
        finally:
            subprocess.run([*lifeline, "down"], check=True)
    for name, screen in screens.items():
        draw(screen, out / name)


if __name__ == "__main__":
    main()
