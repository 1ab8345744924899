"""Stored runs of the longer benches: damaged and missing files."""

from pathlib import Path

import pytest

from bench.rig.stored import read_rows, write_rows


def test_a_stored_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "run.jsonl"
    write_rows(file, {"command": "a"}, [("robots", {"robots": 1})])
    assert read_rows(file) == ({"command": "a"}, [("robots", {"robots": 1})])


def test_a_missing_file_is_no_run(tmp_path: Path) -> None:
    assert read_rows(tmp_path / "none.jsonl") is None


@pytest.mark.parametrize("text", ["", "not JSON\n", "{}\n", "3\n", '{"row": "run"}\n{"robots": 1}\n'])
def test_a_damaged_file_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "run.jsonl"
    file.write_text(text)
    with pytest.raises(RuntimeError, match=r"run\.jsonl is not a stored run"):
        read_rows(file)
