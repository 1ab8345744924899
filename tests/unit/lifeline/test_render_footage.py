"""What `lifeline render` draws of the messages of a running robot, of a recording and of a black box."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from lifeline.render.footage import OPEN, Footage, of_file
from lifeline.render.render import Wanted
from recordings.record import Recorded
from recordings.recording import RecordingWriter
from sim import mj
from sim.config import Build
from sim.messages import to_diagnostics
from sim.overlay import Mode
from sim.plant import Plant, Pose
from tests.unit.recordings.test_incident_summary import lost_at
from tests.unit.sim.test_diagnostics import WELL
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S
from wire.messages import Message, SafetyStatus, encode, header, laser_scan, odometry
from wire.topics import DIAGNOSTICS, ODOM, SCAN, STATUS, TRUTH, Topic

LAUNCH = Launch.read(None, None)
Told = tuple[float, Topic[Any], Message]


def recorded(told: Sequence[Told], namespace: str = "robot") -> list[Recorded]:
    return [
        Recorded(
            f"/{namespace}/{topic.key}",
            topic.type.__msgtype__,
            round((NOON_UTC_S + time_s) * 1e9),
            0,
            encode(message),
        )
        for time_s, topic, message in told
    ]


def footage(*told: Told) -> Footage:
    return Footage("it", LAUNCH, recorded(told))


def at(time_s: float, x_m: float, y_m: float = 0.0, yaw_rad: float = 0.0, topic: Topic[Any] = TRUTH) -> Told:
    return time_s, topic, odometry((x_m, y_m, yaw_rad), (x_m, 0.0))


def seen(time_s: float, walker: Pose, pillar: tuple[float, float] | None = None) -> Told:
    movers = {"walker": walker} | ({} if pillar is None else {"pillar": Pose(*pillar, 0.0)})
    return time_s, DIAGNOSTICS, to_diagnostics(replace(WELL, time_s=time_s, movers=movers))


def drawn(shot: Footage, plant: Plant, *times_s: float) -> list[Pose]:
    return [plant.true_pose for _ in shot.play(plant, times_s)]


def test_the_robot_is_where_its_last_true_pose_was_and_not_where_its_odometry_was() -> None:
    shot = footage(at(0.0, 0.5), at(0.1, 9.0, topic=ODOM), at(1.0, 1.0, 2.0, -2.0), at(2.0, 3.0))
    assert shot.robot == "it, by its true pose"
    assert (shot.scene, shot.duration_s) == ("warehouse", pytest.approx(2.0))
    poses = drawn(shot, Plant("empty"), 0.0, 0.99, 1.01, 2.01)
    for pose, wanted in zip(poses, [(0.5, 0, 0), (0.5, 0, 0), (1.0, 2.0, -2.0), (3.0, 0, 0)], strict=True):
        assert pose == pytest.approx(wanted)


def test_without_a_true_pose_odometry_begins_at_the_start_of_an_open_floor_without_people(
    tmp_path: Path,
) -> None:
    shot = footage(at(0.0, 0.0, topic=ODOM), at(1.0, 2.0, 1.0, 0.5, topic=ODOM))
    assert shot.robot == "it, by its odometry, which drifts"
    assert (shot.scene, shot.sim.moving) == (str(OPEN), False)
    (pose,) = drawn(shot, Plant(shot.scene), 1.01)
    assert pose == pytest.approx((2.0, 1.0, 0.5))
    turned = tmp_path / "turned.toml"
    turned.write_text("[hall]\nsize_m = [20, 20]\n[start]\nx_m = 1\ny_m = 3\nyaw_deg = 90\n")
    (pose,) = drawn(shot, Plant(turned), 1.01)
    assert pose == pytest.approx((0.0, 5.0, 0.5 + math.pi / 2))


def test_people_and_pillar_are_where_the_last_report_says() -> None:
    shot = footage(
        at(0.0, 0.0),
        seen(0.5, Pose(1.0, 1.0, 3.0)),
        seen(1.5, Pose(2.0, 1.0, -3.0), (2.0, 0.5)),
        seen(2.5, Pose(2.0, 1.0, -3.0)),
        at(3.0, 0.0),
    )
    assert shot.sim.moving
    plant = Plant("empty", options=Build(moving=True))
    data: Any = plant.data
    walker, pillar = (mj.id_of(plant.model, "body", name) for name in ("walker", "pillar"))
    found: list[list[float]] = []
    for _ in shot.play(plant, (0.6, 1.6, 2.6)):
        mj.kinematics(plant.model, plant.data)
        w, _, _, z = data.xquat[walker].tolist()
        x_m, y_m, z_m = data.xpos[pillar].tolist()
        stands = [x_m, y_m] if z_m > 0.0 else []
        found.append([*data.xpos[walker][:2].tolist(), 2.0 * math.atan2(z, w), *stands])
    wanted = [[1.0, 1.0, 3.0], [2.0, 1.0, -3.0, 2.0, 0.5], [2.0, 1.0, -3.0]]
    assert found == [pytest.approx(row) for row in wanted]


def test_mode_speed_and_scan_are_shown_until_the_status_is_half_a_second_old() -> None:
    status = SafetyStatus(header(""), mode=SafetyStatus.DRIVING, nearest_m=1.5)
    whole, half = (
        laser_scan(np.full(beams, 2.0, np.float32), range_m=(0.1, 12.0), period_s=0.05)
        for beams in (360, 180)
    )
    shot = footage(at(0.0, 0.3), (0.0, STATUS, status), (0.2, SCAN, whole), (0.4, SCAN, half), at(1.0, 0.3))
    first, then, late = shot.play(Plant("empty"), (0.0, 0.49, 0.51))
    assert (first.mode, first.speed, first.nearest) == (Mode.DRIVING, "0.30 m/s", "1.50 m")
    assert first.ranges[0].size == 0
    assert np.array_equal(then.ranges[0], whole.ranges), "a scan of another lidar has other beams"
    assert late.mode is Mode.ALONE


def test_a_film_is_as_long_as_the_poses_or_as_wanted_and_a_picture_shows_the_end(tmp_path: Path) -> None:
    longest_s = footage(at(1.0, 0.0), at(4.0, 0.0)).duration_s
    film, picture = Wanted(tmp_path / "a.mp4", fps=10.0), Wanted(tmp_path / "a.png")
    assert film.times_s(longest_s) == pytest.approx(np.arange(30) / 10.0)
    assert len(film._replace(seconds=2.0).times_s(longest_s)) == 20
    assert len(film._replace(seconds=9.0).times_s(longest_s)) == 30
    assert picture.times_s(longest_s) == pytest.approx([3.0])
    assert picture._replace(seconds=2.0).times_s(longest_s) == [2.0]


def test_messages_that_cannot_be_decoded_or_are_not_numbers_are_passed_over() -> None:
    told = recorded([at(0.0, 0.0), at(1.0, math.nan), at(2.0, 1.0)])
    told.append(told[0]._replace(payload=b"\x00\x01"))
    shot = Footage("it", LAUNCH, told)
    assert shot.duration_s == pytest.approx(2.0)
    assert drawn(shot, Plant("empty"), 2.01)[0] == pytest.approx((1.0, 0.0, 0.0))


@pytest.mark.parametrize("namespace", ["robot", "robot2"])
def test_a_recording_without_a_pose_is_refused(tmp_path: Path, namespace: str) -> None:
    writer = RecordingWriter(tmp_path / "drive.mcap")
    told = [at(0.0, 0.0)] if namespace == "robot2" else [seen(0.0, Pose(0.0, 0.0, 0.0))]
    for message in recorded(told, namespace):
        writer.write(message)
    writer.close()
    with pytest.raises(
        DeployError, match=r"no message on /robot/odom, so there is no pose to draw: .*--config$"
    ):
        of_file(LAUNCH, tmp_path / "drive.mcap")


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(
        DeployError,
        match="is not an MCAP file: name a recording, such as a file that `lifeline record` wrote",
    ):
        of_file(LAUNCH, tmp_path / "notes.txt")
    with pytest.raises(DeployError, match=r"none\.mcap \(No such file or directory\)"):
        of_file(LAUNCH, tmp_path / "none.mcap")


def test_an_incident_is_drawn_by_its_odometry(tmp_path: Path) -> None:
    lost_at(tmp_path)
    (black_box,) = tmp_path.iterdir()
    shot = of_file(LAUNCH, black_box)
    assert shot.robot == f"{black_box}, by its odometry, which drifts"
    poses = drawn(shot, Plant(shot.scene), 0.0, shot.duration_s)
    assert poses == [pytest.approx((0.0, 0.0, 0.0)), pytest.approx((0.095, 0.0, 0.0), abs=0.001)]
