"""The beginning of a SafetyStatus, read from its CDR bytes.

The process runs without rosbags, and needs only the fields before the sources. tests/unit/ros2/test_status.py compares
the reader with rosbags.
"""

import struct
from typing import NamedTuple

from ros2.cdr import LITTLE_ENDIAN, Planar, is_little_endian
from wire.message_types import SafetyStatus

MODES = {
    SafetyStatus.STOPPED: "STOPPED",
    SafetyStatus.READY: "READY",
    SafetyStatus.DRIVING: "DRIVING",
    SafetyStatus.LIMITED: "LIMITED",
}
MAX_REASONS = 64


class Status(NamedTuple):
    """The supervisor's mode, reasons and velocities."""

    mode: str
    reasons: tuple[str, ...]
    warning: bool
    alarm: bool
    owner: str
    requested: Planar
    permitted: Planar
    scale: float
    nearest_m: float


class _Reader:
    """Reads CDR values in order.

    Raises:
        ValueError: the bytes end too early, or a value is not valid.
    """

    def __init__(self, payload: bytes) -> None:
        if not is_little_endian(payload):
            raise ValueError("not little-endian CDR")
        self._body = payload[len(LITTLE_ENDIAN) :]
        self._at = 0

    def value(self, code: str) -> float:
        size = struct.calcsize(code)
        self._at = -(-self._at // size) * size
        try:
            (value,) = struct.unpack_from(f"<{code}", self._body, self._at)
        except struct.error as error:
            raise ValueError(str(error)) from error
        self._at += size
        return value

    def skip_header(self) -> None:
        self.value("i")
        self.value("I")
        self.text()

    def count(self) -> int:
        return int(self.value("I"))

    def text(self) -> str:
        length = self.count()
        text = self._body[self._at : self._at + length]
        if not text or len(text) != length:
            raise ValueError("a string is not complete")
        self._at += length
        return text[:-1].decode("utf-8", "replace")

    def texts(self) -> tuple[str, ...]:
        count = self.count()
        if count > MAX_REASONS:
            raise ValueError("too many reasons")
        return tuple(self.text() for _ in range(count))

    def planar(self) -> Planar:
        x, _, _, _, _, yaw = (self.value("d") for _ in range(6))
        return Planar(x, yaw)


def status_of(payload: bytes) -> Status | None:
    """Return the status in a `lifeline_msgs/msg/SafetyStatus`; None if the bytes are not one."""
    try:
        reader = _Reader(payload)
        reader.skip_header()
        return Status(
            mode=MODES[int(reader.value("B"))],
            reasons=reader.texts(),
            warning=bool(reader.value("B")),
            alarm=bool(reader.value("B")),
            owner=reader.text(),
            requested=reader.planar(),
            permitted=reader.planar(),
            scale=reader.value("d"),
            nearest_m=reader.value("d"),
        )
    except (ValueError, KeyError):
        return None
