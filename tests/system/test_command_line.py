"""What every command that needs no running robot prints: on pipes, closed pipes, terminals and as JSON."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pexpect
import pytest

from faults.simulated.trial_run import run_trial
from supervisor.blackbox.recorder import BlackBox
from tests.system.commands import run_here
from tests.system.harness import free_endpoint
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, WriterAtOnce
from tests.unit.supervisor.law.law_harness import CONFIG
from wire.host.installation import checkout

pytestmark = pytest.mark.timeout(120)

LIFELINE = str(Path(sys.executable).with_name("lifeline"))
LIMIT_S = 60.0
COLOUR = re.compile(r"\x1b\[[0-9;]*\b(3[0-8]|4[0-8]|9[0-7]|10[0-7])[;m]")
"""A colour of the foreground or the background; bold and dim are none."""


class Files(NamedTuple):
    """Files that the commands read, and a directory for those that they write."""

    directory: Path
    trials: Path
    black_box: Path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    directory = tmp_path_factory.mktemp("files")
    trials = directory / "trials.jsonl"
    trials.write_text(run_trial(1, "of a test").line() + "\n")
    writer = WriterAtOnce(directory)
    drive = Drive(BlackBox(CONFIG, writer, window_s=60.0, utc=lambda: NOON_UTC_S))
    drive.drive(1.0)
    drive.stop()
    drive.box.close()
    return Files(directory, trials, writer.paths[0])


def arguments_of(name: str, files: Files) -> list[str]:
    """Return a command line that ends by itself, without a robot."""
    robot_toml = checkout()
    assert robot_toml is not None
    nobody = ["--endpoint", free_endpoint(), "--state-dir", str(files.directory / "state")]
    return name.split() + {
        "check": [str(robot_toml / "deploy" / "robot.toml")],
        "doctor": nobody,
        "down": nobody[2:],
        "fault-report": [str(files.trials), "--html", str(files.directory / "page.html")],
        "faults": ["--virtual", "--seeds", "1", "--jobs", "1"],
        "faults --virtual": ["--seed", "1"],
        "record": [str(files.directory / "none.mcap"), *nobody],
        "render": ["--out", str(files.directory / "a.png"), "--fresh", "--size", "64x48", "--seconds", "0.2"],
        "replay-decision": [str(files.black_box)],
        "status": nobody,
        "topic list": nobody,
        "watch --once": nobody[:2],
    }.get(name, [])


PRINTING = [
    "check",
    "doctor",
    "down",
    "fault-report",
    "faults",
    "faults --virtual",
    "render",
    "replay-decision",
    "status",
    "watch --once",
]
REFUSED = ["record", "topic list"]
"""These need a robot, and say so."""
OTHERS = ["--help", "topic --help", "nothing"]


def environment(**changes: str) -> dict[str, str]:
    """A colourful terminal, unless the changes say otherwise."""
    forcing = {"FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS", "NO_COLOR"}
    usual = {name: value for name, value in os.environ.items() if name not in forcing}
    return usual | {"TERM": "xterm-256color", "COLORTERM": "truecolor"} | changes


def on_a_terminal(arguments: list[str], **changes: str) -> str:
    terminal: pexpect.spawn[str] = pexpect.spawn(
        LIFELINE, arguments, env=environment(**changes), timeout=LIMIT_S, encoding="utf-8"
    )
    try:
        return terminal.read()
    finally:
        terminal.close(force=True)


@pytest.mark.parametrize("name", [*PRINTING, *REFUSED, *OTHERS])
def test_a_pipe_gets_no_escape_sequences(name: str, files: Files) -> None:
    _, output, errors = run_here(arguments_of(name, files), environment())
    assert "\x1b" not in output + errors
    assert "Traceback" not in errors
    assert output or errors


@pytest.mark.parametrize("name", [*PRINTING, *REFUSED, *OTHERS])
def test_no_color_and_dumb_terminals_are_respected(name: str, files: Files) -> None:
    arguments = arguments_of(name, files)
    assert COLOUR.search(on_a_terminal(arguments, NO_COLOR="1")) is None
    assert "\x1b" not in on_a_terminal(arguments, TERM="dumb")


def test_a_terminal_gets_colours(files: Files) -> None:
    assert COLOUR.search(on_a_terminal(arguments_of("check", files)))


@pytest.mark.parametrize("name", [*PRINTING, *REFUSED, *OTHERS])
def test_a_reader_that_has_ended_causes_no_traceback(name: str, files: Files) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [LIFELINE, *arguments_of(name, files)],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(PYTHONUNBUFFERED="1"),
            timeout=LIMIT_S,
            check=False,
        )
    finally:
        os.close(writing)
    assert "Traceback" not in done.stderr
    assert "Broken pipe" not in done.stderr


@pytest.mark.parametrize("name", PRINTING)
def test_the_result_as_json_is_all_that_standard_output_gets(name: str, files: Files) -> None:
    _, output, errors = run_here([*arguments_of(name, files), "--json"], environment())
    document = json.loads(output, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert document
    assert "\x1b" not in output + errors


@pytest.mark.smoke
def test_the_real_command_prints_plain_text_and_json_on_pipes(files: Files) -> None:
    for more in ([], ["--json"]):
        done = subprocess.run(
            [LIFELINE, *arguments_of("check", files), *more],
            capture_output=True,
            text=True,
            env=environment(),
            timeout=LIMIT_S,
            check=False,
        )
        assert done.stderr == ""
        assert "\x1b" not in done.stdout
        assert bool(more) == done.stdout.startswith("{")


def test_json_of_up_needs_detach() -> None:
    done = subprocess.run(
        [LIFELINE, "up", "--json"], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert (done.returncode, "--json needs --detach" in done.stderr) == (2, True)
