"""The terminal's bytes -> keys, and the meaning of each key."""

import math
import sys
import unicodedata
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.keyboard import MOTIONS, SPEEDS
from teleop.pilots.keys import (
    CTRL_BACKSLASH,
    CTRL_C,
    CTRL_D,
    CTRL_Z,
    FOCUS_OUT,
    MAX_DOWN,
    MAX_KEYS,
    MAX_PARAMETERS,
    PASTED,
    PAUSE_S,
    PLAIN,
    REPLY,
    SEVERAL,
    TOGETHER_S,
    UNFINISHED,
    UNFOCUSED,
    UNKNOWN,
    UNPRESSED,
    WHEEL,
    Command,
    KeyDecoder,
    Report,
    ReportKind,
    TypedKeys,
    level_of,
    name_of,
)
from teleop.pilots.pilot import KeyEvent, KeyKind
from teleop.screen.controls import LEGENDS, command_for
from teleop.screen.view import Control

PRESS, REPEAT, RELEASE = KeyKind.PRESS, KeyKind.REPEAT, KeyKind.RELEASE


def keys(data: bytes) -> list[str]:
    """The keys of some presses."""
    events = KeyDecoder().feed(data)
    assert all(isinstance(event, KeyEvent) and event.kind is PRESS for event in events)
    return [event.key for event in events if isinstance(event, KeyEvent)]


def as_typed(events: Sequence[KeyEvent]) -> Sequence[KeyEvent]:
    """The events of one read after a pause."""
    return TypedKeys().take(events, 0.0)


def typed_apart(data: bytes, gap_s: float) -> list[str]:
    """The keys of single bytes that are read one by one."""
    decoder, typed = KeyDecoder(), TypedKeys()
    return [
        event.key
        for number, byte in enumerate(data)
        for event in typed.take(
            [event for event in decoder.feed(bytes([byte])) if isinstance(event, KeyEvent)], number * gap_s
        )
    ]


FRAGMENTS = (
    b"\x1b",
    b"\x1b[",
    b"\x1b[A",
    b"\x1b[1;5D",
    b"\x1bOP",
    b"\x1bO",
    b" ",
    b"\x03",
    b"w",
    b"\x1b[32",
    b"\x1b[105;1:",
    b"\x1b[?15u",
    b"\x1b[99;5:3u",
    b"\x1b[0n",
    b"\x1b[200~",
    b"\x1b[201~",
    b"\x1b[27;5",
    b"\x1b[?1007;2$y",
    b"\xc2\xa0",
    b"\xe3\x80",
    b":",
    b";",
    b"u",
    b"1",
)
pieces = st.lists(st.one_of(st.binary(max_size=6), st.sampled_from(FRAGMENTS)), max_size=12)


@pytest.mark.parametrize(
    ("sequence", "key"),
    [
        (b"\x1b[A", "up"),
        (b"\x1b[B", "down"),
        (b"\x1b[C", "right"),
        (b"\x1b[D", "left"),
        (b"\x1b[1;5D", "left"),
        (b"\x1bOA", "up"),
        (b"\x1bOS", "f4"),
        (b"\x1b[1;5R", "f3"),
        (b"\x1b[1;2R", "f3"),
        (b"\x1b[3~", "~3"),
        (b"\x1b[Z", "tab"),
        (b"\r", "enter"),
        (b"\x7f", "backspace"),
    ],
)
def test_a_cursor_or_function_key_has_a_name_and_is_no_letter(sequence: bytes, key: str) -> None:
    assert keys(b"w" + sequence + b"x") == ["w", key, "x"]


@pytest.mark.parametrize(
    "sequence",
    [
        b"\x1b[201~",
        b"\x1b[I",
        b"\x1b[?62;22c",
        b"\x1b[24;80R",
        b"\x1b[10;5R",
        b"\x1b[?1;5R",
        b"\x1b[?2026;2$y",
        b"\x1b[3n",
        b"\x1b[8;24;80t",
        b"\x1b[48;24;80;480;800t",
    ],
)
def test_what_a_terminal_reports_by_itself_is_no_key(sequence: bytes) -> None:
    assert keys(b"w" + sequence + b"x") == ["w", "x"]


@pytest.mark.parametrize(
    "sequence",
    [b"\x1b[@", b"\x1bOj", b"\x1b[<0;10;10M", b"\x1b[t", b"\x1b[1;1;x", b"\x1b[n"],
)
def test_a_sequence_that_is_neither_a_key_nor_a_report_is_an_unknown_key(sequence: bytes) -> None:
    assert keys(b"w" + sequence + b"x") == ["w", UNKNOWN, "x"]


@pytest.mark.parametrize(
    ("sequence", "event"),
    [
        (b"\x1b[105u", KeyEvent("i")),
        (b"\x1b[105;1:1u", KeyEvent("i", PRESS)),
        (b"\x1b[105;1:2u", KeyEvent("i", REPEAT)),
        (b"\x1b[105;1:3u", KeyEvent("i", RELEASE)),
        (b"\x1b[105;65:3u", KeyEvent("i", RELEASE)),
        (b"\x1b[113:81;2u", KeyEvent("Q")),
        (b"\x1b[1;1:3A", KeyEvent("up", RELEASE)),
        (b"\x1b[1;1:2D", KeyEvent("left", REPEAT)),
        (b"\x1b[32u", KeyEvent(" ")),
        (b"\x1b[32;5u", KeyEvent(" ")),
        (b"\x1b[32;1:3u", KeyEvent(" ", RELEASE)),
        (b"\x1b[99;5u", KeyEvent(CTRL_C)),
        (b"\x1b[99;69:1u", KeyEvent(CTRL_C)),
        (b"\x1b[1089::99;5u", KeyEvent(CTRL_C)),
        (b"\x1b[122;5u", KeyEvent(CTRL_Z)),
        (b"\x1b[1096::105;1:3u", KeyEvent("i", RELEASE)),
        (b"\x1b[1096u", KeyEvent("key 1096")),
        (b"\x1b[27u", KeyEvent("escape")),
        (b"\x1b[13;1:3u", KeyEvent("enter", RELEASE)),
        (b"\x1b[57419u", KeyEvent("up")),
        (b"\x1b[57403u", KeyEvent("4")),
        (b"\x1b[57376u", KeyEvent("key 57376")),
        (b"\x1b[3;1:3~", KeyEvent("~3", RELEASE)),
        (b"\x1b[u", KeyEvent("key 0")),
        (b"\x1b[?15u", Report(ReportKind.KEYBOARD_FLAGS, 15)),
        (b"\x1b[?u", Report(ReportKind.KEYBOARD_FLAGS, 0)),
        (b"\x1b[0n", Report(ReportKind.WELL)),
        *((b"\x1b[?1007;%d$y" % state, Report(ReportKind.WHEEL_MODE, state in (2, 4))) for state in range(5)),
    ],
)
def test_the_kitty_protocol_reports_what_happened_to_a_key(sequence: bytes, event: KeyEvent | Report) -> None:
    assert KeyDecoder().feed(sequence) == [event]


@pytest.mark.parametrize("code", [57358, 57360, 57441, 57447, 57454])
def test_a_modifier_by_itself_is_no_key(code: int) -> None:
    assert KeyDecoder().feed(f"\x1b[{code};2u\x1b[{code};1:3u".encode()) == []


def test_a_sequence_that_arrives_in_pieces_is_no_letter_either() -> None:
    decoder = KeyDecoder()
    assert [decoder.feed(piece) for piece in (b"\x1b", b"[", b"D", b"d")] == [
        [],
        [],
        [KeyEvent("left")],
        [KeyEvent("d")],
    ]


@pytest.mark.parametrize("char", "ABCDQRSwxadiqrsI")
def test_a_letter_behind_an_escape_is_no_letter(char: str) -> None:
    """It is an arrow of VT52 mode, a function key of an HP terminal, or a key with Alt."""
    assert keys(f"\x1b{char}".encode()) == [f"Alt-{char}"]


@pytest.mark.parametrize("letter", ["w", "x", "u", "m", "l"])
def test_a_key_of_the_keypad_of_vt52_mode_is_unknown(letter: str) -> None:
    assert typed_apart(b"\x1b?" + letter.encode(), 0.15) == [UNKNOWN, UNKNOWN]


@pytest.mark.parametrize(
    "sequence", [b"\x1b[?5A", b"\x1b[>1B", b"\x1b[3$D", b"\x1b[<105u", b"\x1b[=105;1:1u"]
)
def test_a_sequence_with_parameters_that_no_key_has_is_unknown(sequence: bytes) -> None:
    assert keys(sequence) == [UNKNOWN]


def test_space_and_ctrl_c_of_win32_input_mode_come_through_and_a_letter_is_unknown() -> None:
    assert keys(b"\x1b[32;57;32;1;0;1_\x1b[67;46;3;1;8;1_") == [" ", CTRL_C]
    assert keys(b"\x1b[87;17;119;1;0;1_\x1b[32;57;32;0;0;1_") == [UNKNOWN, UNKNOWN]


def test_a_key_with_alt_is_that_key_in_the_kitty_protocol_alone() -> None:
    assert keys(b"\x1b[115;3u") == ["s"]
    assert keys(b"\x1b\r\x1b\x04") == ["enter", CTRL_D]


def test_a_lone_escape_does_not_swallow_the_emergency_stop() -> None:
    assert keys(b"\x1b [ ") == [" ", "[", " "]


def test_parameters_without_end_are_no_key_and_fill_no_memory() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b[" + b"1" * 100_000) == []
    assert len(decoder._parameters) == MAX_PARAMETERS  # pyright: ignore[reportPrivateUsage]
    assert decoder.feed(b"\x1b[32u") == [KeyEvent(UNFINISHED), KeyEvent(" ")]


@pytest.mark.parametrize("begun", [b"\x1b", b"\x1b[", b"\x1b[1;", b"\x1bO"])
def test_an_escape_that_the_reply_to_a_status_request_follows_is_still_an_unknown_key(begun: bytes) -> None:
    assert KeyDecoder().feed(begun + b"\x1b[0n") == [KeyEvent(UNFINISHED), Report(ReportKind.WELL)]


PIECES = [
    (b"\x1b[200~", [KeyEvent(PASTED)]),
    (b"\x1b[32;1u", [KeyEvent(" ")]),
    (b"\x1b[105;1:3u", [KeyEvent("i", RELEASE)]),
    (b"\x1bOD", [KeyEvent("left")]),
    (b"\x1b[D", [KeyEvent("left")]),
    (b"\x1bw", [KeyEvent("Alt-w")]),
    (b"\x1b[27;5;32~", [KeyEvent(" ")]),
]


@pytest.mark.parametrize(("sequence", "events"), PIECES, ids=repr)
@pytest.mark.parametrize(
    "report", [b"\x1b[0n", b"\x1b[0n\x1b[0n", b"\x1b[I", b"\x1b[?1007;2$y", b"\x1b[?62c"]
)
def test_a_sequence_inside_which_the_terminal_reports_goes_on_after_the_report(
    sequence: bytes, events: list[KeyEvent], report: bytes
) -> None:
    """Multiplexers and mosh insert their answers between any two bytes."""
    for cut in range(1, len(sequence)):
        decoder = KeyDecoder()
        found = decoder.feed(sequence[:cut] + report)
        assert [event for event in found if isinstance(event, KeyEvent)] == [KeyEvent(UNFINISHED)]
        assert not decoder.is_unfinished, "it is reported once"
        assert decoder.feed(sequence[cut:]) == events
        decoder.feed(b"w\x1b")
        assert decoder.is_unfinished


def test_a_sequence_that_a_key_interrupts_does_not_go_on() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b[1;\x1b[Aw") == [KeyEvent(UNFINISHED), KeyEvent("up"), KeyEvent("w")]
    assert decoder.feed(b"\x1b[1;\x1b w") == [KeyEvent(UNFINISHED), KeyEvent(" "), KeyEvent("w")]
    assert decoder.feed(b"\x1b[0nw") == [Report(ReportKind.WELL), KeyEvent("w")]


def test_a_plain_character_where_releases_are_reported_was_not_pressed_unless_it_stops() -> None:
    decoder = KeyDecoder()
    decoder.tells_releases = True
    assert decoder.feed(b"i\x1b[105u ") == [
        KeyEvent(PLAIN),
        KeyEvent("i"),
        KeyEvent(" "),
    ]


@pytest.mark.parametrize("opening", [b"\x1b", b"\x1b[", b"\x1b[1;", b"\x1b[105;1:", b"\x1bO"])
@pytest.mark.parametrize("key", [" ", CTRL_C])
def test_the_keys_that_must_come_through_do_so_inside_an_unfinished_sequence(
    opening: bytes, key: str
) -> None:
    assert keys(opening + key.encode()) == [key]


@given(pieces, st.booleans())
def test_every_plain_space_and_ctrl_c_is_a_key_whatever_surrounds_it(
    stream: list[bytes],
    tells_releases: bool,  # noqa: FBT001
) -> None:
    decoder, data = KeyDecoder(), b"".join(stream)
    decoder.tells_releases = tells_releases
    pressed = [
        event.key for event in decoder.feed(data) if isinstance(event, KeyEvent) and event.kind is PRESS
    ]
    assert pressed.count(" ") >= data.count(b" ")
    assert pressed.count(CTRL_C) >= data.count(b"\x03")


@given(
    pieces,
    st.sampled_from(
        [
            (b"\x1b[32u", " "),
            (b"\x1b[99;5u", CTRL_C),
            (b"\x1b[1089::99;5u", CTRL_C),
            (b"\x1b[27;5;99~", CTRL_C),
            *((b"\x1b[27;%d;32~" % modifiers, " ") for modifiers in (1, 2, 5, 9, 255)),
        ]
    ),
    st.sampled_from([b"", b";1:1", b";5", b";5:1", b";69:1", b";255:1", b";5:2"]),
    st.integers(0, 11),
)
def test_every_space_and_ctrl_c_of_another_coding_is_a_key_whatever_came_before_and_however_it_is_cut(
    before: list[bytes], plain: tuple[bytes, str], more: bytes, cut: int
) -> None:
    sequence, key = plain
    if sequence == b"\x1b[32u":
        sequence = sequence[:-1] + more + b"u"
    decoder = KeyDecoder()
    for piece in before:
        decoder.feed(piece)
    events = [*decoder.feed(sequence[:cut]), *decoder.feed(sequence[cut:])]
    assert events[-1:] in ([KeyEvent(key)], [KeyEvent(key, REPEAT)])


@given(pieces)
def test_how_the_bytes_are_cut_makes_no_difference(stream: list[bytes]) -> None:
    """Except that pasted text is reported once for each piece."""
    decoder = KeyDecoder()
    in_pieces = [event for piece in stream for event in decoder.feed(piece)]
    at_once = KeyDecoder().feed(b"".join(stream))
    pasted = KeyEvent(PASTED)
    assert [e for e in in_pieces if e != pasted] == [e for e in at_once if e != pasted]
    assert (pasted in in_pieces) == (pasted in at_once)


def test_bytes_beyond_ascii_are_utf_8_or_else_latin_1() -> None:
    assert keys(b"\xff\xc3\xa4\xb4w") == ["\xff", "\xe4", "\xb4", "w"]


# --- spaces

SPACES = [chr(code) for code in range(sys.maxunicode + 1) if unicodedata.category(chr(code)) == "Zs"]


@given(pieces, st.sampled_from([*(space.encode() for space in SPACES), b"\0"]), pieces, st.integers(0, 4))
def test_every_space_of_unicode_is_the_emergency_stop_whatever_surrounds_it_and_however_it_is_cut(
    before: list[bytes], space: bytes, after: list[bytes], cut: int
) -> None:
    decoder = KeyDecoder()
    events = [event for piece in before for event in decoder.feed(piece)]
    count = events.count(KeyEvent(" "))
    events += [*decoder.feed(space[:cut]), *decoder.feed(space[cut:])]
    assert events.count(KeyEvent(" ")) > count
    decoder.feed(b"".join(after))


def test_a_no_break_space_of_a_latin_1_terminal_is_the_emergency_stop() -> None:
    assert keys(b"\xa0") == [" "]


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("fields", ["{0}", "{0};2:1", "{0}:63;8:1", "32:{0};2", "1089:63:{0};5:1"])
def test_every_space_of_the_kitty_protocol_is_the_emergency_stop_with_any_modifiers(
    space: str, fields: str
) -> None:
    assert KeyDecoder().feed(f"\x1b[{fields.format(ord(space))}u".encode()) == [KeyEvent(" ")]


# --- the keyboard focus


def test_no_key_counts_while_the_terminal_does_not_have_the_focus_except_those_that_always_do() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"w\x1b[Ow\x1b[A \x1b[105;1:1u\x1b[105;1:3u\x03") == [
        *(KeyEvent("w"), KeyEvent(FOCUS_OUT), KeyEvent(UNFOCUSED), KeyEvent(UNFOCUSED), KeyEvent(" ")),
        *(KeyEvent(UNFOCUSED), KeyEvent("i", RELEASE), KeyEvent(CTRL_C)),
    ]
    assert decoder.feed(b"\x1b[Iw") == [KeyEvent("w")]


# --- releases

RENAMED = [
    ("105;1:1u", "99::105;1:3u"),
    ("105::103;1:1u", "103;1:3u"),
    ("57419;1:1u", "57407;1:3u"),
    ("1;1:1A", "57407;1:3u"),
]
"""A press and its release after a change of the layout or Num Lock."""


@pytest.mark.parametrize(("press", "release"), RENAMED)
def test_a_release_without_its_press_is_reported_because_the_key_may_be_a_held_one(
    press: str, release: str
) -> None:
    decoder = KeyDecoder()
    decoder.tells_releases = True
    decoder.feed(f"\x1b[{press}".encode())
    unpressed, event = decoder.feed(f"\x1b[{release}".encode())
    assert unpressed == KeyEvent(UNPRESSED)
    assert isinstance(event, KeyEvent)
    assert event.kind is RELEASE


@pytest.mark.parametrize("before", [b"", b"\x1b[13;1:1u\x1b[O\x1b[I", b"\x1b[105;1:1u\x1b[105;1:3u"])
@pytest.mark.parametrize("released", [b"13", b"13;1:3u\x1b[57443"])
def test_a_release_is_that_of_an_earlier_press_while_no_key_is_down(before: bytes, released: bytes) -> None:
    """For example the release of the Enter that started teleop, or of a key that changes windows."""
    decoder = KeyDecoder()
    decoder.tells_releases = True
    decoder.feed(before)
    assert decoder.feed(b"\x1b[" + released + b";1:3u") == [KeyEvent("enter", RELEASE)]


def test_the_report_of_a_focus_that_was_never_lost_does_not_release_the_keys() -> None:
    decoder = KeyDecoder()
    decoder.tells_releases = True
    decoder.feed(b"\x1b[105;1:1u\x1b[I")
    assert KeyEvent(UNPRESSED) in decoder.feed(b"\x1b[99;1:3u")


PAIRS = [
    ("105;1:1u", "105;1:3u"),
    ("105;1:2u", "105:73;2:3u"),
    ("105;5:1u", "105;1:3u"),
    ("105;129:1u", "105;1:3u"),
    ("34:51:51;2:1u", "34::51;1:3u"),
    ("1096::105;1:1u", "1096::105;1:3u"),
    ("119;9:1u", "119;9:3u"),
    ("A", "1;1:3A"),
    ("1;2:1A", "1;1:3A"),
    ("3~", "3;1:3~"),
    ("13u", "13;1:3u"),
]


@pytest.mark.parametrize(("press", "release"), PAIRS)
def test_a_release_has_its_press_whatever_modifiers_were_pressed_since_then(press: str, release: str) -> None:
    decoder = KeyDecoder()
    decoder.tells_releases = True
    decoder.feed(f"\x1b[{press}\x1b[{press}".encode())
    decoder.feed(b"\x1b[113u")
    assert len(decoder.feed(f"\x1b[{release}".encode())) == 1
    assert KeyEvent(UNPRESSED) in decoder.feed(f"\x1b[{release}".encode())


def test_the_presses_of_a_terminal_without_releases_fill_no_memory() -> None:
    decoder = KeyDecoder()
    for code in range(1000, 3000):
        decoder.feed(f"\x1b[{code}u".encode())
    assert len(decoder._down) == MAX_DOWN  # pyright: ignore[reportPrivateUsage]


# --- what no person typed


@pytest.mark.parametrize("count", range(1, 11))
@pytest.mark.parametrize("key", ["w", "r", "\x1b[A"])
def test_equal_keys_in_one_read_all_count(key: str, count: int) -> None:
    events = [KeyEvent(name) for name in keys((key * count).encode())]
    assert len(events) == count
    assert as_typed(events) == events


@pytest.mark.parametrize("typed", ["wwa", "wa", "ww aa", "s\x03wa ", "swwwwwa", "wawawawawa"])
def test_a_few_different_keys_in_one_read_count(typed: str) -> None:
    events = [KeyEvent(key) for key in typed]
    assert as_typed(events) == events


@pytest.mark.parametrize("pasted", ["www.example.org", "wads", "reset", "wwwwwwwwads"])
def test_more_different_keys_in_one_read_are_none(pasted: str) -> None:
    assert as_typed([KeyEvent(key) for key in pasted]) == [KeyEvent(SEVERAL)]


def test_the_position_in_a_mouse_report_is_no_key() -> None:
    events = [event for event in KeyDecoder().feed(b"\x1b[M`ww") if isinstance(event, KeyEvent)]
    assert as_typed(events) == [KeyEvent(UNKNOWN)]


STRING_REPLIES = [
    b"\x1b]11;rgb:dada/dada/dada\x1b\\",
    b"\x1b]11;rgb:dada/dada/dada\a",
    b"\x1bP>|xterm(370)\x1b\\",
    b"\x1b_Gi=31;wax\x1b\\",
    b"\x1b^w\x1b\\",
    b"\x90>|xterm\x9c",
    b"\xc2\x9d11;rgb:dada\a",
]
"""Replies that another program asked for: a colour, the terminal's name, a picture."""


@pytest.mark.parametrize("gap_s", [0.0, 0.15, 0.4 * PAUSE_S])
@pytest.mark.parametrize("reply", STRING_REPLIES, ids=repr)
def test_no_part_of_a_reply_to_another_program_is_a_key_however_a_slow_link_cuts_it(
    reply: bytes, gap_s: float
) -> None:
    assert set(typed_apart(reply, gap_s)) == {REPLY}


def test_a_key_counts_just_after_the_pause_that_ends_a_reply() -> None:
    typed, reply, key = TypedKeys(), [KeyEvent(REPLY)], [KeyEvent("w")]
    assert typed.take(reply, 0.0) == reply
    assert typed.take([KeyEvent(UNKNOWN)], 0.5) == reply
    assert typed.take(key, 0.5 + PAUSE_S) == reply
    assert typed.take(key, math.nextafter(0.5 + 2 * PAUSE_S, 3.0)) == key


@pytest.mark.parametrize("gap_s", [0.0, 0.15, PAUSE_S / 3])
@pytest.mark.parametrize(
    "report",
    [b"\x1b[Maw2", b"\x1b[[A", b"\x1bO5D", b"\x1b[<0;87;18M"],
    ids=repr,
)
def test_no_part_of_an_unknown_sequence_is_a_key_however_a_link_cuts_it(report: bytes, gap_s: float) -> None:
    assert set(typed_apart(report, gap_s)) == {UNKNOWN}


def test_a_key_counts_just_after_the_pause_that_ends_an_unknown_sequence() -> None:
    typed, unknown, key = TypedKeys(), [KeyEvent(UNKNOWN)], [KeyEvent("w")]
    assert typed.take(unknown, 0.0) == unknown
    assert typed.take([], PAUSE_S) == []
    assert typed.take(key, PAUSE_S) == unknown
    assert typed.take(key, 2 * PAUSE_S) == unknown
    assert typed.take(key, math.nextafter(3 * PAUSE_S, 4.0)) == key


@pytest.mark.parametrize("mark", [b"\x1b[200~", b"\x1b[0200~", b"\x1b[200;1~"])
@pytest.mark.parametrize("gap_s", [0.0, 0.02, 0.14 * PAUSE_S])
def test_pasted_text_that_contains_its_own_end_is_pasted_to_its_last_byte(mark: bytes, gap_s: float) -> None:
    assert set(typed_apart(mark + b"ls\x1b[201~www\x1b[201~ww", gap_s)) == {PASTED}


def test_the_end_of_pasted_text_that_is_read_later_is_no_key() -> None:
    typed = TypedKeys()
    assert typed.take([KeyEvent(key) for key in "forward"], 0.0) == [KeyEvent(SEVERAL)]
    assert typed.take([KeyEvent("w"), KeyEvent(" ")], PAUSE_S) == [KeyEvent(SEVERAL), KeyEvent(" ")]


def test_a_text_that_arrives_byte_by_byte_is_pasted_from_the_fourth_different_key_on() -> None:
    assert typed_apart(b"wadx", TOGETHER_S / 2) == ["w", "a", "d", SEVERAL]
    assert typed_apart(b"wwwwwwad", TOGETHER_S / 2) == list("wwwwwwad")
    assert typed_apart(b"wadx", 2 * TOGETHER_S) == list("wadx")


def test_an_endless_text_of_different_keys_fills_no_memory() -> None:
    typed = TypedKeys()
    for code in range(1000):
        typed.take([KeyEvent(f"key {code}")], code * TOGETHER_S / 2)
    assert len(typed._keys) == MAX_KEYS + 1  # pyright: ignore[reportPrivateUsage]


@pytest.mark.parametrize("eight_bit", [b"\x9b{}", b"\xc2\x9b{}"])
def test_eight_bit_controls_begin_the_same_sequences(eight_bit: bytes) -> None:
    for rest in (b"A", b"1;5D", b"119;1u", b"0n", b"200~w"):
        assert KeyDecoder().feed(eight_bit.replace(b"{}", rest)) == KeyDecoder().feed(b"\x1b[" + rest)
    assert keys(b"\x8fD") == keys(b"\x1bOD") == ["left"]


@pytest.mark.parametrize("parameters", [b"119;1:4", b"119;9", b"119;17:1", b"119;33:2", b"119;73"])
def test_an_unknown_event_and_a_key_of_the_desktop_are_unknown(parameters: bytes) -> None:
    event, *more = KeyDecoder().feed(b"\x1b[" + parameters + b"u")
    assert isinstance(event, KeyEvent)
    assert (event.key, more) == (UNKNOWN, [])


@pytest.mark.parametrize("key", ["u", "i", "o", "j", "l", "m", ",", "."])
def test_a_release_with_any_modifiers_ends_the_motion_of_its_key(key: str) -> None:
    for modifiers in range(1, 257):
        (event,) = KeyDecoder().feed(f"\x1b[{ord(key)};{modifiers}:3u".encode())
        assert isinstance(event, KeyEvent)
        assert (event.key.lower(), event.kind) == (key, RELEASE), modifiers


def test_what_no_person_types_does_not_count_among_different_keys() -> None:
    events = [KeyEvent(key) for key in (FOCUS_OUT, PLAIN, "i", "l", "q")]
    assert as_typed(events) == events


def test_releases_of_many_keys_are_no_keys() -> None:
    events = [KeyEvent(key, RELEASE) for key in "ijlm"]
    assert as_typed([*events, KeyEvent("i")]) == [*events, KeyEvent("i")]


@given(st.lists(st.builds(KeyEvent, st.sampled_from("wad\x03 ."), st.sampled_from(KeyKind))))
def test_the_keys_that_must_come_through_do_so_among_any_others(events: list[KeyEvent]) -> None:
    for key in (" ", CTRL_C):
        assert [e for e in as_typed(events) if e.key == key] == [e for e in events if e.key == key]


def test_a_paste_whose_end_never_arrives_is_reported_at_each_read() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b[200~text") == [KeyEvent(PASTED)]
    assert decoder.feed(b"more") == [KeyEvent(PASTED)]
    assert decoder.feed(b"q \x03") == [KeyEvent(PASTED), KeyEvent(" "), KeyEvent("\x03")]
    assert decoder.feed(b"\x1b[201~w") == [KeyEvent("w")]


@given(st.binary(max_size=40).filter(lambda text: b"\x1b" not in text), st.integers(0, 60))
def test_pasted_text_is_one_key_that_nobody_knows_and_its_spaces_stop(text: bytes, cut: int) -> None:
    data = b"\x1b[200~" + text + b"\x1b[201~w"
    decoder = KeyDecoder()
    found = [event for piece in (data[:cut], data[cut:]) for event in decoder.feed(piece)]
    first, *pasted, last = found
    assert (first, last) == (KeyEvent(PASTED), KeyEvent("w"))
    assert {event.key for event in pasted if isinstance(event, KeyEvent)} <= {" ", CTRL_C, PASTED}
    assert len(pasted) >= text.count(b" ") + text.count(CTRL_C.encode())


def test_a_terminal_may_report_in_the_middle_of_pasted_text() -> None:
    assert KeyDecoder().feed(b"\x1b[200~w\x1b[0nr\x1b[105;1:1u\x1b[201~") == [
        KeyEvent(PASTED),
        Report(ReportKind.WELL),
    ]


@pytest.mark.parametrize("begun", [b"\x1b", b"\x1b[", b"\x1b[1;", b"\x1bO", b"\xe3", b"\xe3\x80"])
def test_an_escape_and_the_beginning_of_a_sequence_or_character_are_unfinished(begun: bytes) -> None:
    decoder = KeyDecoder()
    assert not decoder.is_unfinished
    decoder.feed(begun)
    assert decoder.is_unfinished
    decoder.feed(b" ")
    assert not decoder.is_unfinished


@pytest.mark.parametrize(
    ("code", "key"),
    [(b"47:63", "/"), (b"223:63:45", "-"), (b"44:63:109", ",")],
    ids=["US", "German", "French"],
)
def test_a_question_mark_is_known_on_each_layout_and_its_release_ends_the_key_below(
    code: bytes, key: str
) -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b[" + code + b";2:1u") == [KeyEvent("?")]
    assert decoder.feed(b"\x1b[" + code + b";2:3u") == [KeyEvent(key, KeyKind.RELEASE)]
    assert decoder.feed(b"\x1b[" + code + b";1:1u") == [KeyEvent(key)]


@pytest.mark.parametrize("digit", "12345")
def test_a_digit_of_a_layout_on_which_it_needs_shift_is_that_digit_and_its_release_that_of_the_key_below(
    digit: str,
) -> None:
    code = f"38:{ord(digit)}:{ord(digit)}"
    assert KeyDecoder().feed(f"\x1b[{code};2:1u".encode()) == [KeyEvent(digit)]
    assert KeyDecoder().feed(f"\x1b[{code};1:1u\x1b[{code};2:3u".encode()) == [
        KeyEvent("&"),
        KeyEvent("&", KeyKind.RELEASE),
    ]


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ("5;99", CTRL_C),
        ("5;67", CTRL_C),
        ("6;32", " "),
        ("2;87", "W"),
        ("2;51", "3"),
        ("5;105", "tab"),
        ("3;13", "enter"),
        ("9;119", UNKNOWN),
        ("2;63", "?"),
        ("5;", "key 0"),
    ],
)
def test_keys_of_modify_other_keys_are_those_keys(fields: str, key: str) -> None:
    assert keys(f"w\x1b[27;{fields}~x".encode()) == ["w", key, "x"]
    decoder = KeyDecoder()
    decoder.tells_releases = True
    assert decoder.feed(f"\x1b[27;{fields}~".encode()) == [
        KeyEvent(key if key in (" ", CTRL_C) else PLAIN)
    ], "no release of it will follow"


@pytest.mark.parametrize(
    "arrow", [b"\x1b[A", b"\x1bOB", b"\x1b[1;5C", b"\x1b[1;1:2D", b"\x1b[57419u", b"\x9bA"]
)
def test_an_arrow_that_may_be_the_wheel_is_none_but_its_release_is(arrow: bytes) -> None:
    decoder = KeyDecoder()
    decoder.doubts_arrows = True
    assert decoder.feed(arrow + b"i\x1b[1;1:3A") == [
        KeyEvent(WHEEL),
        KeyEvent("i"),
        KeyEvent("up", RELEASE),
    ]


# --- the program's keys


COMMANDS = {
    " ": Command.ESTOP,
    "r": Command.RESET,
    "q": Command.QUIT,
    CTRL_C: Command.QUIT,
    CTRL_D: Command.QUIT,
    CTRL_BACKSLASH: Command.QUIT,
    CTRL_Z: Command.SUSPEND,
    "?": Command.HELP,
    "h": Command.HELP,
}


@pytest.mark.parametrize(("key", "command"), COMMANDS.items())
def test_each_key_has_its_command(key: str, command: Command) -> None:
    assert command_for(key, Control.INCREMENTAL) is command


@pytest.mark.parametrize("key", ["q", "r", "h"])
def test_caps_lock_takes_no_key_away(key: str) -> None:
    assert command_for(key.upper(), Control.INCREMENTAL) is command_for(key, Control.INCREMENTAL)


@pytest.mark.parametrize("control", Control)
def test_every_other_key_is_no_command(control: Control) -> None:
    others = [chr(code) for code in range(256) if chr(code).lower() not in COMMANDS]
    assert [key for key in [*others, "up", "f1", "focus out"] if command_for(key, control)] == []


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("key", [" ", CTRL_C, CTRL_D, CTRL_Z, "?"])
def test_the_emergency_stop_and_the_way_out_are_the_same_everywhere(key: str, control: Control) -> None:
    assert command_for(key, control) is COMMANDS[key]


def test_while_holding_q_is_a_speed_and_does_not_quit() -> None:
    assert command_for("q", Control.HOLD) is None
    assert "q" in SPEEDS


def test_no_key_for_holding_is_a_command() -> None:
    assert [key for key in (*MOTIONS, *SPEEDS) if command_for(key, Control.HOLD)] == []


def test_who_only_looks_on_releases_nothing() -> None:
    assert command_for("r", Control.VIEW_ONLY) is None


def test_there_are_five_levels() -> None:
    assert [level_of(key) for key in ("0", "1", "5", "6", "w", "11", "")] == [
        None,
        1,
        5,
        None,
        None,
        None,
        None,
    ]


@pytest.mark.parametrize("control", Control)
def test_the_legend_of_each_mode_says_how_to_stop_and_how_to_leave(control: Control) -> None:
    rows = LEGENDS[control]
    assert "SPACE" in {row.keys for row in rows}
    assert [row.keys for row in rows if row.does == "quit"] == ["Ctrl-C" if control is Control.HOLD else "q"]
    assert all(row.keys.isascii() and len(f"{row.keys:<8}{row.does}") < 42 for row in rows)


def test_the_legend_names_no_step_because_the_level_changes_it() -> None:
    assert "m/s" not in str(LEGENDS[Control.INCREMENTAL])
    assert "rad/s" not in str(LEGENDS[Control.INCREMENTAL])


def test_a_key_without_a_character_has_a_name() -> None:
    keys = (" ", CTRL_C, CTRL_BACKSLASH, "w", "up", "\xb4", "\x9b")
    names = ["SPACE", "Ctrl-C", "Ctrl-\\", "w", "up", "acute accent", "u+009b"]
    assert [name_of(key) for key in keys] == names
