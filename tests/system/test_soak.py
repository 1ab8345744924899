"""A soak of some seconds: it drives, writes its files, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from deploy.stack.processes import MARK
from faults.soak.sample import read_samples

LIMIT_S = 90
COMMAND = [sys.executable, "-m", "lifeline.cli.app", "soak"]


@pytest.fixture
def place() -> Iterator[Path]:
    """Where a soak puts its state directory; pytest's own has too long a path for a socket."""
    with tempfile.TemporaryDirectory(prefix="soak-") as directory:
        yield Path(directory).resolve()


def test_a_short_soak_drives_writes_and_draws(tmp_path: Path, place: Path) -> None:
    out, plot = tmp_path / "soak.jsonl", tmp_path / "soak.svg"
    done = subprocess.run(
        [*COMMAND, "--hours", "0.0042", "--out", str(out), "--plot", str(plot)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=LIMIT_S,
        env=os.environ | {"TMPDIR": str(place)},
    )
    told = done.stdout + done.stderr
    (sample,), provenance = read_samples(out)
    assert set(sample.processes) == {"sim", "supervisor", "supervisord", "teleop"}, told
    assert sample.driven_m > 0.05, told
    assert sample.ticks.samples > 100, told
    assert "too few samples to tell its growth" in told
    # A machine under load may stop the robot, and is told so.
    assert done.returncode == int(bool(sample.false_stops)), told
    assert provenance is not None
    assert provenance.command.startswith("lifeline soak --hours 0.0042 --out soak.jsonl")
    assert ET.parse(plot).getroot().tag.endswith("svg")
    assert_nothing_is_left(place)


def test_a_soak_that_is_cut_short_judges_what_it_has(tmp_path: Path, place: Path) -> None:
    out = tmp_path / "soak.jsonl"
    soak = subprocess.Popen(
        [*COMMAND, "--hours", "1", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"TMPDIR": str(place)},
    )
    try:
        deadline_s = time.monotonic() + LIMIT_S
        while not (out.exists() and out.read_text()) and time.monotonic() < deadline_s:
            time.sleep(0.1)
        soak.send_signal(signal.SIGINT)
        told, _ = soak.communicate(timeout=30)
    finally:
        soak.kill()
        soak.wait()
    assert "warning: cut short after" in told
    assert "passed" in told or "FAILED" in told
    assert_nothing_is_left(place)


def test_a_file_that_cannot_be_written_is_refused_before_anything_starts(tmp_path: Path) -> None:
    done = subprocess.run(
        [*COMMAND, "--out", str(tmp_path / "none" / "soak.jsonl")],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert done.returncode == 2
    assert "cannot write" in done.stderr
    assert done.stdout == ""


def assert_nothing_is_left(place: Path) -> None:
    """Check that no process and no file of the soak remains."""
    assert list(place.iterdir()) == []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            assert f"{MARK}={place}/".encode() not in environment, entry
