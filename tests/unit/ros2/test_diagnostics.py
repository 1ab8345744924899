"""The report of the robot's mode."""

import math

import pytest

from ros2.cdr import Planar
from ros2.diagnostics import Level, supervisor_report
from ros2.status import Status

STATUS = Status("DRIVING", (), False, False, "teleop", Planar(0.5, 0.1), Planar(0.25, 0.05), 0.5, 1.2345)  # noqa: FBT003


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
