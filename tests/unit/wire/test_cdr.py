"""Encoding and decoding by offset, compared with the general codec on valid and damaged payloads."""

import math
from random import Random
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz import payloads
from wire import cdr
from wire.messages import (
    MAX_PAYLOAD_BYTES,
    Odometry,
    Point,
    Pose,
    Quaternion,
    Twist,
    UndecodableError,
    Vector3,
    decode,
    decode_motion,
    encode,
    header,
)
from wire.messages import _store as codec  # pyright: ignore[reportPrivateUsage]
from wire.ros import PoseWithCovariance, TwistWithCovariance

NUMBER = st.floats(width=64)
NAME = st.text(st.characters(blacklist_categories=["Cs"]), max_size=9)


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
        VALID + b"\0",
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
