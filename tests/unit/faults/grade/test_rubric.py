"""The rubric of an exam is read strictly."""

import re
from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from faults.grade.marks import Fault
from faults.grade.rubric import DEFAULT, parse, read

TEXT = DEFAULT.read_text()


def test_the_default_rubric_is_valid_and_gives_100_points() -> None:
    rubric = read(None)
    assert sum(getattr(rubric, fault).points for fault in Fault) == 100


def test_a_rubric_of_a_file_is_used(tmp_path: Path) -> None:
    file = tmp_path / "rubric.toml"
    file.write_text(TEXT.replace("points = 25", "points = 7"))
    assert read(file).killed.points == 7


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("points = 25", "points = -1", "killed.points = -1: must be from 0 to 1000"),
        ("points = 25", 'points = "25"', "killed.points = '25'"),
        ("points = 25", "points = 25\npint = 1", "killed.pint: there is no such key"),
        ("standstill_s = 1.0", "standstill_s = nan", "killed.standstill_s = nan: must be from 0.05 to 4"),
        ("standstill_s = 1.0", "standstill_s = inf", "killed.standstill_s = inf"),
        ("standstill_s = 1.0", "standstill_s = 4.1", "watched for 4 s"),
        ("[second]", "[secnd]", "second: is missing"),
        ("[second]", "[secnd]", "secnd: there is no such key"),
        ("pass_percent = 50", "pass_percent = 101", "pass_percent = 101: must be from 0 to 100"),
        ("drive_m_s = 0.5", "", "drive_m_s: is missing"),
        ("ahead_m = 1.0", "ahead_m = 5.0", "obstacle.ahead_m = 5.0"),
    ],
)
def test_each_fault_of_a_rubric_is_named(old: str, new: str, named: str) -> None:
    with pytest.raises(DeployError, match=re.escape(named)) as refused:
        parse(TEXT.replace(old, new, 1), "mine.toml")
    assert "mine.toml" in str(refused.value)
    assert "--print-rubric" in str(refused.value)


def test_all_faults_of_a_rubric_are_named_at_once() -> None:
    with pytest.raises(DeployError) as refused:
        parse(TEXT.replace("points = 25", "points = -1").replace("points = 20", "points = -2"), "mine.toml")
    assert "killed.points" in str(refused.value)
    assert "stopped.points" in str(refused.value)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"points = ", "is not TOML"),
        (b"\xff\xfe", "it is not text"),
        (b"x = 1\n" * (1 << 20), "it is larger"),
    ],
)
def test_a_file_that_is_no_rubric_is_refused(tmp_path: Path, content: bytes, named: str) -> None:
    file = tmp_path / "rubric.toml"
    file.write_bytes(content)
    with pytest.raises(DeployError, match=named):
        read(file)


def test_a_missing_file_is_named_with_the_way_to_get_one(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match=r"nothing\.toml: No such file.*--print-rubric"):
        read(tmp_path / "nothing.toml")
