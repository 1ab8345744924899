"""The report of each topic: its level, its sentence and its values."""

from ros2.config import RosSourceSection
from ros2.presence import Programs
from ros2.reports import base_report, estop_report, sensor_report, source_report
from ros2.ros import BOOL, LASER_SCAN, TWIST, TWIST_STAMPED, Endpoint, Level, Report

TELEOP = Endpoint("/teleop", TWIST, b"1" * 16)
OTHER = Endpoint("/other", TWIST, b"2" * 16)
STAMPED = Endpoint("/joy", TWIST_STAMPED, b"3" * 16)
BASE = Endpoint("/base", TWIST, b"4" * 16)
TOPIC = "/teleop/cmd_vel"
KEYBOARD = RosSourceSection(name="teleop", topic="teleop/cmd_vel", hold_s=0.6)
STEADY = RosSourceSection(name="teleop", topic="teleop/cmd_vel")


def programs(*live: Endpoint, wrong: tuple[Endpoint, ...] = ()) -> Programs:
    return Programs(TOPIC, TWIST, everyone=[*live, *wrong], live=list(live))


# --- sources


def test_a_source_without_a_program_is_a_warning_without_values() -> None:
    report = source_report(STEADY, programs(), 0, 0)
    assert report == ("source teleop", Level.WARN, "no program publishes on /teleop/cmd_vel", ())


def test_the_only_program_is_named_with_what_detects_its_end() -> None:
    report = source_report(STEADY, programs(TELEOP), 3, 1)
    assert report.level is Level.OK
    assert report.message == "/teleop on /teleop/cmd_vel, guarded by discovery, the command timeout"
    assert dict(report.values) == {
        "topic": "/teleop/cmd_vel (geometry_msgs/msg/Twist)",
        "node": "/teleop",
        "guards": "discovery, the command timeout",
        "hold_s": "off",
        "arm": "on_neutral",
        "accepted": "3",
        "refused": "1",
    }


def test_the_guards_are_listed_from_the_earliest_on_and_the_hold_is_named() -> None:
    only = programs(TELEOP)
    only.pid, only.wrapped = 4711, True
    report = source_report(KEYBOARD, only, 0, 0)
    assert report.level is Level.OK
    assert report.message == (
        "/teleop on /teleop/cmd_vel, guarded by process 4711 on this host, lifeline ros2 exec, discovery, "
        "the command timeout; each command is held for 0.6 s"
    )
    assert dict(report.values)["hold_s"] == "0.6"


def test_refused_messages_are_an_error_of_their_topic() -> None:
    source = source_report(STEADY, programs(TELEOP), 0, 0, "messages have no attachment")
    assert (source.level, source.message) == (Level.ERROR, "messages have no attachment")
    sensor = sensor_report("odom", "/odom", TWIST, [BASE], writers=1, problem="messages have no attachment")
    assert (sensor.level, sensor.message) == (Level.ERROR, "messages have no attachment")


def test_the_report_of_a_stamped_source_says_what_shows_its_age() -> None:
    report = source_report(STEADY, programs(TELEOP), 0, 0, age="from the headers' stamps")
    assert dict(report.values)["age"] == "from the headers' stamps"
    assert "age" not in dict(source_report(STEADY, programs(TELEOP), 0, 0).values)


def test_two_programs_are_an_error_that_names_both() -> None:
    report = source_report(STEADY, programs(TELEOP, OTHER), 0, 5)
    assert report.level is Level.ERROR
    assert report.message == (
        "/other and /teleop all publish on /teleop/cmd_vel, so none is obeyed: end all but one"
    )


def test_a_program_that_outlived_its_wrapper_is_named() -> None:
    none = programs()
    none.outlived = [TELEOP]
    report = source_report(STEADY, none, 0, 0)
    assert report.level is Level.ERROR
    assert report.message.startswith(
        "/teleop publishes on /teleop/cmd_vel although its `lifeline ros2 exec` has ended"
    )


def test_an_estop_needs_no_button_but_one_of_the_right_type() -> None:
    button = OTHER._replace(type_name=BOOL)
    assert estop_report("/estop", []).message == "no button publishes on /estop"
    assert estop_report("/estop", [button]).message == "/other on /estop"
    wrong = estop_report("/estop", [OTHER])
    assert wrong.level is Level.ERROR
    assert wrong.message.startswith("/other uses geometry_msgs/msg/Twist on /estop")


def test_a_stopped_program_is_an_error() -> None:
    only = programs(TELEOP)
    only.stopped = True
    report = source_report(STEADY, only, 0, 0)
    assert report.level is Level.ERROR
    assert report.message == "the process of /teleop is stopped by a signal: continue or end it"


def test_a_program_of_the_other_type_is_an_error_also_beside_a_right_one() -> None:
    for live in ((), (TELEOP,)):
        report = source_report(STEADY, programs(*live, wrong=(STAMPED,)), 0, 0)
        assert report.level is Level.ERROR
        assert report.message.startswith("/joy uses geometry_msgs/msg/TwistStamped")
        assert report.message.endswith("set stamped of the source teleop = true")


# --- sensors


def scan_report(*publishers: Endpoint, writers: int) -> tuple[Level, str]:
    report = sensor_report("scan scan", "/scan", LASER_SCAN, publishers, writers=writers)
    assert report.name == "scan scan"
    assert dict(report.values) == {"topic": "/scan (sensor_msgs/msg/LaserScan)"}
    return report.level, report.message


LIDAR = Endpoint("/lidar", LASER_SCAN, b"5" * 16)


def test_a_sensor_that_one_node_publishes_is_fine() -> None:
    assert scan_report(LIDAR, writers=1) == (Level.OK, "/lidar on /scan")


def test_a_sensor_without_publisher_names_what_to_do() -> None:
    assert scan_report(writers=0) == (
        Level.ERROR,
        "no node publishes on /scan: start the driver, or correct the topic in [ros2]",
    )


def test_a_silent_sensor_is_an_error() -> None:
    assert scan_report(LIDAR, writers=0) == (Level.ERROR, "/lidar publishes nothing on /scan")


def test_two_writers_of_a_sensor_are_an_error_even_from_one_node() -> None:
    assert scan_report(LIDAR, writers=2) == (
        Level.ERROR,
        "2 writers publish on /scan (/lidar): end all but one",
    )


def test_a_sensor_of_another_type_is_named_once() -> None:
    level, message = scan_report(LIDAR._replace(type_name=TWIST), writers=0)
    assert level is Level.ERROR
    assert message == (
        "/lidar uses geometry_msgs/msg/Twist on /scan, but sensor_msgs/msg/LaserScan is expected, "
        "so they are not connected: give it a topic with sensor_msgs/msg/LaserScan"
    )


# --- the base


def of_base(others: list[Endpoint], subscriptions: list[Endpoint], base: str = "OK") -> Report:
    return base_report("/cmd_vel", TWIST, others, subscriptions, base, own_node="/lifeline")


def test_a_second_process_of_lifeline_is_named_as_such() -> None:
    second = OTHER._replace(node="/lifeline")
    twice = "a second process ros2 of Lifeline publishes on /cmd_vel: end one of the two"
    assert of_base([second], [BASE]).message == twice
    assert of_base([second, OTHER], [BASE]).message.startswith(f"{twice}; /other publishes")


def test_a_base_that_listens_is_fine() -> None:
    report = of_base([], [BASE], "follows the supervisor")
    assert report == (
        "cmd_vel",
        Level.OK,
        "/base listens on /cmd_vel",
        (("topic", "/cmd_vel (geometry_msgs/msg/Twist)"), ("base", "follows the supervisor")),
    )


def test_a_base_that_does_not_listen_is_an_error() -> None:
    report = of_base([], [], "NO_COMMAND")
    assert report.level is Level.ERROR
    assert report.message == (
        "no node listens on /cmd_vel: start the base's driver, or correct cmd_vel in [ros2]"
    )


def test_another_publisher_past_the_supervisor_is_the_first_problem() -> None:
    listening = BASE._replace(type_name=TWIST_STAMPED, is_transient=True)
    report = of_base([OTHER], [listening])
    assert report.level is Level.ERROR
    first, second, third = report.message.split("; ")
    assert first.startswith("/other publishes on /cmd_vel too, bypassing the supervisor")
    assert second.endswith("set stamped = true")
    assert third.startswith("/base requests /cmd_vel with durability transient local")


def test_the_clock_of_a_base_with_stamped_commands_is_reported() -> None:
    report = base_report("/cmd_vel", TWIST, [], [BASE], "OK", own_node="/lifeline", clock="0.2 s ahead")
    assert (report.level, dict(report.values)["clock"]) == (Level.OK, "0.2 s ahead")
    wrong = base_report(
        "/cmd_vel", TWIST, [], [BASE], "OK", own_node="/lifeline", clock_problem="it has stepped"
    )
    assert (wrong.level, wrong.message) == (Level.ERROR, "it has stepped")
