"""Short runs of `python -m bench.robots` with two robots and all their real processes, also behind a router."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench.rig.program import ROOT
from bench.robots.results import Crowd, read

ROBOTS, KILLS, SOAK_S = 2, 2, 8
RUN_LIMIT_S = 110.0
GENEROUS_GAP_P50_MS, GENEROUS_STOP_MS, GENEROUS_CPU_PERCENT = 40.0, 200.0, 50.0
"""Loose limits, for a loaded machine; `make bench-robots` and `make bench-fleet` measure."""
LATER = 2
"""Behind a router with certificates, all these limits are higher."""
LEAST_BYTES_S = 1000.0
"""The commands of an operator alone are 20 a second, of 85 bytes each."""

pytestmark = [pytest.mark.timed, pytest.mark.timeout(120)]


def measured(file: Path, *words: str) -> Crowd:
    """Run the bench with two robots; return what it has stored."""
    command = [sys.executable, "-m", "bench.robots", "--robots", str(ROBOTS), "--json", str(file), *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=RUN_LIMIT_S, check=False)
    assert done.returncode in (0, 1) if "--soak" in words else done.returncode == 0, done.stderr
    print(done.stdout)
    [crowd] = read(file).crowds
    assert crowd.robots == len(crowd.cpu_percent) == ROBOTS
    return crowd


def test_two_robots_drive_and_stop_when_their_operators_are_killed(tmp_path: Path) -> None:
    crowd = measured(tmp_path / "robots.jsonl", "--seconds", "3", "--kills", str(KILLS))
    assert all(0.0 < percent < GENEROUS_CPU_PERCENT for percent in crowd.cpu_percent)
    assert 0.0 < crowd.gap_p50_ms < GENEROUS_GAP_P50_MS
    assert len(crowd.stop_ms) == KILLS
    assert all(0.0 < stop_ms < GENEROUS_STOP_MS for stop_ms in crowd.stop_ms)


def test_two_robots_behind_a_router_drive_and_stop_when_their_operators_are_killed(tmp_path: Path) -> None:
    crowd = measured(tmp_path / "fleet.jsonl", "--router", "--soak", str(SOAK_S))
    assert 0.0 < crowd.router_percent < LATER * GENEROUS_CPU_PERCENT
    assert crowd.crossing_bytes_s > LEAST_BYTES_S
    assert crowd.stop_ms
    assert all(0.0 < stop_ms < LATER * GENEROUS_STOP_MS for stop_ms in crowd.stop_ms)
