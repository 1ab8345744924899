"""The revision of the virtual campaign covers every file that decides what a seed does."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from faults.simulated import runner
from faults.simulated.runner import DECIDES, ROOT, files_behind, revision

RUN = f"""
import importlib, json, sys
importlib.import_module({DECIDES!r}).run_trial(3)
print(json.dumps([m.__file__ for m in sys.modules.values() if getattr(m, "__file__", None)]))
"""


@pytest.mark.long
def test_every_file_that_a_trial_loads_is_behind_the_campaign() -> None:
    printed = subprocess.run(
        [sys.executable, "-c", RUN], cwd=ROOT, check=True, capture_output=True, text=True, timeout=60
    ).stdout
    files = map(Path, json.loads(printed.splitlines()[-1]))
    loaded = {file for file in files if file.is_relative_to(ROOT) and "site-packages" not in file.parts}
    assert len(loaded) > 50
    assert loaded <= files_behind(DECIDES)


def test_what_decides_outcomes_is_behind_it_and_what_shows_them_is_not() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in files_behind(DECIDES)}
    assert {"faults/seen.py", "faults/demands.py", "supervisor/law/safety.py"} <= names
    assert not {"faults/report/table.py", "faults/simulated/runner.py", "lifeline/cli/app.py"} & names


@pytest.mark.parametrize("changed", ["one.py", "part/two.py", "part/__init__.py", "sim/hall.toml"])
def test_a_change_anywhere_behind_a_module_changes_its_revision(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = {
        "one.py": "import os\n\ndef late():\n    from part import two\n",
        "part/__init__.py": "",
        "part/two.py": "import part.three\n",
        "part/three.py": "import one\n",
        "aside.py": "",
        "sim/hall.toml": "",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(runner, "ROOT", tmp_path)
    before = revision("one")
    (tmp_path / "aside.py").write_text("# changed")
    assert revision("one") == before
    (tmp_path / changed).write_text(texts[changed] + "# changed")
    assert revision("one") != before
