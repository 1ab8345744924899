"""Control by steps, and the setpoint that they change."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.keyboard import Incremental, Setpoint
from teleop.pilots.pilot import LEVELS, NEUTRAL, KeyEvent, KeyKind, Pilot, Ramp, Velocity


def pilot() -> Incremental:
    return Incremental(Setpoint(), Ramp(1.0, 4.0))


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
    small = Incremental(Setpoint(Velocity(0.025, 0.2), level=3), Ramp(1.0, 4.0))
    assert small.note == "each press: 0.015 m/s or 0.12 rad/s"


# --- the setpoint


UP, DOWN, LEFT, RIGHT = (1, 0), (-1, 0), (0, 1), (0, -1)
Move = tuple[int, int]


def after(moves: list[Move], start: Setpoint | None = None) -> Setpoint:
    setpoint = start or Setpoint()
    for linear, angular in moves:
        setpoint = setpoint.moved(linear=linear, angular=angular)
    return setpoint


@pytest.mark.parametrize(
    ("move", "velocity"), [(UP, (0.1, 0.0)), (DOWN, (-0.1, 0.0)), (LEFT, (0.0, 0.2)), (RIGHT, (0.0, -0.2))]
)
def test_one_press_is_one_step(move: Move, velocity: tuple[float, float]) -> None:
    assert after([move]).velocity == Velocity(*velocity)


@pytest.mark.parametrize(("there", "back"), [(UP, DOWN), (DOWN, UP), (LEFT, RIGHT), (RIGHT, LEFT)])
def test_ten_steps_there_and_ten_back_are_exactly_zero(there: Move, back: Move) -> None:
    setpoint = after([there] * 10 + [back] * 10)
    assert setpoint.is_neutral
    assert str(setpoint.velocity) == str(Velocity())


def test_three_tenths_are_three_tenths() -> None:
    assert after([UP] * 3).linear_m_s == 0.3


@pytest.mark.parametrize("presses", [10, 11, 1000])
def test_it_ends_at_the_limits(presses: int) -> None:
    assert after([UP, LEFT] * presses).velocity == Velocity(1.0, 2.0)


def test_presses_beyond_the_limit_need_not_be_counted_back() -> None:
    assert after([UP] * 50 + [DOWN]).linear_m_s == 0.9


def test_a_step_that_does_not_divide_the_limit_still_reaches_it_and_comes_back_to_zero() -> None:
    start = Setpoint(Velocity(0.3, 0.2), Velocity(1.0, 2.0))
    assert [after([UP] * presses, start).linear_m_s for presses in range(6)] == [0.0, 0.3, 0.6, 0.9, 1.0, 1.0]
    assert after([UP] * 9 + [DOWN] * 4, start).is_neutral


def test_a_step_greater_than_the_limit_is_cut_to_it() -> None:
    assert after([DOWN], Setpoint(Velocity(0.5, 0.2), Velocity(0.2, 2.0))).linear_m_s == -0.2


def test_neutral_keeps_the_level() -> None:
    setpoint = after([UP, LEFT, LEFT]).at_level(2).neutral()
    assert (setpoint.is_neutral, setpoint.level) == (True, 2)


def test_turning_on_the_spot_is_not_neutral() -> None:
    assert not after([LEFT]).is_neutral


@pytest.mark.parametrize(("level", "step", "top"), [(1, 0.02, 0.2), (3, 0.06, 0.6), (5, 0.1, 1.0)])
def test_a_level_is_its_fifths_of_step_and_limit(level: int, step: float, top: float) -> None:
    start = Setpoint().at_level(level)
    assert after([UP], start).linear_m_s == step
    assert after([UP] * 20, start).linear_m_s == top


def test_a_lower_level_cuts_what_is_asked_for_and_a_higher_one_leaves_it() -> None:
    fast = after([UP] * 10 + [RIGHT] * 10)
    assert fast.at_level(2).velocity == Velocity(0.4, -0.8)
    assert fast.at_level(2).at_level(5).velocity == Velocity(0.4, -0.8)


def test_after_a_change_of_level_the_way_back_still_leads_through_zero() -> None:
    assert after([DOWN], after([UP], Setpoint().at_level(1)).at_level(5)).is_neutral


sizes = st.floats(0.001, 10.0)
moves = st.tuples(st.integers(-1, 1), st.integers(-1, 1))


@given(
    st.builds(Velocity, sizes, sizes),
    st.builds(Velocity, sizes, sizes),
    st.lists(st.one_of(moves, st.integers(1, LEVELS)), max_size=60),
)
def test_it_is_within_the_limits_of_its_level_and_never_leaps_across_zero(
    step: Velocity, most: Velocity, actions: list[Move | int]
) -> None:
    setpoint = Setpoint(step, most)
    for action in actions:
        before = setpoint
        setpoint = setpoint.at_level(action) if isinstance(action, int) else after([action], setpoint)
        share = setpoint.level / LEVELS
        assert abs(setpoint.linear_m_s) <= share * most.linear_m_s + 1e-9
        assert abs(setpoint.angular_rad_s) <= share * most.angular_rad_s + 1e-9
        assert all(was * now >= 0.0 for was, now in zip(before.velocity, setpoint.velocity, strict=True))
