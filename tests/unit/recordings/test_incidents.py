"""`lifeline incidents`: list, show and export, and their errors."""

import gzip
import json
import re
import shutil
from collections import Counter
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner, Result

from deploy.stack.errors import DeployError
from lifeline.cli.app import app
from recordings.incidents import commands as incidents
from recordings.incidents.incident import find
from recordings.recording import RecordingReader, RecordingWriter
from tests.unit.recordings.test_incident import stopped
from tests.unit.recordings.test_incident_summary import lost_at
from tests.unit.supervisor.law.law_harness import BACK, SPIN
from wire.messages import SafetyStatus, decode

NAME = "20260704T120000.000Z-SOURCE_LOST"


@pytest.fixture
def state(tmp_path: Path) -> Path:
    lost_at(tmp_path / "blackbox")
    return tmp_path


def black_box(state: Path) -> Path:
    return state / "blackbox" / f"{NAME}.jsonl.gz"


def copy_as(state: Path, name: str) -> Path:
    return Path(shutil.copy(black_box(state), state / "blackbox" / f"{name}.jsonl.gz"))


def run(state: Path, *arguments: str) -> Result:
    return CliRunner().invoke(app, ["incidents", *arguments, "--state-dir", str(state)])


def assert_refused(result: Result, *words: str) -> None:
    assert result.exit_code == 2, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    sentence = result.stderr.strip()
    assert sentence.startswith("lifeline: ")
    assert "\n" not in sentence
    for word in words:
        assert word in sentence


# --- list


def test_the_list_has_one_row_for_each_incident(state: Path) -> None:
    copy_as(state, "20260704T130000.500Z-SOURCE_LOST")
    result = run(state, "list")
    assert result.exit_code == 0, result.output
    header, first, second = (
        result.stdout.splitlines()[0],
        *(line for line in result.stdout.splitlines() if line.startswith("2026")),
    )
    assert header.split()[:3] == ["ID", "(UTC)", "reasons"]
    assert first.startswith("20260704T120000.000Z  SOURCE_LOST")
    assert "teleop" in first
    assert "0.50 m/s" in first
    assert "0.08 m" in first
    assert second.startswith("20260704T130000.500Z")


def test_files_of_the_same_time_have_their_whole_names(state: Path) -> None:
    copy_as(state, "20260704T120000.000Z-SOURCE_LOST-2")
    result = run(state, "list")
    assert f"{NAME} " in result.stdout
    assert f"{NAME}-2 " in result.stdout


def test_a_damaged_and_a_foreign_file_have_rows_and_do_not_end_the_list(state: Path) -> None:
    damaged = copy_as(state, "20260704T110000.000Z-ESTOP")
    damaged.write_bytes(damaged.read_bytes()[:-100])
    copy_as(state, "20260704T113000.000Z-ESTOP").write_bytes(b"\x1b[31mnonsense")
    (state / "blackbox" / "notes.txt").write_text("mine")
    result = run(state, "list")
    assert result.exit_code == 0
    text = " ".join(result.stdout.split())
    assert "damaged after" in text
    assert "not a black box" in text
    assert NAME[:20] in text
    assert "notes" not in text
    documents = json.loads(run(state, "list", "--json").stdout)
    assert [document["id"] for document in documents] == [
        "20260704T110000.000Z-ESTOP",
        "20260704T113000.000Z-ESTOP",
        NAME,
    ]
    assert ["damaged" in documents[0]["problem"], "not a black box" in documents[1]["problem"]] == [
        True,
        True,
    ]
    assert documents[2]["problem"] is None


def test_a_robot_that_never_stopped_has_no_incidents(tmp_path: Path) -> None:
    result = run(tmp_path, "list")
    assert result.exit_code == 0
    assert "no incidents in" in result.stdout
    assert json.loads(run(tmp_path, "list", "--json").stdout) == []


def test_a_directory_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "blackbox").write_text("a file")
    assert_refused(run(tmp_path, "list"), "cannot read", "--state-dir")


def test_the_configuration_names_the_directory(state: Path, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'[supervisor]\nblack_box_dir = "{state / "blackbox"}"\n')
    result = run(tmp_path / "elsewhere", "list", "--config", str(config), "--json")
    assert [document["id"] for document in json.loads(result.stdout)] == [NAME]
    config.write_text("[supervisor]\nblack_box_dir = 3\n")
    refused = run(state, "list", "--config", str(config))
    assert refused.exit_code == 2
    assert "supervisor.black_box_dir" in refused.stderr


# --- which incident


@pytest.mark.parametrize("name", [NAME, f"{NAME}.jsonl.gz", "last", "2026", "20260704T120000.000Z"])
def test_an_incident_has_a_name_a_beginning_or_is_the_last(state: Path, name: str) -> None:
    assert find(state / "blackbox", name) == black_box(state)


def test_a_name_that_is_the_beginning_of_another_is_not_ambiguous(state: Path) -> None:
    copy_as(state, f"{NAME}-2")
    assert find(state / "blackbox", NAME) == black_box(state)
    with pytest.raises(DeployError, match="2 incidents begin with '2026'"):
        find(state / "blackbox", "2026")


def test_a_copied_file_is_named_by_its_path(state: Path, tmp_path: Path) -> None:
    moved = black_box(state).rename(tmp_path / "from-the-robot.jsonl.gz")
    result = run(state, "show", str(moved), "--json")
    assert json.loads(result.stdout)["id"] == "from-the-robot"


@pytest.mark.parametrize("name", ["1999", "", "\x1b[31m"])
def test_an_incident_that_is_not_there_is_refused(tmp_path: Path, name: str) -> None:
    result = run(tmp_path, "show", name)
    assert_refused(result, "no incidents", "lifeline incidents list")
    assert "\x1b" not in result.stderr


# --- show


def test_show_prints_the_summary_the_table_and_two_plots(state: Path) -> None:
    result = run(state, "show", "last")
    assert result.exit_code == 0, result.output
    text = " ".join(result.stdout.split())
    assert "stop 2026-07-04 12:00:00.000 UTC" in text
    assert "+0.000 s SOURCE_LOST: command source lost" in text
    assert "speed 0.50 m/s, by odometry" in text
    assert re.search(r"stopping 0\.\d+ m in 0\.32 s, by odometry", text)
    assert re.search(r"\+0\.000 STOPPED 0\.50 0\.00 0\.50 2\.7\d SOURCE_LOST", text)
    assert "· requested ─ permitted ● measured" in text
    assert "─ stop distance 0.30 ● nearest" in text
    assert max(map(len, result.stdout.splitlines())) <= 80


def test_show_prints_turn_rates_only_of_a_robot_that_turns(tmp_path: Path) -> None:
    lost_at(tmp_path / "blackbox", SPIN)
    text = " ".join(run(tmp_path, "show", "last").stdout.split())
    assert "0.00, 1.00" in text
    assert "turn rate, rad/s:" in text
    assert "speed 1.00 rad/s" in text


def test_show_prints_backward_motion_below_zero(tmp_path: Path) -> None:
    lost_at(tmp_path / "blackbox", BACK)
    assert " -0.50 ┤" in run(tmp_path, "show", "last").stdout


def test_show_as_json_has_the_samples(state: Path) -> None:
    document = json.loads(run(state, "show", "last", "--seconds", "0.5", "--json").stdout)
    assert document["speed_m_s"] == 0.5
    assert document["samples"][0]["time_s"] >= -0.5
    assert document["samples"][-1]["mode"] == "STOPPED"


def test_show_of_a_damaged_file_prints_what_can_be_read(state: Path) -> None:
    path = black_box(state)
    path.write_bytes(path.read_bytes()[:-200])
    result = run(state, "show", "last")
    assert result.exit_code == 1
    assert "damaged after" in " ".join(result.stdout.split())
    assert json.loads(run(state, "show", "last", "--json").stdout)["problem"]


def test_show_of_a_file_without_a_header_is_refused(state: Path) -> None:
    black_box(state).write_bytes(gzip.compress(b"{}\n"))
    assert_refused(run(state, "show", "last"), "is not a black box")


def test_show_of_a_file_that_ends_before_its_stop_prints_the_stop(state: Path) -> None:
    path = black_box(state)
    path.write_bytes(path.read_bytes()[:2500])
    result = run(state, "show", "last", "--seconds", "0.1")
    assert result.exit_code == 1
    assert "SOURCE_LOST: command source lost" in result.stdout
    assert "●" not in result.stdout
    assert f"{NAME[:20]}  SOURCE_LOST" in run(state, "list").stdout


def test_show_prints_what_was_left_out_and_the_detail_of_the_first_cause(tmp_path: Path) -> None:
    path = stopped(tmp_path / "blackbox")
    with gzip.open(path, "rt") as file:
        header, *lines = file
    with gzip.open(path, "wt") as file:
        file.writelines([json.dumps(json.loads(header) | {"left_out_for_memory": 1234}) + "\n", *lines])
    text = run(tmp_path, "show", "last").stdout
    assert "left out  1,234 older steps, for lack of space" in text
    assert "detail    something" in text


def with_people(path: Path, people: object) -> None:
    with gzip.open(path, "rt") as file:
        header, *lines = file
    with gzip.open(path, "wt") as file:
        file.writelines([json.dumps(json.loads(header) | {"people": people}) + "\n", *lines])


def test_show_names_who_drove_and_who_stopped_as_foreign_text(state: Path) -> None:
    acts = [
        {"utc": "2026-07-04T11:59:01.000+00:00", "by": "teleop", "text": "Anna began to drive"},
        {"utc": "2026-07-04T12:00:00.001+00:00", "by": "e-stop", "text": "pressed by \x1b[2J"},
    ]
    with_people(black_box(state), acts)
    text = run(state, "show", "last").stdout
    assert "people    2026-07-04 11:59:01 UTC  teleop: Anna began to drive" in text
    assert "e-stop: pressed by ?[2J" in text
    assert json.loads(run(state, "show", "last", "--json").stdout)["people"][1]["text"] == "pressed by ?[2J"


@pytest.mark.parametrize("people", [1, "Anna", {"utc": 1}, [1], [{"utc": "x"}], [None]])
def test_people_of_a_damaged_header_are_damage(state: Path, people: object) -> None:
    with_people(black_box(state), people)
    assert_refused(run(state, "show", "last"), "is damaged")


def test_the_table_has_no_rows_that_repeat_a_robot_at_rest(tmp_path: Path) -> None:
    lost_at(tmp_path / "blackbox", after_s=1.5)
    rows = [line for line in run(tmp_path, "show", "last").stdout.splitlines() if "STOPPED" in line]
    assert 2 < len(rows) < 7
    assert len(json.loads(run(tmp_path, "show", "last", "--json").stdout)["samples"]) > 75


def test_a_long_table_ends_with_the_number_of_its_other_rows(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incidents, "MAX_ROWS", 3)
    text = run(state, "show", "last").stdout
    assert re.search(r"… +\d+ more rows: see --json", " ".join(text.split()))


# --- export


def test_an_export_is_a_recording_that_rosbags_reads(state: Path, tmp_path: Path) -> None:
    file = tmp_path / "incident.mcap"
    result = run(state, "export", "last", str(file))
    assert result.exit_code == 0, result.output
    with AnyReader([file]) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        total = reader.message_count
    assert set(counts) == {
        "/robot/teleop/cmd_vel",
        "/robot/scan",
        "/robot/odom",
        "/robot/cmd_vel",
        "/robot/supervisor/status",
    }
    assert counts == Counter(message.topic for message in RecordingReader(file).messages())
    assert f"{total:,} messages" in result.stdout
    assert f"{counts['/robot/scan']}" in result.stdout


def test_an_export_has_the_namespace_of_the_robot(state: Path, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[bus]\nnamespace = "r2"\n')
    file = tmp_path / "incident.mcap"
    assert run(state, "export", "last", str(file), "--config", str(config)).exit_code == 0
    assert {message.topic.split("/")[1] for message in RecordingReader(file).messages()} == {"r2"}


def test_an_export_never_overwrites_a_file(state: Path, tmp_path: Path) -> None:
    file = tmp_path / "incident.mcap"
    file.write_text("mine")
    assert_refused(run(state, "export", "last", str(file)), "already exists")
    assert file.read_text() == "mine"


def test_an_export_to_no_directory_is_refused(state: Path, tmp_path: Path) -> None:
    assert_refused(
        run(state, "export", "last", str(tmp_path / "none" / "a.mcap")), "cannot write", "No such file"
    )


def test_an_export_without_room_leaves_no_file(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(RecordingWriter, "write", full)
    file = tmp_path / "incident.mcap"
    assert_refused(
        run(state, "export", "last", str(file)), "cannot write", "No space left", "free disk space"
    )
    assert not file.exists()


def test_an_export_that_is_interrupted_leaves_no_file(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(RecordingWriter, "write", interrupted)
    file = tmp_path / "incident.mcap"
    assert run(state, "export", "last", str(file)).exit_code == 130
    assert not file.exists()


def test_an_export_of_a_damaged_file_has_what_can_be_read(state: Path, tmp_path: Path) -> None:
    path = black_box(state)
    path.write_bytes(path.read_bytes()[:-200])
    file = tmp_path / "incident.mcap"
    result = run(state, "export", "last", str(file))
    assert result.exit_code == 1
    assert "the recording ends early" in result.stdout
    reader = RecordingReader(file)
    statuses = [m for m in reader.messages() if m.topic == "/robot/supervisor/status"]
    assert not reader.cut
    assert decode(statuses[0].payload, SafetyStatus).mode == SafetyStatus.READY


def test_an_export_of_nothing_leaves_no_file(state: Path, tmp_path: Path) -> None:
    black_box(state).write_bytes(b"nonsense")
    file = tmp_path / "incident.mcap"
    assert_refused(run(state, "export", "last", str(file)), "is not a black box")
    assert not file.exists()


def test_an_export_without_a_step_leaves_no_file(state: Path, tmp_path: Path) -> None:
    path = black_box(state)
    with gzip.open(path, "rt") as file:
        header = file.readline()
    with gzip.open(path, "wt") as file:
        file.write(header + '{"end":true,"steps":0}\n')
    recording = tmp_path / "incident.mcap"
    assert_refused(run(state, "export", "last", str(recording)), "contains no messages")
    assert not recording.exists()
