"""The commands in a message run where the reader stands."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from wire.host import installation as module
from wire.host.installation import runnable

ROOT = Path(__file__).parents[4]
PROGRAM = Path(sys.executable).with_name("lifeline")


@pytest.fixture
def without_lifeline_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/usr/bin:/bin")


def test_on_the_path_the_command_is_named_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "lifeline").symlink_to(PROGRAM)  # as `uv tool install` does
    monkeypatch.setenv("PATH", str(tmp_path))
    assert runnable("start with `lifeline up`") == "start with `lifeline up`"


@pytest.mark.usefixtures("without_lifeline_on_path")
def test_in_the_checkout_the_command_has_its_path_in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    sentence = "see `lifeline status`, stop it with `lifeline down`, or run `make setup`"
    expected = "see `.venv/bin/lifeline status`, stop it with `.venv/bin/lifeline down`, or run `make setup`"
    assert runnable(sentence) == expected


@pytest.mark.usefixtures("without_lifeline_on_path")
@pytest.mark.parametrize("command", ["lifeline --version", "make --version"])
def test_from_any_directory_the_command_runs_in_a_shell(
    command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    directory = tmp_path / "a b"
    directory.mkdir()
    monkeypatch.chdir(directory)
    told = runnable(f"`{command}`").strip("`")
    subprocess.run(["sh", "-c", told], check=True, capture_output=True, timeout=30)


def test_another_lifeline_on_the_path_is_not_taken_for_this_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "lifeline").write_text("#!/bin/sh\n")
    (tmp_path / "lifeline").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{PROGRAM.parent}")
    monkeypatch.chdir(tmp_path)
    assert runnable("`lifeline up`") == f"`{PROGRAM} up`"


def test_in_a_directory_that_was_removed_the_command_has_its_whole_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(module, "_here", lambda: None)
    assert runnable("`lifeline up`") == f"`{PROGRAM} up`"
