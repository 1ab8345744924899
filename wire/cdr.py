"""Encoding and decoding by offset of the most frequent messages: Twist, and the velocity in an Odometry.

The general codec (messages.py) creates an object for each part of a message, but the supervisor reads only two numbers
and the frame id of an Odometry. A payload in any other layout, such as big-endian or padded, is left to the general
codec; so both accept the same payloads.
"""

import struct
from typing import NamedTuple

from wire.ros import Twist, Vector3

LITTLE_ENDIAN = b"\0\1"
"""The first two bytes of the encapsulation header of the payloads that are read here; two bytes of options follow."""

_NO_OPTIONS = b"\0\0"
_HEADER_BYTES = 4
_TWIST = struct.Struct("<4s6d")
_STAMP_BYTES = 8
_LENGTH = struct.Struct("<I")
_POSE_BYTES = (7 + 36) * 8
_VELOCITY = struct.Struct("<6d")
_VELOCITY_BYTES = (6 + 36) * 8


class Motion(NamedTuple):
    """The planar velocity of the base, and the frame id, from an Odometry."""

    frame_id: str
    """The frame id of the header."""
    linear_m_s: float
    """Forward velocity."""
    angular_rad_s: float
    """Turn rate, counter-clockwise."""


def pack_twist(twist: Twist) -> bytes:
    """Return the Twist as little-endian CDR with its encapsulation header."""
    linear, angular = twist.linear, twist.angular
    return _TWIST.pack(
        LITTLE_ENDIAN + _NO_OPTIONS, linear.x, linear.y, linear.z, angular.x, angular.y, angular.z
    )


def unpack_twist(payload: bytes) -> Twist | None:
    """Return the Twist; None if the payload has another layout."""
    if len(payload) != _TWIST.size or not payload.startswith(LITTLE_ENDIAN):
        return None
    _, x, y, z, roll, pitch, yaw = _TWIST.unpack(payload)
    return Twist(Vector3(x, y, z), Vector3(roll, pitch, yaw))


def unpack_motion(payload: bytes) -> Motion | None:
    """Return the motion in a `nav_msgs/msg/Odometry`; None if the payload has another layout."""
    if not payload.startswith(LITTLE_ENDIAN):
        return None
    body = payload[_HEADER_BYTES:]  # alignment counts from here
    try:
        frame_id, end = _string(body, _STAMP_BYTES)
        _, end = _string(body, end + -end % 4)
        velocity_at = end + -end % 8 + _POSE_BYTES
        if len(body) != velocity_at + _VELOCITY_BYTES:
            return None
        x, _, _, _, _, yaw = _VELOCITY.unpack_from(body, velocity_at)
    except (struct.error, UnicodeDecodeError):
        return None
    return Motion(frame_id, x, yaw)


def _string(body: bytes, at: int) -> tuple[str, int]:
    """Return the string at an offset, and the offset of its end.

    Raises:
        struct.error: it reaches beyond the payload, or has no terminator.
        UnicodeDecodeError: it is not UTF-8.
    """
    (length,) = _LENGTH.unpack_from(body, at)
    begin = at + _LENGTH.size
    end = begin + length
    if length == 0 or end > len(body) or body[end - 1] != 0:
        raise struct.error("no string")
    return body[begin : end - 1].decode(), end
