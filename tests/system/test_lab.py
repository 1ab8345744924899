"""The lab of docs/lab.md: every command in its blocks, in order, and every `lifeline` command in its table."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer

from lifeline.cli.app import app
from tests.system.namespaces import Shell, needs_namespaces, shell
from tests.system.operators import ROOT, until

PAGE = ROOT / "docs/lab.md"
START_LIMIT_S = 60.0
LIFELINE, TELEOP = ".venv/bin/lifeline", ".venv/bin/lifeline teleop"
FULL_SCREEN = {"1049", "1004"}
"""The terminal's modes while teleop has it."""

EXPECTED: tuple[tuple[str, int, tuple[str, ...]], ...] = (
    (f"{LIFELINE} up --detach", 0, ("running at .*down",)),
    (TELEOP, 0, ("READY",)),
    (
        f"{LIFELINE} node list",
        0,
        (r"^supervisor +{supervisor} ", r"^sim +{sim} ", r"^teleop +{teleop} "),
    ),
    (
        f"{LIFELINE} node info teleop",
        0,
        (r"^pid +{teleop}\b", r"^writes +robot/teleop/cmd_vel", r"^reads +robot/supervisor/status"),
    ),
    (
        f"{LIFELINE} topic list",
        0,
        (r"^robot/cmd_vel +Twist +supervisor +supervisor ", r"^robot/scan +LaserScan +sim +sim "),
    ),
    (
        f"{LIFELINE} topic info cmd_vel",
        0,
        (r"^writer +supervisor, pid {supervisor}\b", r"^reader +sim, pid {sim}\b"),
    ),
    (f"{LIFELINE} topic type cmd_vel", 0, (r"\Ageometry_msgs/msg/Twist\n\Z",)),
    (
        f"{LIFELINE} topic pub sim/obstacle '{{x: -1.5, y: 0}}' --once",
        0,
        ("published on robot/sim/obstacle",),
    ),
    (
        f"{LIFELINE} topic echo cmd_vel --once",
        0,
        (r"\Alinear: {x: 0.3, y: 0.0, z: 0.0}\nangular: {x: 0.0, ",),
    ),
    (f"{LIFELINE} topic echo teleop/cmd_vel --once --field linear.x", 0, (r"\A0.3\n",)),
    (f"{LIFELINE} topic echo cmd_vel --once --field linear.x", 0, (r"\A0.0\n",)),
    (f"{LIFELINE} status", 0, ("STOPPED", "OBSTACLE", r"\b0.3\d m from the hull, ahead")),
    (f"{LIFELINE} topic hz scan odom cmd_vel --seconds 4", 0, ()),
    (f"{LIFELINE} topic delay scan odom cmd_vel --seconds 2", 0, (r"robot/cmd_vel: \d\d?\.\d\d ms old",)),
    (f"{LIFELINE} graph --out graph.png", 0, (r"graph.png: 3 nodes",)),
    (f"{LIFELINE} topic pub sim/obstacle '{{z: -1}}' --once", 0, ("published on robot/sim/obstacle",)),
    ("kill -9 $(.venv/bin/lifeline pid teleop)", 0, ()),
    (f"{LIFELINE} status", 0, ("teleop +│ not alive", "STOPPED", "SOURCE_LOST")),
    (f"{LIFELINE} doctor", 1, ("SOURCE_LOST",)),
    (f"{LIFELINE} incidents list", 0, ("OBSTACLE", r"SOURCE_LOST.* teleop +0\.[45]\d m/s +0\.[01]\d m ")),
    (
        f"{LIFELINE} incidents show last",
        0,
        (r"^reason .*SOURCE_LOST", r"^stopping +0\.[01]\d+ m in 0\.\d+ s"),
    ),
    (TELEOP, 0, ("READY",)),
    (f"{LIFELINE} topic echo cmd_vel --once", 0, (r"\Alinear: {x: 0.0, ",)),
    (f"{LIFELINE} down", 0, ("everything is stopped",)),
)
"""Each command with its exit code, and with patterns of its output; {sim} in a pattern stands for the pid of sim."""
RATES_HZ = {"robot/scan": 20.0, "robot/odom": 50.0, "robot/cmd_vel": 50.0}


def lines() -> Iterator[str]:
    """The lines of all blocks of the page, except those that show output."""
    for kind, block in re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL):
        if not kind:
            yield from block.splitlines()


class Lab:
    """The two terminals of the lab.

    Args:
        one: the shell in terminal 1.
        state_dir: Lifeline's state directory.
    """

    def __init__(self, one: Shell, state_dir: Path) -> None:
        self._one, self._black_boxes = one, state_dir / "blackbox"
        self._terminal = ""
        self._keys: list[str] = []
        """The keys that were pressed last in this teleop."""
        self._pids: dict[str, str] = {}
        self._expected = iter(EXPECTED)

    async def do(self, line: str) -> None:
        """Run a command and check its result, or do what a comment says."""
        if not line.startswith("# "):
            command, code, patterns = next(self._expected)
            assert line == command
            await (self._run if self._terminal == "1" else self._run_in_second)(command, code, patterns)
            return
        verb, _, text = line.removeprefix("# ").partition(" ")
        if verb == "terminal":
            self._terminal = text
        elif verb == "press":
            self._keys = text.split()
            self._one.press(self._keys)
        else:
            assert verb == "wait"
            await self._wait(text.removeprefix("for ").split(", "))

    async def _wait(self, texts: list[str]) -> None:
        await self._one.until_shows(*texts, keys=self._keys)

    async def _run(self, command: str, code: int, patterns: tuple[str, ...]) -> None:
        assert code == 0
        self._keys = []
        await until(lambda: not self._one.modes_on & FULL_SCREEN)
        (pattern,) = patterns
        await self._one.run(command, until_says=pattern, limit_s=START_LIMIT_S)
        self._pids = {node: await pid(self._one, node) for node in ("supervisor", "sim", "teleop")}

    async def _run_in_second(self, command: str, code: int, patterns: tuple[str, ...]) -> None:
        if "incidents" in command:  # the black box is written some seconds after the stop
            await until(lambda: list(self._black_boxes.glob("*SOURCE_LOST*")))
        returned, output = await self._one.elsewhere(command)
        assert (returned, missing(patterns, self._pids, output)) == (code, []), output
        if " hz " in command:
            assert rates_hz(output) == pytest.approx(RATES_HZ, rel=0.05)

    def is_complete(self) -> bool:
        """Check that every expected command was run."""
        return next(self._expected, None) is None


@needs_namespaces
@pytest.mark.timed
@pytest.mark.timeout(240)
async def test_the_lab_does_what_its_page_says(tmp_path: Path) -> None:
    (tmp_path / ".venv").symlink_to(ROOT / ".venv")
    state_dir = tmp_path / "state"
    async with shell(state_dir, tmp_path) as one:
        lab = Lab(one, state_dir)
        for line in lines():
            await lab.do(line)
        assert lab.is_complete()
    assert (tmp_path / "graph.png").stat().st_size > 10_000


def rates_hz(output: str) -> dict[str, float]:
    """The rates by `topic hz`."""
    return {key: float(rate) for key, rate in re.findall(r"^(\S+): ([\d.]+) Hz", output, re.MULTILINE)}


async def pid(one: Shell, node: str) -> str:
    """The pid of a node's process, by the kernel; empty if there is none."""
    _, output = await one.elsewhere(f"pgrep -of '[p]ython -m {node}'")
    return output.strip()


def missing(patterns: tuple[str, ...], pids: dict[str, str], output: str) -> list[str]:
    """Return the patterns that are not in the output."""
    for node, number in pids.items():
        patterns = tuple(pattern.replace(f"{{{node}}}", number) for pattern in patterns)
    return [pattern for pattern in patterns if not re.search(pattern, output, re.MULTILINE)]


def in_the_table() -> list[str]:
    """The `lifeline` commands in the table of equivalents."""
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    return [command for row in rows for command in re.findall(r"`(lifeline [^`]+)`", row.split("|")[2])]


@pytest.mark.parametrize("command", in_the_table())
def test_each_command_in_the_table_is_accepted(command: str) -> None:
    words = shlex.split(command)[1:]
    found = typer.main.get_command(app)
    while isinstance(found, click.Group):
        found = found.commands[words.pop(0)]
    found.make_context(command, words)
