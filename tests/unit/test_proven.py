"""The hash of the law's sources."""

from pathlib import Path

import pytest

from tests.proven import ROOT, digest, sources

SMALL = {
    "supervisor/law/safety.py": "from wire import lease\n",
    "tests/unit/supervisor/law/test_safety.py": "import supervisor.law.safety\nfrom tests import rules\n",
    "tests/rules.py": "",
    "wire/__init__.py": "",
    "wire/lease.py": "import numpy\n",
    "teleop/service.py": "",
    "uv.lock": "",
    "pyproject.toml": '[project]\nversion = "1"\n[tool.pytest]\ntimeout = "120"\n[tool.mutmut]\n',
}
"""A project whose law imports one module; teleop is no source of it."""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, content in SMALL.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    return tmp_path


@pytest.mark.long
def test_the_law_its_tests_and_what_they_import_are_sources() -> None:
    found = {str(path) for path in sources(ROOT)}
    law = {str(path.relative_to(ROOT)) for path in ROOT.glob("supervisor/law/*.py")}
    assert found >= law | {"wire/freshness.py", "tests/unit/supervisor/law/test_model_check.py"}
    assert not [name for name in found if name.startswith(("teleop/", "lifeline/", "faults/", "sim/"))]


@pytest.mark.parametrize("name", sorted(SMALL))
def test_a_change_of_a_source_changes_the_hash_and_no_other_change_does(project: Path, name: str) -> None:
    before = digest(project)
    assert digest(project) == before
    (project / name).write_text(SMALL[name] + "# changed\n")
    is_source = name not in {"teleop/service.py", "pyproject.toml"}
    assert (digest(project) != before) == is_source


def test_another_setting_of_a_tool_changes_the_hash(project: Path) -> None:
    before, settings = digest(project), SMALL["pyproject.toml"]
    (project / "pyproject.toml").write_text(settings.replace("120", "121"))
    assert digest(project) != before
    (project / "pyproject.toml").write_text(settings.replace('version = "1"', 'version = "2"'))
    assert digest(project) == before
