"""A short run of `python -m bench.robots` with two robots and all its real processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench.rig.program import ROOT
from bench.robots.results import read

ROBOTS, KILLS = 2, 2
RUN_LIMIT_S = 80.0
GENEROUS_GAP_P50_MS, GENEROUS_STOP_MS, GENEROUS_CPU_PERCENT = 40.0, 200.0, 50.0
"""Loose limits, for a loaded machine; `make bench-robots` measures against the targets."""

pytestmark = [pytest.mark.timed, pytest.mark.timeout(90)]


def test_two_robots_drive_and_stop_when_their_operators_are_killed(tmp_path: Path) -> None:
    file = tmp_path / "robots.jsonl"
    words = ["--robots", str(ROBOTS), "--seconds", "3", "--kills", str(KILLS), "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "bench.robots", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=RUN_LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    robots = read(file)
    [crowd] = robots.crowds
    assert crowd.robots == len(crowd.cpu_percent) == ROBOTS
    assert all(0.0 < percent < GENEROUS_CPU_PERCENT for percent in crowd.cpu_percent)
    assert 0.0 < crowd.gap_p50_ms < GENEROUS_GAP_P50_MS
    assert len(crowd.stop_ms) == KILLS
    assert all(0.0 < stop_ms < GENEROUS_STOP_MS for stop_ms in crowd.stop_ms)
