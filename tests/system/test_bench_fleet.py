"""A short run of `python -m bench.fleet` with two robots behind a router, with certificates and all its real processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench.rig.program import ROOT
from bench.robots.results import read

ROBOTS, SOAK_S = 2, 8
RUN_LIMIT_S = 110.0
GENEROUS_STOP_MS, GENEROUS_CPU_PERCENT = 400.0, 80.0
"""Loose limits, for a loaded machine; `make bench-fleet` prints the measured values."""
LEAST_BYTES_S = 1000.0
"""The commands of an operator alone are 20 a second, of 85 bytes each."""

pytestmark = [pytest.mark.timed, pytest.mark.timeout(120)]


def test_two_robots_behind_a_router_drive_and_stop_when_their_operators_are_killed(tmp_path: Path) -> None:
    file = tmp_path / "fleet.jsonl"
    words = ["--robots", str(ROBOTS), "--soak", str(SOAK_S), "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "bench.fleet", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=RUN_LIMIT_S,
        check=False,
    )
    assert done.returncode in (0, 1), done.stderr
    print(done.stdout)
    fleet = read(file)
    [crowd] = fleet.crowds
    assert crowd.robots == len(crowd.cpu_percent) == ROBOTS
    assert 0.0 < crowd.router_percent < GENEROUS_CPU_PERCENT
    assert crowd.crossing_bytes_s > LEAST_BYTES_S
    assert crowd.stop_ms
    assert all(0.0 < stop_ms < GENEROUS_STOP_MS for stop_ms in crowd.stop_ms)
