"""`python -m ros2` with an interpreter that lacks what it needs."""

import subprocess
import sys
from pathlib import Path


def test_an_interpreter_without_packages_is_refused_with_one_sentence() -> None:
    done = subprocess.run(
        [sys.executable, "-S", "-m", "ros2"],  # -S: without site-packages
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(
        f"ros2: {sys.executable} has no numpy, pydantic, zenoh: create the environment"
    )
    assert "Traceback" not in done.stderr
