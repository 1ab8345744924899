"""The messages of the page, and what it is shown."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.messages import (
    MAX_MESSAGE_BYTES,
    MAX_NUMBER,
    MAX_SECRET,
    BadMessageError,
    is_latched,
    lease,
    read_hello,
    read_lease,
    view,
    welcome,
)
from wire.messages import EstopLease, EstopStationStatus, SafetyStatus, header


def status(*reasons: str, station: str = "door", required: bool = True) -> SafetyStatus:
    own = EstopStationStatus(station, required, EstopStationStatus.HEARD, pressed=False)
    return SafetyStatus(header(""), reasons=list(reasons), causes=list(reasons), estop_stations=[own])


def shown(newest: SafetyStatus | None, *, has_rival: bool = False) -> dict[str, object]:
    return json.loads(view("door", "tcp/robot:7447", newest, has_rival=has_rival))


def test_the_first_message_has_a_code_or_a_token() -> None:
    assert read_hello('{"code": "abc"}') == ("abc", "")
    assert read_hello('{"token": "abc"}') == ("", "abc")
    assert read_hello(json.dumps({"code": "x" * MAX_SECRET})) == ("x" * MAX_SECRET, "")


def test_the_numbers_of_a_lease_are_digits_of_up_to_64_bits() -> None:
    for number in (0, 1, MAX_NUMBER):
        text = json.dumps({"challenge": str(number), "response": str(number), "stop": True})
        assert read_lease(text) == EstopLease(number, number, stop=True)
        assert len(text) <= MAX_MESSAGE_BYTES


GARBAGE = [
    "",
    "{",
    "[]",
    "null",
    "1e999",
    "[" * 400,
    "{}",
    '{"code": 1}',
    '{"code": "a", "token": "b"}',
    json.dumps({"code": "x" * (MAX_SECRET + 1)}),
    json.dumps({"token": "x" * (MAX_SECRET + 1)}),
    '{"challenge": 1, "response": "1", "stop": false}',
    '{"challenge": "1", "response": "1", "stop": 0}',
    '{"challenge": "1", "response": "1", "stop": false, "leaves": true}',
    '{"challenge": "-1", "response": "1", "stop": false}',
    '{"challenge": "", "response": "1", "stop": false}',
    '{"challenge": "١", "response": "1", "stop": false}',
    json.dumps({"challenge": str(MAX_NUMBER + 1), "response": "1", "stop": False}),
    json.dumps({"challenge": "1", "response": "1" * 400, "stop": False}),
]


@pytest.mark.parametrize("text", GARBAGE)
def test_garbage_is_no_message(text: str) -> None:
    for read in (read_hello, read_lease):
        with pytest.raises(BadMessageError):
            read(text)


@given(
    st.text() | st.recursive(st.none() | st.booleans() | st.integers() | st.text(), st.lists).map(json.dumps)
)
def test_no_text_causes_another_error(text: str) -> None:
    for read in (read_hello, read_lease):
        try:
            read(text)
        except BadMessageError:
            continue


def test_the_supervisors_numbers_reach_the_page_as_texts() -> None:
    message = json.loads(lease(EstopLease(MAX_NUMBER, 7, stop=True)))
    assert message == {"kind": "lease", "challenge": str(MAX_NUMBER), "response": "7", "stop": True}
    fields = {"kind": "welcome", "station": "door", "token": "t", "may_drive": True}
    assert json.loads(welcome("door", "t", may_drive=True)) == fields


def test_the_page_is_told_why_it_is_not_heard() -> None:
    assert shown(None)["problem"] == "Waiting for the supervisor at tcp/robot:7447."
    assert "[[supervisor.estop_stations]]" in str(shown(status(station="gate"))["problem"])
    assert "Another page" in str(shown(status(), has_rival=True)["problem"])
    assert shown(status())["problem"] == "The robot does not hear this station."


def test_the_page_is_told_the_reasons_and_whether_the_robot_depends_on_it() -> None:
    assert shown(status("ESTOP")) | {"problem": ""} == {
        "kind": "view",
        "problem": "",
        "reasons": "ESTOP",
        "latched": True,
        "required": True,
    }
    assert shown(status(required=False))["required"] is False
    assert not is_latched(status("OBSTACLE"))


def test_foreign_text_is_made_printable() -> None:
    newest = status("\x1b[31mRED")
    assert shown(newest)["reasons"] == "?[31mRED"
    assert "\\u001b" not in view("door", "tcp/\x1b[2J", None, has_rival=False)
