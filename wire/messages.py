"""The messages: ROS 2 types, encoded as CDR by rosbags.

A payload from the network is never trusted. For any bytes, `decode` raises no other error than `UndecodableError`. It
also refuses payloads larger than any message of Lifeline.
"""

import math
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, cast

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Msgdef
from rosbags.interfaces.typing import Typesdict
from rosbags.serde.cdr import generate_deserialize_cdr, generate_getsize_cdr, generate_serialize_cdr
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from wire import cdr, ros
from wire.cdr import Motion
from wire.message_types import (
    EstopLease,
    EstopStationStatus,
    M,
    Message,
    SafetyStatus,
    SourceStatus,
    TriggerResponse,
    UndecodableError,
    planar_twist,
    zero_twist,
)
from wire.ros import (
    Bool,
    Clock,
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    Imu,
    KeyValue,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    String,
    Time,
    Twist,
    TwistWithCovariance,
    Vector3,
)

__all__ = [
    "Bool",
    "Clock",
    "Definition",
    "DiagnosticArray",
    "DiagnosticStatus",
    "EstopLease",
    "EstopStationStatus",
    "Header",
    "Imu",
    "KeyValue",
    "LaserScan",
    "Message",
    "Motion",
    "Odometry",
    "Point",
    "Pose",
    "Quaternion",
    "SafetyStatus",
    "SourceStatus",
    "String",
    "Time",
    "TriggerResponse",
    "Twist",
    "UndecodableError",
    "Vector3",
    "decode",
    "decode_motion",
    "definition",
    "encode",
    "header",
    "laser_scan",
    "odometry",
    "planar_twist",
    "request_text",
    "yaw_of",
    "zero_twist",
]

MAX_PAYLOAD_BYTES = 1 << 20
MAX_SEQUENCE_LENGTH = 1 << 16


_TYPES: tuple[type[Message], ...] = (
    *ros.TYPES,
    SourceStatus,
    EstopStationStatus,
    SafetyStatus,
    EstopLease,
    TriggerResponse,
)


def _definitions() -> Typesdict:
    """Return the definitions of the types: those in .msg files, and the Trigger service's response."""
    folder = Path(__file__).with_name("msg")
    definitions = get_types_from_msg((folder / "ros.msg").read_text("utf-8"), Bool.__msgtype__)
    for name in ("SourceStatus", "EstopStationStatus", "SafetyStatus", "EstopLease"):
        definitions |= get_types_from_msg(
            (folder / f"{name}.msg").read_text("utf-8"), f"lifeline_msgs/msg/{name}"
        )
    # The parser supports only messages; a service's response is a message with another type name.
    (trigger,) = get_types_from_msg("bool success\nstring message", "std_srvs/msg/Trigger").values()
    definitions[TriggerResponse.__msgtype__] = trigger
    return definitions


APPENDED_FROM = {SafetyStatus.__msgtype__: ("causes", "rmw_zenoh_nodes", "estop_stations", "source_times")}
"""By type, the first field of each group that was appended to it, the oldest group first.

A message from before a group was appended still decodes.
"""


def _before(definitions: Typesdict, name: str, first: str) -> Typesdict:
    """Return the definitions as they were before this field of a type was appended."""
    constants, fields = definitions[name]
    return {**definitions, name: (constants, fields[: [field for field, _ in fields].index(first)])}


def _no_ros1(*_: object) -> NoReturn:
    raise NotImplementedError("ROS 1 is not supported")


class _CdrStore(Typestore):
    """A type store that generates code for CDR only: code for ROS 1 would double the time at the start of each process."""

    def get_msgdef(self, typename: str) -> Msgdef[object]:
        if typename not in self.cache:
            fields = [(normalize_fieldname(name), desc) for name, desc in self.fielddefs[typename][1]]
            getsize_cdr, size_cdr = generate_getsize_cdr(fields, self)
            self.cache[typename] = Msgdef(
                typename,
                fields,
                self.types[typename],
                size_cdr,
                getsize_cdr,
                generate_serialize_cdr(fields, self, "le"),
                generate_serialize_cdr(fields, self, "be"),
                generate_deserialize_cdr(fields, self, "le"),
                generate_deserialize_cdr(fields, self, "be"),
                0,
                *(_no_ros1,) * 7,
            )
        return self.cache[typename]


def _typestore(definitions: Typesdict) -> Typestore:
    """Return a type store with only Lifeline's types, and with classes that a type checker knows."""
    store = _CdrStore(max_sequence_length=MAX_SEQUENCE_LENGTH)
    for message_type in _TYPES:
        name = message_type.__msgtype__
        store.fielddefs[name] = definitions[name]
        store.types[name] = cast("Any", message_type)
    return store


_present = _definitions()
_store = _typestore(_present)
_older_stores = {
    name: [_typestore(_before(_present, name, first)) for first in reversed(firsts)]
    for name, firsts in APPENDED_FROM.items()
}
"""By type, a type store for each of its earlier forms, the newest first."""


def encode(message: Message) -> bytes:
    """Return the message as little-endian CDR with a 4-byte encapsulation header."""
    if isinstance(message, Twist):
        return cdr.pack_twist(message)
    return bytes(_store.serialize_cdr(message, message.__msgtype__))


def decode(payload: bytes, message_type: type[M]) -> M:
    """Decode a payload; fields that it lacks because they were appended to the type later have their defaults.

    Raises:
        UndecodableError: the bytes are not a `message_type`, or exceed 1 MiB.
    """
    if message_type is Twist:
        twist = cdr.unpack_twist(payload)
        if twist is not None:
            return cast("M", twist)
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise UndecodableError(f"{len(payload)} bytes are more than any {message_type.__msgtype__} has")
    try:
        return cast("M", _store.deserialize_cdr(payload, message_type.__msgtype__))
    except Exception as error:  # generated code may raise any exception on invalid bytes
        for store in _older_stores.get(message_type.__msgtype__, ()):
            with suppress(Exception):
                return cast("M", store.deserialize_cdr(payload, message_type.__msgtype__))
        raise UndecodableError(str(error)) from error


def decode_motion(payload: bytes) -> Motion:
    """Decode the velocity of a `nav_msgs/msg/Odometry`, in about a third of the time for the whole message.

    Raises:
        UndecodableError: as `decode`.
    """
    motion = cdr.unpack_motion(payload) if len(payload) <= MAX_PAYLOAD_BYTES else None
    if motion is None:
        odom = decode(payload, Odometry)
        twist = odom.twist.twist
        motion = Motion(odom.header.frame_id, twist.linear.x, twist.angular.z)
    return motion


_CDR_HEADERS = (b"\0\0", b"\0\1")
_CDR_HEADER_BYTES = 4


def request_text(payload: bytes) -> str:
    """Return the text of a request; "" if it has none.

    A request without fields, such as that of `std_srvs/srv/Trigger`, is a CDR header and one dummy byte in ROS 2, which
    some senders pad to four. A text of one character is longer than that.

    Raises:
        UndecodableError: the bytes are neither empty, nor a request without fields, nor a `std_msgs/msg/String`.
    """
    dummy_bytes = len(payload) - _CDR_HEADER_BYTES
    if not payload or (0 <= dummy_bytes <= 4 and payload.startswith(_CDR_HEADERS)):
        return ""
    return decode(payload, String).data


class Definition(NamedTuple):
    """The definition of a message type in a recording, so that the recording can be read without Lifeline's files."""

    text: str
    """Its .msg file and those of all nested types, joined as in rosbag2 (`ros2msg`)."""
    hash: str
    """Its type hash (RIHS01)."""


def definition(type_name: str) -> Definition:
    """Return the definition of a type such as `geometry_msgs/msg/Twist`.

    Raises:
        TypesysError: there is no such type.
    """
    return Definition(_store.generate_msgdef(type_name, ros_version=2)[0], _store.hash_rihs01(type_name))


def header(frame_id: str, time_ns: int | None = None) -> Header:
    """Return a header stamped with `time_ns`, else with the wall clock; for people and recordings, not for safety rules."""
    return Header(Time(*cdr.time_of(time.time_ns() if time_ns is None else time_ns)), frame_id)


def laser_scan(
    ranges: npt.NDArray[np.float32],
    *,
    angle_min_rad: float = -math.pi,
    angle_increment_rad: float | None = None,
    range_m: tuple[float, float],
    period_s: float,
    time_ns: int | None = None,
) -> LaserScan:
    """Return a scan in the frame `lidar`, with all readings taken at the same time.

    Args:
        ranges: (n,) readings [m], counter-clockwise.
        angle_min_rad: the angle of the first beam.
        angle_increment_rad: the angle between neighbouring beams; None: the beams are spread over a full turn.
        range_m: the shortest and the longest measurable distance.
        period_s: the time between two scans.
        time_ns: the stamp of the header; None: now.
    """
    increment_rad = math.tau / max(1, len(ranges)) if angle_increment_rad is None else angle_increment_rad
    return LaserScan(
        header("lidar", time_ns),
        angle_min=angle_min_rad,
        angle_max=angle_min_rad + (len(ranges) - 1) * increment_rad,
        angle_increment=increment_rad,
        time_increment=0.0,
        scan_time=period_s,
        range_min=range_m[0],
        range_max=range_m[1],
        ranges=ranges,
        intensities=np.empty(0, dtype=np.float32),
    )


def yaw_of(orientation: Quaternion) -> float:
    """Return the yaw [rad] of an orientation, counter-clockwise, in (-π, π]."""
    q = orientation
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def odometry(
    pose: tuple[float, float, float], velocity: tuple[float, float], *, time_ns: int | None = None
) -> Odometry:
    """Return planar odometry: pose (x [m], y [m], yaw [rad]) in `odom`, velocity (v [m/s], ω [rad/s]) in `base_link`."""
    x_m, y_m, yaw_rad = pose
    quaternion = Quaternion(0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))
    return Odometry(
        header("odom", time_ns),
        "base_link",
        PoseWithCovariance(Pose(Point(x_m, y_m, 0.0), quaternion), np.zeros(36)),
        TwistWithCovariance(planar_twist(*velocity), np.zeros(36)),
    )
