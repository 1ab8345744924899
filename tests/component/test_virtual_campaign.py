"""The virtual campaign: every seed is repeatable bit for bit, and a broken law is found."""

import itertools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from multiprocessing import active_children
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deploy.stack.errors import DeployError
from faults.classes import classes_by_themselves
from faults.demands import may_be_locked_out
from faults.simulated import runner as campaigns
from faults.simulated import world
from faults.simulated.runner import revision
from faults.simulated.scenario import Drivers, draw
from faults.simulated.trial_run import run_trial
from faults.trial import PROVENANCE_BEGINS, Trial
from faults.trial_file import read_trials
from sim.config import SimSection
from station.driving import Commands
from supervisor.config import SupervisorSection
from supervisor.law import interlock, permission, safety
from supervisor.law.interlock import Source
from teleop.wheel import SourceWheel
from tests.component.rig import Rig, laser_scan
from wire import topics

ROOT = Path(__file__).parents[2]
FEW = (8, 11, 14, 3, 5, 0, 1, 2, 4, 6, 7, 9)
"""This many seeds must suffice to find a missing essential rule."""
trial_of = cache(run_trial)
"""The trial of a seed with the default configuration, for tests that do not change the law."""


def broken(promise: int, run: Callable[[int], Trial], *, first: int) -> bool:
    """Return whether a seed finds a broken promise; the one that found it at the last change is tried first."""
    seeds = sorted(FEW, key=lambda seed: seed != first)
    return any(violation.promise == promise for seed in seeds for violation in run(seed).violations)


@pytest.mark.long
def test_seeds_keep_every_promise() -> None:
    for seed in (0, 3, 8):
        trial = trial_of(seed)
        assert trial.violations == (), f"lifeline faults --virtual --seed {seed}"
        assert trial.faults


@pytest.mark.proof
def test_a_seed_is_the_same_alone_in_a_row_and_in_another_process(tmp_path: Path) -> None:
    """Hash seeds differ between processes, so nothing may depend on the order of a set."""
    alone = [run_trial(seed, "r").line() for seed in (5, 3, 5)]
    assert alone[0] == alone[2]
    script = "from faults.simulated.runner import run_line; print(*(run_line(n, 'r') for n in (4, 3, 5)), sep='\\n')"
    for hash_seed in ("1", "2"):
        printed = subprocess.run(
            [sys.executable, "-c", script],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            check=True,
            capture_output=True,
            text=True,
            timeout=60,
        ).stdout.splitlines()
        assert printed[1:] == [alone[1], alone[0]]


@pytest.mark.long
def test_without_the_barrier_it_comes_too_near(monkeypatch: pytest.MonkeyPatch) -> None:
    def everything(*_: object, **__: object) -> tuple[float, None]:
        return 1.0, None

    monkeypatch.setattr(permission, "permitted_scale", everything)
    assert broken(6, run_trial, first=11)


def test_with_a_command_timeout_ten_times_as_long_it_drives_on() -> None:
    assert broken(3, lambda seed: run_trial(seed, config=SupervisorSection(command_timeout_s=2.0)), first=8)


def test_with_a_scan_timeout_ten_times_as_long_it_drives_blindly() -> None:
    assert broken(5, lambda seed: run_trial(seed, config=SupervisorSection(scan_timeout_s=2.5)), first=14)


@pytest.mark.long
def test_without_the_interlock_it_moves_without_a_neutral(monkeypatch: pytest.MonkeyPatch) -> None:
    latch: Any = interlock._latch  # pyright: ignore[reportPrivateUsage]

    def forget(source: Source, *judged: object) -> Source:
        latched: Source = latch(source, *judged)
        causes = judged[1]
        return latched if causes else latched._replace(latched=interlock.NONE, block=None)

    monkeypatch.setattr(interlock, "_latch", forget)
    assert broken(7, run_trial, first=14)


def test_a_base_that_waits_too_long_does_not_brake_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "SIM", SimSection(imu_hz=1.0, command_timeout_s=1.0))
    assert broken(4, run_trial, first=8)


def test_a_supervisor_that_fails_is_reported_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(safety, "_shared_causes", fail)
    sentences = [violation.sentence for violation in run_trial(3).violations]
    assert any("ZeroDivisionError: by nothing" in sentence for sentence in sentences)


async def test_one_scan_of_another_client_does_not_blind_the_robot_permanently() -> None:
    """Found by the campaign: an epoch ended with the first scan of another one, and could never return."""
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.3)
        rig.network.open_joined("second lidar").publisher(topics.SCAN).put(laser_scan(np.full(360, np.nan)))
        rig.velocity = (0.0, 0.0)
        await rig.pass_time(3.0)
        assert rig.newest_status.reasons == []


@pytest.mark.parametrize("seed", [5974, 6330])
def test_the_checker_blames_nobody_for_what_was_not_done_or_passed_by(seed: int) -> None:
    """Found by the campaign: a sensor fault that reached no sim, and a person who passed a departing robot."""
    assert run_trial(seed).violations == ()


@pytest.mark.parametrize("seed", [41, 860])
def test_a_teleop_whose_place_was_taken_while_it_hung_comes_back_by_itself(seed: int) -> None:
    """Found by the campaign: it was refused until it was restarted."""
    trial = run_trial(seed)
    assert may_be_locked_out({fault.fault for fault in trial.faults})
    assert trial.violations == ()


OWN_SEEDS = {draw(seed).faults[0].name: seed for seed in range(7, 10 * len(classes_by_themselves()), 10)}


OFTEN = {"wire_second_lidar_steady", "sim_scan_dropout", "sim_scan_frozen_odom_zero", "station_page_frozen"}
"""The classes of which one trial is run after each change; all others are run with the proofs."""


@pytest.mark.parametrize(
    ("name", "number"),
    [
        pytest.param(name, number, marks=() if name in OFTEN and number == 0 else pytest.mark.proof)
        for name in OWN_SEEDS
        for number in range(3)
    ],
)
def test_each_class_with_trials_of_its_own_keeps_every_promise(name: str, number: int) -> None:
    seed = OWN_SEEDS[name] + 10 * len(OWN_SEEDS) * number
    trial = trial_of(seed)
    assert [fault.fault for fault in trial.faults] == [name]
    assert trial.faults[0].speed_m_s > 0.1, "it moved, or nothing was tried"
    assert trial.violations == (), f"lifeline faults --virtual --seed {seed}"


@pytest.mark.parametrize("name", ["wire_second_lidar_steady", "sim_scan_dropout"])
def test_what_happens_by_chance_within_a_trial_is_the_same_for_the_same_seed(name: str) -> None:
    assert run_trial(OWN_SEEDS[name]).line() == trial_of(OWN_SEEDS[name]).line()


# --- a page that drives


def _not_refused(*_: object) -> str:
    return ""


def _kept(_: object) -> None:
    """The run of a page goes on after its connection."""


@pytest.mark.parametrize(
    ("name", "promise", "owner", "method", "without"),
    [
        ("station_page_frozen", 3, Commands, "_problem", _not_refused),
        ("station_page_sigkill", 2, SourceWheel, "release", _kept),
        ("station_page_garbage", 2, SourceWheel, "release", _kept),
    ],
)
def test_a_server_without_one_of_its_rules_is_found(
    name: str,
    promise: int,
    owner: type[object],
    method: str,
    without: Callable[..., object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(owner, method, without)
    assert promise in {violation.promise for violation in run_trial(OWN_SEEDS[name]).violations}


def test_a_page_drives_in_the_trials_whose_seed_ends_in_2() -> None:
    trial = trial_of(12)
    assert draw(12).drivers is Drivers.STATION
    assert any(fault.speed_m_s > 0.1 for fault in trial.faults), "it moved, or nothing was tried"
    assert trial.violations == ()


def test_a_page_whose_place_was_taken_while_its_server_hung_drives_again_when_it_is_opened_again() -> None:
    """Found by the campaign: it was refused until the person opened a new page."""
    trial = run_trial(9412)
    assert may_be_locked_out({fault.fault for fault in trial.faults})
    assert trial.violations == ()


# --- the command


def say_to(said: list[str]) -> Callable[[str], None]:
    return said.append


@pytest.mark.long
def test_a_campaign_keeps_its_trials_and_goes_on_where_it_ended(tmp_path: Path) -> None:
    out, said = tmp_path / "trials.jsonl", list[str]()
    assert campaigns.campaign(2, 2, out, say_to(said)) == 0
    first = sorted(line for line in out.read_text().splitlines() if not line.startswith(PROVENANCE_BEGINS))
    assert sorted(trial.seed for trial in read_trials(out)) == [0, 1]
    # A killed campaign leaves half a line; trials of another revision do not count.
    other = trial_of(2).model_copy(update={"revision": "other code"}).line()
    out.write_text("\n".join([*first, other]) + "\n" + first[0][:30])
    assert campaigns.campaign(3, 1, out, say_to(said)) == 0
    assert "2 of 3 seeds are in" in " ".join(said)
    assert sorted(trial.seed for trial in read_trials(out)) == [0, 1, 2, 2]


@pytest.mark.long
def test_an_interrupt_whose_dead_workers_are_noticed_before_anything_else_prints_no_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    threads = threading.active_count()
    died = list[threading.ExceptHookArgs]()
    monkeypatch.setattr(threading, "excepthook", died.append)

    result = Future[list[str]].result
    results = itertools.count()

    def interrupted(future: Future[list[str]], timeout_s: float | None = None) -> list[str]:
        if next(results) == 0:
            return result(future, timeout_s)  # from now on the queue of the workers is full
        raise KeyboardInterrupt

    class Worker:
        """One whose end the pool's thread handles at once."""

        def __init__(self, process: BaseProcess) -> None:
            self._process = process

        def kill(self) -> None:
            self._process.kill()
            while threading.active_count() > threads:
                threading.Event().wait(0.01)

    monkeypatch.setattr(campaigns, "active_children", lambda: [Worker(child) for child in active_children()])
    monkeypatch.setattr(Future, "result", interrupted)
    monkeypatch.setattr(campaigns, "BATCH", 1)
    assert campaigns.campaign(20, 1, None, print) == 130
    assert not died


def test_a_violation_is_printed_with_the_command_that_replays_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trial: dict[str, Any] = json.loads(trial_of(3).line())
    trial["revision"] = revision(campaigns.DECIDES)
    trial["seed"] = 0
    trial["violations"] = [{"promise": 6, "time_s": 1.0, "sentence": "it came too near"}]
    out, said = tmp_path / "trials.jsonl", list[str]()
    out.write_text(json.dumps(trial) + "\n")
    assert campaigns.campaign(1, 1, out, say_to(said)) == 1
    assert "  replay: lifeline faults --virtual --seed 0" in capsys.readouterr().out


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match="cannot write"):
        campaigns.campaign(1, 1, tmp_path, print)


@pytest.mark.long
def test_a_replay_prints_the_story(tmp_path: Path) -> None:
    said = list[str]()
    assert campaigns.replay(3, said.append) == 0
    assert any("FAULT" in line for line in said)
    assert trial_of(3).digest in said[0]
