"""A fixed rate that neither drifts nor catches up."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.rate import TOLERANCE_S, Rate


def test_the_first_tick_is_due_at_once_and_only_once() -> None:
    rate = Rate(0.05, 100.0)
    assert [rate.tick(100.0), rate.tick(100.0)] == [True, False]


def test_it_ticks_at_its_time_and_not_before() -> None:
    rate = Rate(0.05, 0.0)
    rate.tick(0.0)
    assert [rate.tick(0.05 - 2 * TOLERANCE_S), rate.tick(0.05)] == [False, True]


def test_a_timer_that_fires_a_hair_too_early_is_the_tick_and_does_not_bring_another() -> None:
    rate = Rate(0.05, 0.0)
    rate.tick(0.0)
    assert [rate.tick(0.05 - TOLERANCE_S / 2), rate.tick(0.05), rate.tick(0.1)] == [True, False, True]


def test_a_late_tick_does_not_move_the_next_one() -> None:
    rate = Rate(0.05, 0.0)
    rate.tick(0.0)
    rate.tick(0.08)
    assert rate.next_s == pytest.approx(0.10)


def test_missed_ticks_are_gone() -> None:
    rate = Rate(0.05, 0.0)
    rate.tick(0.0)
    assert [rate.tick(3.02), rate.tick(3.02)] == [True, False]
    assert rate.next_s == pytest.approx(3.05)


def test_lateness_is_counted_from_the_tick_that_is_due() -> None:
    rate = Rate(0.05, 0.0)
    rate.tick(0.0)
    assert rate.lateness_s(0.25) == pytest.approx(0.20)


@given(st.floats(0.001, 1.0), st.floats(0.0, 1e6), st.lists(st.floats(0.0, 2.0), max_size=30))
def test_after_a_tick_the_next_one_lies_ahead_within_a_period(
    period: float, start: float, gaps: list[float]
) -> None:
    rate, now = Rate(period, start), start
    for gap in gaps:
        now += gap
        rate.tick(now)
        assert not rate.tick(now)
        assert now - TOLERANCE_S < rate.next_s <= now + period + 2 * TOLERANCE_S
