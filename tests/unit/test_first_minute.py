"""`make run` in a fresh clone, with a uv that installs nothing and reports how it was called."""

import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from lifeline.cli import app as cli

ROOT = Path(__file__).parents[2]
LOCK: list[dict[str, Any]] = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
UV = """#!/bin/sh
echo "$@" >> uv.log
[ "$1" = sync ] || exit 0
[ ! -e offline ] || exit 2
mkdir -p .venv/bin
printf '#!/bin/sh\\n' > .venv/bin/python
printf '#!/bin/sh\\necho "lifeline $@"\\n' > .venv/bin/lifeline
chmod +x .venv/bin/*
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    for name in ("Makefile", "pyproject.toml", "uv.lock"):
        shutil.copy(ROOT / name, tmp_path)
    uv = tmp_path / "bin" / "uv"
    uv.parent.mkdir()
    uv.write_text(UV)
    uv.chmod(0o755)
    return tmp_path


def make(clone: Path, target: str) -> subprocess.CompletedProcess[str]:
    path = f"{clone / 'bin'}{os.pathsep}{os.environ['PATH']}"
    # This test may itself run under make, whose variables would change the output.
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(
        ["make", target],
        cwd=clone,
        env=environment | {"PATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )


def calls(clone: Path) -> list[str]:
    log = clone / "uv.log"
    return [line for line in log.read_text().splitlines() if line.startswith("sync")] if log.exists() else []


def test_make_run_installs_what_driving_needs_with_one_line_for_each_step_and_removes_nothing(
    clone: Path,
) -> None:
    done = make(clone, "run")
    assert done.stdout.splitlines() == [
        "lifeline: installing what driving needs; this fetches at most 90 MB, once",
        "lifeline: compiling",
        "lifeline demo",
    ]
    (call,) = calls(clone)
    assert {"--locked", "--no-dev", "--inexact"} <= set(call.split())
    assert re.findall(r"--extra (\w+)", call) == ["sim", "gamepad", "station"]


def test_make_run_installs_once_and_uses_the_whole_environment_if_it_exists(clone: Path) -> None:
    make(clone, "setup")
    make(clone, "run")
    make(clone, "run")
    assert ["--all-extras" in call for call in calls(clone)] == [True]


def test_the_tests_still_get_the_whole_environment_after_make_run(clone: Path) -> None:
    make(clone, "run")
    make(clone, "setup")
    assert ["--all-extras" in call for call in calls(clone)] == [False, True]


def test_without_a_network_make_run_says_what_is_missing_and_installs_at_the_next_try(clone: Path) -> None:
    (clone / "offline").touch()
    done = make(clone, "run")
    assert "access to PyPI" in done.stderr
    assert done.returncode != 0
    (clone / "offline").unlink()
    assert make(clone, "run").returncode == 0


@pytest.mark.parametrize(
    ("what", "extras", "groups"),
    [
        ("what driving needs", ["sim", "gamepad", "station"], []),
        ("everything, also for the tests", None, ["dev"]),
    ],
)
def test_make_fetches_at_most_as_much_as_it_announces(
    what: str, extras: list[str] | None, groups: list[str]
) -> None:
    (lifeline,) = (package for package in LOCK if package["name"] == "lifeline")
    chosen = lifeline["optional-dependencies"] if extras is None else extras
    needs = [need for group in groups for need in lifeline["dev-dependencies"][group]]
    fetched_mb = megabytes(
        [("lifeline", ""), *(("lifeline", extra) for extra in chosen), *with_extras(needs)]
    )
    (announced,) = re.findall(rf"{what}; this fetches at most (\d+) MB", (ROOT / "Makefile").read_text())
    assert 0.8 * int(announced) < fetched_mb < int(announced)


def with_extras(needs: Iterable[dict[str, Any]]) -> list[tuple[str, str]]:
    return [(need["name"], extra) for need in needs for extra in ("", *need.get("extra", ()))]


def megabytes(wanted: Iterable[tuple[str, str]]) -> float:
    """The size of the largest Linux wheel of each package that some packages need, each with an extra or none ("")."""
    found, todo = set[tuple[str, str]](), list(wanted)
    while todo:
        one = name, extra = todo.pop()
        if one in found:
            continue
        found.add(one)
        for package in LOCK:
            if package["name"] == name:
                key = (
                    package.get("optional-dependencies", {}).get(extra, [])
                    if extra
                    else package.get("dependencies", [])
                )
                todo += with_extras(key)
    names = {name for name, _ in found}
    largest = dict.fromkeys(names, 0)
    for package in LOCK:
        for wheel in package.get("wheels", ()):
            if package["name"] in names and re.search(r"linux|-any\.whl", wheel["url"]):
                largest[package["name"]] = max(largest[package["name"]], wheel["size"])
    return sum(largest.values()) / 1e6


@pytest.mark.parametrize(("variables", "expected"), [({"LIFELINE_UNDER_MAKE": "1"}, 0), ({}, 2)])
def test_below_a_refusal_of_make_run_there_is_no_error_of_make(
    variables: dict[str, str], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[int] = []

    def refuse(prog_name: str) -> NoReturn:
        raise SystemExit(2)

    monkeypatch.setattr(cli, "app", refuse)
    monkeypatch.setattr("os._exit", ended.append)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    cli.main()
    assert ended == [expected]
