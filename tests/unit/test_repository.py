"""Rules for the repository itself."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.packages import PACKAGES

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("package", PACKAGES)
def test_each_package_is_this_repository_s_from_any_directory(package: str, tmp_path: Path) -> None:
    """PyPI has a `supervisor` (supervisord's) and a `teleop`: neither may shadow ours."""
    found = subprocess.run(
        [sys.executable, "-c", f"import {package}; print({package}.__file__)"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
    ).stdout.strip()
    assert Path(found) == ROOT / package / "__init__.py"


def test_the_lock_fails_when_a_namesake_comes_in() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert set(project["tool"]["uv"]["constraint-dependencies"]) == {"supervisor<0", "teleop<0"}
    lock = tomllib.loads((ROOT / "uv.lock").read_text())
    assert {"supervisor", "teleop"}.isdisjoint(package["name"] for package in lock["package"])


def test_the_page_of_the_wire_names_every_key() -> None:
    from wire import topics  # noqa: PLC0415 - the test above must import it first in a process of its own

    page = (ROOT / "docs/wire.md").read_text()
    for entry in (*topics.TOPICS, *topics.SERVICES):
        assert f"`robot/{entry.key}`" in page


def listed_files(docstring: str) -> set[str]:
    """Return the files and folders of a list in a docstring: names that begin a line, with a gap or a colon after them."""
    return set(re.findall(r"^\s*(?:\* )?`?(\w+(?:\.py|/))`?(?:  |:)", docstring, re.MULTILINE))


@pytest.mark.parametrize("package", [*PACKAGES, "bench"])
def test_a_list_of_files_in_a_package_names_each_of_them(package: str) -> None:
    for init in (ROOT / package).rglob("__init__.py"):
        listed = listed_files(ast.get_docstring(ast.parse(init.read_text())) or "")
        there = {path.name for path in init.parent.glob("*.py")} - {"__init__.py"}
        there |= {f"{path.parent.name}/" for path in init.parent.glob("*/__init__.py")}
        assert not listed or listed == there, init


def test_a_file_that_begins_a_line_is_listed() -> None:
    assert listed_files(
        "One idea. See a.py.\n`b.py` decides.\n\n  start.py   begins\n* rig/: robots\n`end.py`  ends"
    ) == {
        "start.py",
        "rig/",
        "end.py",
    }
