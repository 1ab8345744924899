"""`lifeline path`: reading recordings, placing a path, and the report."""

import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from deploy.stack.errors import DeployError
from lifeline.cli.app import app
from lifeline.path import START_LIMIT_M, absolute, read_poses, relative, report, to_json
from recordings.recording import Recorded, RecordingWriter
from teleop.path.course import PathError, Pose, Poses, placed, to_path
from teleop.path.service import Drive, Ending
from wire.messages import Odometry, encode, odometry

AHEAD: Poses = np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)])


def record(path: FilePath, poses: Poses, topic: str = "/robot/odom", *, whole: bool = True) -> FilePath:
    writer = RecordingWriter(path)
    for n, (x_m, y_m, yaw_rad) in enumerate(poses.tolist()):
        payload = encode(odometry((x_m, y_m, yaw_rad), (0.0, 0.0)))
        writer.write(Recorded(topic, Odometry.__msgtype__, n * 20_000_000, n, payload))
    writer.flush()
    flushed = path.read_bytes()
    writer.close()
    if not whole:
        path.write_bytes(flushed)
    return path


def drive_straight(count: int = 101) -> Poses:
    x_m = np.linspace(5.0, 7.0, count)
    return np.stack((x_m, np.full(count, 1.0), np.zeros(count)), axis=1)


@pytest.mark.parametrize("whole", [True, False])
def test_the_path_of_a_recording_is_read_also_from_one_that_was_cut(
    tmp_path: FilePath, *, whole: bool
) -> None:
    poses = read_poses(record(tmp_path / "a.mcap", drive_straight(), whole=whole))
    assert poses[0].tolist() == [5.0, 1.0, 0.0]
    assert to_path(poses).length_m == pytest.approx(2.0)


def test_a_recording_of_another_robot_will_do(tmp_path: FilePath) -> None:
    assert len(read_poses(record(tmp_path / "a.mcap", drive_straight(), topic="/odom")))


def test_a_recording_without_odometry_is_refused(tmp_path: FilePath) -> None:
    path = record(tmp_path / "a.mcap", drive_straight(), topic="/robot/sim/truth")
    with pytest.raises(
        DeployError, match="one odometry topic is needed to follow a recording, and it has none"
    ):
        read_poses(path)


def test_a_recording_of_a_robot_that_stands_is_refused(tmp_path: FilePath) -> None:
    path = record(tmp_path / "a.mcap", np.zeros((50, 3)))
    with pytest.raises(DeployError, match=r"a\.mcap: the robot of this recording does not drive"):
        read_poses(path)


def test_an_undecodable_sample_is_passed_over(tmp_path: FilePath) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap")
    for n, row in enumerate(drive_straight().tolist()):
        payload = b"junk" if n == 50 else encode(odometry(tuple(row), (0.0, 0.0)))
        writer.write(Recorded("/robot/odom", Odometry.__msgtype__, n * 20_000_000, n, payload))
    writer.close()
    assert to_path(read_poses(tmp_path / "a.mcap")).length_m == pytest.approx(2.0)


def test_a_relative_path_begins_where_the_robot_stands() -> None:
    path = relative(placed(AHEAD, Pose(7.0, -3.0, 2.0)))(Pose(1.0, 1.0, math.pi / 2))
    assert path.start == pytest.approx((1.0, 1.0, math.pi / 2))
    assert path.end == pytest.approx((1.0, 3.0, math.pi / 2))


def test_an_absolute_path_stays_where_it_is_and_asks_the_robot_to_be_there() -> None:
    plan = absolute(AHEAD)
    assert plan(Pose(0.0, START_LIMIT_M - 1e-9, 1.0)).start == (0.0, 0.0, 0.0)
    with pytest.raises(PathError, match=r"begins 0\.50 m from the robot, at x 0\.00 m, y 0\.00 m"):
        plan(Pose(0.0, START_LIMIT_M + 1e-9, 1.0))


# --- the report


def straight_drive(off_m: float = 0.01) -> Drive:
    """Two metres ahead, a little to the left."""
    return Drive(Ending.DONE, "", to_path(AHEAD), [off_m] * 100, 2.0, 5.0)


def test_the_report_of_a_path_that_was_driven() -> None:
    assert report(straight_drive()) == [
        "the path is complete: 2.00 of 2.00 m in 5.0 s of driving",
        "distance from the path, by odometry: 10 mm rms, 10 mm at most, over 100 samples",
    ]


def test_the_report_of_a_path_that_was_stopped_or_never_began() -> None:
    drive = straight_drive(off_m=1.2)
    drive.ending, drive.reason, drive.done_m = Ending.STOPPED, "STOPPED: ESTOP", 0.5
    assert report(drive) == [
        "ended early, STOPPED: ESTOP: 0.50 of 2.00 m in 5.0 s of driving",
        "distance from the path, by odometry: 1.20 m rms, 1.20 m at most, over 100 samples",
    ]
    assert report(Drive()) == ["interrupted; the robot did not move"]


def test_the_report_as_json_has_no_path_if_the_robot_did_not_move() -> None:
    assert to_json(straight_drive()) == {
        "ending": "DONE",
        "reason": None,
        "path": {"length_m": 2.0, "done_m": 2.0, "driving_s": 5.0},
        "off_path_by_odometry": {"count": 100, "rms_m": pytest.approx(0.01), "max_m": 0.01},
    }
    assert to_json(Drive()) == {"ending": "INTERRUPTED", "reason": None, "path": None}


# --- the command


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["path", *arguments])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["square", "--side", "0"], "--side"),
        (["square", "--speed", "nan"], "--speed"),
        (["circle", "--radius", "-1"], "--radius"),
        (["circle", "--laps", "0"], "--laps"),
        (["follow", "no/such.mcap"], "cannot read no/such.mcap"),
        (["square", "--endpoint", "nonsense"], "nonsense"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(arguments: list[str], words: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert words in result.output
    assert "Traceback" not in result.output


def test_a_wrong_teleop_section_is_refused(tmp_path: FilePath) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[teleop]\nrate_hz = 0\n")
    result = run("square", "--config", str(config))
    assert result.exit_code == 2
    assert "teleop.rate_hz = 0" in result.output
