"""The drawing in Foxglove's messages, decoded by field number."""

import struct

import numpy as np

from lifeline.foxglove_messages import scene_message, transforms_message
from lifeline.robot_drawing import Outline, Transform
from tests.protobuf import protobuf_fields
from wire.messages import Point, Quaternion, Time


def test_a_transform_keeps_its_frames_stamp_and_pose() -> None:
    turned = Transform("odom", "base", Time(3, 4), Point(1.0, -2.0, 0.5), Quaternion(0.1, 0.2, 0.6, 0.8))
    (encoded,) = protobuf_fields(transforms_message([turned]).encode())[1]
    fields = protobuf_fields(encoded)
    assert protobuf_fields(fields[1][0]) == {1: [3], 2: [4]}
    assert (fields[2], fields[3]) == ([b"odom"], [b"base"])
    assert protobuf_fields(fields[4][0]) == {1: [1.0], 2: [-2.0], 3: [0.5]}
    assert protobuf_fields(fields[5][0]) == {1: [0.1], 2: [0.2], 3: [0.6], 4: [0.8]}


def test_a_stamp_that_no_timestamp_can_hold_is_moved_to_the_nearest_that_one_can() -> None:
    for stamp, expected in (
        (Time(-1, 5), {2: [5]}),
        (Time(2, (1 << 32) - 1), {1: [2], 2: [999_999_999]}),
    ):
        still = Transform("a", "b", stamp, Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        (encoded,) = protobuf_fields(transforms_message([still]).encode())[1]
        assert protobuf_fields(protobuf_fields(encoded)[1][0]) == expected


def test_an_outline_is_a_closed_line_that_is_locked_to_its_frame() -> None:
    ring = Outline("stop", 0.3, np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]))
    (encoded,) = protobuf_fields(scene_message([ring], "base", 7_000_000_008).encode())[2]
    fields = protobuf_fields(encoded)
    assert protobuf_fields(fields[1][0]) == {1: [7], 2: [8]}
    assert (fields[2], fields[3], fields[5]) == ([b"base"], [b"stop"], [1])
    assert protobuf_fields(fields[6][0]) == {1: [b"distance_m"], 2: [b"0.3"]}
    line = protobuf_fields(fields[11][0])
    line_loop = 1
    assert line[1] == [line_loop]
    assert [protobuf_fields(point) for point in line[5]] == [
        {1: [x_m], 2: [y_m]} for x_m, y_m in ring.points.tolist()
    ]


def test_a_varint_of_several_bytes_and_a_double_are_recognised() -> None:
    assert protobuf_fields(bytes((0x08, 0xAC, 0x02))) == {1: [300]}
    assert protobuf_fields(bytes((0x09,)) + struct.pack("<d", 0.5)) == {1: [0.5]}
