"""`lifeline faults` on real processes: its measurements, and that it leaves nothing behind."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from faults.report.page import write_report
from faults.trial_file import read_trials

pytestmark = pytest.mark.timeout(2 * 120 + 30)

LIMIT_S = 120.0
POLL_S = 0.05


@dataclass
class Campaign:
    """Campaigns whose every file is under one directory."""

    directory: Path

    @property
    def out(self) -> Path:
        return self.directory / "trials.jsonl"

    def start(self, *options: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "lifeline.cli.app", "faults", "--out", str(self.out), *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"TMPDIR": str(self.directory)},
            start_new_session=True,
        )

    def run(self, *options: str) -> tuple[int, str]:
        campaign = self.start(*options)
        try:
            said, _ = campaign.communicate(timeout=LIMIT_S)
        finally:
            campaign.kill()
        return campaign.returncode, said

    def left(self) -> list[str]:
        """Processes, mounts and directories that a campaign left behind."""
        found = [path.name for path in self.directory.iterdir() if path != self.out]
        found += [
            line for line in Path("/proc/mounts").read_text().splitlines() if str(self.directory) in line
        ]
        for entry in Path("/proc").iterdir():
            with suppress(OSError):
                if (
                    entry.name.isdecimal()
                    and str(self.directory).encode() in (entry / "environ").read_bytes()
                ):
                    found.append((entry / "cmdline").read_text().replace("\0", " "))
        return found


@pytest.fixture
def campaign() -> Generator[Campaign]:
    """Not in pytest's own directory, which has too long a path for a socket on some machines."""
    directory = Path(tempfile.mkdtemp(prefix="lf-")).resolve()
    yield Campaign(directory)
    shutil.rmtree(directory, ignore_errors=True)


@pytest.mark.timed
def test_one_fault_of_each_kind_is_done_measured_and_kept(campaign: Campaign) -> None:
    classes = (
        "teleop_sigkill,supervisor_sigkill,sim_scan_nan,net_healed,station_page_sigkill,wire_rogue_cmd_vel"
    )
    code, said = campaign.run("--classes", classes, "--trials", "1", "--seed", "3")
    print(said)
    assert code == 0, said
    assert campaign.left() == []
    trials = {trial.faults[0].fault: trial for trial in read_trials(campaign.out)}
    assert set(trials) == set(classes.split(","))
    for trial in trials.values():
        assert (trial.mode, trial.seed, trial.contacts) == ("real", 3, 0)
        assert trial.faults[0].speed_m_s >= 0.25, "it moved, or nothing was measured"
    healed = trials["net_healed"].faults[0]
    for name in ("teleop_sigkill", "station_page_sigkill"):
        killed = trials[name].faults[0]
        assert killed.detector == "SOURCE_LOST"
        assert killed.to_zero_s is not None
        assert killed.to_zero_s < 0.06
    assert healed.to_zero_s is not None
    assert 0.1 < healed.to_zero_s < 0.3
    assert float(trials["supervisor_sigkill"].faults[0].parameters["to_wheels_s"]) < 0.06
    assert trials["wire_rogue_cmd_vel"].faults[0].parameters["sent"]

    page = campaign.directory / "report.html"
    assert "every promise was kept" in write_report([campaign.out], page).sentence
    assert all(trial.timeline for trial in trials.values())
    # A refused write on cmd_vel need not stop anything; then there is no time and no picture.
    assert 5 <= page.read_text().count("<figure><svg") <= 6
    page.unlink()

    code, said = campaign.run("--classes", classes, "--trials", "1", "--seed", "3")
    assert (code, len(list(read_trials(campaign.out)))) == (0, 6), "what is there is not done again"
    assert "starting" not in said


@pytest.mark.timed
def test_a_campaign_whose_time_is_over_before_every_class_was_tried_fails_and_names_them(
    campaign: Campaign,
) -> None:
    code, said = campaign.run("--classes", "teleop_*,net_*", "--trials", "1", "--minutes", "0.1")
    assert code == 1, said
    assert "trials were not run: no results for " in said
    assert campaign.left() == []


@pytest.mark.timed
def test_a_campaign_that_is_interrupted_keeps_what_it_has_and_leaves_nothing_behind(
    campaign: Campaign,
) -> None:
    running = campaign.start("--classes", "teleop_sigstop,machine_cpu_hogs", "--trials", "50")
    try:
        deadline_s = time.monotonic() + LIMIT_S
        while not (campaign.out.exists() and campaign.out.read_text().count("\n")):
            assert time.monotonic() < deadline_s, "no trial was made"
            assert running.poll() is None, running.communicate()[0]
            time.sleep(POLL_S)
        running.send_signal(signal.SIGINT)
        said, _ = running.communicate(timeout=30)
    finally:
        running.kill()
        running.wait()
    print(said)
    assert running.returncode == 130
    assert campaign.left() == []
    assert len(list(read_trials(campaign.out))) >= 1


@pytest.mark.smoke
def test_a_campaign_that_is_killed_is_cleaned_up_after(campaign: Campaign) -> None:
    running = campaign.start("--classes", "net_unplugged", "--trials", "1")
    deadline_s = time.monotonic() + LIMIT_S
    try:
        while not list(campaign.directory.glob("*/state/supervisord.sock")):
            assert time.monotonic() < deadline_s, "nothing was started"
            assert running.poll() is None, running.communicate()[0]
            time.sleep(POLL_S)
    finally:
        running.kill()
        running.communicate()
    deadline_s = time.monotonic() + LIMIT_S
    while campaign.left():
        assert time.monotonic() < deadline_s, campaign.left()
        time.sleep(POLL_S)


def test_a_class_that_there_is_not_is_one_sentence(campaign: Campaign) -> None:
    code, said = campaign.run("--classes", "teleop_bored")
    assert code == 2
    assert "there is no class 'teleop_bored' of faults; there are teleop_sigkill, " in said
    assert "Traceback" not in said
