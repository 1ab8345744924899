"""The messages of the page, and what it is shown."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.messages import (
    MAX_MESSAGE_BYTES,
    MAX_NAME,
    MAX_NUMBER,
    MAX_SECRET,
    MAX_TIME_S,
    BadMessageError,
    HandOver,
    Wanted,
    is_latched,
    lease,
    read_drawn,
    read_hello,
    read_lease,
    read_wanted,
    view,
)
from wire.messages import EstopLease, EstopStationStatus, SafetyStatus, header

READERS = (read_hello, read_lease, read_drawn, read_wanted)


def status(*reasons: str, station: str = "door", required: bool = True) -> SafetyStatus:
    own = EstopStationStatus(station, required, EstopStationStatus.HEARD, pressed=False)
    return SafetyStatus(header(""), reasons=list(reasons), causes=list(reasons), estop_stations=[own])


def shown(newest: SafetyStatus | None, *, has_rival: bool = False) -> dict[str, object]:
    return dict(view("door", "tcp/robot:7447", newest, "Anna", has_rival=has_rival))


def test_the_first_message_has_a_code_or_a_token() -> None:
    assert read_hello('{"code": "abc"}') == ("abc", "", None)
    assert read_hello('{"token": "abc"}') == ("", "abc", None)
    assert read_hello('{"token": "abc", "name": " Ben\\u001b"}') == ("", "abc", "Ben?")
    assert read_hello(json.dumps({"code": "x" * MAX_SECRET})) == ("x" * MAX_SECRET, "", None)


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
    '{"token": "a", "name": 1}',
    '{"name": 1}',
    json.dumps({"token": "a", "name": "x" * (MAX_NAME + 1)}),
    '{"press": false}',
    '{"press": 1}',
    '{"press": true, "stop": true}',
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
    for read in READERS:
        with pytest.raises(BadMessageError):
            read(text)


@given(
    st.text() | st.recursive(st.none() | st.booleans() | st.integers() | st.text(), st.lists).map(json.dumps)
)
def test_no_text_causes_another_error(text: str) -> None:
    for read in READERS:
        try:
            read(text)
        except BadMessageError:
            continue


def test_a_name_is_short_and_printable() -> None:
    assert read_lease('{"name": " J\u00f6rg "}') == "J\u00f6rg"
    assert read_lease(json.dumps({"name": "\x1b[2J\u202e\ud800"})) == "?[2J??"
    assert [read_lease(json.dumps({"name": blank})) for blank in ("\u3164", " \u2800\ufe0f ")] == ["", ""]
    assert read_lease(json.dumps({"name": "\U0001f980" * MAX_NAME})) == "\U0001f980" * MAX_NAME
    for fields in ({"name": "x" * (MAX_NAME + 1)}, {"name": 1}, {"name": "x", "stop": True}):
        with pytest.raises(BadMessageError):
            read_lease(json.dumps(fields))


def test_the_supervisors_numbers_reach_the_page_as_texts() -> None:
    message = {"challenge": str(MAX_NUMBER), "response": "7", "stop": True}
    assert lease(EstopLease(MAX_NUMBER, 7, stop=True)) == message


def test_the_page_shows_why_it_is_not_heard_and_what_to_do() -> None:
    waiting = "Waiting for the supervisor at tcp/robot:7447: start it if it does not run."
    assert shown(None)["problem"] == waiting
    assert "[[supervisor.estop_stations]]" in str(shown(status(station="gate"))["problem"])
    assert "Another page" in str(shown(status(), has_rival=True)["problem"])
    unheard = "The robot does not hear this station: wait; if this lasts, check the network."
    assert shown(status())["problem"] == unheard


def test_the_page_shows_the_cause_in_words_and_whether_the_robot_depends_on_it() -> None:
    assert shown(status("ESTOP")) | {"problem": ""} == {
        "problem": "",
        "cause": "the emergency stop is latched",
        "latched": True,
        "seen": False,
        "required": True,
        "driver": "Anna",
    }
    assert shown(status(required=False))["required"] is False
    assert not is_latched(status("OBSTACLE"))
    assert shown(None)["seen"] is False


def test_a_page_that_is_touched_again_says_so() -> None:
    assert read_lease('{"press": true}') is None


def test_foreign_text_is_made_printable() -> None:
    newest = status("\x1b[31mRED")
    assert shown(newest)["cause"] == "?[31mRED"
    assert "\x1b" not in str(view("door", "tcp/\x1b[2J", None, "", has_rival=False)["problem"])


def command(**fields: object) -> str:
    return json.dumps({"linear": 0.5, "angular": -1, "time_s": 7.5, "picture": 3} | fields)


def test_a_command_has_two_shares_the_time_of_the_page_and_the_number_of_a_picture() -> None:
    assert read_wanted(command()) == Wanted(0.5, -1.0, 7.5, 3)
    assert read_wanted(command(linear=1, angular=1, time_s=0)) == Wanted(1.0, 1.0, 0.0, 3)


def test_a_driver_requests_a_reset_or_names_the_person_who_drives_next() -> None:
    assert read_wanted('{"request": "reset"}') == "reset"
    assert read_wanted('{"hand_over": "Ben"}') == HandOver("Ben")


@pytest.mark.parametrize(
    "text",
    [
        command(linear=1.001),
        command(linear=math.nan),
        command(linear=True),
        command(linear="1"),
        command(angular=-1.001),
        command(time_s=MAX_TIME_S),
        command(time_s=True),
        command(picture=1.5),
        command(picture=None),
        command(more=1),
        '{"linear": 1e999, "angular": 0, "time_s": 1, "picture": 1}',
        '{"linear": 0.1, "angular": 0, "time_s": 1}',
        '{"request": "drive"}',
        '{"request": "hand_over"}',
        '{"request": 1}',
        '{"request": "reset", "linear": 0}',
        '{"reset": true}',
        '{"hand_over": 1}',
        '{"hand_over": "Ben", "request": "reset"}',
    ],
)
def test_what_is_no_command_and_no_request_is_refused(text: str) -> None:
    with pytest.raises(BadMessageError):
        read_wanted(text)


def test_a_page_says_which_picture_it_has_drawn() -> None:
    assert read_drawn('{"drawn": 12}') == 12
    for text in ('{"drawn": true}', '{"drawn": 1.5}', '{"drawn": "1"}', '{"drawn": 1, "more": 1}', "[]"):
        with pytest.raises(BadMessageError):
            read_drawn(text)
