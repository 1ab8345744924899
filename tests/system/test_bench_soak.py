"""A soak of some seconds: it drives, writes its file, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.rig.stored import read_appended
from bench.soak import Sample
from deploy.stack.processes import MARK

LIMIT_S = 90


@pytest.fixture
def place() -> Iterator[Path]:
    """Where a soak puts its state directory; pytest's own has too long a path for a socket."""
    with tempfile.TemporaryDirectory(prefix="soak-") as directory:
        yield Path(directory).resolve()


@pytest.mark.timed
def test_a_soak_that_is_cut_short_judges_what_it_has(tmp_path: Path, place: Path) -> None:
    out = tmp_path / "soak.jsonl"
    soak = subprocess.Popen(
        [sys.executable, "-u", "-m", "bench.soak", "--out", str(out)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(place)},
    )
    try:
        assert soak.stdout is not None
        told = next(line for line in soak.stdout if line.startswith("sample"))
        soak.send_signal(signal.SIGINT)
        told += soak.communicate(timeout=LIMIT_S)[0]
    finally:
        soak.kill()
        soak.wait()
    (sample, *_), [provenance] = read_appended(out, Sample)
    assert set(sample.processes) == {"sim", "supervisor", "supervisord", "teleop"}, told
    assert sample.driven_m > 0.05, told
    assert sample.ticks.samples > 100, told
    assert "warning: cut short" in told
    assert "not judged" in told
    # A machine under load may stop the robot, and is told so.
    assert soak.returncode == int(bool(sample.false_stops)), told
    assert provenance.command.startswith("python -m bench.soak")
    assert list(place.iterdir()) == []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            assert f"{MARK}={place}/".encode() not in environment, entry
