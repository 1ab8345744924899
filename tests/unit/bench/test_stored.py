"""Stored runs of the longer benches: damaged and missing files."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from bench.rig.sheet import Verdict, sentences
from bench.rig.stored import StoredRun, origin, read_rows, rows_of, this_run, was_idle, write_rows


def test_a_stored_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "run.jsonl"
    write_rows(file, {"command": "a"}, [("robots", {"robots": 1})])
    assert read_rows(file) == ({"command": "a"}, [("robots", {"robots": 1})])


def test_a_missing_file_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"none\.jsonl is not a stored run"):
        read_rows(tmp_path / "none.jsonl")


@pytest.mark.parametrize("text", ["", "not JSON\n", "{}\n", "3\n", '{"row": "run"}\n{"robots": 1}\n'])
def test_a_damaged_file_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "run.jsonl"
    file.write_text(text)
    with pytest.raises(RuntimeError, match=r"run\.jsonl is not a stored run"):
        read_rows(file)


@dataclass(frozen=True)
class Times:
    """A measurement."""

    name: str
    times_ms: tuple[float, ...]


def test_figures_are_rounded_and_measurements_are_read_by_their_kind() -> None:
    rows = rows_of("times", [Times("a", (1.23456, 2.0))], digits=2)
    assert rows == [("times", {"name": "a", "times_ms": [1.23, 2.0]})]
    stored = StoredRun({}, [*rows, ("other", {})])
    assert stored.of("times", Times) == (Times("a", (1.23, 2.0)),)


@pytest.mark.parametrize("fields", [{}, {"name": "a"}, {"name": "a", "times_ms": "soon"}])
def test_a_measurement_without_a_field_or_with_another_type_is_refused(fields: dict[str, str]) -> None:
    with pytest.raises(RuntimeError, match="a damaged times"):
        StoredRun({}, [("times", fields)]).of("times", Times)


@pytest.mark.parametrize(
    ("machine", "is_idle"),
    [
        ("2 cores (x86_64), load average 2.0 before and 1.5 during, Linux", True),
        ("2 cores (x86_64), load average 2.0 before, Linux", True),
        ("2 cores (x86_64), load average 2.1, Linux", False),
        ("2 cores (x86_64), load average 0.1 before and 2.1 during, Linux", False),
        ("a machine of which nothing is known", False),
    ],
)
def test_a_machine_was_idle_if_no_load_before_or_during_the_run_exceeded_its_cores(
    machine: str,
    is_idle: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    run = {"command": "a", "date": "today", "machine": machine, "commit": "abc"}
    assert was_idle(run) is is_idle
    assert ("not idle" in origin(run)) is not is_idle
    [sentence] = sentences([Verdict("the time", 3.0, 2.0, "× the reference")], run)
    state = "OVER TARGET by 50 %" if is_idle else "not judged"
    assert sentence == f"{state}: the time 3 × the reference, at most 2 × the reference"


def test_a_run_says_whether_the_machine_was_idle() -> None:
    run = this_run("python -m bench")
    assert run["idle"] == ("yes" if was_idle(run) else "no")
    assert "during" in run["machine"]
