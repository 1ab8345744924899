"""The bytes on the wire are ROS 2's, and hostile bytes raise only the documented error."""

import math
import re
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wire import topics
from wire.messages import (
    APPENDED_FROM,
    MAX_PAYLOAD_BYTES,
    Bool,
    LaserScan,
    Message,
    SafetyStatus,
    SourceStatus,
    String,
    Time,
    TriggerResponse,
    Twist,
    UndecodableError,
    decode,
    definition,
    encode,
    header,
    laser_scan,
    odometry,
    planar_twist,
    request_text,
    yaw_of,
)


def test_a_twist_is_52_bytes_of_little_endian_cdr() -> None:
    payload = encode(planar_twist(0.5, -1.0))
    assert payload == b"\x00\x01\x00\x00" + struct.pack("<6d", 0.5, 0.0, 0.0, 0.0, 0.0, -1.0)
    assert len(payload) == 52


def test_a_twist_comes_back_as_it_went() -> None:
    assert decode(encode(planar_twist(0.3, 0.2)), Twist) == planar_twist(0.3, 0.2)


def test_a_scan_comes_back_with_its_special_readings() -> None:
    ranges = np.array([1.0, np.inf, -np.inf, np.nan], dtype=np.float32)
    scan = LaserScan(header("lidar"), -1.0, 1.0, 0.5, 0.0, 0.05, 0.1, 12.0, ranges, np.empty(0, np.float32))
    back = decode(encode(scan), LaserScan)
    assert np.array_equal(back.ranges, ranges, equal_nan=True)
    assert back.header.frame_id == "lidar"


def test_the_status_comes_back_with_all_its_sources() -> None:
    source = SourceStatus("teleop", 100, 1, True, False, True, 0.01, ["OBSTACLE"], 1, 2, 3, 4, 5)  # noqa: FBT003
    status = SafetyStatus(header("base_link"), mode=3, reasons=["OBSTACLE"], sources=[source], scale=0.4)
    back = decode(encode(status), SafetyStatus)
    assert isinstance(back, SafetyStatus)
    assert back.sources == [source]
    assert (back.mode, back.reasons, back.scale) == (3, ["OBSTACLE"], 0.4)


OLD_STATUS = bytes.fromhex(
    "0001000001000000020000000a000000626173655f6c696e6b00000002000000080000004f56455252554e000b000000"
    "5343414e5f5354414c450000000000000700000074656c656f7000000000000000000000000000000000000000000000"
    "000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "00000000000000000000000000000000000000000000000000000000000000000000e03f000000000000f83f00000000"
    "0000d03f000000000000c03f010000000000000007000000000000000000000000000000010000000200000078000000"
    "010000000700000074656c656f7000006400000001010001000000007b14ae47e17a843f01000000090000004f425354"
    "41434c450000000000000000010000000000000002000000000000000300000000000000040000000000000005000000"
    "00000000"
)
"""A status as it was recorded before `causes`, `latched` and `detail` were appended."""


STATUS_BEFORE_RMW_ZENOH = bytes.fromhex(
    "0001000001000000020000000a000000626173655f6c696e6b00000001000000090000004f42535441434c4500000000"
    "0700000074656c656f700000000000000000000000000000000000000000000000000000000000000000000000000000"
    "000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "000000000000000000000000000000000000e03f000000000000e03f000000000000d03f000000000000000001000000"
    "0000000000000000000000000000000000000000000000000000000001000000090000004f42535441434c4500000000"
    "01000000080000004f56455252554e000600000061686561640000000a0000006469736b2066756c6c00"
)
"""A status as it was recorded before `rmw_zenoh_nodes` was appended."""


def test_a_status_from_before_the_last_field_was_appended_still_decodes() -> None:
    back = decode(STATUS_BEFORE_RMW_ZENOH, SafetyStatus)
    assert (back.owner, back.scale) == ("teleop", 0.5)
    assert (back.causes, back.latched, back.detail) == (["OBSTACLE"], ["OVERRUN"], "ahead")
    assert (back.estop_record_problem, back.rmw_zenoh_nodes) == ("disk full", [])


def test_the_status_comes_back_with_the_nodes_that_use_other_keys() -> None:
    status = SafetyStatus(header(""), detail="x", rmw_zenoh_nodes=["/talker", "and 3 more"])
    assert decode(encode(status), SafetyStatus).rmw_zenoh_nodes == ["/talker", "and 3 more"]


def test_a_status_reports_the_stamp_of_a_source_that_it_knows() -> None:
    known = [SourceStatus(name, 1, 1, True, True, True, 0.0, [], 1, 0, 0, 0, 0) for name in ("teleop", "joy")]  # noqa: FBT003
    status = SafetyStatus(header(""), sources=known)
    assert status.source_time_ns("teleop") is None
    status.source_times = [Time(3, 5), Time(0, 0)]
    back = decode(encode(status), SafetyStatus)
    assert [back.source_time_ns(name) for name in ("teleop", "joy", "path")] == [3_000_000_005, 0, None]


def test_a_status_from_before_fields_were_appended_still_decodes() -> None:
    back = decode(OLD_STATUS, SafetyStatus)
    assert (back.reasons, back.owner, back.scale) == (["OVERRUN", "SCAN_STALE"], "teleop", 0.5)
    assert [source.refused_invalid for source in back.sources] == [5]
    assert (back.causes, back.latched, back.detail, back.rmw_zenoh_nodes) == ([], [], "", [])
    assert back.causes_and_latched() == (["OVERRUN", "SCAN_STALE"], [])


@given(cut=st.integers(0, len(OLD_STATUS) - 4))
def test_a_truncated_status_is_refused_in_its_old_form_too(cut: int) -> None:
    """CDR allows three bytes of padding at the end, and rosbags reads as many fewer."""
    with pytest.raises(UndecodableError):
        decode(OLD_STATUS[:cut], SafetyStatus)


@given(spare=st.integers(4, 200))
def test_an_old_status_with_more_behind_it_is_refused(spare: int) -> None:
    with pytest.raises(UndecodableError):
        decode(OLD_STATUS + b"\xff" * spare, SafetyStatus)


def test_the_status_parts_what_holds_from_what_is_over() -> None:
    status = SafetyStatus(
        header(""), reasons=["SCAN_STALE", "OVERRUN"], causes=["SCAN_STALE"], latched=["OVERRUN"], detail="°"
    )
    back = decode(encode(status), SafetyStatus)
    assert back.causes_and_latched() == (["SCAN_STALE"], ["OVERRUN"])
    assert back.detail == "°"
    assert back.why() == "SCAN_STALE, OVERRUN (over)"
    assert SafetyStatus(header(""), reasons=["ESTOP"]).why() == "ESTOP"
    assert SafetyStatus(header(""), reasons=["ESTOP"], latched=["ESTOP"]).causes_and_latched() == (
        [],
        ["ESTOP"],
    )
    assert SafetyStatus(header("")).why() == ""


def test_every_type_that_has_grown_names_its_first_new_field() -> None:
    for name, firsts in APPENDED_FROM.items():
        text = definition(name).text.partition("===")[0]
        places = [re.search(rf"^\S+ {first}\b", text, re.MULTILINE) for first in firsts]
        starts = [place.start() for place in places if place is not None]
        assert len(starts) == len(firsts)
        assert starts == sorted(starts)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -3.0, math.pi])
def test_the_yaw_of_odometry_is_the_one_that_was_put_in(yaw_rad: float) -> None:
    assert yaw_of(odometry((1.0, 2.0, yaw_rad), (0.0, 0.0)).pose.pose.orientation) == pytest.approx(yaw_rad)


def test_the_beams_of_a_scan_share_a_full_turn_unless_their_angles_are_given() -> None:
    ranges = np.ones(4, dtype=np.float32)
    turn = laser_scan(ranges, range_m=(0.1, 12.0), period_s=0.05)
    assert (turn.angle_min, turn.angle_increment, turn.angle_max) == (-math.pi, math.pi / 2, math.pi / 2)
    fan = laser_scan(ranges, angle_min_rad=-0.3, angle_increment_rad=0.2, range_m=(0.1, 12.0), period_s=0.05)
    assert fan.angle_max == pytest.approx(0.3)


def test_a_trigger_response_is_ros_2s() -> None:
    payload = encode(TriggerResponse(success=True, message="ok"))
    assert payload == b"\x00\x01\x00\x00\x01\x00\x00\x00\x03\x00\x00\x00ok\x00"


@pytest.mark.parametrize("cdr_header", [b"\0\1\0\0", b"\0\1\0\3", b"\0\0\0\0"])
@pytest.mark.parametrize("dummy", [b"", b"\0", b"\x7f", b"\0\xaa\xbb\xcc"])
def test_a_trigger_request_of_ros_2_is_a_request_without_a_text(cdr_header: bytes, dummy: bytes) -> None:
    """zenoh-bridge-ros2dds sends five bytes; Fast CDR pads to eight, and leaves the padding unset."""
    assert request_text(cdr_header + dummy) == ""


def test_a_request_without_a_payload_has_no_text() -> None:
    assert request_text(b"") == ""


@pytest.mark.parametrize("text", ["", "a", "at once"])
def test_the_text_of_a_request_is_returned(text: str) -> None:
    assert request_text(encode(String(text))) == text


@pytest.mark.parametrize(
    "payload",
    [b"\0", b"\0\1\0", b"\1\1\0\0\0", b"\0\2\0\0\0", b"reset", b"\0\1\0\0" + 5 * b"\0", b"\xff" * 20],
)
def test_a_request_that_is_neither_empty_nor_a_text_is_refused(payload: bytes) -> None:
    with pytest.raises(UndecodableError):
        request_text(payload)


@pytest.mark.parametrize("padding", [b"", b"\xaa", b"\xaa\xbb", b"\xaa\xbb\xcc"])
@pytest.mark.parametrize("pressed", [False, True])
def test_a_padded_estop_of_ros_2_is_decoded(padding: bytes, *, pressed: bool) -> None:
    """Fast CDR sends a Bool as eight bytes, of which the last three are unset."""
    assert decode(encode(Bool(data=pressed)) + padding, Bool).data is pressed


def test_a_definition_holds_the_types_within_the_type_and_their_hash() -> None:
    told = definition("lifeline_msgs/msg/SafetyStatus")
    assert "MSG: lifeline_msgs/SourceStatus" in told.text
    assert "MSG: geometry_msgs/Vector3" in told.text
    assert told.hash.startswith("RIHS01_")


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.key)
@given(payload=st.binary(max_size=200))
def test_any_bytes_decode_or_are_refused(topic: topics.Topic[Message], payload: bytes) -> None:
    for candidate in (payload, b"\x00\x01\x00\x00" + payload):
        try:
            message = decode(candidate, topic.type)
        except UndecodableError:
            continue
        assert message.__msgtype__ == topic.type.__msgtype__


@given(cut=st.integers(0, 51))
def test_a_truncated_twist_is_refused(cut: int) -> None:
    with pytest.raises(UndecodableError):
        decode(encode(planar_twist(1.0, 1.0))[:cut], Twist)


def test_an_oversized_payload_is_refused_unread() -> None:
    with pytest.raises(UndecodableError, match="bytes are more than"):
        decode(bytes(MAX_PAYLOAD_BYTES + 1), Twist)


def test_a_scan_that_claims_more_beams_than_it_has_is_refused() -> None:
    scan = LaserScan(
        header(""), 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, np.zeros(4, np.float32), np.empty(0, np.float32)
    )
    count, too_many = struct.pack("<I", 4), struct.pack("<I", 0x7FFFFFFF)
    payload = encode(scan)
    assert payload.count(count) == 1
    with pytest.raises(UndecodableError):
        decode(payload.replace(count, too_many), LaserScan)


def test_the_table_of_topics_has_each_key_once_and_no_leading_slash() -> None:
    keys = [topic.key for topic in topics.TOPICS] + [service.key for service in topics.SERVICES]
    assert len(set(keys)) == len(keys)
    assert not any(key.startswith("/") for key in keys)
