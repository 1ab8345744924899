"""The black box: recording, writing, and replay with the same decisions."""

import gzip
import json
import logging
import os
import tempfile
import threading
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from recordings.incidents.replay import replay
from supervisor.__main__ import black_box
from supervisor.blackbox import recorder as blackbox
from supervisor.blackbox.file import LAW, VERSION, Order, pack_state, write
from supervisor.blackbox.reader import BlackBoxError, Document, read
from supervisor.blackbox.recorder import (
    MEMORY_BYTES,
    SEGMENT_BYTES,
    TAIL_LIMIT_S,
    TAIL_S,
    BlackBox,
    ThreadWriter,
)
from supervisor.config import SupervisorSection
from supervisor.law.decision import Mode
from supervisor.law.model import Inputs, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.slip import ReferenceScan, SlipMeasurement
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, KeepingWriter, WriterAtOnce
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, TICK_S, lost, on_time
from wire.host.installation import ENVIRONMENT
from wire.reasons import StopReason

WINDOW_S = 60.0


def box_of(writer: blackbox.Writer, window_s: float = WINDOW_S) -> BlackBox:
    return BlackBox(CONFIG, writer, window_s=window_s, utc=lambda: NOON_UTC_S)


@pytest.fixture
def writer(tmp_path: Path) -> WriterAtOnce:
    return WriterAtOnce(tmp_path / "blackbox")


@pytest.fixture
def drive(writer: WriterAtOnce) -> Drive:
    return Drive(box_of(writer))


def steps_of(document: Document) -> list[dict[str, Any]]:
    return [line for line in document.lines if "inputs" in line]


# --- when it writes


def test_a_supervisor_that_never_moved_writes_nothing(drive: Drive, writer: WriterAtOnce) -> None:
    assert drive.step(Inputs()).mode is Mode.STOPPED
    assert drive.hold(1.0).mode is Mode.READY
    assert drive.step(Inputs(liveliness=lost())).mode is Mode.STOPPED
    drive.hold(5.0)
    drive.box.close()
    assert writer.paths == []


def test_a_stop_is_written_with_the_two_seconds_after_it(drive: Drive, writer: WriterAtOnce) -> None:
    drive.drive()
    assert drive.stop().reasons == (StopReason.OBSTACLE,)
    stop_s = drive.now_s
    drive.hold(TAIL_S - TICK_S)
    assert writer.paths == []
    drive.hold(2 * TICK_S)
    (path,) = writer.paths
    assert path.name == "20260704T120000.000Z-OBSTACLE.jsonl.gz"
    document = read(path)
    assert document.header["stops"] == [
        {"now_s": stop_s, "utc": "2026-07-04T12:00:00.000+00:00", "reasons": ["OBSTACLE"]}
    ]
    steps = steps_of(document)
    assert steps[0]["now_s"] == document.header["first_s"] == 1000.0 + TICK_S
    assert steps[-1]["now_s"] == document.header["last_s"] == pytest.approx(stop_s + TAIL_S, abs=TICK_S)
    assert len(steps) == document.header["steps"]


@pytest.mark.parametrize("reason", ["left", "e-stop"])
def test_a_stop_at_rest_is_not_written(drive: Drive, writer: WriterAtOnce, reason: str) -> None:
    drive.drive()
    assert drive.hold(1.0).mode is Mode.READY
    decision = drive.step(Inputs(liveliness=lost()) if reason == "left" else Inputs(estop=True))
    assert decision.mode is Mode.STOPPED
    drive.hold(TAIL_S + TICK_S)
    drive.box.close()
    assert writer.paths == []


def test_a_stop_while_the_robot_still_brakes_is_written(drive: Drive, writer: WriterAtOnce) -> None:
    drive.drive()
    drive.step(Inputs(commands=(on_time("teleop", NEUTRAL, drive.now_s + TICK_S),)))
    rolling = Odometry(FORWARD, drive.now_s + TICK_S)
    assert drive.step(Inputs(odometry=rolling)).mode is Mode.READY
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_S + TICK_S)  # odometry that falls silent meanwhile is less severe
    assert [path.name[21:] for path in writer.paths] == ["ESTOP.jsonl.gz"]


def test_a_second_reason_while_the_robot_still_brakes_belongs_to_the_file_and_may_name_it(
    drive: Drive, writer: WriterAtOnce
) -> None:
    drive.drive()
    drive.step(Inputs(liveliness=lost()))
    drive.step(Inputs(estop=True))
    drive.hold(2 * TAIL_S)
    (path,) = writer.paths
    assert path.name[21:] == "ESTOP.jsonl.gz"
    assert [told["reasons"] for told in read(path).header["stops"]] == [["SOURCE_LOST"], ["ESTOP"]]


@pytest.mark.parametrize("stopped", [False, True])
def test_a_base_that_runs_away_from_rest_is_written(
    drive: Drive, writer: WriterAtOnce, *, stopped: bool
) -> None:
    drive.drive()
    drive.hold(2.0, NEUTRAL)
    if stopped:
        drive.step(Inputs(estop=True))
    still = Odometry(NEUTRAL, drive.now_s + TICK_S)
    drive.step(Inputs(odometry=still))
    drive.hold(0.2, NEUTRAL)
    assert drive.step(Inputs(odometry=Odometry(FORWARD, drive.now_s + TICK_S))).alarm
    drive.hold(2 * TAIL_S, NEUTRAL)
    assert [path.name[21:] for path in writer.paths] == ["BASE_RUNAWAY.jsonl.gz"]


def test_a_stop_at_the_slowest_speed_is_written(drive: Drive, writer: WriterAtOnce) -> None:
    drive.hold(1.0)
    drive.hold(1.0, Velocity(CONFIG.creep_m_s, 0.0))
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_S + TICK_S)
    assert [path.name[21:] for path in writer.paths] == ["ESTOP.jsonl.gz"]


@pytest.mark.parametrize(("later_s", "files"), [(0.28, 1), (0.32, 0)])
def test_a_stop_that_is_confirmed_a_moment_after_a_slow_robot_stands_is_written(
    drive: Drive, writer: WriterAtOnce, later_s: float, files: int
) -> None:
    """At an obstacle, the scan after the one that stops the robot confirms it."""
    drive.hold(1.0)
    drive.hold(1.0, Velocity(CONFIG.creep_m_s, 0.0))
    drive.hold(later_s)
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_S + TICK_S)
    assert len(writer.paths) == files


def test_a_source_that_waits_with_an_old_reason_writes_nothing_when_the_owner_lets_go(
    drive: Drive, writer: WriterAtOnce
) -> None:
    drive.drive()
    for velocity in (FORWARD, NEUTRAL):
        arrival_s = drive.now_s + TICK_S
        pushed = on_time("joy", FORWARD, arrival_s)
        decision = drive.step(Inputs(commands=(on_time("teleop", velocity, arrival_s), pushed)))
    assert (decision.owner, decision.mode) == ("joy", Mode.STOPPED)
    drive.hold(2 * TAIL_S, NEUTRAL)
    assert writer.paths == []


def test_a_stop_while_a_base_without_odometry_still_brakes_is_written(
    drive: Drive, writer: WriterAtOnce
) -> None:
    """The command has been zero for some steps: only the base's ramps show that it may still move."""
    drive.drive()
    for _ in range(5):
        assert drive.step(Inputs(commands=(on_time("teleop", NEUTRAL, drive.now_s),))).mode is Mode.READY
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_S + TICK_S)
    assert [path.name[21:] for path in writer.paths] == ["ESTOP.jsonl.gz"]


def test_a_file_with_several_stops_is_named_after_the_most_severe(drive: Drive, writer: WriterAtOnce) -> None:
    drive.drive()
    drive.stop()
    drive.drive()
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_S + TICK_S)
    assert [path.name[21:] for path in writer.paths] == ["ESTOP.jsonl.gz"]


def test_a_stop_that_lasts_is_written_once(drive: Drive, writer: WriterAtOnce) -> None:
    drive.drive()
    drive.step(Inputs(estop=True))
    drive.hold(TAIL_LIMIT_S + TAIL_S + 1.0)
    assert len(writer.paths) == 1


def test_a_new_stop_within_the_tail_is_in_the_same_file_and_has_its_own_tail(
    drive: Drive, writer: WriterAtOnce
) -> None:
    drive.drive()
    drive.stop()
    drive.drive()
    drive.stop()
    second_s = drive.now_s
    drive.hold(TAIL_S + TICK_S)
    (path,) = writer.paths
    header = read(path).header
    assert len(header["stops"]) == 2
    assert header["last_s"] >= second_s + TAIL_S


def test_stops_that_never_end_are_written_all_the_same(drive: Drive, writer: WriterAtOnce) -> None:
    drive.drive()
    drive.stop()
    first_s = drive.now_s
    while not writer.paths:
        drive.drive()
        drive.stop()
    assert drive.now_s == pytest.approx(first_s + TAIL_LIMIT_S, abs=1.0)


def test_a_stop_after_the_tail_has_a_file_of_its_own(drive: Drive, writer: WriterAtOnce) -> None:
    for _ in range(2):
        drive.drive()
        drive.stop()
        drive.hold(TAIL_S + TICK_S)
    assert [path.name for path in writer.paths] == [
        "20260704T120000.000Z-OBSTACLE.jsonl.gz",
        "20260704T120000.000Z-OBSTACLE-2.jsonl.gz",
    ]


def test_a_supervisor_that_ends_writes_what_still_waits_for_its_tail(
    drive: Drive, writer: WriterAtOnce
) -> None:
    drive.drive()
    drive.stop()
    drive.hold(0.5)
    drive.box.close()
    assert read(writer.paths[0]).header["last_s"] == drive.now_s


# --- recording


@pytest.mark.long
def test_the_window_reaches_back_60_s_from_the_stop_and_begins_with_an_older_state(
    drive: Drive, writer: WriterAtOnce
) -> None:
    decision = drive.hold(1.0)
    for _ in range(round((WINDOW_S + 5.0) / TICK_S)):
        drive.now_s += TICK_S
        drive.box.record(drive.now_s, Inputs(scans=(drive.scan(drive.now_s),)), drive.state, decision)
    drive.drive()
    drive.stop()
    stop_s = drive.now_s
    drive.hold(TAIL_S + TICK_S)
    document = read(writer.paths[0])
    assert "state" in document.lines[0]
    assert stop_s - WINDOW_S - 1.1 < document.header["first_s"] <= stop_s - WINDOW_S
    assert document.header["left_out_for_memory"] == 0


@pytest.mark.long
def test_60_s_of_150_steps_a_second_and_360_beams_take_less_than_15_mb_in_few_pieces() -> None:
    """Few pieces, found by a soak: thousands of small blocks fragmented the heap, by 2.5 % in 40 minutes."""
    state = initial_state(CONFIG)
    drive = Drive(box_of(KeepingWriter()))
    _, decision = step(state, 1000.0, Inputs())
    tracemalloc.start()
    try:
        for i in range(150 * 70):
            now_s = 1000.0 + i / 150
            command = on_time("teleop", Velocity(0.1, i * 1e-5), now_s)
            scans = (drive.scan(now_s),) if i % 7 == 0 else ()
            drive.box.record(now_s, Inputs((command,), scans=scans), state, decision)
        used, _ = tracemalloc.get_traced_memory()
        taken = tracemalloc.take_snapshot().filter_traces(
            [tracemalloc.Filter(inclusive=True, filename_pattern="*/supervisor/blackbox*.py")]
        )
    finally:
        tracemalloc.stop()
    assert used < 15_000_000
    assert drive.box.size == pytest.approx(used, rel=0.2)
    pieces = sum(statistic.count for statistic in taken.statistics("filename"))
    assert sum(statistic.size for statistic in taken.statistics("filename")) > 500_000
    assert pieces < 20 * WINDOW_S, "of nine thousand steps"


def test_the_scan_before_a_stop_takes_8_bytes_for_each_beam_of_a_recorded_state() -> None:
    drive = Drive(box_of(KeepingWriter()))
    drive.tick()
    lidar = drive.state.sight.lidars[0]
    assert lidar.scan is not None
    assert lidar.scan.view is not None
    slip = SlipMeasurement(drive.now_s, ReferenceScan.of(lidar.scan.view))
    sight = drive.state.sight._replace(lidars=(lidar._replace(slip=slip),))
    more = len(pack_state(drive.state._replace(sight=sight))) - len(pack_state(drive.state))
    beams = lidar.scan.view.geometry.beams
    assert 8 * beams < more < 8 * beams + 200


def test_a_flood_of_10_000_commands_a_second_is_bounded_in_bytes_and_the_header_says_what_is_missing() -> (
    None
):
    keeping = KeepingWriter()
    drive = Drive(box_of(keeping))
    decision = drive.drive()
    flood = tuple(on_time("teleop", FORWARD, drive.now_s) for _ in range(32))
    most = 0
    for _ in range(int(10_000 / 32 * 30.0)):
        drive.now_s += 0.0032
        drive.box.record(drive.now_s, Inputs(flood), drive.state, decision)
        most = max(most, drive.box.size)
    assert MEMORY_BYTES - SEGMENT_BYTES < most <= MEMORY_BYTES
    drive.stop()
    drive.box.close()
    assert keeping.orders[0].header["left_out_for_memory"] > 0


def test_a_flood_after_the_stop_does_not_push_the_stop_out() -> None:
    keeping = KeepingWriter()
    drive = Drive(box_of(keeping))
    drive.drive()
    decision = drive.stop()
    stop_s = drive.now_s
    flood = tuple(on_time("teleop", FORWARD, drive.now_s) for _ in range(10_000))
    while not keeping.orders:
        drive.now_s += 1e-4
        drive.box.record(drive.now_s, Inputs(flood), drive.state, decision)
    assert drive.now_s < stop_s + TAIL_S
    assert keeping.orders[0].header["last_s"] == drive.now_s
    assert len(keeping.orders[0].segments) > 2
    assert sum(len(steps) for _, steps in keeping.orders[0].segments) > 40


def test_what_it_cannot_record_is_reported_once_and_supervision_goes_on(
    drive: Drive, writer: WriterAtOnce, caplog: pytest.LogCaptureFixture
) -> None:
    decision = drive.drive()
    strange: Any = object()
    for _ in range(3):
        drive.box.record(drive.now_s, Inputs(estop=strange), drive.state, decision)
    assert len(caplog.records) == 1
    assert "stopped recording" in caplog.text
    drive.stop()
    drive.box.close()
    assert writer.paths == []


# --- the file


@cache
def an_order(seconds: float = 4.0) -> Order:
    keeping = KeepingWriter()
    drive = Drive(box_of(keeping))
    drive.drive(seconds)
    drive.stop()
    drive.box.close()
    return keeping.orders[0]


def put(order: Order, directory: Path, *, max_files: int = 20, max_bytes: int = 20_000_000) -> Path:
    return write(order, directory, max_files=max_files, max_bytes=max_bytes)


def test_the_header_says_what_was_recorded_with_which_law(tmp_path: Path) -> None:
    path = put(an_order(), tmp_path)
    with gzip.open(path, "rt") as file:
        header = json.loads(file.readline())
    assert header["format"] == "lifeline black box"
    assert header["version"] == VERSION
    assert LAW.read(header["config"]) == CONFIG
    assert header["window_s"] == WINDOW_S
    assert header["numpy"]


def test_a_directory_that_others_can_change_gets_no_file(tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    with pytest.raises(PermissionError, match=f"other users can change it: run `chmod 755 {tmp_path}`"):
        put(an_order(), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_only_the_newest_files_are_kept_and_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    notes = tmp_path / "notes.jsonl.gz"
    notes.write_text("mine")
    order = an_order()
    for second in range(5):
        put(replace(order, name=f"20260704T12000{second}.000Z-ESTOP"), tmp_path, max_files=3)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *(f"20260704T12000{second}.000Z-ESTOP.jsonl.gz" for second in (2, 3, 4)),
        notes.name,
    ]


def test_files_of_routine_stops_are_deleted_before_all_others(tmp_path: Path) -> None:
    order = an_order()
    reasons = ("SOURCE_LOST", "OBSTACLE", "OVERRUN", "NO_COMMAND", "SCAN_BLIND", "OBSTACLE")
    for second, reason in enumerate(reasons):
        put(replace(order, name=f"20260704T12000{second}.000Z-{reason}"), tmp_path, max_files=3)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"20260704T12000{second}.000Z-{reasons[second]}.jsonl.gz" for second in (0, 2, 5)
    ]


def test_the_file_of_a_routine_stop_makes_no_incident_go(tmp_path: Path) -> None:
    order = an_order()
    names = [
        f"20260704T12000{second}.000Z-{reason}"
        for second, reason in enumerate(("ESTOP", "ESTOP", "OBSTACLE", "OBSTACLE"))
    ]
    for name in names:
        put(replace(order, name=name), tmp_path, max_files=2)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{name}.jsonl.gz" for name in (*names[:2], names[3])
    ]
    put(replace(order, name="20260704T120005.000Z-ESTOP"), tmp_path, max_files=2)
    assert [path.name[13:] for path in sorted(tmp_path.iterdir())] == [
        "01.000Z-ESTOP.jsonl.gz",
        "05.000Z-ESTOP.jsonl.gz",
    ]


def test_the_file_just_written_is_kept_also_when_the_wall_clock_has_gone_back(tmp_path: Path) -> None:
    order = an_order()
    for name in ("20260704T120000.000Z-ESTOP", "20200101T000000.000Z-ESTOP"):
        path = put(replace(order, name=name), tmp_path, max_files=1)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_would_be_too_large_leaves_out_the_oldest_and_says_so(tmp_path: Path) -> None:
    order = an_order(seconds=10.0)
    whole = put(order, tmp_path)
    limit = whole.stat().st_size // 2
    small = put(order, tmp_path, max_bytes=limit)
    assert small.stat().st_size <= limit + 2000  # the header and the end
    header = read(small).header
    assert header["left_out_for_file_size"] > 0
    assert header["steps"] + header["left_out_for_file_size"] == read(whole).header["steps"]
    assert header["last_s"] == read(whole).header["last_s"]
    assert replay(read(small)).difference is None


def test_a_writer_that_was_killed_leaves_no_half_file_under_a_final_name(tmp_path: Path) -> None:
    beyond_the_largest_pid = 2**22 + 1
    left = tmp_path / f".20260704T120000.000Z-ESTOP.jsonl.gz.{beyond_the_largest_pid}.tmp"
    left.write_bytes(b"half")
    running = tmp_path / ".20260704T120000.000Z-ESTOP.jsonl.gz.1.tmp"
    running.write_bytes(b"another supervisor's")
    path = put(an_order(), tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([path, running])


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    order = an_order()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        put(order, tmp_path)
    assert list(tmp_path.iterdir()) == []


# --- the thread


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait for the writer at the end, also on a busy machine."""
    monkeypatch.setattr(blackbox, "CLOSE_LIMIT_S", 30.0)


@pytest.mark.usefixtures("patient")
def test_the_thread_writes_and_says_where(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    thread_writer = ThreadWriter(tmp_path / "a" / "b", max_files=20)
    thread_writer.submit(an_order())
    thread_writer.close()
    (path,) = (tmp_path / "a" / "b").iterdir()
    assert str(path) in caplog.text
    assert replay(read(path)).difference is None


@pytest.mark.usefixtures("patient")
def test_a_directory_that_cannot_be_is_reported_once_and_again_after_a_success(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    directory = tmp_path / "blackbox"
    thread_writer = ThreadWriter(directory, max_files=20)
    directory.write_text("a file is in its place")
    for _ in range(3):
        thread_writer.submit(an_order())
        thread_writer.close()
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    directory.unlink()
    thread_writer.submit(an_order())
    thread_writer.close()
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]


@pytest.mark.usefixtures("patient")
def test_orders_that_come_faster_than_they_are_written_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()
    begun = threading.Event()

    def slow(*args: Any, **kwargs: Any) -> Path:  # noqa: ANN401
        begun.set()
        go_on.wait(10.0)
        return write(*args, **kwargs)

    monkeypatch.setattr(blackbox, "write", slow)
    thread_writer = ThreadWriter(tmp_path, max_files=20)
    order = an_order(1.0)
    thread_writer.submit(order)
    assert begun.wait(10.0)
    for _ in range(4):
        thread_writer.submit(order)
    assert "still wait" in caplog.text
    go_on.set()
    thread_writer.close()
    assert len(list(tmp_path.iterdir())) == 3


def test_the_end_waits_for_the_writer_but_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()

    def stuck(*_: Any, **__: Any) -> Path:  # noqa: ANN401
        go_on.wait(30.0)
        return tmp_path

    monkeypatch.setattr(blackbox, "write", stuck)
    monkeypatch.setattr(blackbox, "CLOSE_LIMIT_S", 0.05)
    thread_writer = ThreadWriter(tmp_path, max_files=20)
    thread_writer.submit(an_order(1.0))
    started_s = time.monotonic()
    thread_writer.close()
    assert time.monotonic() - started_s < 5.0
    go_on.set()


# --- where it goes


@pytest.mark.parametrize("is_configured", [False, True])
def test_it_goes_into_the_state_directory_or_where_the_configuration_sends_it(
    *, is_configured: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ENVIRONMENT, str(tmp_path))
    there = tmp_path / ("there" if is_configured else "blackbox")
    config = SupervisorSection(
        black_box_dir=str(there) if is_configured else None, black_box_s=1.0, black_box_files=1
    )
    drive = Drive(black_box(config, config.law()))
    for _ in range(2):
        drive.hold(3.0)
        drive.drive()
        drive.stop()
        drive.hold(TAIL_S + TICK_S)
    drive.box.close()
    (path,) = there.iterdir()
    header = read(path).header
    assert 3.0 < header["last_s"] - header["first_s"] < 4.2


# --- the replay


@pytest.mark.proof
@pytest.mark.parametrize("seed", range(6))
def test_a_random_drive_is_replayed_to_the_bit_from_the_middle_of_it(seed: int) -> None:
    keeping = KeepingWriter()
    drive = Drive(box_of(keeping, window_s=5.0))
    drive.anything(30.0, seed)
    drive.box.close()
    assert keeping.orders, "this drive never stopped"
    for order in keeping.orders:
        document = written(order)
        found = replay(document)
        assert found.difference is None
        assert found.steps == document.header["steps"] > 100


def written(order: Order, change: Callable[[list[dict[str, Any]]], None] = lambda _: None) -> Document:
    """Write the order to a file, with changed lines."""
    with tempfile.TemporaryDirectory() as name:
        document = read(put(order, Path(name)))
    lines = list(document.lines)
    change(lines)
    return Document(document.header, lines)


def test_a_decision_that_was_tampered_with_is_found_where_it_is() -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        lines[150]["decision"]["output"]["linear_m_s"] += 1e-12

    document = written(an_order(), change)
    difference = replay(document).difference
    assert difference is not None
    assert difference.now_s == document.lines[150]["now_s"]
    assert difference.where == "decision.output.linear_m_s"
    assert difference.recorded == repr(0.5 + 1e-12)
    assert difference.replayed == "0.5"


def test_an_input_that_was_tampered_with_changes_the_decision() -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        lines[150]["inputs"]["estop"] = True

    document = written(an_order(), change)
    difference = replay(document).difference
    assert difference is not None
    assert difference.now_s == document.lines[150]["now_s"]
    assert difference.where == "decision.mode"
    assert (difference.recorded, difference.replayed) == ('"DRIVING"', '"STOPPED"')


def test_a_state_that_was_tampered_with_is_found_where_it_is() -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        states = [line for line in lines if "state" in line]
        states[2]["state"]["interlock"]["sources"][0]["neutral_s"] = -0.0

    difference = replay(written(an_order(), change)).difference
    assert difference is not None
    assert difference.where == "state.interlock.sources[0].neutral_s"
    assert difference.recorded == "-0.0"


@pytest.mark.parametrize("key", ["now_s", "inputs", "decision"])
def test_a_line_that_says_nothing_is_refused_with_its_number(key: str) -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        del lines[3][key]

    with pytest.raises(BlackBoxError, match="line 5 "):
        replay(written(an_order(1.0), change))


def test_a_field_that_only_another_law_knows_is_no_difference() -> None:
    def change(lines: list[dict[str, Any]]) -> None:
        for line in lines:
            if "decision" in line:
                line["decision"]["mood"] = "good"
                del line["decision"]["warning"]

    assert replay(written(an_order(1.0), change)).difference is None


def test_the_replay_reports_the_phases_of_the_drive() -> None:
    found = replay(written(an_order(1.0)))
    assert [phase.first.mode for phase in found.phases] == [
        Mode.READY,
        Mode.DRIVING,
        Mode.LIMITED,  # until a second scan confirms the obstacle
        Mode.STOPPED,
    ]
    assert found.phases[-1].first.reasons == (StopReason.OBSTACLE,)
    assert found.phases[0].first.commanded == NEUTRAL
