"""A held key, detected by its repeats alone."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.repeats import MIN_WINDOW_S, PROOF_S, WINDOW_INTERVALS, Repeats

from .repeat_streams import DETECTORS, KEYBOARDS, Keyboard, observe, table

DECISION = Path(__file__).parents[3] / "docs/decisions/0014-hold-to-run.md"


def pressed(*times: float, key: str = "i") -> Repeats:
    repeats = Repeats()
    for at_s in times:
        repeats.press(key, at_s)
    return repeats


def test_one_press_is_not_held() -> None:
    assert pressed(0.0).held(0.0) is None


def test_two_presses_are_held_if_no_finger_is_that_fast() -> None:
    assert pressed(0.0, PROOF_S).held(PROOF_S) == "i"
    assert pressed(0.0, math.nextafter(PROOF_S, 1.0)).held(0.12) is None


def test_two_keys_in_turn_are_not_held() -> None:
    repeats = pressed(0.0)
    repeats.press("l", 0.03)
    repeats.press("i", 0.06)
    assert repeats.held(0.06) is None


def test_another_key_ends_it_at_once() -> None:
    repeats = pressed(0.0, 0.03)
    repeats.press("l", 0.04)
    assert repeats.held(0.04) is None
    repeats.press("l", 0.07)
    assert repeats.held(0.07) == "l"


def test_it_ends_when_the_window_does() -> None:
    repeats = pressed(0.0, 0.03)
    assert repeats.until_s == pytest.approx(0.03 + MIN_WINDOW_S)
    assert repeats.held(math.nextafter(repeats.until_s, 0.0)) == "i"
    assert repeats.held(repeats.until_s) is None


def test_the_window_follows_the_longest_interval_of_late() -> None:
    repeats = pressed(0.0, 0.03, 0.11, 0.14)
    assert repeats.window_s == pytest.approx(WINDOW_INTERVALS * 0.08)
    for n in range(20):
        repeats.press("i", 0.17 + 0.03 * n)
    assert repeats.window_s == MIN_WINDOW_S


def test_a_repeat_that_is_late_but_within_the_window_proves_nothing_and_ends_nothing() -> None:
    repeats = pressed(0.0, 0.1)
    until_s = repeats.until_s
    repeats.press("i", 0.1 + PROOF_S + 0.01)
    assert repeats.until_s == until_s


def test_forgotten_it_is_proven_anew_by_what_was_learned() -> None:
    repeats = pressed(0.0, 0.08)
    window_s = repeats.window_s
    repeats.forget()
    assert (repeats.held(0.08), repeats.window_s) == (None, window_s)
    repeats.press("i", 0.1)
    assert repeats.held(0.1) is None


@pytest.mark.parametrize("keyboard", KEYBOARDS, ids=lambda keyboard: keyboard.name)
def test_on_every_usual_keyboard_it_neither_stutters_nor_runs_on_and_a_tap_moves_nothing(
    keyboard: Keyboard,
) -> None:
    outcome = observe(DETECTORS[-1][1], keyboard)
    assert outcome.stutter_s == 0.0
    assert outcome.runs_on_s <= MIN_WINDOW_S + 0.005
    assert outcome.tap_s == 0.0
    assert outcome.start_s == pytest.approx(keyboard.delay_s + keyboard.interval_s, abs=0.006)


def test_the_decision_shows_what_is_measured() -> None:
    text = DECISION.read_text()
    assert [row for row in table() if row not in text] == []


@given(st.lists(st.tuples(st.sampled_from("il"), st.floats(0.0, 0.5)), max_size=60))
def test_nothing_is_held_for_longer_than_a_window_after_its_last_repeat(
    presses: list[tuple[str, float]],
) -> None:
    repeats, now_s = Repeats(), 0.0
    for key, gap_s in presses:
        now_s += gap_s
        repeats.press(key, now_s)
        assert MIN_WINDOW_S <= repeats.window_s <= WINDOW_INTERVALS * PROOF_S
        assert repeats.held(now_s) in (None, key)
        assert repeats.held(now_s + repeats.window_s) is None
    assert all(later >= earlier for earlier, later in pairwise([0.0, now_s]))


def test_the_repeats_of_a_key_that_was_held_at_a_stop_are_void_until_a_pause() -> None:
    repeats = Repeats()
    for number in range(4):
        repeats.press("i", number * 0.03)
    assert repeats.held(0.1) == "i"
    repeats.forget()
    for number in range(4, 40):
        repeats.press("i", number * 0.03)
        assert repeats.held(number * 0.03) is None
    for later_s in (2.0, 2.03):
        repeats.press("i", later_s)
    assert repeats.held(2.04) == "i"


def test_another_key_counts_at_once_after_a_stop() -> None:
    repeats = Repeats()
    for number in range(4):
        repeats.press("i", number * 0.03)
    repeats.forget()
    for later_s in (0.12, 0.15):
        repeats.press("j", later_s)
    assert repeats.held(0.16) == "j"


def test_a_key_that_was_pressed_once_before_a_stop_counts_when_it_repeats_afterwards() -> None:
    repeats = Repeats()
    repeats.press("i", 0.0)
    repeats.forget()
    for later_s in (0.03, 0.06):
        repeats.press("i", later_s)
    assert repeats.held(0.07) == "i"
