"""The words for a bearing in all directions, and foreign text without control characters."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wire.text import bearing_in_words, printable_lines


@pytest.mark.parametrize(
    ("degrees", "words"),
    [
        (0.0, "ahead"),
        (9.4, "ahead"),
        (-9.4, "ahead"),
        (9.6, "at 10° left"),
        (-9.6, "at 10° right"),
        (45.0, "at 45° left"),
        (90.0, "at 90° left"),
        (135.0, "at 135° left"),
        (170.4, "at 170° left"),
        (170.6, "behind"),
        (180.0, "behind"),
        (-180.0, "behind"),
        (-170.6, "behind"),
        (-170.4, "at 170° right"),
        (-135.0, "at 135° right"),
        (-90.0, "at 90° right"),
        (-45.0, "at 45° right"),
        (360.0, "ahead"),
        (400.0, "at 40° left"),
    ],
)
def test_a_bearing_is_said_with_its_side(degrees: float, words: str) -> None:
    assert bearing_in_words(math.radians(degrees)) == words
    ascii_words = bearing_in_words(math.radians(degrees), degree=" deg")
    assert ascii_words.isascii()
    assert ascii_words == words.replace("°", " deg")


@settings(deadline=None)
@given(st.floats())
def test_any_bearing_has_words_or_none(bearing_rad: float) -> None:
    assert bool(bearing_in_words(bearing_rad)) == math.isfinite(bearing_rad)


def test_a_sentence_keeps_its_lines_and_loses_its_control_characters() -> None:
    assert printable_lines("refused:\n  \x1b]0;title\x07 \x9b31m") == "refused:\n  ?]0;title? ?31m"
