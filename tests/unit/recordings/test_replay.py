"""`lifeline replay-decision`: its output and its errors."""

import gzip
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lifeline.cli.app import app
from supervisor.blackbox.file import VERSION
from tests.unit.recordings.test_incident import stopped
from tests.unit.recordings.test_incidents import assert_refused
from tests.unit.supervisor.blackbox.black_boxes import rewrite


def run(path: Path) -> Result:
    return CliRunner().invoke(app, ["replay-decision", str(path)])


def in_one_line(text: str) -> str:
    return " ".join(text.split())


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Neutral, forward, an object at 0.2 m; the base stands 0.3 s later."""
    return stopped(tmp_path)


def test_the_timeline_names_each_change_and_all_decisions_are_the_same(recording: Path) -> None:
    result = run(recording)
    assert result.exit_code == 0, result.output
    text = in_one_line(result.output)
    assert "2026-07-04T12:00:00.000+00:00 OBSTACLE" in text
    assert "-1.020 1.000 DRIVING" in text
    assert "-0.020 0.020 LIMITED" in text
    assert "STOPPED teleop 0.50, 0.00 0.00, 0.00 0.20 OBSTACLE" in text
    assert "the base was at rest 0.32 s after the stop" in text
    assert "83 steps replayed in" in text
    assert "all decisions are the same" in text


def test_a_difference_is_reported_with_its_place_and_exit_code_1(recording: Path) -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        lines[40]["decision"]["scale"] = 0.9999999

    rewrite(recording, change)
    result = run(recording)
    assert result.exit_code == 1
    text = in_one_line(result.output)
    assert "the first difference is in decision.scale" in text
    assert "recorded 0.9999999" in text
    assert "replayed 1.0" in text
    assert "s from the stop, at step time 1000.7" in text


def test_another_machine_is_named_where_the_decisions_differ(recording: Path) -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        lines[0]["numpy"] = "1.0"
        lines[40]["decision"]["owner"] = "joy"

    rewrite(recording, change)
    assert (
        "the environment of the recording differs, which may be the cause: numpy 1.0, here "
        in in_one_line(run(recording).output)
    )


def test_a_file_that_left_something_out_says_so(recording: Path) -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        lines[0]["left_out_for_memory"] = 1234

    rewrite(recording, change)
    assert "1,234 older steps" in run(recording).output


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    assert_refused(run(tmp_path / "none.jsonl.gz"), "cannot read", "No such file")


def test_a_directory_is_refused(tmp_path: Path) -> None:
    assert_refused(run(tmp_path), "cannot read", "directory")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no gzip at all",
        gzip.compress(b"", mtime=0),
        gzip.compress(b"\xff\xfe", mtime=0),
        gzip.compress(b"[1, 2]\n", mtime=0),
        gzip.compress(b'{"format": "another"}\n', mtime=0),
        gzip.compress(b'{"format": "lifeline black box"}\n', mtime=0),
    ],
)
def test_a_file_that_is_no_black_box_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "some.gz"
    path.write_bytes(content)
    assert_refused(run(path), "is not a black box")


@pytest.mark.parametrize("share", [0.3, 0.6, 0.97])
def test_a_file_that_ends_early_is_refused(recording: Path, share: float) -> None:
    whole = recording.read_bytes()
    recording.write_bytes(whole[: int(len(whole) * share)])
    assert_refused(run(recording))


def test_a_file_without_its_last_lines_is_refused(recording: Path) -> None:
    rewrite(recording, lambda lines: lines.pop())
    assert_refused(run(recording), "is truncated")


def test_a_file_that_lacks_a_line_is_refused(recording: Path) -> None:
    rewrite(recording, lambda lines: lines.pop(20))
    assert_refused(run(recording), "is truncated")


def test_a_damaged_file_is_refused(recording: Path) -> None:
    whole = bytearray(recording.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    recording.write_bytes(whole)
    assert_refused(run(recording), "is damaged after")


def test_a_file_of_version_1_had_all_fields_of_the_state_in_one_object(recording: Path) -> None:
    def flatten(lines: list[dict[str, Any]]) -> None:
        lines[0].update(version=1)
        for line in lines:
            if "state" in line:
                state = line["state"]
                for part in ("interlock", "base", "sight", "clock"):
                    state.update(state.pop(part))
                state["sights"], state["odometry_writers"] = state.pop("lidars"), state.pop("writers")

    rewrite(recording, flatten)
    assert "all decisions are the same" in run(recording).output


def test_a_newer_version_is_refused(recording: Path) -> None:
    rewrite(recording, lambda lines: lines[0].update(version=VERSION + 1))
    assert_refused(run(recording), f"has version {VERSION + 1}", "replay it with a newer Lifeline")


def test_a_field_that_this_law_does_not_know_is_named(recording: Path) -> None:
    rewrite(recording, lambda lines: lines[5]["inputs"].update(telepathy=True))
    assert_refused(run(recording), "line 6 ", "Inputs has no telepathy")


def test_a_header_without_a_stop_is_refused(recording: Path) -> None:
    rewrite(recording, lambda lines: lines[0].update(stops=[]))
    assert_refused(run(recording), "names no stop")
