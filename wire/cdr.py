"""CDR by offset: reads and writes messages without the general codec, in order or at known places (pure).

The general codec (messages.py) creates an object for each part of a message, but the supervisor reads only two numbers
and the frame id of an Odometry, and the process that speaks ROS runs without the codec.

A payload begins with `00 01` and two bytes of any value, which may count the padding at its end (Cyclone DDS); all
offsets are aligned from the end of this header. Padding bytes may have any value, and up to three may follow the
message. A string is UTF-8 and ends with a zero byte. The general codec accepts the same payloads, and big-endian ones.
"""

import math
import struct
from typing import Any, NamedTuple

from wire.message_types import planar_twist
from wire.ros import Twist, Vector3

LITTLE_ENDIAN = b"\0\1\0\0"
MAX_PADDING = 3
SECOND_NS = 1_000_000_000
MAX_TIME_NS = 2**31 * SECOND_NS - 1
"""The largest time of a ROS message."""
TRUE = LITTLE_ENDIAN + b"\1"
"""The payload of a `std_msgs/msg/Bool` that is true."""
_TWIST = struct.Struct("<4s6d")
_VELOCITY = struct.Struct("<6d")
_POSE_BYTES = (7 + 36) * 8
_COVARIANCE_BYTES = 36 * 8


class Planar(NamedTuple):
    """A velocity of a ground robot: forward [m/s], and turn rate [rad/s, counter-clockwise]."""

    linear_m_s: float
    angular_rad_s: float


STANDSTILL = Planar(0.0, 0.0)


class Motion(NamedTuple):
    """The planar velocity of the base, and the frame id, from an Odometry."""

    frame_id: str
    """The frame id of the header."""
    linear_m_s: float
    """Forward velocity."""
    angular_rad_s: float
    """Turn rate, counter-clockwise."""


class Reader:
    """Reads the values of a payload in order, each aligned to its size.

    Raises:
        ValueError: the payload is not little-endian CDR, ends too early, or a value is not valid.
    """

    def __init__(self, payload: bytes) -> None:
        if len(payload) < len(LITTLE_ENDIAN) or not _is_little_endian(payload):
            raise ValueError("not little-endian CDR")
        self._body = payload[len(LITTLE_ENDIAN) :]
        self._at = 0

    def raw(self, size: int, alignment: int = 1) -> bytes:
        begin = self._at + -self._at % alignment
        self._at = begin + size
        if self._at > len(self._body):
            raise ValueError("the message ends too early")
        return self._body[begin : self._at]

    def value(self, code: str) -> Any:  # noqa: ANN401 - an int or a float, by the code of `struct`
        size = struct.calcsize(code)
        return struct.unpack(f"<{code}", self.raw(size, size))[0]

    def text(self) -> str:
        return self.string().decode()

    def string(self) -> bytes:
        """Read a string that may be other than UTF-8."""
        length_at = self._at + -self._at % 4
        begin = length_at + 4
        self._at = begin + int.from_bytes(self._body[length_at:begin], "little")
        text = self._body[begin : self._at]
        if self._at > len(self._body) or not text.endswith(b"\0"):
            raise ValueError("a string ends too early, or without a zero byte")
        return text[:-1]

    def frame_id(self) -> str:
        """Read a `std_msgs/msg/Header`, and return its frame id."""
        self.raw(8, 4)
        return self.text()

    def twist(self) -> tuple[float, ...]:
        return _VELOCITY.unpack(self.raw(_VELOCITY.size, 8))

    def end(self) -> None:
        if len(self._body) - self._at > MAX_PADDING:
            raise ValueError("the message is longer than its type")


class Writer:
    """Writes the values of a payload in order, each aligned to its size."""

    def __init__(self) -> None:
        self._body = bytearray()

    def value(self, code: str, value: float) -> None:
        size = struct.calcsize(code)
        self._body += bytes(-len(self._body) % size) + struct.pack(f"<{code}", value)

    def text(self, text: str) -> None:
        encoded = text.encode("utf-8", "replace").replace(b"\0", b"") + b"\0"
        self.value("I", len(encoded))
        self._body += encoded

    def header(self, time_ns: int, frame_id: str = "") -> None:
        """Write a `std_msgs/msg/Header`.

        Args:
            time_ns: its stamp; 0: none.
            frame_id: its frame.
        """
        seconds, nanoseconds = time_of(time_ns)
        self.value("i", seconds)
        self.value("I", nanoseconds)
        self.text(frame_id)

    def payload(self) -> bytes:
        return LITTLE_ENDIAN + bytes(self._body)


def time_of(time_ns: int) -> tuple[int, int]:
    """Return the seconds and nanoseconds of a `builtin_interfaces/msg/Time`: of a time outside of 1901 to 2038, the nearest one."""
    return divmod(min(max(-MAX_TIME_NS, time_ns), MAX_TIME_NS), SECOND_NS)


def ns_of(seconds: int, nanoseconds: int) -> int:
    """Return the time [ns] of a `builtin_interfaces/msg/Time`."""
    return seconds * SECOND_NS + nanoseconds


def _is_little_endian(payload: bytes) -> bool:
    return payload.startswith(LITTLE_ENDIAN[:2])


def pack_twist(twist: Twist) -> bytes:
    """Return the payload of a `geometry_msgs/msg/Twist`."""
    linear, angular = twist.linear, twist.angular
    return _TWIST.pack(LITTLE_ENDIAN, linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)


def unpack_twist(payload: bytes) -> Twist | None:
    """Return the Twist; None if the payload has another layout."""
    if not 0 <= len(payload) - _TWIST.size <= MAX_PADDING or not _is_little_endian(payload):
        return None
    _, x, y, z, roll, pitch, yaw = _TWIST.unpack_from(payload)
    return Twist(Vector3(x, y, z), Vector3(roll, pitch, yaw))


def unpack_motion(payload: bytes) -> Motion | None:
    """Return the motion in a `nav_msgs/msg/Odometry`; None if the payload has another layout."""
    try:
        reader = Reader(payload)
        frame_id = reader.frame_id()
        reader.text()
        body = reader.raw(_POSE_BYTES + _VELOCITY.size + _COVARIANCE_BYTES, 8)
        reader.end()
    except ValueError:
        return None
    x, _, _, _, _, yaw = _VELOCITY.unpack_from(body, _POSE_BYTES)
    return Motion(frame_id, x, yaw)


def header_ns_of(payload: bytes) -> int:
    """Return the stamp [ns] of a message that begins with a `std_msgs/msg/Header`; 0 if it has none, or is no such message."""
    try:
        reader = Reader(payload)
        return ns_of(int(reader.value("i")), int(reader.value("I")))
    except ValueError:
        return 0


def twist_of(payload: bytes, *, stamped: bool) -> bytes | None:
    """Return the payload of a `geometry_msgs/msg/Twist`, or of the Twist in a `TwistStamped`; None if it is neither.

    The frame id has no effect, so its bytes may have any value.
    """
    try:
        reader = Reader(payload)
        if stamped:
            reader.raw(8, 4)
            reader.string()
        values = reader.raw(_VELOCITY.size, 8)
        reader.end()
    except ValueError:
        return None
    return LITTLE_ENDIAN + values


def planar_of(payload: bytes) -> Planar | None:
    """Return the planar velocity of a Twist; None if it is not finite, or if another component is not zero."""
    twist = unpack_twist(payload)
    if twist is None:
        return None
    x, yaw = twist.linear.x, twist.angular.z
    others = (twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y)
    if not (math.isfinite(x) and math.isfinite(yaw)) or any(value != 0.0 for value in others):
        return None
    return Planar(x, yaw)


def twist(velocity: Planar) -> bytes:
    """Return the payload of a `geometry_msgs/msg/Twist`."""
    return pack_twist(planar_twist(*velocity))


def twist_stamped(velocity: Planar, time_ns: int, frame_id: str) -> bytes:
    """Return the payload of a `geometry_msgs/msg/TwistStamped`, with the arguments of `Writer.header`."""
    writer = Writer()
    writer.header(time_ns, frame_id)
    for value in (velocity.linear_m_s, 0.0, 0.0, 0.0, 0.0, velocity.angular_rad_s):
        writer.value("d", value)
    return writer.payload()


def bool_of(payload: bytes) -> bool | None:
    """Return the value of a `std_msgs/msg/Bool`; None if it is not one."""
    try:
        reader = Reader(payload)
        value = reader.value("B")
        reader.end()
    except ValueError:
        return None
    return value != 0


def trigger_reply(payload: bytes) -> tuple[bool, str] | None:
    """Return `success` and `message` of a `std_srvs/srv/Trigger` response; None if it is not one."""
    try:
        reader = Reader(payload)
        success, message = reader.value("B") != 0, reader.text()
        reader.end()
    except ValueError:
        return None
    return success, message


def trigger_response(*, success: bool, message: str) -> bytes:
    """Return the payload of a `std_srvs/srv/Trigger` response."""
    writer = Writer()
    writer.value("B", success)
    writer.text(message)
    return writer.payload()
