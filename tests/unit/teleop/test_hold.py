"""Control by holding, and a held key detected by its repeats alone."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.keyboard import (
    LEAST,
    MIN_WINDOW_S,
    MOTIONS,
    PROOF_S,
    SPEEDS,
    TAP_S,
    UNPROVEN_S,
    WINDOW_INTERVALS,
    Hold,
    Repeats,
)
from teleop.pilots.pilot import NEUTRAL, KeyEvent, KeyKind, Ramp, Velocity

from .repeat_streams import DETECTORS, KEYBOARDS, Keyboard, observe, table

PRESS, REPEAT, RELEASE = KeyKind.PRESS, KeyKind.REPEAT, KeyKind.RELEASE


def pilot(*, releases: bool = True, ramp: Ramp | None = None) -> Hold:
    subject = Hold(Velocity(0.5, 1.0), Velocity(1.0, 2.0), ramp or Ramp(1e6, 1e6))
    subject.rely_on_releases(reported=releases)
    return subject


def happen(subject: Hold, *events: tuple[str, KeyKind], at_s: float = 1.0) -> Velocity:
    for key, kind in events:
        subject.on_key(KeyEvent(key, kind), at_s)
    return subject.velocity(at_s)


@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        ("u", (0.5, 1.0)),
        ("i", (0.5, 0.0)),
        ("o", (0.5, -1.0)),
        ("j", (0.0, 1.0)),
        ("l", (0.0, -1.0)),
        ("m", (-0.5, -1.0)),
        (",", (-0.5, 0.0)),
        (".", (-0.5, 1.0)),
        ("up", (0.5, 0.0)),
        ("down", (-0.5, 0.0)),
        ("left", (0.0, 1.0)),
        ("right", (0.0, -1.0)),
        ("I", (0.5, 0.0)),
    ],
)
def test_a_key_moves_from_its_press_to_its_release(key: str, velocity: tuple[float, float]) -> None:
    subject = pilot()
    assert happen(subject, (key, PRESS)) == Velocity(*velocity)
    assert subject.wanted() == Velocity(*velocity)
    happen(subject, ("f1", RELEASE))
    assert happen(subject, (key, REPEAT), at_s=60.0) == Velocity(*velocity)
    assert str(happen(subject, (key, RELEASE), at_s=60.0)) == str(NEUTRAL)


def test_releasing_one_of_two_held_keys_keeps_the_motion_of_the_other() -> None:
    subject = pilot()
    assert happen(subject, ("i", PRESS), ("l", PRESS)) == Velocity(0.5, -1.0)
    assert happen(subject, ("i", RELEASE)) == Velocity(0.0, -1.0)
    assert happen(subject, ("l", RELEASE)) == NEUTRAL


def test_a_held_forward_key_still_moves_after_a_turn_key_is_tapped() -> None:
    assert happen(pilot(), ("up", PRESS), ("left", PRESS), ("left", RELEASE)) == Velocity(0.5, 0.0)


def test_opposite_keys_cancel_and_equal_ones_do_not_add_up() -> None:
    assert happen(pilot(), ("i", PRESS), (",", PRESS)) == NEUTRAL
    assert happen(pilot(), ("i", PRESS), ("u", PRESS), ("up", PRESS)) == Velocity(0.5, 1.0)


@pytest.mark.parametrize("key", ["k", "s", "5x", "f1", "escape", "focus out", "\xff", "h", "r"])
def test_any_other_key_stops_and_a_key_that_is_still_held_must_be_pressed_again(key: str) -> None:
    subject = pilot()
    assert happen(subject, ("i", PRESS), (key, PRESS)) == NEUTRAL
    assert happen(subject, ("i", REPEAT)) == NEUTRAL
    assert happen(subject, ("i", RELEASE), ("i", PRESS), at_s=1.1) == Velocity(0.5)


def test_letting_go_bypasses_the_ramp() -> None:
    subject = pilot(ramp=Ramp(1.0, 4.0))
    happen(subject, ("i", PRESS))
    assert 0.0 < subject.velocity(1.1).linear_m_s < 0.5
    subject.let_go()
    assert (subject.velocity(1.1), subject.wanted(), subject.next_s) == (NEUTRAL, NEUTRAL, math.inf)


def test_a_key_release_bypasses_the_ramp() -> None:
    subject = pilot(ramp=Ramp(1.0, 4.0))
    happen(subject, ("i", PRESS))
    subject.velocity(1.4)
    assert happen(subject, ("i", RELEASE), at_s=1.4) == NEUTRAL


@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        ("q", (0.55, 1.1)),
        ("z", (0.45, 0.9)),
        ("w", (0.55, 1.0)),
        ("x", (0.45, 1.0)),
        ("e", (0.5, 1.1)),
        ("c", (0.5, 0.9)),
    ],
)
def test_a_speed_key_changes_the_speed_by_ten_per_cent_during_motion(
    key: str, velocity: tuple[float, float]
) -> None:
    subject = pilot()
    assert happen(subject, ("u", PRESS), (key, PRESS)) == pytest.approx(velocity)


def test_the_speed_stays_between_its_minimum_and_its_maximum() -> None:
    subject = pilot()
    assert happen(subject, *[("q", PRESS)] * 50, ("u", PRESS)) == Velocity(1.0, 2.0)
    assert happen(subject, *[("z", PRESS)] * 90) == Velocity(LEAST * 1.0, LEAST * 2.0)


def test_a_speed_level_limits_the_speed_immediately() -> None:
    subject = pilot()
    assert happen(subject, ("u", PRESS), ("1", PRESS)) == pytest.approx((0.2, 0.4))
    assert subject.level == 1
    assert happen(subject, ("5", PRESS), at_s=1.1) == Velocity(0.5, 1.0)


def test_the_note_names_the_key_detection_and_the_speeds() -> None:
    assert pilot().note == "releases reported: 0.50 m/s, 1.00 rad/s"
    assert pilot(releases=False).note == "by key repeat: 0.50 m/s, 1.00 rad/s"
    assert pilot().explanation.startswith("the terminal reports")
    assert pilot(releases=False).explanation.startswith("no key releases")


def test_all_keys_are_released_when_the_terminal_stops_reporting_releases() -> None:
    subject = pilot()
    happen(subject, ("i", PRESS))
    subject.rely_on_releases(reported=True)
    assert subject.velocity(1.0) == Velocity(0.5)
    subject.rely_on_releases(reported=False)
    assert subject.velocity(1.0) == NEUTRAL


def test_without_releases_a_key_moves_once_it_repeats_and_stops_soon_after() -> None:
    subject = pilot(releases=False)
    assert happen(subject, ("i", PRESS), at_s=0.0) == NEUTRAL
    assert subject.next_s == math.inf
    assert happen(subject, ("i", PRESS), at_s=0.5) == NEUTRAL
    assert happen(subject, ("i", PRESS), at_s=0.53) == Velocity(0.5)
    assert subject.next_s == pytest.approx(0.63)
    assert subject.velocity(subject.next_s) == NEUTRAL
    assert subject.next_s == math.inf


def test_without_releases_another_key_stops_until_it_repeats() -> None:
    subject = pilot(releases=False)
    happen(subject, ("i", PRESS), at_s=0.0)
    assert happen(subject, ("i", PRESS), at_s=0.03) == Velocity(0.5)
    assert happen(subject, ("l", PRESS), at_s=0.05) == NEUTRAL
    assert happen(subject, ("l", PRESS), at_s=0.08) == Velocity(0.0, -1.0)
    assert happen(subject, ("k", PRESS), at_s=0.09) == NEUTRAL


events = st.tuples(
    st.sampled_from([*MOTIONS, *SPEEDS, "k", "1", "3", "focus out", " "]),
    st.sampled_from(KeyKind),
    st.floats(0.0, 0.3),
)


@given(st.lists(events, max_size=60), st.floats(0.1, 10.0))
def test_with_releases_the_robot_moves_only_while_a_motion_key_is_down(
    stream: list[tuple[str, KeyKind, float]], acceleration: float
) -> None:
    subject, down, now_s = pilot(ramp=Ramp(acceleration, acceleration)), set[str](), 0.0
    for key, kind, gap_s in stream:
        now_s += gap_s
        velocity = happen(subject, (key, kind), at_s=now_s)
        if kind is RELEASE:
            down.discard(key)
        elif kind is PRESS:
            down.add(key)
        assert velocity.is_neutral or down & MOTIONS.keys()
        assert abs(velocity.linear_m_s) <= 0.2 * subject.level + 1e-9
        assert abs(velocity.angular_rad_s) <= 0.4 * subject.level + 1e-9
        assert subject.next_s > now_s


@given(st.lists(st.tuples(st.sampled_from([*MOTIONS, "k", "q"]), st.floats(0.0, 0.3)), max_size=60))
def test_without_releases_the_robot_stops_when_no_key_has_repeated_recently(
    stream: list[tuple[str, float]],
) -> None:
    subject, now_s, longest_s = pilot(releases=False), 0.0, 0.275
    for key, gap_s in stream:
        later_s = now_s + gap_s
        if gap_s > longest_s:
            assert subject.velocity(later_s) == NEUTRAL
        now_s = later_s
        happen(subject, (key, PRESS), at_s=now_s)
    assert subject.velocity(now_s + longest_s) == NEUTRAL


def test_before_the_first_release_a_key_counts_for_a_second_after_its_newest_repeat() -> None:
    subject, said = pilot(), list[str]()
    subject.say = said.append
    assert happen(subject, ("i", PRESS), at_s=1.0) == Velocity(0.5)
    assert subject.next_s == 1.0 + UNPROVEN_S
    assert happen(subject, ("i", REPEAT), at_s=1.5) == Velocity(0.5)
    assert happen(subject, ("l", PRESS), at_s=1.6) == Velocity(0.5, -1.0)
    assert subject.velocity(math.nextafter(1.5 + UNPROVEN_S, 0.0)) == Velocity(0.5, -1.0)
    assert said == []
    assert subject.velocity(1.5 + UNPROVEN_S) == Velocity(0.0, -1.0)
    assert said == ["no key release from this terminal yet: a key counts for 1 s"]
    assert happen(subject, ("i", REPEAT), at_s=2.55) == Velocity(0.0, -1.0)
    assert happen(subject, ("f1", RELEASE), at_s=2.59) == Velocity(0.0, -1.0)
    assert (subject.velocity(60.0), subject.next_s) == (Velocity(0.0, -1.0), math.inf)
    for reported in (False, True):
        subject.rely_on_releases(reported=reported)
    assert happen(subject, ("i", PRESS), at_s=61.0) == Velocity(0.5)
    assert subject.velocity(61.0 + UNPROVEN_S) == NEUTRAL, "another terminal must prove it again"


VOID = "a key that was held at a stop moves nothing: let go of it, and press it again"


def test_the_repeats_of_a_key_that_was_held_at_a_stop_are_shown_to_be_void_once() -> None:
    subject, said = pilot(), list[str]()
    subject.say = said.append
    happen(subject, ("i", PRESS), ("i", REPEAT), ("k", PRESS))
    assert said == []
    for _ in range(3):
        assert happen(subject, ("i", REPEAT)) == NEUTRAL
        assert happen(subject, ("k", PRESS)) == NEUTRAL
    assert said == [VOID]
    happen(subject, ("i", RELEASE), ("i", PRESS), ("k", PRESS), ("i", REPEAT))
    assert said == [VOID] * 2


def test_without_releases_the_void_repeats_are_shown_once_too() -> None:
    subject, said = pilot(releases=False), list[str]()
    subject.say = said.append
    for number in range(4):
        happen(subject, ("i", PRESS), at_s=number * 0.03)
    subject.let_go()
    for number in range(4, 20):
        assert happen(subject, ("i", PRESS), at_s=number * 0.03) == NEUTRAL
    assert said == [VOID]


def test_a_key_that_was_held_when_the_terminal_stopped_reporting_releases_is_not_held_by_its_repeats() -> (
    None
):
    subject = pilot()
    happen(subject, ("i", PRESS), at_s=0.0)
    subject.rely_on_releases(reported=False)
    for number in range(40):
        assert happen(subject, ("i", REPEAT), at_s=0.5 + number * 0.03) == NEUTRAL
    for later_s in (3.0, 3.03):
        happen(subject, ("i", PRESS), at_s=later_s)
    assert subject.velocity(3.04) == Velocity(0.5)


# --- repeats


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


@pytest.mark.parametrize("keyboard", KEYBOARDS, ids=lambda keyboard: keyboard.name)
def test_without_releases_a_tap_says_once_that_it_was_too_short_and_a_held_key_never(
    keyboard: Keyboard,
) -> None:
    subject, said = pilot(releases=False), list[str]()
    subject.say = said.append
    for at_s in (1.0, *(1.0 + keyboard.delay_s + n * keyboard.interval_s for n in range(9))):
        happen(subject, ("i", PRESS), at_s=at_s)
        subject.velocity(math.nextafter(at_s + keyboard.interval_s, 0.0))
    subject.velocity(9.0)
    assert said == []
    happen(subject, ("i", PRESS), at_s=10.0)
    subject.velocity(math.nextafter(10.0 + TAP_S, 0.0))
    assert said == []
    for at_s in (math.nextafter(10.0 + TAP_S, 11.0), 12.0):
        assert subject.velocity(at_s) == NEUTRAL
    assert said == ["a tap is too short to move the robot: hold the key until it repeats"]


def test_a_key_that_was_let_go_of_by_a_stop_is_no_tap() -> None:
    subject, said = pilot(releases=False), list[str]()
    subject.say = said.append
    happen(subject, ("i", PRESS), ("k", PRESS))
    subject.velocity(9.0)
    assert said == []


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


def test_the_time_for_which_keys_were_not_taken_after_a_stop_is_no_pause() -> None:
    repeats = Repeats()
    for number in range(4):
        repeats.press("i", number * 0.03)
    repeats.forget()
    for start_s in (1.0, 3.0):
        for number in range(40):
            repeats.press("i", start_s + number * 0.03)
            assert repeats.held(start_s + number * 0.03) is None
        repeats.forget()


def test_a_key_that_is_pressed_anew_after_a_stop_counts_once_it_repeats() -> None:
    subject, said = pilot(releases=False), list[str]()
    subject.say = said.append
    for at_s in (0.0, 0.5, 0.53):
        happen(subject, ("i", PRESS), at_s=at_s)
    subject.let_go()
    for at_s in (2.0, 2.25):
        assert happen(subject, ("i", PRESS), at_s=at_s) == NEUTRAL
    assert happen(subject, ("i", PRESS), at_s=2.28) == Velocity(0.5)
    assert said == []


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
