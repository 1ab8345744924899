"""CDR by offset, compared with the general codec on valid and damaged payloads."""

import math
import struct
from random import Random
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from tests.fuzz import payloads
from wire import cdr
from wire.messages import (
    MAX_PAYLOAD_BYTES,
    Bool,
    Odometry,
    Point,
    Pose,
    Quaternion,
    TriggerResponse,
    Twist,
    UndecodableError,
    Vector3,
    decode,
    decode_motion,
    encode,
    header,
    planar_twist,
)
from wire.messages import _store as codec  # pyright: ignore[reportPrivateUsage]
from wire.ros import PoseWithCovariance, TwistWithCovariance

STORE = get_typestore(Stores.ROS2_JAZZY)
STAMPED = STORE.types["geometry_msgs/msg/TwistStamped"]
NUMBER = st.floats(width=64)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
SIX = st.tuples(*[NUMBER] * 6)
FRAME_IDS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=60)
PADDING_COUNT = b"\x00\x01\x00\x03"
"""The header of a message that Cyclone DDS has padded with three bytes."""
NAME = st.text(st.characters(blacklist_categories=["Cs"]), max_size=9)


@pytest.mark.parametrize("year", [1700, 1969, 1970, 2026, 2038, 2042, 2250])
def test_a_header_gets_the_nearest_time_that_ros_can_hold_in_any_year(
    year: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = round((year - 1970) * 365.25 * 86400) * 10**9
    nearest_ns = min(max(-cdr.MAX_TIME_NS, now_ns), cdr.MAX_TIME_NS)
    assert cdr.header_ns_of(cdr.twist_stamped(cdr.STANDSTILL, now_ns, "")) == nearest_ns
    monkeypatch.setattr("time.time_ns", lambda: now_ns)
    assert cdr.header_ns_of(encode(_odometry("odom", "base_link", planar_twist(0.0, 0.0)))) == nearest_ns


def _odometry(frame_id: str, child: str, twist: Twist) -> Odometry:
    pose = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    return Odometry(
        header(frame_id),
        child,
        PoseWithCovariance(pose, np.arange(36.0)),
        TwistWithCovariance(twist, np.arange(36.0)),
    )


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


@given(st.tuples(*[NUMBER] * 6))
def test_a_twist_is_packed_and_read_as_by_the_codec(values: tuple[float, ...]) -> None:
    twist = Twist(Vector3(*values[:3]), Vector3(*values[3:]))
    payload = cdr.pack_twist(twist)
    assert payload == bytes(codec.serialize_cdr(twist, Twist.__msgtype__))
    read = cdr.unpack_twist(payload)
    assert read is not None
    assert cdr.pack_twist(read) == payload


@given(NAME, NAME, NUMBER, NUMBER)
def test_the_motion_of_an_odometry_is_read_as_by_the_codec(
    frame_id: str, child: str, linear: float, angular: float
) -> None:
    twist = Twist(Vector3(linear, 1.0, 2.0), Vector3(3.0, 4.0, angular))
    motion = cdr.unpack_motion(encode(_odometry(frame_id, child, twist)))
    assert motion is not None
    assert motion.frame_id == frame_id
    assert _same(motion.linear_m_s, linear)
    assert _same(motion.angular_rad_s, angular)


@pytest.mark.parametrize("message_type", [Twist, Odometry])
def test_damaged_payloads_are_accepted_and_refused_as_by_the_codec(
    message_type: type[Twist | Odometry],
) -> None:
    random, accepted = Random(3), 0
    for _ in range(4000):
        payload = payloads.mutated(random, message_type)
        try:
            message = codec.deserialize_cdr(payload, message_type.__msgtype__)
        except Exception:  # noqa: BLE001 - generated code may raise any exception
            assert _refuses(payload, message_type)
            continue
        accepted += 1
        twist = cast("Odometry", message).twist.twist if message_type is Odometry else cast("Twist", message)
        linear, angular = _read(payload, message_type)
        assert _same(linear, twist.linear.x)
        assert _same(angular, twist.angular.z)
    assert 100 < accepted < 3900


def _read(payload: bytes, message_type: type[Twist | Odometry]) -> tuple[float, float]:
    if message_type is Odometry:
        _, linear, angular = decode_motion(payload)
        return linear, angular
    twist = decode(payload, Twist)
    return twist.linear.x, twist.angular.z


def _refuses(payload: bytes, message_type: type[Twist | Odometry]) -> bool:
    try:
        _read(payload, message_type)
    except UndecodableError:
        return True
    return False


VALID = encode(_odometry("odom", "base_link", Twist(Vector3(0.5, 0.0, 0.0), Vector3(0.0, 0.0, 0.1))))
FRAME_AT = 4 + 8


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        VALID[:3],
        VALID[: FRAME_AT + 2],
        VALID[: FRAME_AT + 6],
        VALID[:-1],
        VALID + bytes(4),
        b"\0\0" + VALID[2:],
        VALID[:FRAME_AT] + bytes(4) + VALID[FRAME_AT + 4 :],
        VALID[:FRAME_AT] + b"\xff\xff\xff\x7f" + VALID[FRAME_AT + 4 :],
        VALID[: FRAME_AT + 4] + b"\xff" + VALID[FRAME_AT + 5 :],
        VALID[: FRAME_AT + 8] + b"x" + VALID[FRAME_AT + 9 :],
    ],
    ids=[
        "empty",
        "header",
        "length",
        "string",
        "short",
        "long",
        "big endian",
        "no string",
        "huge",
        "not UTF-8",
        "no end",
    ],
)
def test_another_layout_is_left_to_the_codec(payload: bytes) -> None:
    assert cdr.unpack_motion(payload) is None
    assert cdr.unpack_twist(payload) is None


@pytest.mark.parametrize("names", [("x" * MAX_PAYLOAD_BYTES, ""), ("", "x" * MAX_PAYLOAD_BYTES)])
def test_the_motion_of_a_payload_above_1_mib_is_refused_as_by_the_codec(names: tuple[str, str]) -> None:
    payload = encode(_odometry(*names, Twist(Vector3(0.5, 0.0, 0.0), Vector3(0.0, 0.0, 0.1))))
    with pytest.raises(UndecodableError):
        decode(payload, Odometry)
    with pytest.raises(UndecodableError):
        decode_motion(payload)


def test_the_options_of_the_header_may_have_any_value() -> None:
    assert cdr.unpack_motion(VALID[:2] + b"\xab\xcd" + VALID[4:]) == cdr.Motion("odom", 0.5, 0.1)
    twist = encode(Twist(Vector3(1.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
    assert cdr.unpack_twist(twist[:2] + b"\0\3" + twist[4:]) == decode(twist, Twist)


@pytest.mark.parametrize(("bytes_after", "is_one"), [(3, True), (4, False)])
def test_the_codec_accepts_as_many_bytes_of_padding(bytes_after: int, is_one: bool) -> None:  # noqa: FBT001
    for message in (Twist(Vector3(1.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)), decode(VALID, Odometry)):
        payload = encode(message) + b"\xff" * bytes_after
        assert (cdr.unpack_twist(payload) is not None or cdr.unpack_motion(payload) is not None) is is_one
        try:
            codec.deserialize_cdr(payload, message.__msgtype__)
        except Exception:  # noqa: BLE001 - generated code may raise any exception
            assert not is_one
        else:
            assert is_one


def twist_message(values: tuple[float, ...]) -> Twist:
    return Twist(Vector3(*values[:3]), Vector3(*values[3:]))


def twist_bytes(values: tuple[float, ...]) -> bytes:
    return cdr.LITTLE_ENDIAN + struct.pack("<6d", *values)


def stamped_bytes(values: tuple[float, ...], frame_id: str = "base_link", sec: int = 0) -> bytes:
    """Return a TwistStamped, encoded by rosbags."""
    types = STORE.types
    vector, twist = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Twist"]
    head = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](sec, 5), frame_id)
    message = STAMPED(head, twist(vector(*values[:3]), vector(*values[3:])))
    return bytes(STORE.serialize_cdr(message, STAMPED.__msgtype__))


@given(SIX)
def test_a_twist_passes_as_the_bytes_it_arrived_in(values: tuple[float, ...]) -> None:
    payload = encode(twist_message(values))
    assert cdr.twist_of(payload, stamped=False) == payload == twist_bytes(values)


@given(SIX, FRAME_IDS, st.integers(-(2**31), 2**31 - 1))
def test_the_twist_of_any_twist_stamped_is_found(values: tuple[float, ...], frame_id: str, sec: int) -> None:
    assert cdr.twist_of(stamped_bytes(values, frame_id, sec), stamped=True) == twist_bytes(values)


@pytest.mark.parametrize("length", range(18))
def test_the_padding_after_a_frame_id_may_have_any_value(length: int) -> None:
    values = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    payload = bytearray(stamped_bytes(values, "f" * length))
    end = 4 + 12 + length + 1
    for at in range(end, len(payload) - 48):
        assert payload[at] == 0
        payload[at] = 0xAB
    assert cdr.twist_of(bytes(payload), stamped=True) == twist_bytes(values)


@pytest.mark.parametrize("stamped", [False, True])
@pytest.mark.parametrize(("bytes_after", "is_one"), [(0, True), (3, True), (4, False)])
def test_up_to_three_bytes_of_padding_may_follow(stamped: bool, bytes_after: int, is_one: bool) -> None:  # noqa: FBT001
    values = (0.5, 0.0, 0.0, 0.0, 0.0, 0.1)
    payload = stamped_bytes(values) if stamped else twist_bytes(values)
    found = cdr.twist_of(payload + b"\xff" * bytes_after, stamped=stamped)
    assert found == (twist_bytes(values) if is_one else None)


def test_the_header_may_count_the_padding() -> None:
    body = twist_bytes((0.5, 0.0, 0.0, 0.0, 0.0, 0.1))[4:]
    assert cdr.twist_of(PADDING_COUNT + body, stamped=False) == cdr.LITTLE_ENDIAN + body
    assert cdr.bool_of(PADDING_COUNT + b"\x00\x00\x00\x00") is False


@pytest.mark.parametrize("stamped", [False, True])
def test_a_message_of_the_other_type_is_no_command(stamped: bool) -> None:  # noqa: FBT001
    values = (0.5, 0.0, 0.0, 0.0, 0.0, 0.1)
    other = twist_bytes(values) if stamped else stamped_bytes(values)
    assert cdr.twist_of(other, stamped=stamped) is None


@pytest.mark.parametrize("stamped", [False, True])
def test_a_message_that_ends_early_is_no_command(stamped: bool) -> None:  # noqa: FBT001
    values = (0.5, 0.0, 0.0, 0.0, 0.0, 0.1)
    payload = stamped_bytes(values) if stamped else twist_bytes(values)
    for length in range(len(payload)):
        assert cdr.twist_of(payload[:length], stamped=stamped) is None


def test_a_big_endian_message_is_no_command() -> None:
    payload = b"\x00\x00\x00\x00" + struct.pack(">6d", 0.5, 0, 0, 0, 0, 0)
    assert cdr.twist_of(payload, stamped=False) is None


def test_the_frame_id_of_a_command_need_not_be_utf_8() -> None:
    values = (0.5, 0.0, 0.0, 0.0, 0.0, 0.1)
    payload = stamped_bytes(values, "base").replace(b"base\0", b"b\xe4se\0")
    assert cdr.twist_of(payload, stamped=True) == twist_bytes(values)


def test_a_frame_id_without_its_zero_or_without_any_byte_is_refused() -> None:
    payload = bytearray(stamped_bytes((0.0,) * 6, "abc"))
    payload[4 + 12 + 3] = ord("d")
    assert cdr.twist_of(bytes(payload), stamped=True) is None
    empty = cdr.LITTLE_ENDIAN + struct.pack("<iII4x6d", 0, 0, 0, *(0.0,) * 6)
    assert cdr.twist_of(empty, stamped=True) is None


@given(st.binary(max_size=200), st.booleans())
def test_no_bytes_raise(payload: bytes, headed: bool) -> None:  # noqa: FBT001
    payload = cdr.LITTLE_ENDIAN + payload if headed else payload
    for stamped in (False, True):
        found = cdr.twist_of(payload, stamped=stamped)
        assert found is None or len(found) == len(twist_bytes((0.0,) * 6))
    cdr.planar_of(payload)
    cdr.unpack_motion(payload)
    cdr.bool_of(payload)
    cdr.trigger_reply(payload)


@given(FINITE, FINITE)
def test_a_planar_velocity_survives_a_twist_and_a_twist_stamped(x: float, yaw: float) -> None:
    velocity = cdr.Planar(x, yaw)
    assert cdr.twist(velocity) == encode(planar_twist(x, yaw))
    assert cdr.planar_of(cdr.twist(velocity)) == velocity
    stamped = cdr.twist_of(cdr.twist_stamped(velocity, 1_700_000_000_000_000_005, "base"), stamped=True)
    assert stamped == cdr.twist(velocity)


@given(FINITE, FINITE, st.integers(0, 2**31 * 10**9 - 1), FRAME_IDS)
def test_a_twist_stamped_is_encoded_like_the_other_encoder_does(
    x: float, yaw: float, time_ns: int, frame_id: str
) -> None:
    payload = cdr.twist_stamped(cdr.Planar(x, yaw), time_ns, frame_id)
    read: Any = STORE.deserialize_cdr(payload, STAMPED.__msgtype__)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == divmod(time_ns, 10**9)
    assert read.header.frame_id == frame_id
    assert (read.twist.linear.x, read.twist.angular.z) == (x, yaw)
    assert payload == bytes(STORE.serialize_cdr(read, STAMPED.__msgtype__))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_twist_that_is_not_finite_has_no_planar_velocity(place: int, bad: float) -> None:
    values = [0.0] * 6
    values[place] = bad
    assert cdr.planar_of(twist_bytes(tuple(values))) is None


@pytest.mark.parametrize("place", [1, 2, 3, 4])
def test_a_twist_that_is_not_planar_by_the_least_has_no_planar_velocity(place: int) -> None:
    values = [0.5, 0.0, 0.0, 0.0, 0.0, 0.1]
    values[place] = -0.0
    assert cdr.planar_of(twist_bytes(tuple(values))) == cdr.Planar(0.5, 0.1)
    values[place] = math.nextafter(0.0, 1.0)
    assert cdr.planar_of(twist_bytes(tuple(values))) is None


@pytest.mark.parametrize("data", [False, True])
@pytest.mark.parametrize("padding", [0, 3])
def test_a_bool_is_read_with_and_without_padding(data: bool, padding: int) -> None:  # noqa: FBT001
    assert cdr.bool_of(encode(Bool(data=data)) + b"\x00" * padding) is data


def test_any_byte_but_zero_is_true() -> None:
    assert cdr.bool_of(cdr.LITTLE_ENDIAN + b"\x7f") is True
    assert decode(cdr.TRUE, Bool).data is True


@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + bytes(5), bytes(5)])
def test_other_bytes_are_no_bool(payload: bytes) -> None:
    assert cdr.bool_of(payload) is None


@given(st.booleans(), st.text(st.characters(exclude_categories=("Cs",)), max_size=60))
def test_the_reply_of_a_trigger_is_read(success: bool, message: str) -> None:  # noqa: FBT001
    payload = encode(TriggerResponse(success=success, message=message))
    assert cdr.trigger_reply(payload) == (success, message)
    for length in range(len(payload.rstrip(b"\x00"))):
        assert cdr.trigger_reply(payload[:length]) is None


def test_a_reply_without_its_last_zero_is_refused() -> None:
    assert cdr.trigger_reply(cdr.LITTLE_ENDIAN + struct.pack("<?3xI2s", True, 2, b"ok")) is None  # noqa: FBT003


def test_bytes_of_another_length_have_no_planar_velocity() -> None:
    payload = cdr.twist(cdr.Planar(0.5, 0.0))
    assert cdr.planar_of(payload[:-1]) is None
    assert cdr.planar_of(b"") is None


@given(st.booleans(), FRAME_IDS)
def test_the_answer_of_a_service_is_read_back(success: bool, message: str) -> None:  # noqa: FBT001 - given by hypothesis
    assert cdr.trigger_reply(cdr.trigger_response(success=success, message=message)) == (success, message)


def test_a_zero_byte_in_a_text_does_not_end_it() -> None:
    assert cdr.trigger_reply(cdr.trigger_response(success=True, message="one\0two")) == (True, "onetwo")


def test_the_stamp_of_any_header_is_found_and_what_has_none_gives_zero() -> None:
    assert cdr.header_ns_of(cdr.twist_stamped(cdr.STANDSTILL, 1_700_000_000_000_000_123, "f")) == (
        1_700_000_000_000_000_123
    )
    assert cdr.header_ns_of(cdr.twist_stamped(cdr.STANDSTILL, 0, "f")) == 0
    for payload in (b"", b"text", cdr.LITTLE_ENDIAN + bytes(7)):
        assert cdr.header_ns_of(payload) == 0
