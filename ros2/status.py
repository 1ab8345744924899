"""The beginning of a SafetyStatus, read from its CDR bytes.

The process runs without rosbags, and needs only the fields before the sources. tests/unit/ros2/test_status.py compares
the reader with rosbags.
"""

from typing import NamedTuple

from wire.cdr import Planar, Reader
from wire.message_types import MODES

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


def status_of(payload: bytes) -> Status | None:
    """Return the status in a `lifeline_msgs/msg/SafetyStatus`; None if the bytes are not one."""
    try:
        reader = Reader(payload)
        reader.frame_id()
        return Status(
            mode=MODES[reader.value("B")],
            reasons=_texts(reader),
            warning=bool(reader.value("B")),
            alarm=bool(reader.value("B")),
            owner=reader.text(),
            requested=_planar(reader),
            permitted=_planar(reader),
            scale=reader.value("d"),
            nearest_m=reader.value("d"),
        )
    except (ValueError, IndexError):
        return None


def _texts(reader: Reader) -> tuple[str, ...]:
    count = reader.value("I")
    if count > MAX_REASONS:
        raise ValueError("too many reasons")
    return tuple(reader.text() for _ in range(count))


def _planar(reader: Reader) -> Planar:
    x, *_, yaw = reader.twist()
    return Planar(x, yaw)
