"""The terminal's bytes -> keys."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.keymap import CTRL_C
from teleop.keys import KeyDecoder

pieces = st.lists(
    st.one_of(
        st.binary(max_size=6),
        st.sampled_from(
            [b"\x1b", b"\x1b[", b"\x1b[A", b"\x1b[1;5D", b"\x1bOP", b"\x1bO", b" ", b"\x03", b"w"]
        ),
    ),
    max_size=12,
)


@pytest.mark.parametrize(
    "sequence",
    [
        b"\x1b[A",
        b"\x1b[D",
        b"\x1b[1;5D",
        b"\x1b[3~",
        b"\x1bOA",
        b"\x1bOS",
        b"\x1b[200~",
        b"\x1b[@",
        b"\x1b[97;5u",
    ],
)
def test_a_cursor_or_function_key_is_no_letter(sequence: bytes) -> None:
    assert KeyDecoder().feed(b"w" + sequence + b"x") == ["w", "x"]


def test_a_sequence_that_arrives_in_pieces_is_no_letter_either() -> None:
    decoder = KeyDecoder()
    assert [decoder.feed(piece) for piece in (b"\x1b", b"[", b"D", b"d")] == [[], [], [], ["d"]]


def test_a_key_with_alt_is_that_key() -> None:
    assert KeyDecoder().feed(b"\x1bs") == ["s"]


def test_a_lone_escape_does_not_swallow_the_emergency_stop() -> None:
    assert KeyDecoder().feed(b"\x1b [ ") == [" ", "[", " "]


@pytest.mark.parametrize("opening", [b"\x1b", b"\x1b[", b"\x1b[1;", b"\x1bO"])
@pytest.mark.parametrize("key", [" ", CTRL_C])
def test_the_keys_that_must_come_through_do_so_inside_an_unfinished_sequence(
    opening: bytes, key: str
) -> None:
    assert KeyDecoder().feed(opening + key.encode()) == [key]


@given(pieces)
def test_every_space_and_ctrl_c_is_a_key_whatever_surrounds_it(stream: list[bytes]) -> None:
    keys = KeyDecoder().feed(b"".join(stream))
    data = b"".join(stream)
    assert [keys.count(" "), keys.count(CTRL_C)] == [data.count(b" "), data.count(b"\x03")]


@given(pieces)
def test_how_the_bytes_are_cut_makes_no_difference(stream: list[bytes]) -> None:
    decoder = KeyDecoder()
    in_pieces = [key for piece in stream for key in decoder.feed(piece)]
    assert in_pieces == KeyDecoder().feed(b"".join(stream))


def test_bytes_beyond_ascii_do_not_raise() -> None:
    assert "w" in KeyDecoder().feed(b"\xff\xc3\xa4w")
