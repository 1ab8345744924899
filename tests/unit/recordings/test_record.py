"""A recording is a bag that rosbags reads, and flushed data can be read from a truncated file."""

import asyncio
import errno
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from typer.testing import CliRunner, Result

from deploy.stack.reach import MAX_SOURCES
from lifeline.cli.app import app
from recordings.record import Recorder, Report
from recordings.recording import Recorded, RecordingError, RecordingReader, RecordingWriter
from supervisor.config import SupervisorSection
from virtual.network import VirtualNetwork
from wire import topics
from wire.messages import M, Odometry, SafetyStatus, Twist, decode, encode, header, odometry, planar_twist
from wire.stamp import Stamp
from wire.topics import Topic

NOON_NS = 1_780_000_000_000_000_000
SECOND_NS = 1_000_000_000
TWIST = Twist.__msgtype__


def twist(number: int, topic: str = "/robot/cmd_vel") -> Recorded:
    payload = encode(planar_twist(number / 10, 0.0))
    return Recorded(topic, TWIST, NOON_NS + number * SECOND_NS // 50, number, payload)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.mcap"


def write(path: Path, *chunks: list[Recorded]) -> list[int]:
    """A complete file, and its size after each flush."""
    writer, sizes = RecordingWriter(path), list[int]()
    for chunk in chunks:
        for message in chunk:
            writer.write(message)
        writer.flush()
        sizes.append(path.stat().st_size)
    writer.close()
    return sizes


def read(path: Path) -> tuple[list[Recorded], bool]:
    reader = RecordingReader(path)
    messages = list(reader.messages())
    return messages, reader.cut


def size_of(path: Path) -> int:
    return path.stat().st_size


def test_what_was_written_is_read_with_its_bytes_and_times(path: Path) -> None:
    written = [twist(n) for n in range(5)] + [twist(2**32 + 7, "/robot/teleop/cmd_vel")]
    write(path, written)
    messages, cut = read(path)
    assert not cut
    assert messages[:5] == written[:5]
    assert messages[5] == written[5]._replace(sequence=7), "a sequence has 32 bits"


def test_rosbags_reads_it_as_a_bag_with_types_names_and_times(path: Path) -> None:
    status = SafetyStatus(header("base_link", NOON_NS), reasons=["OBSTACLE"], owner="teleop", nearest_m=0.3)
    odom = odometry((1.0, 2.0, 0.5), (0.3, -0.1), time_ns=NOON_NS)
    written = [
        Recorded("/robot/odom", Odometry.__msgtype__, NOON_NS, 1, encode(odom)),
        Recorded("/robot/supervisor/status", SafetyStatus.__msgtype__, NOON_NS + 5, 2, encode(status)),
        twist(3),
    ]
    write(path, written)
    with AnyReader([path]) as bag:
        assert {c.topic: c.msgtype for c in bag.connections} == {m.topic: m.msgtype for m in written}
        assert all(c.ext.serialization_format == "cdr" for c in bag.connections)  # type: ignore[union-attr]
        assert all(c.ext.offered_qos_profiles == [] for c in bag.connections)  # type: ignore[union-attr]
        rows = [(c.topic, time_ns, bag.deserialize(data, c.msgtype)) for c, time_ns, data in bag.messages()]
    assert [(topic, time_ns) for topic, time_ns, _ in rows] == [(m.topic, m.log_time_ns) for m in written]
    assert rows[0][2].pose.pose.position.y == 2.0  # type: ignore[attr-defined]
    assert (rows[1][2].reasons, rows[1][2].nearest_m) == (["OBSTACLE"], 0.3)  # type: ignore[attr-defined]
    assert rows[2][2].linear.x == 0.3  # type: ignore[attr-defined]


def test_rosbags_counts_and_times_of_many_chunks_are_right(path: Path) -> None:
    write(path, *[[twist(50 * n + i) for i in range(50)] for n in range(4)])
    with Reader(path) as bag:
        assert bag.message_count == 200
        assert bag.start_time == NOON_NS
        assert bag.end_time == twist(199).log_time_ns + 1


def test_a_file_cut_anywhere_reads_up_to_its_last_whole_chunk(path: Path) -> None:
    chunks = [[twist(10 * n + i) for i in range(10)] for n in range(3)]
    sizes = write(path, *chunks)
    whole = path.read_bytes()
    for length in [*range(sizes[0], sizes[2], 7), sizes[2] - 1, sizes[2], sizes[2] + 1, len(whole) - 1]:
        path.write_bytes(whole[:length])
        messages, cut = read(path)
        assert cut
        flushed = 10 * sum(size <= length for size in sizes)
        assert len(messages) >= flushed
        assert messages == [m for chunk in chunks for m in chunk][: len(messages)]


def test_a_damaged_chunk_ends_the_reading(path: Path) -> None:
    sizes = write(path, [twist(1)], [twist(2)], [twist(3)])
    data = bytearray(path.read_bytes())
    data[sizes[0] + 60] ^= 0xFF
    path.write_bytes(bytes(data))
    messages, cut = read(path)
    assert cut
    assert messages == [twist(1)]


def test_a_recording_of_nothing_is_whole(path: Path) -> None:
    write(path)
    assert read(path) == ([], False)


def test_what_is_no_recording_is_refused(path: Path) -> None:
    with pytest.raises(RecordingError, match=r"cannot read .*No such file"):
        RecordingReader(path)
    path.write_text("a bag of nothing")
    with pytest.raises(RecordingError, match="is not an MCAP file"):
        RecordingReader(path)


def test_a_file_that_exists_is_never_overwritten(path: Path) -> None:
    path.write_text("precious")
    with pytest.raises(RecordingError, match="already exists"):
        RecordingWriter(path)
    assert path.read_text() == "precious"


# --- the recorder on a bus

CONFIG = SupervisorSection.model_validate(
    {
        "lidars": [
            {"name": "front", "topic": "scan", "profile": "rep117"},
            {"name": "rear", "topic": "scan_rear", "profile": "rep117"},
        ],
        "estop_stations": [{"name": "door"}],
    }
)


class Stage:
    """A recorder on a network."""

    def __init__(self, path: Path) -> None:
        self.bus = VirtualNetwork().open_hub("recorder")
        self.shown: list[str] = []
        self.stop = asyncio.Event()
        self.writer = RecordingWriter(path)
        self.recorder = Recorder(self.bus, "robot", CONFIG, self.writer, self.shown.append)

    def put(self, topic: Topic[M], message: M) -> None:
        self.bus.receive(topic.key, encode(message), None)

    async def end(self) -> Report:
        self.stop.set()
        return await self.recorder.run(self.stop)


async def test_everything_until_the_end_is_recorded_under_its_ros_name(path: Path) -> None:
    stage = Stage(path)
    for n in range(100):
        stage.put(topics.ODOM, odometry((n / 10, 0.0, 0.0), (0.1, 0.0)))
    stage.put(topics.source_cmd_vel("teleop"), planar_twist(0.5, 0.0))
    stage.put(topics.STATUS, SafetyStatus(header("")))
    report = await stage.end()
    messages, cut = read(path)
    assert not cut
    counts = {c.name: c.messages for c in report.channels if c.messages}
    assert counts == {"/robot/odom": 100, "/robot/teleop/cmd_vel": 1, "/robot/supervisor/status": 1}
    assert (report.messages, report.failure) == (102, "")
    assert report.size_bytes == size_of(path)
    x_m = [decode(m.payload, Odometry).pose.pose.position.x for m in messages if m.topic == "/robot/odom"]
    assert x_m == [n / 10 for n in range(100)]


async def test_every_lidar_and_estop_station_of_the_configuration_is_recorded(path: Path) -> None:
    stage = Stage(path)
    report = await stage.end()
    names = {channel.name for channel in report.channels}
    assert names >= {"/robot/scan", "/robot/scan_rear", "/robot/estop_station/door/presence"}


async def test_a_source_that_the_supervisor_does_not_know_is_recorded_once_it_is_heard(path: Path) -> None:
    stage = Stage(path)
    running = asyncio.create_task(stage.recorder.run(stage.stop))
    joy, nameless = topics.source_cmd_vel("stick"), topics.source_cmd_vel("no name")
    stage.put(nameless, planar_twist(0.1, 0.0))
    stage.put(joy, planar_twist(0.1, 0.0))
    async with asyncio.timeout(10):
        while joy.key not in stage.bus.subscriptions:  # noqa: ASYNC110 - no event tells
            await asyncio.sleep(0)
    stage.put(nameless, planar_twist(0.1, 0.0))
    stage.put(joy, planar_twist(0.1, 0.0))
    stage.stop.set()
    report = await running
    assert [(c.name, c.messages) for c in report.channels if c.messages] == [("/robot/stick/cmd_vel", 1)]


async def test_strangers_are_recorded_up_to_a_limit(path: Path) -> None:
    stage = Stage(path)
    for n in range(MAX_SOURCES + 10):
        stage.put(topics.source_cmd_vel(f"s{n}"), planar_twist(0.1, 0.0))
    report = await stage.end()
    assert sum(c.name.endswith("/cmd_vel") and c.name.startswith("/robot/s") for c in report.channels) == (
        MAX_SOURCES - len(CONFIG.sources)
    )


async def test_samples_that_never_came_are_counted_as_lost(path: Path) -> None:
    stage = Stage(path)
    payload = encode(planar_twist(0.1, 0.0))
    for sequence, gid in ((1, b"a"), (5, b"a"), (500, b"b"), (501, b"b"), (501, b"b")):
        stamp = Stamp(sequence, 0, gid * 16).pack()
        stage.bus.receive(topics.CMD_VEL.key, payload, stamp)
    stage.bus.receive(topics.CMD_VEL.key, payload, None)
    report = await stage.end()
    (channel,) = [c for c in report.channels if c.messages]
    assert (channel.messages, channel.lost) == (6, 3), "another run begins wherever it likes"


async def test_bytes_that_are_no_message_are_kept_as_they_came(path: Path) -> None:
    stage = Stage(path)
    stage.bus.receive(topics.SCAN.key, b"\x00junk", None)
    await stage.end()
    messages, _ = read(path)
    assert [m.payload for m in messages] == [b"\x00junk"]


async def test_a_file_that_takes_no_more_ends_the_recording_with_the_reason(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(path)
    stage.put(topics.CMD_VEL, planar_twist(0.1, 0.0))

    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("mcap.writer.Writer.finish", full)
    report = await stage.end()
    assert report.failure == "No space left on device"


# --- the command


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def test_the_command_refuses_to_overwrite_before_it_does_anything(path: Path) -> None:
    path.write_text("precious")
    result = run("record", str(path))
    assert result.exit_code == 2
    assert "already exists" in result.output
    assert path.read_text() == "precious"


def test_the_command_refuses_a_wrong_configuration(path: Path, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[supervisor]\ntick_hz = 0\n")
    result = run("record", str(path), "--config", str(config))
    assert result.exit_code == 2
    assert "supervisor.tick_hz = 0" in result.output
    assert not path.exists()
