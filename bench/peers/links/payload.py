"""The message of all measurements: a planar Twist of six doubles; its turning speed tells the messages apart (pure)."""

import struct

PAYLOAD_BYTES = 48
CDR_HEADER = b"\x00\x01\x00\x00"
"""Before the payload in a message of ROS 2: little endian."""
_TURN = struct.Struct("<40xd")


def payload_of(turn_rad_s: float) -> bytes:
    return _TURN.pack(turn_rad_s)


def turn_of(payload: bytes) -> float:
    """Return the turning speed of a payload [rad/s]."""
    return _TURN.unpack(payload)[0]
