"""Writes reports and the responses of services as CDR, for a process without rclpy (pure).

tests/unit/ros2/test_report_cdr.py compares each message with rosbags.
"""

import struct
from collections.abc import Sequence

from ros2.cdr import LITTLE_ENDIAN
from ros2.diagnostics import Report

HARDWARE_ID = "lifeline"


class _Writer:
    """Writes CDR values in order, each aligned to its size."""

    def __init__(self) -> None:
        self._body = bytearray()

    def value(self, code: str, value: int) -> None:
        size = struct.calcsize(code)
        self._body += bytes(-len(self._body) % size) + struct.pack(f"<{code}", value)

    def text(self, text: str) -> None:
        encoded = text.encode("utf-8", "replace").replace(b"\x00", b"") + b"\x00"
        self.value("I", len(encoded))
        self._body += encoded

    def status(self, report: Report) -> None:
        self.value("B", report.level)
        self.text(f"lifeline: {report.name}")
        self.text(report.message)
        self.text(HARDWARE_ID)
        self.value("I", len(report.values))
        for key, value in report.values:
            self.text(key)
            self.text(value)

    def payload(self) -> bytes:
        return LITTLE_ENDIAN + bytes(self._body)


def diagnostic_status(report: Report) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticStatus`."""
    writer = _Writer()
    writer.status(report)
    return writer.payload()


def diagnostic_array(reports: Sequence[Report], time_ns: int) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticArray` with one status for each report.

    Args:
        reports: the reports.
        time_ns: the stamp of its header, by the wall clock.
    """
    writer = _Writer()
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    writer.value("i", seconds)
    writer.value("I", nanoseconds)
    writer.text("")
    writer.value("I", len(reports))
    for report in reports:
        writer.status(report)
    return writer.payload()


def trigger_response(*, success: bool, message: str) -> bytes:
    """Return the payload of a `std_srvs/srv/Trigger` response."""
    writer = _Writer()
    writer.value("B", success)
    writer.text(message)
    return writer.payload()
