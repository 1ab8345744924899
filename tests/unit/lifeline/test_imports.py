"""`lifeline --help` is fast, and `import supervisor` always finds our package."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.packages import PACKAGES
from wire.host.installation import checkout


def _python(code: str, cwd: Path) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=cwd
    ).stdout.strip()


def test_the_commands_help_loads_neither_zenoh_nor_pydantic_nor_numpy(tmp_path: Path) -> None:
    code = "import sys, lifeline.cli.app; print({'zenoh', 'pydantic', 'numpy', 'asyncio'} & set(sys.modules))"
    assert _python(code, tmp_path) == "set()"


def test_only_the_command_keys_loads_cryptography(tmp_path: Path) -> None:
    modules = "supervisor.__main__, teleop.__main__, sim.program, ros2.program, lifeline.cli.app, lifeline.watch.watch, deploy.up"
    assert _python(f"import sys, {modules}; print('cryptography' in sys.modules)", tmp_path) == "False"


CONFIGURATION = {
    "annotated_types",
    "numpy",
    "pydantic",
    "pydantic_core",
    "typing_extensions",
    "typing_inspection",
}
BUS = CONFIGURATION | {"rosbags", "zenoh"}
COMMAND = {"annotated_doc", "shellingham", "typer"}
IMPORTED = {
    "supervisor.__main__": BUS,
    "teleop.__main__": BUS,
    "lifeline.cli.app": COMMAND,
    "lifeline.cli.app, lifeline.status": COMMAND | BUS | {"rich"},
    "lifeline.cli.app, lifeline.inspection.keys": COMMAND | CONFIGURATION,
    "lifeline.cli.app, lifeline.check.check": COMMAND | CONFIGURATION | {"rich"},
}
"""The packages of others that a program or command imports: they are most of the time of its start."""


@pytest.mark.parametrize("modules", IMPORTED)
def test_a_program_imports_only_the_packages_that_it_needs(modules: str, tmp_path: Path) -> None:
    code = (
        f"import sys, {modules}; print(*{{name.partition('.')[0] for name, module in sys.modules.items()"
        " if 'site-packages' in (getattr(module, '__file__', None) or '')})"
    )
    measuring = {"coverage"}  # where `make coverage` measures this process, too
    assert {*_python(code, tmp_path).split()} - measuring == IMPORTED[modules]


def test_our_names_are_ours_from_any_directory(tmp_path: Path) -> None:
    found = _python(
        f"import {', '.join(PACKAGES)}; print({', '.join(f'{name}.__file__' for name in PACKAGES)}, sep='\\n')",
        tmp_path,
    )
    root = checkout()
    assert root is not None
    assert found.splitlines() == [str(root / name / "__init__.py") for name in PACKAGES]


def test_the_command_reports_its_version(tmp_path: Path) -> None:
    code = "import sys; sys.argv = ['lifeline', '--version']; from lifeline.cli.app import app; app()"
    assert _python(code, tmp_path) == f"lifeline {version('lifeline')}"
