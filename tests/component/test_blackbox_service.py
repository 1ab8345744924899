"""The supervisor's black box on a perfect network: a stop writes a file, and its replay decides the same."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import pytest

from recordings.incidents.replay import replay
from supervisor.blackbox import recorder as blackbox
from supervisor.blackbox.reader import Document, read
from supervisor.blackbox.recorder import BlackBox, ThreadWriter, Writer
from supervisor.config import SupervisorSection
from tests.component.rig import Rig
from tests.unit.supervisor.blackbox.black_boxes import WriterAtOnce
from wire import topics
from wire.bus import Arrival
from wire.messages import Twist, planar_twist


def box_of(writer: Writer) -> BlackBox:
    return BlackBox(SupervisorSection().law(), writer, window_s=60.0)


@pytest.fixture
def writer(tmp_path: Path) -> WriterAtOnce:
    return WriterAtOnce(tmp_path)


def changes(outputs: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The outputs without repetitions."""
    return [output for output, _ in groupby(outputs)]


def decided(document: Document) -> list[tuple[float, float]]:
    outputs = [line["decision"]["output"] for line in document.lines if "decision" in line]
    return changes((output["linear_m_s"], output["angular_rad_s"]) for output in outputs)


def heard(arrivals: Iterable[Arrival[Twist]]) -> list[tuple[float, float]]:
    twists = [arrival.message for arrival in arrivals if arrival.message is not None]
    return changes((twist.linear.x, twist.angular.z) for twist in twists)


async def test_a_killed_teleop_leaves_a_file_that_decides_the_same_as_went_over_the_wire(
    writer: WriterAtOnce,
) -> None:
    rig = Rig()
    async with rig.supervisor(black_box=box_of(writer)), rig.lidar():
        async with rig.source() as teleop:
            await rig.drive(0.5, 0.2)
            await rig.pass_time(3.0)
            teleop.die()
            await rig.pass_time(1.9)
            assert writer.paths == []
            await rig.pass_time(0.2)
        (path,) = writer.paths
        assert path.name.endswith("Z-SOURCE_LOST.jsonl.gz")
        document = read(path)
        assert heard(rig.cmd_vel.take()) == [(0.5, 0.2), (0.0, 0.0)]
    found = replay(document)
    assert found.difference is None
    assert found.steps == document.header["steps"] > 200
    assert decided(document) == [(0.0, 0.0), (0.5, 0.2), (0.0, 0.0)]


async def test_a_supervisor_that_is_stopped_soon_after_a_stop_writes_at_its_end(writer: WriterAtOnce) -> None:
    rig = Rig()
    async with rig.lidar():
        async with rig.supervisor(black_box=box_of(writer)):
            async with rig.source():
                await rig.drive(0.5)
            await rig.pass_time(0.5)
            assert rig.newest_status.reasons == ["COMMAND_TIMEOUT"]
            assert writer.paths == []
        assert replay(read(writer.paths[0])).difference is None


async def test_a_start_and_an_end_without_motion_leave_nothing(writer: WriterAtOnce) -> None:
    rig = Rig()
    async with rig.supervisor(black_box=box_of(writer)), rig.lidar(), rig.source():
        await rig.pass_time(10.0)
    assert writer.orders == []


async def test_a_directory_that_cannot_be_written_to_stops_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blackbox, "CLOSE_LIMIT_S", 30.0)  # its thread writes in real time
    directory = tmp_path / "blackbox"
    directory.write_text("a file is in its place")
    rig = Rig()
    black_box = box_of(ThreadWriter(directory, max_files=20))
    async with rig.supervisor(black_box=black_box), rig.lidar(), rig.source() as teleop:
        await rig.drive(0.5)
        teleop.publisher(topics.source_cmd_vel(topics.TELEOP)).put(planar_twist(float("nan"), 0.0))
        await rig.pass_time(5.0)
        await rig.drive(0.5)
        assert rig.output() == (0.5, 0.0)
        black_box.close()
        assert [r.message for r in caplog.records if r.levelname == "WARNING"] == [
            f"no black box: [Errno 17] File exists: '{directory}'; supervision continues"
        ]


async def test_bytes_that_are_no_message_are_recorded_as_what_the_law_was_told(writer: WriterAtOnce) -> None:
    rig = Rig()
    async with rig.supervisor(black_box=box_of(writer)), rig.lidar(), rig.source():
        await rig.drive(0.5)
        rig.outsider.send(topics.source_cmd_vel(topics.TELEOP).key, b"\xff" * 52, None)
        rig.outsider.send(topics.SCAN.key, b"", None)
        await rig.pass_time(2.5)
    document = read(writer.paths[0])
    told = [line["inputs"] for line in document.lines if "inputs" in line]
    assert any(inputs["undecodable_lidars"] for inputs in told)
    assert any(command["velocity"] is None for inputs in told for command in inputs["commands"])
    assert replay(document).difference is None
