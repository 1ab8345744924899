"""A start fails early if a program exits repeatedly; a second start says how to use the robot that runs."""

import json
from pathlib import Path

import pytest

from deploy.stack import bringup, processes, supervisord
from deploy.stack.bringup import Health, check_nothing_runs, new_station_address
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.processes import Process
from deploy.stack.statedir import StateDir
from deploy.stack.supervisord import Program


def reported(monkeypatch: pytest.MonkeyPatch) -> list[Program]:
    """Return a list that stands for the programs that supervisord reports."""
    programs: list[Program] = []

    def programs_of(_: StateDir) -> list[Program]:
        return programs

    monkeypatch.setattr(supervisord, "programs", programs_of)
    return programs


class Start:
    """A start that is watched, and what supervisord reports of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, state: Path) -> None:
        self._programs = reported(monkeypatch)
        self._health = Health(StateDir(state))

    def sees(self, *seen: tuple[str, int, int]) -> None:
        """Check the sim after each of these reports: its state, pid and start."""
        for state, pid, start in seen:
            self._programs[:] = [Program("sim", state, pid, start), Program("supervisor", "RUNNING", 6, 1)]
            self._health.check()


def silent(_: StateDir) -> None:
    """Stand for a supervisord that does not answer."""


@pytest.mark.parametrize(
    "seen",
    [
        [("FATAL", 0, 1)],
        [("STARTING", 7, 1), ("BACKOFF", 0, 1), ("STARTING", 8, 2), ("BACKOFF", 0, 2)],
        [("BACKOFF", 0, 1), ("EXITED", 0, 3)],
        # It fails only after startsecs: supervisord counts it as running, and restarts it at once.
        [("RUNNING", 7, 1), ("RUNNING", 8, 5), ("RUNNING", 9, 9)],
        [("STARTING", 7, 1), ("STARTING", 8, 5), ("STARTING", 9, 9)],
    ],
)
def test_a_program_that_dies_twice_has_failed(
    seen: list[tuple[str, int, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    start = Start(monkeypatch, tmp_path)
    start.sees(*seen[:-1])
    with pytest.raises(DeployError, match="sim exits soon after each start"):
        start.sees(seen[-1])


@pytest.mark.parametrize(
    "seen",
    [
        [("STARTING", 7, 1), ("RUNNING", 7, 1), ("RUNNING", 7, 1)],
        [("STARTING", 7, 1), ("BACKOFF", 0, 1), ("BACKOFF", 0, 1), ("STARTING", 8, 3), ("RUNNING", 8, 3)],
        [("RUNNING", 7, 1), ("RUNNING", 8, 5)],
        # supervisord moves the start of a living process when the clock steps back.
        [("STARTING", 7, 1000), ("STARTING", 7, 900), ("RUNNING", 7, 800)],
    ],
)
def test_a_program_that_dies_once_may_still_start(
    seen: list[tuple[str, int, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    Start(monkeypatch, tmp_path).sees(*seen)


def test_a_supervisord_that_does_not_answer_is_no_failed_program(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(supervisord, "programs", silent)
    Health(StateDir(tmp_path)).check()


def test_a_second_start_says_how_to_drive_the_robot_that_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def running(_: Path) -> list[Process]:
        return [Process(4, "supervisord"), Process(5, "supervisor")]

    monkeypatch.setattr(processes, "of", running)
    state = StateDir(tmp_path)
    state.record.write_text(json.dumps(Launch.read(None, None).to_record()))
    with pytest.raises(
        DeployError, match=r"a robot already runs in .*: drive it with `lifeline teleop`, "
    ) as refused:
        check_nothing_runs(state)
    assert f"stop it with `lifeline down --state-dir {tmp_path}`" in str(refused.value)


def test_a_new_code_where_nothing_runs_is_refused_without_waiting(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(bringup.time, "sleep", waits.append)
    monkeypatch.setattr(bringup, "ALIVE_LIMIT_S", 0.1)  # for a version that waits
    with pytest.raises(DeployError, match=r"no e-stop station runs in .*`lifeline up --station`"):
        new_station_address(StateDir(tmp_path))
    assert waits == []
