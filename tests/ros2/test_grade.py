"""`lifeline grade --ros2`: the lab's node without and with Lifeline."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros2.host import ROOT
from tests.system.test_grade import rubric

LIMIT_S = 100.0


@pytest.mark.parametrize(("options", "code"), [((), 1), (("--through-lifeline",), 0)])
def test_only_behind_the_supervisor_a_killed_node_of_the_lab_gets_points(
    tmp_path: Path, options: tuple[str, ...], code: int
) -> None:
    file = tmp_path / "grade.json"
    command = [sys.executable, "-m", "lifeline.cli.app", "grade", "--ros2", "--keys", "w", "--stop-key", "s"]
    files = ["--rubric", str(rubric(tmp_path, "killed")), "--json", str(file)]
    done = subprocess.run(
        [*command, *options, *files, "--", "python", "-m", "tests.ros2.peers.lab_teleop"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=LIMIT_S,
    )
    assert done.returncode == code, done.stdout + done.stderr
    (killed,) = json.loads(file.read_text())["marks"]
    assert (killed["points"] > 0) is (code == 0)
