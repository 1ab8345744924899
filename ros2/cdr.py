"""Reads and writes velocities and a few other values of ROS 2 messages at their places in CDR, without a codec.

A little-endian message begins with the encapsulation header `00 01`, and two bytes that may count the padding at its end
(Cyclone DDS); all offsets are aligned from the end of the header. Padding bytes may have any value, and may follow the
message.
"""

import math
import struct
from typing import NamedTuple

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_HEADER = len(LITTLE_ENDIAN)
_TWIST = struct.Struct("<6d")
TWIST_BYTES = _HEADER + _TWIST.size
MAX_FRAME_ID = 256
TRUE = LITTLE_ENDIAN + b"\x01"
"""The payload of a `std_msgs/msg/Bool` that is true."""


class Planar(NamedTuple):
    """A velocity of a ground robot: forward [m/s], and turn rate [rad/s, counter-clockwise]."""

    linear_m_s: float
    angular_rad_s: float


STANDSTILL = Planar(0.0, 0.0)


def is_little_endian(payload: bytes) -> bool:
    """Return whether a payload begins with the header of little-endian CDR."""
    return len(payload) >= _HEADER and payload[:2] == LITTLE_ENDIAN[:2]


def twist_of(payload: bytes, *, stamped: bool) -> bytes | None:
    """Return the payload of a `geometry_msgs/msg/Twist`, or of the Twist in a `TwistStamped`; None if it is neither."""
    if not is_little_endian(payload):
        return None
    start = _HEADER
    if stamped:
        after_frame = _after_header(payload)
        if after_frame is None:
            return None
        start = after_frame
    values = payload[start : start + _TWIST.size]
    if len(values) != _TWIST.size or len(payload) - start - _TWIST.size > 3:
        return None
    return LITTLE_ENDIAN + values


def _after_header(payload: bytes) -> int | None:
    """Return the offset of the first double after a `std_msgs/msg/Header`; None if the header is not complete."""
    length_at = _HEADER + 8
    if len(payload) < length_at + 4:
        return None
    (length,) = struct.unpack_from("<I", payload, length_at)
    end = length_at + 4 + length
    if not 1 <= length <= MAX_FRAME_ID or len(payload) < end or payload[end - 1] != 0:
        return None
    return _HEADER + _aligned(end - _HEADER, 8)


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size


def planar_of(twist: bytes) -> Planar | None:
    """Return the planar velocity of a Twist from `twist_of`; None if it is not finite, or if another component is not zero."""
    if len(twist) != TWIST_BYTES:
        return None
    x, y, z, roll, pitch, yaw = _TWIST.unpack_from(twist, _HEADER)
    if not (math.isfinite(x) and math.isfinite(yaw)) or any(v != 0.0 for v in (y, z, roll, pitch)):
        return None
    return Planar(x, yaw)


def odometry_velocity(payload: bytes) -> Planar | None:
    """Return the planar velocity in a `nav_msgs/msg/Odometry`; None if it has none that is finite.

    The message ends with the twist and its covariance of 36 doubles.
    """
    end = len(payload) - 36 * 8
    if not is_little_endian(payload) or end < TWIST_BYTES:
        return None
    x, *_, yaw = _TWIST.unpack_from(payload, end - _TWIST.size)
    return Planar(x, yaw) if math.isfinite(x) and math.isfinite(yaw) else None


def twist(velocity: Planar) -> bytes:
    """Return the payload of a `geometry_msgs/msg/Twist`."""
    return LITTLE_ENDIAN + _TWIST.pack(velocity.linear_m_s, 0.0, 0.0, 0.0, 0.0, velocity.angular_rad_s)


def twist_stamped(velocity: Planar, time_ns: int, frame_id: str) -> bytes:
    """Return the payload of a `geometry_msgs/msg/TwistStamped`.

    Args:
        velocity: the velocity of the robot.
        time_ns: the stamp of its header, by the wall clock.
        frame_id: the frame of its header.
    """
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    frame = frame_id.encode() + b"\x00"
    header = struct.pack(f"<iII{len(frame)}s", seconds, nanoseconds, len(frame), frame)
    return LITTLE_ENDIAN + header.ljust(_aligned(len(header), 8), b"\x00") + twist(velocity)[_HEADER:]


def bool_of(payload: bytes) -> bool | None:
    """Return the value of a `std_msgs/msg/Bool`; None if it is not one."""
    if not is_little_endian(payload) or not _HEADER < len(payload) <= _HEADER + 4:
        return None
    return payload[_HEADER] != 0


def trigger_reply(payload: bytes) -> tuple[bool, str] | None:
    """Return `success` and `message` of a `std_srvs/srv/Trigger` response; None if it is not one."""
    at = _HEADER + 4
    if not is_little_endian(payload) or len(payload) < at + 4:
        return None
    (length,) = struct.unpack_from("<I", payload, at)
    text = payload[at + 4 : at + 4 + length]
    if len(text) != length or text[-1:] != b"\x00":
        return None
    return payload[_HEADER] != 0, text[:-1].decode("utf-8", "replace")
