"""The report of the robot's mode, and the messages that are written without rclpy, compared with rosbags."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from ros2.reports import diagnostic_array, diagnostic_status, supervisor_report
from ros2.ros import Level, Report
from ros2.status import Status
from wire.cdr import Planar

STATUS = Status("DRIVING", (), False, False, "teleop", Planar(0.5, 0.1), Planar(0.25, 0.05), 0.5, 1.2345)  # noqa: FBT003
STORE = get_typestore(Stores.ROS2_JAZZY)
STATUS_TYPE, ARRAY = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/DiagnosticArray"
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
REPORTS = st.builds(
    Report, TEXTS, st.sampled_from(Level), TEXTS, st.lists(st.tuples(TEXTS, TEXTS), max_size=3).map(tuple)
)


def test_a_silent_supervisor_is_an_error_with_the_state_of_the_base() -> None:
    assert supervisor_report(None, "SUPERVISOR_LOST") == (
        "supervisor",
        Level.ERROR,
        "the supervisor is silent: the robot is stopped",
        (("base", "SUPERVISOR_LOST"),),
    )


def test_a_driving_robot_is_fine() -> None:
    report = supervisor_report(STATUS, "follows the supervisor")
    assert (report.level, report.message) == (Level.OK, "DRIVING")
    assert dict(report.values) == {
        "mode": "DRIVING",
        "reasons": "",
        "owner": "teleop",
        "nearest_m": "1.234",
        "requested": "0.500 m/s 0.100 rad/s",
        "permitted": "0.250 m/s 0.050 rad/s",
        "base": "follows the supervisor",
    }


@pytest.mark.parametrize(
    ("changes", "level"),
    [
        ({"mode": "READY"}, Level.OK),
        ({"mode": "LIMITED"}, Level.OK),
        ({"warning": True}, Level.WARN),
        ({"mode": "STOPPED"}, Level.WARN),
        ({"alarm": True}, Level.ERROR),
        ({"mode": "STOPPED", "alarm": True, "warning": True}, Level.ERROR),
    ],
)
def test_the_level_follows_the_mode_the_warning_and_the_alarm(
    changes: dict[str, object], level: Level
) -> None:
    assert supervisor_report(STATUS._replace(**changes), "").level is level


def test_the_reasons_of_a_stop_are_in_the_message_and_in_the_values() -> None:
    stopped = STATUS._replace(mode="STOPPED", reasons=("OBSTACLE", "COMMAND_TIMEOUT"), nearest_m=math.nan)
    report = supervisor_report(stopped, "")
    assert report.message == "STOPPED (OBSTACLE, COMMAND_TIMEOUT)"
    assert dict(report.values)["reasons"] == "OBSTACLE COMMAND_TIMEOUT"
    assert dict(report.values)["nearest_m"] == "nan"


def read(status: object) -> Report:
    assert getattr(status, "hardware_id", None) == "lifeline"
    name: str = getattr(status, "name", "")
    assert name.startswith("lifeline: ")
    return Report(
        name.removeprefix("lifeline: "),
        Level(getattr(status, "level", -1)),
        getattr(status, "message", ""),
        tuple((one.key, one.value) for one in getattr(status, "values", ())),
    )


@given(REPORTS)
def test_a_status_is_what_rosbags_reads(report: Report) -> None:
    payload = diagnostic_status(report)
    assert read(message := STORE.deserialize_cdr(payload, STATUS_TYPE)) == report
    assert bytes(STORE.serialize_cdr(message, STATUS_TYPE)) == payload


@given(st.lists(REPORTS, max_size=4), st.integers(0, 2**31 * 10**9 - 1))
def test_an_array_is_what_rosbags_reads(reports: list[Report], time_ns: int) -> None:
    payload = diagnostic_array(reports, time_ns)
    message = STORE.deserialize_cdr(payload, ARRAY)
    stamp = message.header.stamp  # type: ignore[attr-defined]
    assert stamp.sec * 10**9 + stamp.nanosec == time_ns
    assert [read(status) for status in message.status] == reports  # type: ignore[attr-defined]
    assert bytes(STORE.serialize_cdr(message, ARRAY)) == payload
