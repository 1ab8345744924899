"""The demo: every promise that it checks is kept, and it leaves nothing behind."""

import subprocess
import sys

import pytest

LIMIT_S = 100


@pytest.mark.demo
def test_the_demo_keeps_every_promise_it_checks() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "lifeline.cli.app", "demo", "--quick"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=LIMIT_S,
    )
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "10 of 10 promises kept" in done.stdout or "late by" in done.stdout
    assert "BROKEN" not in done.stdout
