"""`lifeline judge` over recordings of invented and of real robots, whole and damaged."""

import json
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin
from typer.testing import CliRunner, Result

from lifeline.cli.app import app
from recordings.judge import findings
from recordings.judge.choice import Named
from recordings.judge.judge import Judgement, judge
from recordings.judge.page import page, to_json
from recordings.judge.source import MAX_WAITING, Found, Source
from recordings.recording import Recorded, RecordingReader
from tests.unit.recordings.judge.recorded import (
    CMD_VEL,
    ODOM,
    SCAN,
    command,
    configuration,
    drive,
    message,
    ns,
    odom,
    real,
    scan,
    write_mcap,
    write_rosbag2,
)
from tests.unit.recordings.test_incident import stopped
from tests.unit.supervisor.law.recordings import DATA, ROBOTS
from wire import messages as ros

NO_SHOW: Callable[[str], None] = lambda _: None  # noqa: E731


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["judge", *map(str, arguments)])


def judged(
    path: Path, messages: Iterable[Recorded], config: Path | None = None, named: Named | None = None
) -> Judgement:
    return judge(write_mcap(path / "r.mcap", messages), config, named or Named(), NO_SHOW)


def totals(found: Judgement) -> dict[str, int]:
    return {one.name: one.places for one in found.feed.places.totals.values() if one.is_stop}


def stream(found: Judgement, topic: str) -> Any:  # noqa: ANN401 - a Stream
    return found.feed.streams[topic]


# --- where Lifeline would have stopped the robot


def test_a_drive_in_open_space_has_no_finding(tmp_path: Path) -> None:
    result = run(write_mcap(tmp_path / "r.mcap", drive()))
    assert result.exit_code == 0, result.output
    text = " ".join(result.stdout.split())
    assert "Lifeline would not have stopped this robot." in text
    assert "assumed round hull of 0.25 m" in text
    assert "kept" in text
    assert "no status of a supervisor" in text


def test_a_robot_that_drives_into_a_wall_would_have_been_stopped_at_30_cm(tmp_path: Path) -> None:
    found = judged(tmp_path, drive(wall_m=2.0))
    places = found.feed.places
    assert found.is_found
    assert places.first_stop is not None
    at = places.first_stop.first
    assert at.reasons == ("OBSTACLE",)
    assert at.nearest_m == pytest.approx(0.30, abs=0.03)
    assert at.wanted == (0.4, 0.0)
    assert not places.kept[0].is_conditional
    assert all(place.is_conditional for place in places.kept[1:])
    assert places.nearest_moving is not None
    assert places.nearest_moving.nearest_m < 0.02
    assert places.nearest_moving.time_s > at.time_s


def test_a_stop_at_which_the_robot_drives_on_is_one_place(tmp_path: Path) -> None:
    assert totals(judged(tmp_path, drive(wall_m=2.0))) == {"OBSTACLE": 1}


def test_commands_that_fall_silent_while_the_robot_moves_are_a_stop_and_break_a_rule(tmp_path: Path) -> None:
    found = judged(tmp_path, drive(silent=(3.0, 4.5)))
    assert totals(found)["COMMAND_TIMEOUT"] == 1
    assert found.broken == ["motion ⇒ a fresh command"]
    commands = stream(found, CMD_VEL)
    assert commands.stale == 1
    assert commands.stale_longest_s == pytest.approx(1.55, abs=0.01)
    assert commands.stale_at_s == pytest.approx(2.96, abs=0.01)
    first = found.feed.places.first_stop
    assert first is not None
    assert first.first.time_s == pytest.approx(2.96 + 0.2, abs=0.03)


def test_a_base_that_brakes_by_itself_breaks_no_rule(tmp_path: Path) -> None:
    found = judged(tmp_path, drive(silent=(3.0, 4.5), stops=True))
    assert totals(found) == {"COMMAND_TIMEOUT": 1}
    assert found.broken == []


def test_a_lidar_that_falls_silent_is_named_with_its_gap(tmp_path: Path) -> None:
    messages = (one for one in drive() if one.topic != SCAN or not ns(3.0) < one.log_time_ns < ns(4.0))
    found = judged(tmp_path, messages)
    assert totals(found) == {"SCAN_STALE": 1}
    assert (stream(found, SCAN).stale, stream(found, ODOM).stale) == (1, 0)


def test_a_lidar_that_is_silent_until_the_end_counts_too(tmp_path: Path) -> None:
    found = judged(tmp_path, (one for one in drive() if one.topic != SCAN or one.log_time_ns < ns(3.0)))
    assert stream(found, SCAN).stale == 1


def test_a_lidar_that_repeats_while_the_robot_moves_is_counted(tmp_path: Path) -> None:
    payload = scan(0.0).payload
    frozen = (
        one._replace(payload=payload) if one.topic == SCAN and one.log_time_ns > ns(3.0) else one
        for one in drive()
    )
    found = judged(tmp_path, frozen)
    assert stream(found, SCAN).repeats > 50
    assert found.feed.places.stops > 0
    at_rest = judged(
        tmp_path_of(tmp_path, "rest"),
        (one._replace(payload=payload) if one.topic == SCAN else one for one in drive(from_s=9.0)),
    )
    assert stream(at_rest, SCAN).repeats == 0


def tmp_path_of(tmp_path: Path, name: str) -> Path:
    (tmp_path / name).mkdir()
    return tmp_path / name


def test_a_command_faster_than_the_limit_is_a_limit_and_not_a_stop(tmp_path: Path) -> None:
    found = judged(tmp_path, drive(speed_m_s=1.5))
    assert {one.name for one in found.feed.places.totals.values()} >= {"MAX_SPEED"}
    assert found.feed.places.kept[0].first.scale == pytest.approx(1.0 / 1.5, abs=0.01)


def test_a_command_that_a_ground_robot_cannot_execute_is_invalid(tmp_path: Path) -> None:
    sideways = ros.Twist(ros.Vector3(0.3, 0.2, 0.0), ros.Vector3(0.0, 0.0, 0.0))
    payload = ros.encode(sideways)
    found = judged(
        tmp_path,
        (
            one._replace(payload=payload) if one.topic == CMD_VEL and one.log_time_ns > ns(3.0) else one
            for one in drive()
        ),
    )
    assert totals(found) == {"COMMAND_INVALID": 1}
    assert found.broken == []


def test_without_commands_the_motion_of_odometry_counts(tmp_path: Path) -> None:
    found = judged(tmp_path, (one for one in drive(wall_m=2.0) if one.topic != CMD_VEL))
    assert totals(found) == {"OBSTACLE": 1}
    assert any("no commands are recorded" in text for text in found.assumptions)
    assert [verdict.is_judged for verdict in found.feed.monitors.verdicts()] == [False] * 4


def test_without_odometry_the_base_moves_as_commanded(tmp_path: Path) -> None:
    found = judged(tmp_path, (one for one in drive(wall_m=2.0) if one.topic != ODOM))
    assert totals(found) == {"OBSTACLE": 1}
    assert any("no odometry is recorded" in text for text in found.assumptions)


def test_without_scans_only_the_commands_are_judged(tmp_path: Path) -> None:
    result = run(write_mcap(tmp_path / "r.mcap", (one for one in drive() if one.topic != SCAN)))
    assert result.exit_code == 0, result.output
    assert "cannot be judged: the recording has no laser scan" in " ".join(result.stdout.split())


def test_a_recording_of_which_nothing_can_be_judged_exits_with_2(tmp_path: Path) -> None:
    result = run(write_mcap(tmp_path / "r.mcap", (one for one in drive() if one.topic == SCAN)))
    assert result.exit_code == 2, result.output
    assert "no motion is recorded" in " ".join(result.stdout.split())


def test_odometry_without_velocities_is_named(tmp_path: Path) -> None:
    def still() -> Iterable[Recorded]:
        for one in drive():
            if one.topic == ODOM:
                at_s = (one.log_time_ns - ns(0.0)) / 1e9
                yield message(ODOM, at_s, ros.odometry((at_s, 0.0, 0.0), (0.0, 0.0)))
            else:
                yield one

    assert any("all its velocities are zero" in note for note in judged(tmp_path, still()).feed.notes)


def test_a_lidar_whose_zeros_mean_no_return_is_named(tmp_path: Path) -> None:
    def zeros() -> Iterable[Recorded]:
        for one in drive():
            if one.topic != SCAN:
                yield one
                continue
            seen = ros.decode(one.payload, ros.LaserScan)
            ranges = seen.ranges.copy()
            ranges[:100] = 0.0
            yield one._replace(payload=ros.encode(replace(seen, ranges=ranges)))

    (note,) = judged(tmp_path, zeros()).feed.notes
    assert note.startswith("28% of the readings on /scan are at or below range_min")


def test_a_slow_lidar_gets_a_timeout_of_one_and_a_half_periods(tmp_path: Path) -> None:
    def slow() -> Iterable[Recorded]:
        return (one for one in drive() if one.topic != SCAN or one.log_time_ns % 200_000_000 == 0)

    found = judged(tmp_path, slow())
    assert found.feed.law.lidars[0].timeout_s == pytest.approx(0.3)
    assert totals(found) == {}


def test_a_pause_of_the_whole_recording_starts_the_law_again(tmp_path: Path) -> None:
    def paused() -> Iterable[Recorded]:
        yield from drive(3.0)
        yield from (one._replace(log_time_ns=one.log_time_ns + 3600 * 10**9) for one in drive(3.0))

    found = judged(tmp_path, paused())
    assert "all topics paused 1 ×" in found.feed.notes[0]
    assert found.duration_s > 3600.0


def test_what_happened_in_a_pause_of_the_whole_recording_breaks_no_rule(tmp_path: Path) -> None:
    def paused() -> Iterable[Recorded]:
        yield from drive(3.0)
        for one in drive(6.0, silent=(3.0, 3.4)):
            if one.log_time_ns > ns(3.1):
                yield one._replace(log_time_ns=one.log_time_ns + 3600 * 10**9)

    found = judged(tmp_path, paused())
    assert found.broken == []
    assert stream(found, CMD_VEL).stale == 0


@pytest.mark.long
def test_what_follows_a_clock_that_was_set_back_is_judged(tmp_path: Path) -> None:
    found = judged(tmp_path, [*drive(20.0), *drive(wall_m=2.0)])
    assert totals(found) == {"OBSTACLE": 1}
    assert found.broken == []
    assert any("the clock was set back 1 ×" in note for note in found.feed.notes)


@pytest.mark.parametrize(("obeyed", "broken"), [(True, []), (False, ["e-stop ⇒ zero until a reset"])])
def test_an_estop_of_any_robot_is_judged_if_its_topic_is_named(
    tmp_path: Path, *, obeyed: bool, broken: list[str]
) -> None:
    def pressed() -> Iterable[Recorded]:
        yield from drive(2.0)
        yield message("/base/stopped", 2.0, ros.Bool(data=True))
        for one in drive(4.0):
            if one.log_time_ns > ns(2.0):
                at_s = (one.log_time_ns - ns(0.0)) / 1e9
                yield odom(at_s, max(0.0, 0.4 - at_s + 2.0)) if obeyed and one.topic == ODOM else one
        yield message("/base/stopped", 4.0, ros.Bool(data=False))
        yield from (one for one in drive(6.0) if one.log_time_ns > ns(4.1))

    named = Named(estops=("/base/stopped",))
    assert judged(tmp_path, pressed(), named=named).broken == broken
    assert run(tmp_path / "r.mcap", "--estop", SCAN).exit_code == 2


def test_a_fast_base_that_brakes_breaks_no_rule_and_one_that_does_not_breaks_it(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[supervisor]\ndeceleration_m_s2 = 1.0\n")
    for stops, broken in ((True, []), (False, ["motion ⇒ a fresh command"])):
        fast = drive(8.0, speed_m_s=0.95, silent=(4.0, 6.0), stops=stops)
        assert judged(tmp_path_of(tmp_path, str(stops)), fast, config).broken == broken


def test_the_configuration_of_the_robot_replaces_the_assumptions(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[supervisor]\ndeceleration_m_s2 = 1.5\nfootprint = { radius_m = 0.6 }\n")
    wide = judged(tmp_path, drive(wall_m=2.0), config)
    assert wide.assumptions == ()
    assert wide.feed.places.first_stop is not None
    assert wide.feed.places.first_stop.first.time_s < 4.2
    result = run(tmp_path / "r.mcap", "--config", tmp_path / "none.toml")
    assert result.exit_code == 2
    assert "cannot read the configuration" in result.stderr


def test_several_lidars_are_judged_together(tmp_path: Path) -> None:
    both = [*drive(), *(one._replace(topic="/rear") for one in drive() if one.topic == SCAN)]
    path = write_mcap(tmp_path / "r.mcap", sorted(both, key=lambda one: one.log_time_ns))
    assert "name one or more with --scan" in run(path).stderr.replace("\n", " ")
    assert "--scan names a topic twice" in run(path, "--scan", SCAN, "--scan", SCAN).stderr
    result = run(path, "--scan", SCAN, "--scan", "/rear", "--json")
    assert result.exit_code == 0, result.output
    assert [one["topic"] for one in json.loads(result.stdout)["topics"]] == [SCAN, "/rear", ODOM, CMD_VEL]


# --- files


def test_mcap_sqlite_and_folders_give_the_same_result(tmp_path: Path) -> None:
    expected = json.loads(run(write_mcap(tmp_path / "r.mcap", drive(wall_m=2.0)), "--json").stdout)
    sqlite = write_rosbag2(tmp_path / "sqlite", drive(wall_m=2.0, stamped=True))
    mcap = write_rosbag2(tmp_path / "mcap", drive(wall_m=2.0, stamped=True), storage=StoragePlugin.MCAP)
    for path in (sqlite, sqlite / "sqlite.db3", mcap, mcap / "mcap.mcap"):
        result = run(path, "--json")
        assert result.exit_code == 1, result.output
        found = json.loads(result.stdout)
        assert found.pop("file") == str(path)
        assert found == {key: value for key, value in expected.items() if key != "file"}


def test_a_truncated_file_is_judged_up_to_its_end(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "r.mcap", drive(20.0))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    result = run(path)
    assert result.exit_code == 0, result.output
    assert "the recording ends early: its end is missing or damaged" in " ".join(result.stdout.split())


def test_an_index_that_is_damaged_is_not_needed(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "r.mcap", drive())
    content = bytearray(path.read_bytes())
    content[-60:-8] = bytes(52)
    path.write_bytes(content)
    assert run(path).exit_code == 0


@pytest.mark.parametrize("name", ["r.mcap", "r.db3", "r.jsonl.gz", "r.bag"])
@pytest.mark.parametrize(
    "content", [b"", b"garbage " * 1000, b"\x89MCAP0\r\n" + bytes(500), b"SQLite format 3\0" + bytes(4096)]
)
def test_garbage_is_refused_in_one_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    result = run(tmp_path / name)
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert result.stderr.startswith("lifeline: ")
    assert result.stderr.count("\n") == 1


def test_what_is_no_recording_is_refused_in_one_sentence(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    (tmp_path / "folder").mkdir()
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta/metadata.yaml").write_text("rosbag2_bagfile_information: [1, 2")
    for name in ("none.mcap", "none.db3", "none.jsonl.gz", "pipe.mcap", "folder", "meta"):
        result = run(tmp_path / name)
        assert result.exit_code == 2, (name, result.output)
        assert result.stderr.count("\n") == 1, result.stderr


def test_messages_that_are_not_of_their_type_are_counted(tmp_path: Path) -> None:
    found = judged(
        tmp_path,
        (one._replace(payload=one.payload[:9]) if one.log_time_ns % 7 == 0 else one for one in drive()),
    )
    assert all(one.undecodable > 0 for one in found.feed.streams.values())


def test_a_recording_that_is_compressed_needs_its_folder(tmp_path: Path) -> None:
    (tmp_path / "r.db3.zstd").write_bytes(b"compressed")
    assert "is compressed: name the folder" in run(tmp_path / "r.db3.zstd").stderr
    path = write_mcap(tmp_path / "r.mcap", (one._replace(payload=one.payload[:9]) for one in drive()))
    result = run(path)
    assert result.exit_code == 2
    assert "no message on /scan, /odom, /cmd_vel can be decoded" in " ".join(result.stdout.split())


ANY = st.sampled_from((0.0, -0.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1.0, -3.0))


@pytest.mark.long
@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.sampled_from((SCAN, ODOM, CMD_VEL)), ANY, ANY, st.integers(0, 400)), max_size=30)
)
def test_messages_with_any_numbers_are_judged(
    tmp_path_factory: pytest.TempPathFactory, odd: list[tuple[str, float, float, int]]
) -> None:
    def hostile() -> Iterable[Recorded]:
        yield from drive(1.0, from_s=0.6)
        for k, (topic, one, other, beams) in enumerate(odd):
            time_s = 1.0 + 0.03 * k
            if topic == ODOM:
                yield message(ODOM, time_s, ros.odometry((other, one, 0.0), (one, other)))
            elif topic == CMD_VEL:
                yield message(CMD_VEL, time_s, ros.planar_twist(one, other))
            else:
                with np.errstate(all="ignore"):
                    ranges = np.full(beams, one, dtype=np.float32)
                    seen = ros.laser_scan(
                        ranges, angle_increment_rad=0.01, range_m=(0.05, 12.0), period_s=0.1
                    )
                    yield message(SCAN, time_s, replace(seen, range_max=float(np.float32(other))))

    found = judged(tmp_path_factory.mktemp("hostile"), hostile())
    list(page(found))
    json.dumps(to_json(found), allow_nan=False)


class Endless(Source):
    """A recording that would not fit into memory."""

    taken = 0

    def topics(self) -> dict[str, Found]:
        return {}

    def messages(self, wanted: object) -> Any:  # noqa: ANN401 - a generator
        while True:
            self.taken += 1
            yield Recorded(SCAN, "", self.taken, 0, b"")


def test_the_messages_that_wait_to_be_put_in_order_are_bounded() -> None:
    source = Endless(Path("r"))
    messages = source.in_order([SCAN])
    for _ in range(10_000):
        next(messages)
    assert source.taken <= 10_000 + MAX_WAITING + 1


def test_messages_are_judged_in_order_of_time(tmp_path: Path) -> None:
    messages = list(drive())
    late = [messages[k ^ 3] if (k ^ 3) < len(messages) else one for k, one in enumerate(messages)]
    assert run(write_mcap(tmp_path / "r.mcap", late)).exit_code == 0


def test_places_are_counted_beyond_those_that_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(findings, "MAX_PLACES", 5)
    rare = (one for one in drive(7.0) if one.topic != CMD_VEL or one.log_time_ns % 300_000_000 < 50_000_000)
    found = judged(tmp_path, rare)
    assert totals(found)["COMMAND_TIMEOUT"] > 10
    assert len(found.feed.places.kept) == 5


# --- recordings of supervised robots


def test_a_black_box_and_its_export_are_judged_alike(tmp_path: Path) -> None:
    path = stopped(tmp_path)
    export = tmp_path / "out.mcap"
    assert CliRunner().invoke(app, ["incidents", "export", str(path), str(export)]).exit_code == 0
    for file in (path, export):
        result = run(file, "--json")
        assert result.exit_code == 0, result.output
        found = json.loads(result.stdout)
        assert found["supervised"]
        assert {one["name"] for one in found["totals"]} >= {"OBSTACLE"}
        kept = {one["rule"]: (one["why_not"], one["broken"]) for one in found["rules"]}
        assert kept["motion ⇒ a fresh command"] == ("", 0)
        assert kept["a stop reason ⇒ zero in the same step"] == ("", 0)


def status(time_s: float, speed_m_s: float, *reasons: str) -> Recorded:
    twist = ros.planar_twist(speed_m_s, 0.0)
    names = list(reasons)
    one = ros.SafetyStatus(
        ros.header("", 0), 0, names, owner="teleop", commanded=twist, permitted=twist, scale=1.0, causes=names
    )
    one.estop_stations = [ros.EstopStationStatus("gate", True, ros.EstopStationStatus.HEARD, False)]  # noqa: FBT003
    return message("/robot/supervisor/status", time_s, one)


def supervised(
    *extra: Recorded,
    asked: ros.Twist | None = None,
    output: ros.Twist | None = None,
    permitted_m_s: float = 0.4,
    stop: tuple[float, float] = (math.inf, math.inf),
) -> list[Recorded]:
    """Four seconds of a drive at 0.4 m/s under a supervisor.

    Args:
        extra: more messages.
        asked: the command of the source from 2 s on; None: as before.
        output: the command to the base from 2 s on; None: what the status permits.
        permitted_m_s: permitted outside the stop.
        stop: the time in which the status has a stop reason and permits nothing.
    """
    found = list(extra)
    for k in range(80):
        time_s = 0.05 * k
        is_stopped, is_late = stop[0] <= time_s < stop[1], time_s >= 2.0
        speed_m_s = 0.0 if is_stopped else permitted_m_s
        forward = ros.planar_twist(0.4, 0.0)
        command = asked if is_late and asked is not None else forward
        found.append(message("/robot/teleop/cmd_vel", time_s, command))
        out = output if is_late and output is not None else ros.planar_twist(speed_m_s, 0.0)
        found.append(message("/robot/cmd_vel", time_s + 0.002, out))
        found.append(status(time_s + 0.003, speed_m_s, *(["SCAN_STALE"] if is_stopped else [])))
    return sorted(found, key=lambda one: one.log_time_ns)


def twist(x_m_s: float, y_m_s: float = 0.0) -> ros.Twist:
    return ros.Twist(ros.Vector3(x_m_s, y_m_s, 0.0), ros.Vector3(0.0, 0.0, 0.0))


def test_a_supervisor_that_ignores_an_estop_breaks_the_rule(tmp_path: Path) -> None:
    press = message("/robot/estop", 2.0, ros.Bool(data=True))
    assert judged(tmp_path, supervised(press)).broken == ["e-stop ⇒ zero until a reset"]


def test_an_estop_without_a_running_supervisor_breaks_nothing(tmp_path: Path) -> None:
    press = message("/robot/estop", 2.0, ros.Bool(data=True))
    late = (one._replace(log_time_ns=one.log_time_ns + 4 * 10**9) for one in supervised())
    assert judged(tmp_path, [press, *late]).broken == []


@pytest.mark.parametrize(("station", "broken"), [("gate", 1), ("of-another-robot", 0)])
def test_only_a_station_of_this_robot_presses_its_estop(tmp_path: Path, station: str, broken: int) -> None:
    lease = ros.EstopLease(1, stop=True)
    press = message(f"/robot/estop_station/{station}/presence", 2.0, lease)
    assert len(judged(tmp_path, supervised(press)).broken) == broken


@pytest.mark.parametrize("asked", [twist(math.nan), twist(math.inf), twist(0.4, 0.1), twist(0.0, math.nan)])
def test_an_invalid_command_is_neither_fresh_nor_neutral(tmp_path: Path, asked: ros.Twist) -> None:
    assert judged(tmp_path, supervised(asked=asked)).broken == ["motion ⇒ a fresh command"]
    again = judged(tmp_path_of(tmp_path, "again"), supervised(asked=asked, stop=(1.5, 2.5)))
    assert "motion ⇒ no cause since the last neutral command" in again.broken


@pytest.mark.parametrize("output", [twist(0.3), twist(0.0, 0.3), twist(math.nan)])
def test_a_motion_that_the_base_is_commanded_in_spite_of_the_status_is_found(
    tmp_path: Path, output: ros.Twist
) -> None:
    found = judged(tmp_path, supervised(output=output, stop=(1.0, math.inf)))
    assert found.broken == ["a stop reason ⇒ zero in the same step"]


def test_an_estop_is_a_stop_although_teleop_sends_zero_with_it(tmp_path: Path) -> None:
    def pressed(*, obeyed: bool) -> Iterable[Recorded]:
        for k in range(40):
            time_s = 0.05 * k
            speed_m_s = 0.4 if k < 20 or (k > 30 and not obeyed) else 0.0
            yield message("/robot/teleop/cmd_vel", time_s, ros.planar_twist(speed_m_s, 0.0))
            if k == 20:
                yield message("/robot/estop", time_s, ros.Bool(data=True))
            yield message("/robot/cmd_vel", time_s + 0.002, ros.planar_twist(speed_m_s, 0.0))
            yield status(time_s + 0.003, speed_m_s, *(["ESTOP"] if k >= 20 else []))

    found = judged(tmp_path, pressed(obeyed=True))
    assert totals(found) == {"ESTOP": 1}
    assert found.broken == []
    ignored = judged(tmp_path_of(tmp_path, "ignored"), pressed(obeyed=False))
    assert set(ignored.broken) >= {"e-stop ⇒ zero until a reset", "a stop reason ⇒ zero in the same step"}


def test_a_supervisor_that_moves_despite_a_stop_is_found_in_its_recording(tmp_path: Path) -> None:
    path = stopped(tmp_path)
    export = tmp_path / "out.mcap"
    CliRunner().invoke(app, ["incidents", "export", str(path), str(export)])

    def wrong() -> Iterable[Recorded]:
        for one in RecordingReader(export).messages():
            if one.msgtype == ros.SafetyStatus.__msgtype__:
                status = ros.decode(one.payload, ros.SafetyStatus)
                yield one._replace(payload=ros.encode(replace(status, permitted=ros.planar_twist(0.5, 0.0))))
            else:
                yield one

    path = write_mcap(tmp_path / "wrong.mcap", wrong())
    assert run(path).exit_code == 1
    rules = {one["rule"]: one for one in json.loads(run(path, "--json").stdout)["rules"]}
    assert rules["a stop reason ⇒ zero in the same step"]["broken"] == 1
    (violation,) = rules["a stop reason ⇒ zero in the same step"]["violations"]
    assert violation["sentence"] == "motion is commanded despite OBSTACLE"


def test_names_in_a_recording_reach_the_terminal_printable(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path / "r.mcap", (one._replace(topic=f"{one.topic}\x1b[31m[red]") for one in drive())
    )
    for option in ((), ("--json",), ("--scan", "\x1b[2J")):
        result = run(path, *option)
        assert "\x1b" not in result.stdout + result.stderr
        assert result.exit_code == (2 if "--scan" in option else 0)


# --- real robots


@pytest.mark.parametrize(
    ("name", "stops"),
    [
        pytest.param("neato-lds", {"ODOM_STALE": 1, "SCAN_INVALID": 1}, marks=pytest.mark.long),
        pytest.param("hokuyo726-front", {}, marks=pytest.mark.long),
        pytest.param("hokuyo768-right", {}, marks=pytest.mark.long),
        pytest.param("hokuyo-urg04", {}, marks=pytest.mark.long),
        ("sick-lms1xx", {}),
    ],
)
def test_the_recordings_of_real_lidars_are_judged(tmp_path: Path, name: str, stops: dict[str, int]) -> None:
    """The Neato loses its odometry for 0.35 s, and one of its scans has 36 beams; the others have no commands."""
    robot = ROBOTS[name]
    if not (DATA / f"{robot.file}.npz").exists():
        pytest.skip(f"no recording {robot.file}.npz; LIFELINE_LIDAR_DATA can say where the recordings are")
    config = tmp_path / "robot.toml"
    config.write_text(configuration(robot.section))
    found = judged(tmp_path, real(robot), config)
    assert totals(found) == stops
    assert bool(found.feed.not_judged) == (not stops)
    nearest = found.feed.places.nearest
    assert nearest is not None
    assert math.isfinite(nearest.nearest_m)


def test_a_moment_without_motion_is_not_judged(tmp_path: Path) -> None:
    found = judged(tmp_path, [*(scan(k / 20) for k in range(60)), command(3.0, 0.0), odom(3.0, 0.0)])
    assert found.feed.not_judged == "no motion is recorded after the first scans"
