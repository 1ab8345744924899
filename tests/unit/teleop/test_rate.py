"""A fixed rate that neither drifts nor catches up, and when the bell rings."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.rate import CLOSER_M, PAUSE_S, TOLERANCE_S, Rate, WarningBell


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


# --- the bell


def rings(*statuses: tuple[float, bool, float]) -> list[float]:
    bell = WarningBell()
    return [
        at
        for at, warning, nearest_m in statuses
        if bell.rings(warning=warning, nearest_m=nearest_m, now_s=at)
    ]


def test_it_rings_once_at_the_edge() -> None:
    assert rings((0.0, False, 0.6), (0.1, True, 0.49), (0.2, True, 0.49), (9.0, True, 0.49)) == [0.1]


def test_it_rings_again_only_where_it_has_come_closer_by_more_than_noise() -> None:
    closer = 0.49 - CLOSER_M
    assert rings((0.0, True, 0.49), (PAUSE_S, True, math.nextafter(closer, 1.0)), (3.0, True, closer)) == [
        0.0,
        3.0,
    ]


def test_a_pause_is_kept_while_it_closes() -> None:
    statuses = [(n / 10, True, 0.5 - n / 100) for n in range(45)]
    assert rings(*statuses) == [0.0, 2.0, 4.0]


def test_a_warning_that_flickers_does_not_rattle() -> None:
    assert rings(*[(n / 10, n % 2 == 0, 0.5) for n in range(40)]) == [0.0, 2.0]


def test_an_edge_within_the_pause_rings_after_it() -> None:
    assert rings((0.0, True, 0.49), (0.5, False, 0.6), (1.0, True, 0.49), (2.1, True, 0.49)) == [0.0, 2.1]


def test_an_unknown_distance_rings_at_the_edge_alone() -> None:
    assert rings((0.0, True, math.nan), (3.0, True, math.nan)) == [0.0]
