"""deploy/Containerfile: what it copies and calls exists, it fetches nothing by address, and it does not run as root."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

from typer.testing import CliRunner

from lifeline.cli.app import app
from wire.host.command_line import service_parser

ROOT = Path(__file__).resolve().parents[3]


def instructions() -> Iterator[tuple[str, str]]:
    """Yield each instruction with its arguments."""
    text = (ROOT / "deploy" / "Containerfile").read_text().replace("\\\n", " ")
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, _, arguments = line.partition(" ")
            yield name, arguments.strip()


def all_of(name: str) -> list[str]:
    return [arguments for each, arguments in instructions() if each == name]


def test_it_copies_files_that_exist_and_every_package_of_the_wheel() -> None:
    copied = [arguments.split() for arguments in all_of("COPY")]
    from_here = [name for words in copied if not words[0].startswith("--") for name in words[:-1]]
    assert all((ROOT / name).exists() for name in from_here)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert set(wheel) <= set(from_here)


def test_it_fetches_only_from_package_indexes() -> None:
    assert not all_of("ADD")
    assert not [run for run in all_of("RUN") if "://" in run or "curl" in run or "wget" in run]


def test_it_runs_as_a_user_of_its_own_with_the_state_in_a_volume() -> None:
    names = [name for name, _ in instructions()]
    last_stage = names[len(names) - names[::-1].index("FROM") :]
    assert last_stage.index("USER") < last_stage.index("ENTRYPOINT")
    assert all_of("USER") == ["lifeline"]
    (variables,) = [value for value in all_of("ENV") if "LIFELINE_STATE_DIR" in value]
    assert f"LIFELINE_STATE_DIR={all_of('VOLUME')[0]} " in variables


def test_its_commands_have_these_options() -> None:
    (entry,), (options,), (check,) = all_of("ENTRYPOINT"), all_of("CMD"), all_of("HEALTHCHECK")
    assert json.loads(entry) == ["python", "-m", "supervisor"]
    arguments = service_parser("supervisor").parse_args(json.loads(options))
    assert arguments.endpoint is None  # the file's, else that of the loopback interface
    command = json.loads(check.partition("CMD ")[2])
    assert command[:2] == ["lifeline", "status"]
    helped = CliRunner().invoke(app, ["status", "--help"], env={"COLUMNS": "200"}).output
    assert all(f"{word} " in helped for word in command if word.startswith("--"))
