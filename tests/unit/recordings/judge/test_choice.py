"""Which topics of a recording are judged."""

from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from recordings.judge.choice import TWIST_STAMPED, Chosen, Named, choose
from recordings.judge.source import Found
from wire.message_types import EstopLease, SafetyStatus
from wire.ros import Bool, Imu, LaserScan, Odometry, Twist

PATH = Path("bag.mcap")
SCAN, ODOM, TWIST = (Found(one.__msgtype__, 9) for one in (LaserScan, Odometry, Twist))
STAMPED = Found(TWIST_STAMPED, 9)
USUAL = {"/scan": SCAN, "/odom": ODOM, "/cmd_vel": TWIST, "/imu": Found(Imu.__msgtype__, 9)}


def chosen(found: dict[str, Found], *lidars: str, **named: object) -> Chosen:
    return choose(PATH, found, Named(**named), lidars)  # type: ignore[arg-type]


def refused(found: dict[str, Found], *lidars: str, **named: object) -> str:
    with pytest.raises(DeployError) as caught:
        chosen(found, *lidars, **named)
    sentence = str(caught.value)
    assert "\n" not in sentence
    return sentence


def test_the_only_topic_of_each_type_is_judged() -> None:
    assert chosen(USUAL) == Chosen(("/scan",), "/odom", "/cmd_vel")
    assert chosen(USUAL | {"/cmd_vel": STAMPED}) == Chosen(("/scan",), "/odom", "/cmd_vel")


def test_a_topic_without_messages_does_not_count() -> None:
    assert chosen(USUAL | {"/cmd_vel_nav": Found(TWIST_STAMPED, 0)}).cmd_vel == "/cmd_vel"


@pytest.mark.parametrize(
    ("more", "option"),
    [
        ({"/scan_rear": SCAN}, "--scan"),
        ({"/odometry/filtered": ODOM}, "--odom"),
        ({"/cmd_vel_stamped": STAMPED}, "--cmd-vel"),
    ],
)
def test_of_several_topics_all_are_named_and_the_option_is_asked_for(
    more: dict[str, Found], option: str
) -> None:
    sentence = refused(USUAL | more)
    assert option in sentence
    (added,) = more
    assert added in sentence


def test_named_topics_are_judged_in_their_order() -> None:
    found = USUAL | {"/rear": SCAN, "/odom2": ODOM, "/joy_vel": TWIST}
    names = {"scans": ("/scan", "/rear"), "odom": "/odom2", "cmd_vel": "/joy_vel"}
    assert chosen(found, **names) == Chosen(("/scan", "/rear"), "/odom2", "/joy_vel")


def test_a_named_topic_that_is_not_there_or_of_another_type_is_refused() -> None:
    assert "it has /odom" in refused(USUAL, odom="/odometry")
    assert "it is a sensor_msgs/msg/Imu, not a nav_msgs/msg/Odometry" in refused(USUAL, odom="/imu")


def test_the_configurations_lidars_choose_their_topics() -> None:
    found = {**USUAL, "/base/rear/scan": SCAN, "/base/front": SCAN}
    assert chosen(found, "front", "rear/scan").scans == ("/base/front", "/base/rear/scan")
    assert chosen(USUAL, "laser").scans == ("/scan",)
    assert "the configuration has 2 lidars" in refused(USUAL, "front", "rear")
    assert "the configuration has 2 lidars" in refused(USUAL, "front", "rear", scans=("/scan",))


def test_a_recording_without_a_scan_is_judged_by_odometry_and_commands() -> None:
    del (found := dict(USUAL))["/scan"]
    assert chosen(found) == Chosen((), "/odom", "/cmd_vel")
    del found["/odom"]
    assert "cannot be judged: it has no laser scan" in refused(found)
    assert "no ROS 2 messages" in refused({})


def test_the_topics_of_a_supervised_robot_are_found_by_the_names_of_the_wire() -> None:
    found = {
        "/r2/scan": SCAN,
        "/r2/odom": ODOM,
        "/r2/cmd_vel": TWIST,
        "/r2/teleop/cmd_vel": TWIST,
        "/r2/joy/cmd_vel": TWIST,
        "/r2/estop": Found(Bool.__msgtype__, 1),
        "/r2/estop_station/door/presence": Found(EstopLease.__msgtype__, 9),
        "/r2/supervisor/status": Found(SafetyStatus.__msgtype__, 9),
        "/other/scan": SCAN,
    }
    own = chosen(found)
    assert (own.scans, own.odom, own.cmd_vel) == (("/r2/scan",), "/r2/odom", "/r2/cmd_vel")
    assert own.requests == {"/r2/teleop/cmd_vel": "teleop", "/r2/joy/cmd_vel": "joy"}
    assert set(own.estops) == {"/r2/estop", "/r2/estop_station/door/presence"}
    assert own.all() == set(found) - {"/other/scan"}
    assert chosen(found, scans=("/other/scan",), cmd_vel="/r2/cmd_vel").status is None
    assert "several statuses" in refused(
        found | {"/r3/supervisor/status": Found(SafetyStatus.__msgtype__, 9)}
    )


def test_a_sentence_names_few_of_many_topics() -> None:
    sentence = refused({f"/scan{k}": SCAN for k in range(50)})
    assert "42 more" in sentence
    assert len(sentence) < 600
