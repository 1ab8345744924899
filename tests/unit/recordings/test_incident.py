"""A black box as ROS messages: the topics, the order of time, and the values."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import pytest

from recordings.incidents import incident
from recordings.incidents.incident import IncidentError, messages
from recordings.recording import Recorded
from supervisor.blackbox.recorder import BlackBox
from supervisor.law.model import Command, Inputs, Odometry
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, WriterAtOnce
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, TICK_S, lost
from wire.freshness import Sent
from wire.messages import Bool, LaserScan, Message, SafetyStatus, Twist, decode, yaw_of
from wire.messages import Odometry as OdometryMessage

M = TypeVar("M", bound=Message)
NOON_NS = round(NOON_UTC_S * 1e9)


def box_of(writer: WriterAtOnce, *topics: str) -> BlackBox:
    topics = topics or ("scan",)
    return BlackBox(CONFIG, writer, window_s=60.0, lidar_topics=topics, utc=lambda: NOON_UTC_S)


def stopped(directory: Path, *topics: str) -> Path:
    """Neutral, forward for 1 s, an object at 0.2 m; the base brakes in 0.3 s."""
    writer = WriterAtOnce(directory)
    drive = Drive(box_of(writer, *topics))
    drive.drive(1.0)
    drive.stop()
    drive.brake()
    drive.box.close()
    return writer.paths[0]


def of(found: list[Recorded], topic: str, message_type: type[M]) -> list[tuple[int, M]]:
    return [(m.log_time_ns, decode(m.payload, message_type)) for m in found if m.topic == topic]


def test_a_black_box_has_the_topics_of_the_wire(tmp_path: Path) -> None:
    found = list(messages(stopped(tmp_path)))
    assert {m.topic: m.msgtype for m in found} == {
        "/robot/teleop/cmd_vel": "geometry_msgs/msg/Twist",
        "/robot/scan": "sensor_msgs/msg/LaserScan",
        "/robot/odom": "nav_msgs/msg/Odometry",
        "/robot/cmd_vel": "geometry_msgs/msg/Twist",
        "/robot/supervisor/status": "lifeline_msgs/msg/SafetyStatus",
    }
    assert {m.topic.split("/")[1] for m in messages(tmp_path / next(tmp_path.iterdir()), "r2")} == {"r2"}


def test_the_messages_are_in_order_of_time_and_the_stop_is_at_its_wall_time(tmp_path: Path) -> None:
    found = list(messages(stopped(tmp_path)))
    assert all(before.log_time_ns <= after.log_time_ns for before, after in pairwise(found))
    statuses = of(found, "/robot/supervisor/status", SafetyStatus)
    time_ns, status = next(pair for pair in statuses if pair[1].mode == SafetyStatus.STOPPED)
    assert time_ns == NOON_NS
    assert status.header.stamp.sec * 10**9 + status.header.stamp.nanosec == NOON_NS
    assert status.reasons == ["OBSTACLE"]
    assert status.owner == "teleop"
    assert status.nearest_m == pytest.approx(0.2, abs=0.02)
    assert status.permitted.linear.x == 0.0
    assert dict(of(found, "/robot/cmd_vel", Twist))[NOON_NS].linear.x == 0.0
    assert dict(of(found, "/robot/cmd_vel", Twist))[NOON_NS - 40_000_000].linear.x == 0.5


def test_the_scans_and_commands_are_those_that_the_law_read(tmp_path: Path) -> None:
    found = list(messages(stopped(tmp_path)))
    scans = of(found, "/robot/scan", LaserScan)
    commands = of(found, "/robot/teleop/cmd_vel", Twist)
    assert len(scans) == len(commands) == 67
    last = scans[-1][1]
    assert last.header.frame_id == "lidar"
    assert last.ranges.shape == (360,)
    assert last.ranges[180] == pytest.approx(0.45, abs=0.02)
    assert last.angle_max == pytest.approx(math.pi - math.tau / 360, abs=1e-5)
    assert commands[-1][1].linear.x == 0.5


def test_the_pose_is_reckoned_from_the_measured_velocity(tmp_path: Path) -> None:
    samples = of(list(messages(stopped(tmp_path))), "/robot/odom", OdometryMessage)
    assert [round(sample.twist.twist.linear.x, 3) for _, sample in samples[:2]] == [0.5, 0.467]
    travelled_m = samples[-1][1].pose.pose.position.x - samples[0][1].pose.pose.position.x
    assert travelled_m == pytest.approx(0.5 * 0.5 * 0.3, rel=0.1)
    assert yaw_of(samples[-1][1].pose.pose.orientation) == 0.0


def test_a_press_of_the_emergency_stop_is_a_message(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    drive.step(Inputs(estop=True))
    drive.box.close()
    pressed = of(list(messages(writer.paths[0])), "/robot/estop", Bool)
    assert [(time_ns, message.data) for time_ns, message in pressed] == [(NOON_NS, True)]


def test_a_stamped_command_keeps_its_sequence_and_an_undecodable_one_is_left_out(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    at_s = drive.now_s + TICK_S
    stamped = Command("joy", FORWARD, at_s, Sent(b"epoch", 2**32 + 7, 1.0))
    drive.step(Inputs(commands=(stamped, Command("joy", None, at_s)), liveliness=lost()))
    drive.box.close()
    joy = [m for m in messages(writer.paths[0]) if m.topic == "/robot/joy/cmd_vel"]
    assert [m.sequence for m in joy] == [2**32 + 7]


def test_a_message_that_arrived_before_an_earlier_step_is_in_its_place(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    early_s = drive.now_s - 0.5 * TICK_S
    drive.step(Inputs(odometry=Odometry(FORWARD, early_s), liveliness=lost()))
    drive.box.close()
    times = [(m.log_time_ns, m.topic) for m in messages(writer.paths[0])]
    assert times == sorted(times, key=lambda pair: pair[0])
    (place,) = [i for i, (_, topic) in enumerate(times) if topic == "/robot/odom"]
    assert times[place + 1 :][0][1] in {"/robot/teleop/cmd_vel", "/robot/scan"}
    assert times[place][0] == NOON_NS - round(1.5 * TICK_S * 1e9)


def test_each_lidar_has_its_own_topic(tmp_path: Path) -> None:
    assert "/robot/front/scan" in {m.topic for m in messages(stopped(tmp_path, "front/scan"))}


def test_a_topic_that_no_lidar_may_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IncidentError, match="cmd_vel"):
        next(messages(stopped(tmp_path, "cmd_vel")))


def test_a_truncated_file_yields_its_beginning_and_then_the_error(tmp_path: Path) -> None:
    path = stopped(tmp_path)
    whole = len(list(messages(path)))
    path.write_bytes(path.read_bytes()[:-200])
    found: list[Recorded] = []
    with pytest.raises(IncidentError, match="is damaged after"):
        found.extend(messages(path))
    assert whole // 2 < len(found) <= whole
    assert all(before.log_time_ns <= after.log_time_ns for before, after in pairwise(found))


def test_a_file_that_is_not_there_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(IncidentError, match=r"cannot read .*No such file"):
        next(messages(tmp_path / "none.jsonl.gz"))


def test_few_messages_wait_for_earlier_ones_and_none_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = stopped(tmp_path)
    whole = sorted(messages(path))
    monkeypatch.setattr(incident, "MAX_WAITING", 0)
    assert sorted(messages(path)) == whole


def test_a_message_far_from_the_stop_is_damage(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    drive.step(Inputs(commands=(Command("teleop", FORWARD, 1e9),), liveliness=lost()))
    drive.box.close()
    with pytest.raises(IncidentError, match="damaged: a message is"):
        list(messages(writer.paths[0]))


def test_a_scan_of_a_lidar_that_is_not_configured_is_left_out(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    document = drive.scan(drive.now_s)
    decision = drive.step(Inputs(liveliness=lost()))
    drive.box.record(drive.now_s, Inputs(scans=(replace(document, lidar=3),)), drive.state, decision)
    drive.box.close()
    scans = [m for m in messages(writer.paths[0]) if m.topic == "/robot/scan"]
    assert len(scans) == round(0.8 / TICK_S)


def test_a_value_that_no_message_can_hold_is_damage(tmp_path: Path) -> None:
    writer = WriterAtOnce(tmp_path)
    drive = Drive(box_of(writer))
    drive.drive()
    decision = drive.step(Inputs(liveliness=lost()))
    far = replace(drive.scan(drive.now_s), range_max=1e300)
    drive.box.record(drive.now_s, Inputs(scans=(far,)), drive.state, decision)
    drive.box.close()
    with pytest.raises(IncidentError, match="damaged: sensor_msgs/msg/LaserScan"):
        list(messages(writer.paths[0]))
