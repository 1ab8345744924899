"""A short run of `python -m bench.peers` with all its real processes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.peers.results import RATES_HZ, pooled, ratios, read
from bench.peers.run import kinds
from bench.rig.program import ROOT

RUN_LIMIT_S = 280.0
GENEROUS_RATIO, GENEROUS_SHARE, GENEROUS_DEATH_MS = 8.0, 0.5, 60.0
"""For a loaded machine; `make bench-peers` measures."""

pytestmark = [pytest.mark.timed, pytest.mark.timeout(300)]


def test_the_supervisor_costs_a_small_multiple_of_a_bare_relay(tmp_path: Path) -> None:
    file = tmp_path / "peers.jsonl"
    words = ["--rounds", "2", "--count", "30", "--kills", "3", "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "bench.peers", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=RUN_LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    peers = read(file)
    assert peers.names == [kind.name for kind in kinds() if kind.missing() is None]
    own, reference = peers.names[:2]
    for rate_hz in RATES_HZ:
        assert min(ratios(own, reference, rate_hz, peers.trips)) < GENEROUS_RATIO
        sent = sum(trip.sent for trip in peers.trips if (trip.kind, trip.rate_hz) == (own, rate_hz))
        assert len(pooled(own, rate_hz, peers.trips)) > GENEROUS_SHARE * sent
    deaths_ms = [ms for death in peers.deaths if death.kind == own for ms in death.times_ms]
    assert len(deaths_ms) == 6
    assert np.median(deaths_ms) < GENEROUS_DEATH_MS
