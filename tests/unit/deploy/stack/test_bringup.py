"""A start fails early if a program exits repeatedly."""

from pathlib import Path

import pytest

from deploy.stack import supervisord
from deploy.stack.bringup import Health
from deploy.stack.errors import DeployError
from deploy.stack.statedir import StateDir
from deploy.stack.supervisord import Program


def reported(monkeypatch: pytest.MonkeyPatch) -> list[Program]:
    """Return a list that stands for the programs that supervisord reports."""
    programs: list[Program] = []

    def programs_of(_: StateDir) -> list[Program]:
        return programs

    monkeypatch.setattr(supervisord, "programs", programs_of)
    return programs


def silent(_: StateDir) -> None:
    """Stand for a supervisord that does not answer."""


@pytest.mark.parametrize(
    "seen",
    [
        [("FATAL", 1)],
        [("STARTING", 1), ("BACKOFF", 1), ("STARTING", 2), ("BACKOFF", 2)],
        [("BACKOFF", 1), ("EXITED", 3)],
        # It fails only after startsecs: supervisord counts it as running, and restarts it at once.
        [("RUNNING", 1), ("RUNNING", 5), ("RUNNING", 9)],
        [("STARTING", 1), ("STARTING", 5), ("STARTING", 9)],
    ],
)
def test_a_program_that_dies_twice_has_failed(
    seen: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    programs = reported(monkeypatch)
    health = Health(StateDir(tmp_path))
    for number, (state, start) in enumerate(seen):
        programs[:] = [Program("sim", state, 7, start), Program("supervisor", "RUNNING", 8, 1)]
        if number < len(seen) - 1:
            health.check()
    with pytest.raises(DeployError, match="sim exits soon after each start"):
        health.check()


@pytest.mark.parametrize(
    "seen",
    [
        [("STARTING", 1), ("RUNNING", 1), ("RUNNING", 1)],
        [("STARTING", 1), ("BACKOFF", 1), ("BACKOFF", 1), ("STARTING", 3), ("RUNNING", 3)],
        [("RUNNING", 1), ("RUNNING", 5)],
    ],
)
def test_a_program_that_dies_once_may_still_start(
    seen: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    programs = reported(monkeypatch)
    health = Health(StateDir(tmp_path))
    for state, start in seen:
        programs[:] = [Program("sim", state, 7, start)]
        health.check()


def test_a_supervisord_that_does_not_answer_is_no_failed_program(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(supervisord, "programs", silent)
    Health(StateDir(tmp_path)).check()
