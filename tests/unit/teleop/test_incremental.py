"""Control by steps."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.keyboard import DEFAULT_MOST, DEFAULT_STEP, STEPS, Incremental
from teleop.pilots.keys import LEVEL_KEYS, NO_MOTION, NOT_TYPED, PRESENCE_KEY, STOP_KEY
from teleop.pilots.pilot import LEVELS, NEUTRAL, KeyEvent, KeyKind, Pilot, Ramp, Velocity


def pilot(step: Velocity = DEFAULT_STEP, most: Velocity = DEFAULT_MOST, level: int = LEVELS) -> Incremental:
    return Incremental(Ramp(1.0, 4.0), step, most, level)


def press(subject: Pilot, keys: str) -> None:
    for key in keys:
        subject.on_key(KeyEvent(key), 0.0)


@pytest.mark.parametrize(
    ("keys", "velocity"),
    [
        ("w", (0.1, 0)),
        ("x", (-0.1, 0)),
        ("a", (0, 0.2)),
        ("d", (0, -0.2)),
        ("WwA", (0.2, 0.2)),
        ("wxx", (-0.1, 0)),
    ],
)
def test_each_press_is_a_step(keys: str, velocity: tuple[float, float]) -> None:
    subject = pilot()
    press(subject, keys)
    assert subject.wanted() == Velocity(*velocity)


def test_s_is_zero_at_once_in_the_middle_of_a_ramp() -> None:
    subject = pilot()
    press(subject, "wwwww")
    assert not subject.velocity(0.2).is_neutral
    press(subject, "s")
    assert (subject.velocity(0.2), subject.wanted(), subject.next_s) == (NEUTRAL, NEUTRAL, math.inf)


def test_a_repeat_is_a_press_and_a_release_is_none() -> None:
    subject = pilot()
    for kind in KeyKind:
        subject.on_key(KeyEvent("w", kind), 0.0)
    assert subject.wanted() == Velocity(0.2)


def test_a_level_is_chosen_by_its_key() -> None:
    subject = pilot()
    assert subject.level == 5
    press(subject, "2w")
    assert (subject.level, subject.wanted()) == (2, Velocity(0.04))


def test_other_keys_and_the_arrows_ask_for_nothing() -> None:
    subject = pilot()
    for key in ("up", "left", "f1", "i", "6", " ", "r", "q", "focus out"):
        subject.on_key(KeyEvent(key), 0.0)
    assert subject.wanted() == NEUTRAL


@given(st.sampled_from(["up", "f1", "6", "^", "~", "\xb4", *NOT_TYPED]) | st.text(max_size=3))
def test_a_key_without_a_function_stops_at_once(key: str) -> None:
    subject = pilot()
    press(subject, "www")
    assert not subject.velocity(0.2).is_neutral
    is_known = key.lower() in {*STEPS, *LEVEL_KEYS, *NO_MOTION, STOP_KEY}
    assert subject.on_key(KeyEvent(key), 0.2) is is_known
    assert is_known or (subject.velocity(0.2), subject.wanted()) == (NEUTRAL, NEUTRAL)


@pytest.mark.parametrize("key", [*sorted(NO_MOTION), PRESENCE_KEY, "R", "Q", "3"])
def test_a_key_of_the_program_and_a_level_do_not_stop(key: str) -> None:
    subject = pilot()
    press(subject, "w")
    assert subject.on_key(KeyEvent(key), 0.0)
    assert subject.wanted() == Velocity(0.1)


def test_the_ramp_is_due_while_it_moves() -> None:
    subject = pilot()
    press(subject, "w")
    subject.velocity(1.0)
    assert 1.0 < subject.next_s < 1.05


def test_the_note_names_the_step_at_the_level_and_small_steps_keep_their_digits() -> None:
    subject = pilot()
    press(subject, "3")
    assert subject.note == "each press: 0.06 m/s or 0.12 rad/s"
    assert subject.limit == Velocity(0.6 * 1.0, 0.6 * 2.0)
    small = pilot(Velocity(0.025, 0.2), level=3)
    assert small.note == "each press: 0.015 m/s or 0.12 rad/s"


# --- a terminal that answers no status requests


def silent() -> tuple[Incremental, list[str]]:
    """A pilot on a terminal that has not answered, and what it says."""
    subject, said = Incremental(Ramp(1.0, 4.0), unanswered_m_s=0.071), list[str]()
    subject.say = said.append
    return subject, said


@given(keys=st.text(alphabet="wxads12345", max_size=30))
def test_on_a_silent_terminal_no_keys_request_more_than_its_limit_and_turns_are_not_limited(
    keys: str,
) -> None:
    subject, _ = silent()
    press(subject, keys)
    assert abs(subject.wanted().linear_m_s) <= 0.071
    assert subject.wanted().angular_rad_s == after(keys).angular_rad_s


def test_the_screen_names_the_limit_of_a_silent_terminal_and_says_the_reason_once() -> None:
    subject, said = silent()
    assert subject.limit == Velocity(0.071, 2.0)
    assert subject.note == "no answer from terminal: 0.071 m/s"
    press(subject, "a")
    assert said == []
    press(subject, "wwsxx")
    assert said == ["the terminal answers no status requests: at most 0.071 m/s"]


def test_the_first_answer_of_the_terminal_permits_all_speeds_but_does_not_change_the_request() -> None:
    subject, _ = silent()
    press(subject, "w")
    subject.rely_on_answers()
    assert subject.wanted() == Velocity(0.071)
    press(subject, "w")
    assert (subject.wanted(), subject.limit) == (Velocity(0.171), Velocity(1.0, 2.0))


def test_a_level_below_the_limit_of_a_silent_terminal_is_the_lower_one() -> None:
    subject = Incremental(Ramp(1.0, 4.0), most=Velocity(0.2, 2.0), unanswered_m_s=0.071)
    press(subject, "1www")
    assert (subject.limit.linear_m_s, subject.wanted().linear_m_s) == pytest.approx((0.04, 0.04))
    assert subject.note.startswith("each press")


# --- sums of steps


def after(keys: str, step: Velocity = DEFAULT_STEP, most: Velocity = DEFAULT_MOST) -> Velocity:
    """Return the requested velocity after some key presses."""
    subject = pilot(step, most)
    press(subject, keys)
    return subject.wanted()


@pytest.mark.parametrize(("there", "back"), ["wx", "xw", "ad", "da"])
def test_ten_steps_and_ten_steps_back_give_exactly_zero(there: str, back: str) -> None:
    velocity = after(there * 10 + back * 10)
    assert velocity.is_neutral
    assert str(velocity) == str(Velocity())


def test_three_tenths_are_three_tenths() -> None:
    assert after("www").linear_m_s == 0.3


@pytest.mark.parametrize("presses", [10, 11, 1000])
def test_it_ends_at_the_limits(presses: int) -> None:
    assert after("wa" * presses) == Velocity(1.0, 2.0)


def test_presses_beyond_the_limit_need_not_be_counted_back() -> None:
    assert after("w" * 50 + "x").linear_m_s == 0.9


def test_a_step_that_does_not_divide_the_limit_still_reaches_it_and_comes_back_to_zero() -> None:
    step = Velocity(0.3, 0.2)
    assert [after("w" * n, step=step).linear_m_s for n in range(6)] == [0.0, 0.3, 0.6, 0.9, 1.0, 1.0]
    assert after("w" * 9 + "x" * 4, step=step).is_neutral


def test_a_step_greater_than_the_limit_is_cut_to_it() -> None:
    assert after("x", step=Velocity(0.5, 0.2), most=Velocity(0.2, 2.0)).linear_m_s == -0.2


def test_neutral_keeps_the_level() -> None:
    subject = pilot()
    press(subject, "waa2s")
    assert (subject.wanted().is_neutral, subject.level) == (True, 2)


def test_turning_on_the_spot_is_not_neutral() -> None:
    assert not after("a").is_neutral


@pytest.mark.parametrize(("level", "step", "top"), [(1, 0.02, 0.2), (3, 0.06, 0.6), (5, 0.1, 1.0)])
def test_a_level_is_its_fifths_of_step_and_limit(level: int, step: float, top: float) -> None:
    assert after(f"{level}w").linear_m_s == step
    assert after(f"{level}{'w' * 20}").linear_m_s == top


def test_a_lower_level_cuts_what_is_asked_for_and_a_higher_one_leaves_it() -> None:
    fast = "w" * 10 + "d" * 10
    assert after(f"{fast}2") == Velocity(0.4, -0.8)
    assert after(f"{fast}25") == Velocity(0.4, -0.8)


def test_after_a_change_of_level_the_way_back_still_leads_through_zero() -> None:
    assert after("1w5x").is_neutral


sizes = st.floats(0.001, 10.0)


@given(
    st.builds(Velocity, sizes, sizes), st.builds(Velocity, sizes, sizes), st.text("wxad12345", max_size=60)
)
def test_it_is_within_the_limits_of_its_level_and_never_leaps_across_zero(
    step: Velocity, most: Velocity, keys: str
) -> None:
    subject = pilot(step=step, most=most)
    for key in keys:
        before = subject.wanted()
        press(subject, key)
        share, wanted = subject.level / LEVELS, subject.wanted()
        assert abs(wanted.linear_m_s) <= share * most.linear_m_s + 1e-9
        assert abs(wanted.angular_rad_s) <= share * most.angular_rad_s + 1e-9
        assert all(was * now >= 0.0 for was, now in zip(before, wanted, strict=True))
