"""The ramp, which only limits the increase of speed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.pilot import NEUTRAL, RAMP_PERIOD_S, Ramp, Velocity


def test_its_first_step_is_taken_at_once_and_no_more_at_the_same_instant() -> None:
    ramp = Ramp(1.0, 4.0)
    first = ramp.toward(Velocity(1.0, 2.0), 10.0)
    assert first == pytest.approx((0.02, 0.08))
    assert ramp.toward(Velocity(1.0, 2.0), 10.0) == first


def test_it_grows_by_its_acceleration_and_arrives_exactly() -> None:
    ramp = Ramp(1.0, 4.0)
    goal = Velocity(0.3, -0.6)
    ramp.toward(goal, 0.0)
    assert ramp.toward(goal, 0.1).linear_m_s == pytest.approx(0.12)
    assert ramp.toward(goal, 0.5) == goal


def test_it_is_due_again_while_it_moves_and_never_when_it_has_arrived() -> None:
    ramp = Ramp(1.0, 4.0)
    assert ramp.next_s == math.inf
    ramp.toward(Velocity(1.0), 5.0)
    assert ramp.next_s == pytest.approx(5.0 + RAMP_PERIOD_S)
    ramp.toward(Velocity(1.0), 6.0)
    assert ramp.next_s == math.inf


@pytest.mark.parametrize("wanted", [NEUTRAL, Velocity(0.4), Velocity(0.4, 0.0)])
def test_slower_is_at_once(wanted: Velocity) -> None:
    ramp = Ramp(1.0, 4.0)
    ramp.toward(Velocity(1.0, 2.0), 0.0)
    ramp.toward(Velocity(1.0, 2.0), 9.0)
    assert ramp.toward(wanted, 9.0) == wanted


def test_a_reversal_begins_at_zero() -> None:
    ramp = Ramp(1.0, 4.0)
    ramp.toward(Velocity(1.0), 0.0)
    ramp.toward(Velocity(1.0), 9.0)
    assert ramp.toward(Velocity(-1.0), 9.01).linear_m_s == pytest.approx(-0.01)


def test_a_reset_is_zero_and_the_next_step_begins_there() -> None:
    ramp = Ramp(1.0, 4.0)
    ramp.toward(Velocity(1.0), 0.0)
    ramp.toward(Velocity(1.0), 0.5)
    ramp.reset()
    assert ramp.next_s == math.inf
    assert ramp.toward(NEUTRAL, 0.5) == NEUTRAL
    assert ramp.toward(Velocity(1.0), 0.6).linear_m_s == pytest.approx(RAMP_PERIOD_S)


@pytest.mark.parametrize("gap_s", [0.0, -3.0])
def test_a_clock_that_stands_or_goes_back_moves_nothing(gap_s: float) -> None:
    ramp = Ramp(1.0, 4.0)
    before = ramp.toward(Velocity(1.0), 5.0)
    assert ramp.toward(Velocity(1.0), 5.0 + gap_s) == before


axis = st.one_of(st.just(0.0), st.floats(-2.0, 2.0))


@given(
    st.floats(0.01, 10.0),
    st.lists(st.tuples(st.builds(Velocity, axis, axis), st.floats(0.0, 0.3)), max_size=40),
)
def test_it_never_asks_for_more_than_is_wanted_and_never_grows_faster_than_it_may(
    acceleration: float, steps: list[tuple[Velocity, float]]
) -> None:
    ramp, sent, now_s = Ramp(acceleration, acceleration), NEUTRAL, 0.0
    for wanted, gap_s in steps:
        now_s += gap_s
        before, sent = sent, ramp.toward(wanted, now_s)
        for was, now, goal in zip(before, sent, wanted, strict=True):
            assert abs(now) <= abs(goal)
            assert now * goal >= 0.0
            assert (
                abs(now)
                <= (abs(was) if was * now > 0 else 0.0) + acceleration * max(gap_s, RAMP_PERIOD_S) + 1e-9
            )
        assert (sent == wanted) == (ramp.next_s == math.inf)
