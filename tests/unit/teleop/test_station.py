"""The station's side of its lease, and what its screen shows."""

import math

import pytest

from teleop.screen.view import Line
from teleop.station.state import (
    KEYS,
    LETTERS,
    ROWS,
    Lease,
    Look,
    Word,
    farewell,
    headline,
    large,
    picture,
    pressed,
    received,
    released,
    sent,
    sentence,
)
from wire.lease import LEASE_S, PRESENCE_PERIOD_S
from wire.messages import EstopLease, EstopStationStatus, SafetyStatus, header
from wire.reasons import StopReason

ENDPOINT = "tcp/127.0.0.1:7447"


def heard(now_s: float = 1.0, *, stop: bool = False) -> Lease:
    """A lease whose challenge 7 of this time is answered."""
    lease, _ = sent(Lease(), 7, now_s)
    return received(lease, EstopLease(100, 7, stop=stop))


def test_a_new_station_is_not_heard_and_its_first_message_is_due_at_once() -> None:
    assert Lease().word(0.0) is Word.NOT_HEARD
    assert Lease().due_s == -math.inf
    _, message = sent(Lease(), 7, 1.0)
    assert message == EstopLease(7, 0, stop=False, leaves=False)


def test_an_answer_to_its_challenge_shows_that_it_is_heard_until_the_lease_ends() -> None:
    lease = heard(0.0)
    assert lease.word(LEASE_S) is Word.HEARD
    assert lease.word(math.nextafter(LEASE_S, 1.0)) is Word.NOT_HEARD


def test_it_answers_the_newest_challenge_also_of_a_supervisor_that_has_not_heard_it_yet() -> None:
    lease, _ = sent(Lease(), 7, 1.0)
    lease = received(lease, EstopLease(100, 0, stop=True))
    assert lease.word(1.0) is Word.NOT_HEARD
    lease, message = sent(lease, 8, 1.05)
    assert message.response == 100
    assert lease.due_s == 1.05 + PRESENCE_PERIOD_S


def test_an_answer_to_an_older_challenge_does_not_shorten_the_lease_or_change_the_word() -> None:
    lease, _ = sent(Lease(), 7, 0.0)
    lease, _ = sent(lease, 8, 0.1)
    lease = received(lease, EstopLease(100, 8, stop=True))
    lease = received(lease, EstopLease(99, 7, stop=False))
    assert lease.heard_s == 0.1
    assert lease.word(0.1) is Word.STOPPED


def test_a_stop_of_the_robot_is_shown_while_it_is_heard_and_ends_with_the_next_answer() -> None:
    lease = heard(1.0, stop=True)
    assert lease.word(1.0) is Word.STOPPED
    assert received(lease, EstopLease(101, 7, stop=False)).word(1.0) is Word.HEARD


def test_a_pressed_button_stays_pressed_until_it_is_confirmed_and_released() -> None:
    lease = pressed(heard(1.0), 1.1)
    assert lease.is_pressed
    assert not lease.is_confirmed
    assert released(lease) == lease
    assert pressed(lease, 1.2) == lease, "a second press changes nothing"
    lease, message = sent(lease, 8, 1.1)
    assert message.stop
    lease = received(lease, EstopLease(101, 8, stop=True))
    assert lease.is_confirmed
    assert not released(lease).is_pressed
    assert not Lease().is_pressed


def test_a_goodbye_says_so_and_has_the_state_of_the_button() -> None:
    _, message = sent(pressed(Lease(), 1.0), 9, 1.0, leaves=True)
    assert message == EstopLease(9, 0, stop=True, leaves=True)


# --- the screen


def look(word: Word, *stations: EstopStationStatus, **fields: object) -> Look:
    status = SafetyStatus(header(""), causes=["ESTOP_STATION_LOST\x1b[2J"], estop_stations=[*stations])
    return Look("door", ENDPOINT, word, **({"is_connected": True, "status": status} | fields))  # type: ignore[arg-type]


def own(*, required: bool = True) -> EstopStationStatus:
    return EstopStationStatus("door", required, EstopStationStatus.HEARD, pressed=False)


def stopped(*stations: EstopStationStatus) -> SafetyStatus:
    return SafetyStatus(header(""), reasons=[StopReason.ESTOP], estop_stations=[*stations])


def text(line: Line) -> str:
    return "".join(segment.text for segment in line)


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [
        (look(Word.HEARD, own()), "any key stops the robot"),
        (look(Word.HEARD, own(), is_pressed=True), "stopping"),
        (look(Word.STOPPED, own(), is_pressed=True), "pressed here: waiting for the confirmation"),
        (
            look(Word.STOPPED, own(), is_pressed=True, is_confirmed=True),
            "pressed here: release it with Ctrl-R, then reset with r in teleop",
        ),
        (look(Word.STOPPED, own()), "the robot is stopped: ESTOP_STATION_LOST?[2J"),
        (look(Word.STOPPED, own(), status=None), "the robot is stopped"),
        (look(Word.NOT_HEARD, own()), "the robot does not hear this station"),
        (look(Word.NOT_HEARD, status=None), "the robot does not hear this station"),
        (
            look(Word.NOT_HEARD),
            "the supervisor has no station door: add it to [[supervisor.estop_stations]]",
        ),
        (
            look(Word.NOT_HEARD, own(), has_rival=True),
            "another program is the station door: end it, or use another name",
        ),
        (look(Word.NOT_HEARD, is_connected=False), f"waiting for the supervisor at {ENDPOINT}"),
        (
            look(Word.NOT_HEARD, own(), is_pressed=True),
            "PRESSED, not confirmed; the robot does not hear this station",
        ),
        (
            look(Word.NOT_HEARD, own(), has_rival=True, is_pressed=True, status=stopped(own())),
            "pressed, and the robot is stopped; another program is the station door: end it, or use another name",
        ),
        (
            look(Word.NOT_HEARD, own(), is_pressed=True, is_confirmed=True),
            "the robot does not hear this station",
        ),
    ],
)
def test_the_first_line_says_the_word_and_what_it_means(shown: Look, wanted: str) -> None:
    assert sentence(shown) == wanted
    assert text(headline(shown)) == f"door: {shown.word} - {wanted}"
    assert text(picture(shown, 120, 24)[0]) == text(headline(shown))


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [
        (look(Word.HEARD, own()), ": the robot stops, because this station is required"),
        (look(Word.STOPPED, own()), ": the robot stops, because this station is required"),
        (look(Word.HEARD, own(required=False)), ""),
        (look(Word.HEARD, status=None), ""),
        (look(Word.NOT_HEARD, own(), has_rival=True), "; it was not heard"),
        (look(Word.NOT_HEARD), "; it was not heard"),
    ],
)
def test_only_a_required_station_that_is_heard_stops_the_robot_by_leaving(shown: Look, wanted: str) -> None:
    assert farewell(shown) == f"e-stop station door has left{wanted}"
    lines = [text(line) for line in picture(shown, 80, 24)]
    assert ("Leaving stops the robot: this station is required." in lines) is ("robot stops" in wanted)


@pytest.mark.parametrize(
    "shown",
    [
        look(Word.HEARD, own()),
        look(Word.STOPPED, own(), is_pressed=True, is_confirmed=True),
        look(Word.NOT_HEARD, own(), has_rival=True, is_pressed=True),
    ],
)
@pytest.mark.parametrize("size", [(40, 10), (60, 10), (80, 24), (200, 60)])
def test_the_word_its_meaning_and_the_keys_are_whole_on_every_screen(
    shown: Look, size: tuple[int, int]
) -> None:
    columns, rows = size
    lines = [text(line) for line in picture(shown, columns, rows)]
    assert len(lines) <= rows
    assert max(map(len, lines)) <= columns
    words = " ".join(lines)
    assert words.startswith(text(headline(shown)))
    assert all(key in words for key in KEYS)


@pytest.mark.parametrize(("columns", "rows", "is_large"), [(44, 13, True), (43, 13, False), (44, 12, False)])
def test_the_large_word_is_left_out_where_it_would_displace_or_be_cut(
    columns: int,
    rows: int,
    is_large: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    lines = picture(look(Word.NOT_HEARD, own()), columns, rows)
    assert any("█" in text(line) for line in lines) is is_large


def test_the_word_is_large_and_twice_as_wide_where_there_is_room() -> None:
    assert large("HEARD", 23, unicode=False)[2] == "#### ###  #### ###  #  #"
    assert large("HEARD", 48, unicode=True)[0].startswith("██    ██  ████████")
    assert len(large("HEARD", 47, unicode=True)[0]) == 24
    assert len(large("HEARD", 48, unicode=True)[0]) == 48


@pytest.mark.parametrize("word", Word)
def test_every_word_has_its_letters(word: Word) -> None:
    assert set(word) <= LETTERS.keys()
    assert len(large(word, 200, unicode=False)) == ROWS
    assert all(len(row) == 4 for letter in LETTERS.values() for row in letter)
