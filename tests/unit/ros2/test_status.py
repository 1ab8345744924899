"""The beginning of a SafetyStatus, compared with the encoder of the supervisor."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros2.status import MAX_REASONS, status_of
from wire.cdr import Planar
from wire.message_types import MODES
from wire.messages import SafetyStatus, encode, header, planar_twist
from wire.reasons import StopReason

TEXT = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=40)
FINITE = st.floats(allow_nan=False)


@given(
    frame_id=TEXT,
    mode=st.sampled_from(range(len(MODES))),
    reasons=st.lists(TEXT, max_size=MAX_REASONS),
    warning=st.booleans(),
    alarm=st.booleans(),
    owner=TEXT,
    values=st.tuples(FINITE, FINITE, FINITE, FINITE, FINITE, FINITE),
    detail=TEXT,
)
def test_any_status_is_read_as_it_was_written(
    frame_id: str,
    mode: int,
    reasons: list[str],
    warning: bool,  # noqa: FBT001
    alarm: bool,  # noqa: FBT001
    owner: str,
    values: tuple[float, ...],
    detail: str,
) -> None:
    written = SafetyStatus(
        header(frame_id),
        mode=mode,
        reasons=reasons,
        warning=warning,
        alarm=alarm,
        owner=owner,
        commanded=planar_twist(values[0], values[1]),
        permitted=planar_twist(values[2], values[3]),
        scale=values[4],
        nearest_m=values[5],
        detail=detail,
    )
    status = status_of(encode(written))
    assert status is not None
    assert status.mode == MODES[mode]
    assert status.reasons == tuple(reasons)
    assert (status.warning, status.alarm, status.owner) == (warning, alarm, owner)
    assert status.requested == Planar(values[0], values[1])
    assert status.permitted == Planar(values[2], values[3])
    assert (status.scale, status.nearest_m) == values[4:]


def test_every_mode_of_the_message_has_its_name() -> None:
    names = {name: value for name, value in vars(SafetyStatus).items() if name.isupper()}
    assert {name: value for value, name in enumerate(MODES)} == names


def test_all_reasons_at_once_are_few_enough() -> None:
    assert len(StopReason) <= MAX_REASONS
    status = status_of(encode(SafetyStatus(header(""), reasons=[r.value for r in StopReason])))
    assert status is not None
    assert status.reasons == tuple(r.value for r in StopReason)


def test_a_status_without_a_scan_has_no_nearest_distance() -> None:
    status = status_of(encode(SafetyStatus(header(""))))
    assert status is not None
    assert math.isnan(status.nearest_m)


def test_more_reasons_than_there_can_be_are_no_status() -> None:
    reasons = ["x"] * MAX_REASONS
    assert status_of(encode(SafetyStatus(header(""), reasons=reasons))) is not None
    assert status_of(encode(SafetyStatus(header(""), reasons=[*reasons, "x"]))) is None


def test_an_unknown_mode_is_no_status() -> None:
    payload = bytearray(encode(SafetyStatus(header(""))))
    at = 4 + 12 + 1
    for mode in range(256):
        payload[at] = mode
        assert (status_of(bytes(payload)) is not None) is (mode < len(MODES))


def test_a_status_that_ends_before_the_nearest_distance_is_none() -> None:
    payload = encode(SafetyStatus(header("base_link"), reasons=["OBSTACLE"], owner="teleop", nearest_m=1.0))
    read = [length for length in range(len(payload)) if status_of(payload[:length]) is not None]
    assert read == list(range(read[0], len(payload)))
    assert read[0] > 4 + 2 * 48


@pytest.mark.parametrize("payload", [b"", b"\x00\x01", b"\x00\x00\x00\x00" + bytes(300), b"\xff" * 300])
def test_other_bytes_are_no_status(payload: bytes) -> None:
    assert status_of(payload) is None


@given(st.binary(max_size=400), st.booleans())
def test_no_bytes_raise(payload: bytes, headed: bool) -> None:  # noqa: FBT001
    status_of(b"\x00\x01\x00\x00" + payload if headed else payload)


@given(st.data())
def test_no_changed_bytes_of_a_status_raise(data: st.DataObject) -> None:
    payload = bytearray(encode(SafetyStatus(header("base_link"), reasons=["OBSTACLE"], owner="teleop")))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    status_of(bytes(payload))
