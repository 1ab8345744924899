"""The units of deploy/systemd: what their commands name exists."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lifeline.cli.app import app
from wire.host.command_line import service_parser

UNITS = sorted((Path(__file__).resolve().parents[3] / "deploy" / "systemd").glob("*.service"))


def start(unit: Path) -> list[str]:
    """Return the words of ExecStart."""
    (line,) = re.findall(r"^ExecStart=(.*)$", unit.read_text(), re.MULTILINE)
    return shlex.split(line)


def test_there_is_a_unit_for_each_part_of_a_robot() -> None:
    assert [unit.name for unit in UNITS] == [
        "lifeline-guard@.service",
        "lifeline-ros2.service",
        "lifeline-supervisor.service",
    ]


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_every_option_of_a_unit_exists(unit: Path) -> None:
    program, *words = start(unit)
    options = [word for word in words if word.startswith("--") and word != "--"]
    assert options
    if program == "/opt/lifeline/bin/lifeline":
        helped = CliRunner().invoke(app, [*words[:2], "--help"], env={"COLUMNS": "200"})
        assert helped.exit_code == 0
        assert all(f"{option} " in helped.output for option in options)
    else:
        assert [program, *words[:2]] == ["/opt/lifeline/bin/python", "-m", "supervisor"]
        service_parser("supervisor").parse_args(words[2:])


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_unit_keeps_the_record_of_the_estop_in_the_directory_that_systemd_makes(unit: Path) -> None:
    text = unit.read_text()
    assert "\nStateDirectory=lifeline\n" in text
    assert "LIFELINE_STATE_DIR=/var/lib/lifeline" in text
    assert "\nUser=lifeline\n" in text
