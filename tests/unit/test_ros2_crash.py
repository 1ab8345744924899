"""The stored trials of keyboard nodes in ROS 2, and their table."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from docs.generate.ros2_crash import KEEPS, KILL, Trial, markdown, read

TRIAL = Trial(
    "lab_teleop",
    KILL,
    "stops after 0.5 s",
    lifeline=False,
    zero_s=None,
    standstill_s=0.75,
    distance_m=0.3,
)
LINE = json.dumps(asdict(TRIAL))


def test_a_trial_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "trials.jsonl"
    file.write_text(f"{LINE}\n")
    assert read(file) == [TRIAL]


@pytest.mark.parametrize("line", ["[]", "{}", "{", LINE.replace('"zero_s"', '"zero"')])
def test_a_line_that_is_not_a_trial_is_refused(tmp_path: Path, line: str) -> None:
    file = tmp_path / "trials.jsonl"
    file.write_text(f"{line}\n")
    with pytest.raises(ValueError, match="validation error"):
        read(file)


def test_the_table_has_the_median_and_the_largest_of_each_case() -> None:
    trials = [replace(TRIAL, standstill_s=s, distance_m=s / 2, zero_s=s / 10) for s in (0.9, 0.7, 0.8)]
    assert (
        "| lab_teleop | SIGKILL | stops after 0.5 s | no | 3 | all | 0.080 s | 0.80 (0.90) s | 0.40 (0.45) m |"
        in markdown(trials)
    )


def test_the_table_names_the_robots_that_did_not_stop_and_their_distance_is_a_lower_bound() -> None:
    keeps = replace(TRIAL, robot=KEEPS, standstill_s=None, distance_m=2.5)
    table = markdown([keeps, keeps])
    assert "| keeps the last command | no | 2 | 0 within 5 s | none | none | > 2.50 (2.50) m |" in table


def test_the_rows_without_and_with_lifeline_follow_each_other() -> None:
    without = [TRIAL, replace(TRIAL, fault="SIGSTOP")]
    _, _, *rows = markdown([*without, *(replace(trial, lifeline=True) for trial in without)]).splitlines()
    assert [[row.split(" | ")[column] for column in (1, 3)] for row in rows] == [
        [KILL, "no"],
        [KILL, "yes"],
        ["SIGSTOP", "no"],
        ["SIGSTOP", "yes"],
    ]
