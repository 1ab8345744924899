"""`lifeline path`: reading recordings, placing a path, and the report."""

import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from deploy.stack.errors import DeployError
from lifeline.cli.app import app
from lifeline.path import START_LIMIT_M, TruthSample, absolute, read_poses, relative, report, true_distances_m
from lifeline.recording.reader import Recorded, RecordingWriter
from teleop.path.legs import Path, to_path
from teleop.path.pose import PathError, Pose, Poses, placed
from teleop.path.service import Drive, Ending, Sample
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
    path = to_path(AHEAD)
    times_s = 100.0 + 0.02 * np.arange(101)
    samples = [
        Sample(float(t), Pose(x, off_m, 0.0), 0, x, off_m, on_path=i > 0)
        for i, (t, x) in enumerate(zip(times_s, np.linspace(0.0, 2.0, 101).tolist(), strict=True))
    ]
    began = Sample(99.98, Pose(0.0, 0.0, 0.0), 0, 0.0, 0.0, on_path=True)
    return Drive(Ending.DONE, "", path, began, samples, 2.0, 5.0, Pose(2.0, off_m, 0.02))


def truth_of(drive: Drive, frame: Pose, slip_m: float) -> list[TruthSample]:
    """The true poses: in another frame, and slipped to the right."""
    assert drive.began is not None
    start = TruthSample(drive.began.arrival_s + 0.005, frame)
    rows = [s.pose._replace(y_m=s.pose.y_m - slip_m) for s in drive.samples]
    world = placed(np.array(rows), frame).tolist()
    return [start] + [
        TruthSample(s.arrival_s + 0.005, Pose(*row)) for s, row in zip(drive.samples, world, strict=True)
    ]


def path_of(drive: Drive) -> Path:
    assert drive.path is not None
    return drive.path


def test_the_truth_is_measured_in_the_frame_in_which_the_drive_began() -> None:
    drive = straight_drive(off_m=0.01)
    distances = true_distances_m(path_of(drive), drive, truth_of(drive, Pose(-4.5, 2.0, 1.0), slip_m=0.03))
    assert len(distances) == 100, "the sample before it was on the path does not count"
    assert distances == pytest.approx([0.02] * 100)


def test_without_a_truth_at_the_time_nothing_is_made_up() -> None:
    drive = straight_drive()
    truth = truth_of(drive, Pose(0.0, 0.0, 0.0), 0.0)
    assert true_distances_m(path_of(drive), drive, []) == []
    assert true_distances_m(path_of(drive), drive, truth[5:]) == []
    assert len(true_distances_m(path_of(drive), drive, truth[:50])) == pytest.approx(50, abs=2)
    drive.began = None
    assert true_distances_m(path_of(drive), drive, truth) == []


def test_the_report_of_a_path_that_was_driven() -> None:
    drive = straight_drive()
    assert report(drive, truth_of(drive, Pose(1.0, 2.0, 3.0), 0.02)) == [
        "the path is complete: 2.00 of 2.00 m in 5.0 s of driving",
        "distance from the path, by odometry: 10 mm rms, 10 mm at most, over 100 samples",
        "distance from the path, by the simulator's ground truth: 10 mm rms, 10 mm at most, over 100 samples",
        "distance from the end, by odometry: 10 mm and 1.1 degrees",
    ]


def test_the_report_of_a_path_that_was_stopped_or_never_began() -> None:
    drive = straight_drive(off_m=1.2)
    drive.ending, drive.reason, drive.done_m = Ending.STOPPED, "STOPPED: ESTOP", 0.5
    assert report(drive, []) == [
        "ended early, STOPPED: ESTOP: 0.50 of 2.00 m in 5.0 s of driving",
        "distance from the path, by odometry: 1.20 m rms, 1.20 m at most, over 100 samples",
    ]
    assert report(Drive(), []) == ["interrupted; the robot did not move"]


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
