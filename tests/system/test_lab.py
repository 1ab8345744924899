"""The lab of docs/lab.md: every command in its blocks and every step of its test sequence, in order.

The `lifeline` commands in its tables, and those in the table of equivalents in docs/how-to/inspect.md, must be accepted.
"""

import asyncio
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click
import pytest
import typer

from lifeline.cli.app import app
from tests.system.namespaces import Shell, needs_namespaces, shell
from tests.system.operators import ROOT, until

pytestmark = pytest.mark.smoke

PAGE = ROOT / "docs/lab.md"
EQUIVALENTS = ROOT / "docs/how-to/inspect.md"
START_LIMIT_S = 60.0
DRAWING_LIMIT_S = 120.0
LIFELINE, TELEOP = ".venv/bin/lifeline", ".venv/bin/lifeline teleop"
RECORD = f"{LIFELINE} record lab-report/drive.mcap"
SEQUENCE = "w w w a a s x x d d d SPACE r q"
"""The course's test sequence, and `r`, without which the emergency stop stays latched."""
MOTION_KEYS = {"w", "x", "a", "d"}
FULL_SCREEN = {"1049", "1004"}
"""The terminal's modes while teleop has it."""

EXPECTED: tuple[tuple[str, int, tuple[str, ...]], ...] = (
    (f"{LIFELINE} up --detach", 0, ("running at .*down",)),
    (TELEOP, 0, ("READY",)),
    ("mkdir -p lab-report", 0, ()),
    (RECORD, 0, (r"/robot/teleop/cmd_vel +\d+", r"drive.mcap: .* messages, .* 0 lost")),
    (f"{LIFELINE} down", 0, ("everything is stopped",)),
    (f"{LIFELINE} up --detach", 0, ("running at .*down",)),
    (f"{LIFELINE} path follow lab-report/drive.mcap", 0, ("the path is complete",)),
    (f"{LIFELINE} path square --side 0.5", 0, (r"2.00 of 2.00 m(.|\n)*mm rms",)),
    (f"{LIFELINE} down", 0, ("everything is stopped",)),
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
    (f"{LIFELINE} topic hz scan odom cmd_vel --seconds 4", 0, ()),
    (f"{LIFELINE} topic delay scan odom cmd_vel --seconds 2", 0, (r"robot/cmd_vel: \d\d?\.\d\d ms old",)),
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
    (f"{LIFELINE} topic echo odom --once --field pose.pose.position", 0, (r"\bx: 2\.\d+",)),
    (f"{LIFELINE} status", 0, ("STOPPED", "OBSTACLE", r"\b0.3\d m from the hull, ahead")),
    (f"{LIFELINE} graph --out lab-report/graph.png", 0, (r"graph.png: 3 nodes",)),
    (f"{LIFELINE} topic pub sim/obstacle '{{z: -1}}' --once", 0, ("published on robot/sim/obstacle",)),
    ("kill -9 $(.venv/bin/lifeline pid teleop)", 0, ()),
    (f"{LIFELINE} status", 0, ("teleop +not alive", "STOPPED", "SOURCE_LOST")),
    (f"{LIFELINE} doctor", 1, ("SOURCE_LOST",)),
    (f"{LIFELINE} incidents list", 0, ("OBSTACLE", r"SOURCE_LOST.* teleop +0\.[45]\d m/s +0\.[01]\d m ")),
    (
        f"{LIFELINE} incidents show last",
        0,
        (r"^reason .*SOURCE_LOST", r"^stopping +0\.[01]\d+ m in 0\.\d+ s"),
    ),
    (TELEOP, 0, ("READY",)),
    (f"{LIFELINE} topic echo cmd_vel --once", 0, (r"\Alinear: {x: 0.0, ",)),
    ("mkdir -p lab04_teleop", 0, ()),
    ("sed 's/patrol/teleop/' examples/command_source.py > lab04_teleop/teleop_key.py", 0, ()),
    (".venv/bin/python lab04_teleop/teleop_key.py", 0, ("",)),
    (f"{LIFELINE} status", 0, ()),
    (f"{LIFELINE} down", 0, ("everything is stopped",)),
    ("tar -czf lab04_teleop.tar.gz lab04_teleop/", 0, ()),
    (
        f"{LIFELINE} render lab-report/drive.mcap --seconds 20 --fps 4 --size 480x270 --out lab-report/drive.mp4",
        0,
        (
            "wrote lab-report/drive.mp4: ",
            "frames of 480x270",
            ": lab-report/drive.mcap, by its true pose, at x",
        ),
    ),
    (
        f"{LIFELINE} render --drive --seconds 3 --out lab-report/lab-robot.png",
        0,
        ("wrote lab-report/lab-robot.png: a picture of 1280x720",),
    ),
    (".venv/bin/python -m docs.generate.draw_lab --out lab-report", 0, ("everything is stopped",)),
)
"""Each command with its exit code, and with patterns of its output; {sim} in a pattern stands for the pid of sim."""
FILES = {
    "lab-report/drive.mcap",
    "lab-report/graph.png",
    "lab-report/drive.mp4",
    "lab-report/lab-robot.png",
    "lab-report/lab-teleop.png",
    "lab-report/lab-echo.png",
    "lab-report/lab-graph.png",
    "lab04_teleop/teleop_key.py",
    "lab04_teleop.tar.gz",
}
"""What the student has in the end."""
RATES_HZ = {"robot/scan": 20.0, "robot/odom": 50.0, "robot/cmd_vel": 50.0}


def lines() -> Iterator[str]:
    """The lines of all blocks of the page, except those that show output."""
    for kind, block in re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL):
        if not kind:
            yield from block.splitlines()


class Step(NamedTuple):
    """A row of the test sequence."""

    keys: list[str]
    requested: list[str]
    """The velocities after each key."""
    shown: list[str]
    """Texts on the screen afterwards."""


def steps() -> list[Step]:
    """The rows of the test sequence, without the last, which quits."""
    rows = [line for line in PAGE.read_text().splitlines() if re.match(r"\| \d+ \| `", line)]
    cells = [[re.findall("`([^`]+)`", cell) for cell in row.split("|")[2:5]] for row in rows]
    assert " ".join(keys[0] for keys, _, _ in cells) == SEQUENCE
    cells.pop()
    return [Step(keys[0].split(), requested, shown) for keys, requested, shown in cells]


class Lab:
    """The two terminals of the lab.

    Args:
        one: the shell in terminal 1.
        state_dir: Lifeline's state directory.
        directory: the student's directory, which stands for the checkout.
    """

    def __init__(self, one: Shell, state_dir: Path, directory: Path) -> None:
        self._one, self._black_boxes = one, state_dir / "blackbox"
        self._recording_file = directory / "lab-report/drive.mcap"
        self._terminal = ""
        self._keys: list[str] = []
        """The keys that were pressed in this teleop since its last stop."""
        self._last_in_second = ""
        self._recording: asyncio.Task[None] | None = None
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
        elif line == "# do the steps of the table":
            await self._do_the_steps()
        elif line == "# press Ctrl-C":
            await self._interrupt()
        elif line == "# press Enter":
            self._one.press("\r")
        elif verb == "repeat":
            await self._repeat_until(text.removeprefix("until "))
        elif verb == "press":
            self._keys = text.split()
            self._one.press(self._keys)
        else:
            assert verb == "wait"
            await self._wait(text.removeprefix("for ").split(", "))

    async def _wait(self, texts: list[str]) -> None:
        await self._one.until_shows(*texts, keys=self._keys)

    async def _do_the_steps(self) -> None:
        for step in steps():
            if not MOTION_KEYS.issuperset(step.keys):
                self._keys = []
            for key, velocity in zip(step.keys, step.requested, strict=True):
                self._one.press([key.replace("SPACE", " ")])
                if key in MOTION_KEYS:
                    self._keys.append(key)
                await self._wait([f"requested {velocity}"])
            await self._wait(step.shown)
        self._one.press("q")
        await until(lambda: not self._one.modes_on & FULL_SCREEN)
        await self._one.run("echo code $?", until_says="code 0")

    async def _interrupt(self) -> None:
        """Press Ctrl-C in the present terminal."""
        if self._terminal == "1":
            self._one.press("\x03")
            await self._one.prompt()
            return
        assert self._recording is not None
        await self._one.elsewhere("kill -INT $(pgrep -nf '[l]ifeline record')")
        await self._recording

    async def _repeat_until(self, text: str) -> None:
        """Repeat the last command in the second terminal."""
        async with asyncio.timeout(START_LIMIT_S):
            while text not in (await self._one.elsewhere(self._last_in_second))[1]:
                pass

    async def _run(self, command: str, code: int, patterns: tuple[str, ...]) -> None:
        assert code == 0
        self._keys = []
        await until(lambda: not self._one.modes_on & FULL_SCREEN)
        (pattern,) = patterns
        await self._one.run(command, until_says=pattern, limit_s=START_LIMIT_S)
        self._pids = {node: await pid(self._one, node) for node in ("supervisor", "sim", "teleop")}

    async def _run_in_second(self, command: str, code: int, patterns: tuple[str, ...]) -> None:
        if command == RECORD:
            self._recording = asyncio.create_task(self._run_until_it_ends(command, code, patterns))
            await until(self._recording_file.exists, START_LIMIT_S)
            return
        if "incidents" in command:  # the black box is written some seconds after the stop
            await until(lambda: list(self._black_boxes.glob("*SOURCE_LOST*")))
        self._last_in_second = command
        await self._run_until_it_ends(command, code, patterns)

    async def _run_until_it_ends(self, command: str, code: int, patterns: tuple[str, ...]) -> None:
        returned, output = await self._one.elsewhere(command, DRAWING_LIMIT_S)
        assert (returned, missing(patterns, self._pids, output)) == (code, []), output
        if " hz " in command:
            assert rates_hz(output) == pytest.approx(RATES_HZ, rel=0.05)

    def is_complete(self) -> bool:
        """Check that every expected command was run."""
        return next(self._expected, None) is None


@needs_namespaces
@pytest.mark.timed
@pytest.mark.timeout(420)
async def test_the_lab_does_what_its_page_says(tmp_path: Path) -> None:
    for name in (".venv", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    state_dir = tmp_path / "state"
    async with shell(state_dir, tmp_path) as one:
        lab = Lab(one, state_dir, tmp_path)
        for line in lines():
            await lab.do(line)
        assert lab.is_complete()
    assert {name for name in FILES if (tmp_path / name).is_file()} == FILES
    assert (tmp_path / "lab-report/graph.png").stat().st_size > 10_000


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


def outside_blocks() -> list[str]:
    """The `lifeline` commands in the tables and the text of the pages."""
    pages = "".join(
        re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
        for page in (PAGE, EQUIVALENTS)
    )
    return sorted(set(re.findall(r"`(lifeline [^`]+)`", pages)))


@pytest.mark.parametrize("command", outside_blocks())
def test_each_command_outside_the_blocks_is_accepted(command: str) -> None:
    words = shlex.split(command)[1:]
    found = typer.main.get_command(app)
    while isinstance(found, click.Group):
        found = found.commands[words.pop(0)]
    found.make_context(command, words)
