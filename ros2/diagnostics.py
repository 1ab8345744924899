"""What the ROS 2 process reports: one report for each topic, and one for the supervisor (pure).

Without rclpy, reports are written as CDR; tests/unit/ros2/test_diagnostics.py compares each message with rosbags.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from ros2.status import Status
from wire.cdr import Writer

HARDWARE_ID = "lifeline"


class Level(IntEnum):
    """The levels of `diagnostic_msgs/msg/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2


class Report(NamedTuple):
    """The state of one part."""

    name: str
    level: Level
    message: str
    values: tuple[tuple[str, str], ...] = ()


def supervisor_report(status: Status | None, base: str) -> Report:
    """Return the report of the robot's mode.

    Args:
        status: the supervisor's newest status; None if it is silent.
        base: state of the base's watchdog in this process.
    """
    if status is None:
        return Report(
            "supervisor", Level.ERROR, "the supervisor is silent: the robot is stopped", (("base", base),)
        )
    level = Level.OK
    if status.alarm:
        level = Level.ERROR
    elif status.mode == "STOPPED" or status.warning:
        level = Level.WARN
    why = f" ({', '.join(status.reasons)})" if status.reasons else ""
    values = (
        ("mode", status.mode),
        ("reasons", " ".join(status.reasons)),
        ("owner", status.owner),
        ("nearest_m", f"{status.nearest_m:.3f}"),
        ("requested", f"{status.requested.linear_m_s:.3f} m/s {status.requested.angular_rad_s:.3f} rad/s"),
        ("permitted", f"{status.permitted.linear_m_s:.3f} m/s {status.permitted.angular_rad_s:.3f} rad/s"),
        ("base", base),
    )
    return Report("supervisor", level, f"{status.mode}{why}", values)


def diagnostic_status(report: Report) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticStatus`."""
    writer = Writer()
    _write(writer, report)
    return writer.payload()


def diagnostic_array(reports: Sequence[Report], time_ns: int) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticArray` with one status for each report.

    Args:
        reports: the reports.
        time_ns: the stamp of its header, by the wall clock.
    """
    writer = Writer()
    writer.header(time_ns)
    writer.value("I", len(reports))
    for report in reports:
        _write(writer, report)
    return writer.payload()


def _write(writer: Writer, report: Report) -> None:
    writer.value("B", report.level)
    writer.text(f"lifeline: {report.name}")
    writer.text(report.message)
    writer.text(HARDWARE_ID)
    writer.value("I", len(report.values))
    for key, value in report.values:
        writer.text(key)
        writer.text(value)
