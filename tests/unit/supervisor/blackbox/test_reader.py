"""Reading a black box line by line: skipping, limits, and headers that are wrong."""

import gzip
import json
import os
from pathlib import Path

import pytest

from supervisor.blackbox import reader as blackbox_reader
from supervisor.blackbox.file import FORMAT, VERSION
from supervisor.blackbox.reader import BlackBoxError, BlackBoxReader, read, stops_of
from supervisor.blackbox.recorder import BlackBox
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, WriterAtOnce, rewrite
from tests.unit.supervisor.law.law_harness import CONFIG

STOP = {"now_s": 1000.5, "utc": "2026-07-04T12:00:00.000+00:00", "reasons": ["ESTOP"]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(BlackBox(CONFIG, writer, window_s=60.0, utc=lambda: NOON_UTC_S))
    drive.drive(2.0)
    drive.stop()
    drive.box.close()
    return writer.paths[0]


def test_the_steps_from_a_time_on_are_those_of_the_whole_file(path: Path) -> None:
    reader = BlackBoxReader(path)
    whole = list(reader.steps())
    from_s = whole[40].now_s
    late = list(reader.steps(from_s))
    assert [step.now_s for step in late] == [step.now_s for step in whole[40:]]
    assert [step.decision for step in late] == [step.decision for step in whole[40:]]
    assert len(whole) == reader.header["steps"]


def test_a_file_that_lacks_a_skipped_step_is_truncated(path: Path) -> None:
    rewrite(path, lambda lines: lines.pop(20))
    with pytest.raises(BlackBoxError, match="is truncated"):
        list(BlackBoxReader(path).steps(1e9))


def test_a_file_that_continues_after_its_end_is_refused(path: Path) -> None:
    rewrite(path, lambda lines: lines.append({"state": {}}))
    with pytest.raises(BlackBoxError, match="is truncated"):
        read(path)


def test_a_line_without_end_takes_no_more_memory_than_the_limit(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blackbox_reader, "LINE_LIMIT", 1 << 16)
    with gzip.open(path, "at") as file:
        file.write("0" * (1 << 20))
    with pytest.raises(BlackBoxError, match=r"is damaged after \d+ lines: line \d+ is too long"):
        read(path)


@pytest.mark.parametrize("now_s", [1e9, -1e9, "NaN", "soon"])
def test_a_step_far_from_its_stop_is_damage(path: Path, now_s: object) -> None:
    rewrite(path, lambda lines: lines[30].update(now_s=now_s))
    with pytest.raises(BlackBoxError, match="does not match the types of this law"):
        list(BlackBoxReader(path).steps())


def test_the_header_names_the_topics_of_the_lidars(path: Path) -> None:
    assert BlackBoxReader(path).lidar_topics == ("scan",)
    rewrite(path, lambda lines: lines[0].pop("lidar_topics"))
    assert BlackBoxReader(path).lidar_topics == ("scan",)


def test_a_configuration_of_another_law_is_refused(path: Path) -> None:
    rewrite(path, lambda lines: lines[0].update(config={"mood": "good"}))
    with pytest.raises(BlackBoxError, match=r"the configuration in .* does not match"):
        _ = BlackBoxReader(path).law


def test_what_was_left_out_is_the_sum_of_both_reasons(path: Path) -> None:
    rewrite(path, lambda lines: lines[0].update(left_out_for_memory=3, left_out_for_file_size=4))
    assert BlackBoxReader(path).left_out == 7
    rewrite(path, lambda lines: lines[0].update(left_out_for_memory="many"))
    assert BlackBoxReader(path).left_out == 4


def test_a_stop_has_its_wall_time_in_nanoseconds() -> None:
    (stop,) = stops_of({"stops": [STOP]})
    assert stop.utc_ns == round(NOON_UTC_S * 1e9)
    assert (stop.now_s, stop.utc, stop.reasons) == (1000.5, "2026-07-04T12:00:00.000", ("ESTOP",))


@pytest.mark.parametrize(
    "stops",
    [
        None,
        [],
        [3],
        [{**STOP, "utc": "now"}],
        [{**STOP, "utc": "2026-13-04T12:00:00.000"}],
        [{**STOP, "now_s": None}],
        [{"now_s": 1.0}],
    ],
)
def test_a_header_whose_stops_are_wrong_is_refused(stops: object) -> None:
    with pytest.raises(BlackBoxError, match="names no stop"):
        stops_of({"stops": stops})


@pytest.mark.parametrize(
    "text",
    [
        "[" * 200_000,
        json.dumps({"format": FORMAT, "version": VERSION, "stops": [{**STOP, "now_s": 10**400}]}),
    ],
)
def test_a_header_of_deep_lists_or_huge_numbers_is_refused(tmp_path: Path, text: str) -> None:
    damaged = tmp_path / "damaged.jsonl.gz"
    with gzip.open(damaged, "wt") as file:
        file.write(text)
    with pytest.raises(BlackBoxError):
        BlackBoxReader(damaged)


def test_a_pipe_is_refused_without_waiting_for_its_writer(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.jsonl.gz"
    os.mkfifo(pipe)
    with pytest.raises(BlackBoxError, match="it is a pipe or a device, not a file"):
        BlackBoxReader(pipe)
