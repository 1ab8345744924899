"""`lifeline grade` on the real simulator, with a small program over Zenoh."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from faults.grade import leftovers
from faults.grade.report import from_json
from faults.grade.rubric import DEFAULT
from tests.system.commands import run_here
from tests.system.ports import free_endpoint

ROOT = Path(__file__).parents[2]
STUDENT = (sys.executable, str(Path(__file__).with_name("student_teleop.py")), "{endpoint}")
FAULTS = ("killed", "stopped", "resumed", "unplugged", "garbage", "obstacle", "second")
LIMIT_S, POLL_S = 110.0, 0.05


def rubric(folder: Path, *faults: str) -> Path:
    """Write a rubric in which only some faults have points."""
    text = DEFAULT.read_text()
    for fault in set(FAULTS) - set(faults):
        begin = text.index(f"[{fault}]")
        text = text[:begin] + text[begin:].replace("points = ", "points = 0 # ", 1)
    file = folder / "rubric.toml"
    file.write_text(text)
    return file


def start(folder: Path, options: Sequence[str], program: Sequence[str]) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "lifeline.cli.app", "grade", "--endpoint", free_endpoint(), *options]
    return subprocess.Popen(
        [*command, "--", *program],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(folder), "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def grade(
    folder: Path, options: Sequence[str], program: Sequence[str], code: int
) -> tuple[str, dict[str, float]]:
    """Grade a program; return the output, and the share of the points for each fault."""
    file = folder / "grade.json"
    with start(folder, ["--json", str(file), *options], program) as process:
        output, _ = process.communicate(timeout=LIMIT_S)
    assert process.returncode == code, output
    marks = from_json(file.read_text()).marks if file.exists() else ()
    return output, {one.fault.value: one.points / one.of for one in marks if one.of}


def test_a_bare_teleop_leaves_the_robot_driving_and_two_of_them_fight(tmp_path: Path) -> None:
    page, xml = tmp_path / "grade.html", tmp_path / "grade.xml"
    files = ["--html", str(page), "--junit", str(xml)]
    only = ["--rubric", str(rubric(tmp_path, "killed", "unplugged", "second"))]
    output, marks = grade(tmp_path, ["--keys", "w", "--stop-key", "s", *files, *only], STUDENT, 1)
    assert marks == {"killed": 0.0, "unplugged": 0.0, "second": 0.0}, output
    assert "the two instances fought" in output
    assert page.read_text().count("<svg") == 3
    assert ET.parse(xml).getroot().get("failures") == "3"


def test_what_the_program_starts_may_stop_the_robot_unless_it_is_killed_too(tmp_path: Path) -> None:
    options = ["--keys", "w", "--stop-key", "s", "--rubric", str(rubric(tmp_path, "killed"))]
    output, marks = grade(tmp_path, options, (*STUDENT, "--guard"), 0)
    assert marks["killed"] > 0.0, output
    output, marks = grade(tmp_path, [*options, "--group"], (*STUDENT, "--guard"), 1)
    assert marks["killed"] == 0.0, output


def test_a_rest_before_a_pillar_is_no_stop_and_a_second_instance_that_begins_too_late_is_not_tested(
    tmp_path: Path,
) -> None:
    file = tmp_path / "grade.json"
    only = ["--rubric", str(rubric(tmp_path, "obstacle", "second"))]
    output, marks = grade(tmp_path, only, (*STUDENT, "--patrol"), 1)
    assert marks["obstacle"] == 0.0, output
    (second,) = (one for one in from_json(file.read_text()).marks if one.fault == "second")
    assert second.observed is None, output
    assert "the second instance printed nothing" in second.sentence


def test_a_rubric_without_points_grades_nothing(tmp_path: Path) -> None:
    output, marks = grade(tmp_path, ["--rubric", str(rubric(tmp_path))], STUDENT, 2)
    assert "could not be graded: the rubric gives no points" in output
    assert marks == {}


def test_behind_the_supervisor_lifelines_teleop_stops_and_stays_stopped(tmp_path: Path) -> None:
    teleop = (sys.executable, "-m", "teleop", "--endpoint", "{endpoint}")
    only = ["--rubric", str(rubric(tmp_path, "killed", "stopped", "resumed"))]
    output, marks = grade(
        tmp_path, ["--through-lifeline", "--keys", "w", "--stop-key", "s", *only], teleop, 0
    )
    assert min(marks.values()) > 0.0, output
    assert marks["resumed"] == 1.0, output


@pytest.mark.smoke
def test_a_program_that_ends_cannot_be_graded_and_its_last_lines_say_why(tmp_path: Path) -> None:
    ends = (sys.executable, "-c", "raise SystemExit('no \\x1b[31mkeyboard')")
    output, marks = grade(tmp_path, [], ends, 2)
    assert "it ended before the fault; it ended with code 1" in output
    assert "no keyboard" in output
    assert marks == {}


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--hold"], "--hold needs --keys"),
        (["--through-lifeline", "--base-timeout", "1"], "--base-timeout is for a robot alone"),
        (["--endpoint", "quic/127.0.0.1:7447"], "must be of this machine"),
        (["--endpoint", "tcp/0.0.0.0:7447"], "must be of this machine"),
        (["--keys", "w" * 41], "at most 40 keys"),
        (["--endpoint", "nowhere"], "expected PROTOCOL/HOST:PORT"),
        (["--json", "/nowhere/grade.json"], "the directory of /nowhere/grade.json does not exist"),
        (["--rubric", "/nowhere.toml"], "cannot read the rubric"),
    ],
)
def test_wrong_options_are_refused_in_one_sentence(options: list[str], named: str) -> None:
    code, output, errors = run_here(["grade", *options, "--", "true"], os.environ)
    assert (code, output) == (2, "")
    assert named in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGHUP, 129), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_an_exam_that_is_ended_early_leaves_nothing_behind(
    tmp_path: Path, number: signal.Signals, code: int
) -> None:
    with start(tmp_path, ["--keys", "w", "--stop-key", "s"], STUDENT) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if "driving" in line:
                break
        until(lambda: any("student_teleop" in one for one in marked(tmp_path)))
        process.send_signal(number)
        process.communicate(timeout=LIMIT_S)
    assert process.returncode == code
    until(lambda: not marked(tmp_path) and not list(tmp_path.glob("lifeline-grade-*")))


def marked(folder: Path) -> list[str]:
    """Return the command lines of the running processes of an exam."""
    found: list[str] = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if f"{leftovers.MARK}={folder}".encode() in (process / "environ").read_bytes():
                found.append((process / "cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return found


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LIMIT_S / 4
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(POLL_S)
