"""Vigilance: when a key is demanded, when zero is due, and the speed that goes with it."""

import math

from hypothesis import given
from hypothesis import strategies as st

from teleop.pilots.vigilance import (
    DEAD_LINK_M,
    DEMAND_S,
    REACTION_S,
    unanswered_limit_m_s,
    vigilance_left_s,
)
from teleop.screen.view import Control
from teleop.service import Setup


@given(vigilance_s=st.sampled_from([2.0, 10.0, 120.0]), key_s=st.sampled_from([0.0, 1.0, 4096.0]))
def test_a_key_is_demanded_at_the_end_of_vigilance_and_zero_is_due_three_seconds_later(
    vigilance_s: float, key_s: float
) -> None:
    demanded_s, zero_s = key_s + vigilance_s, key_s + vigilance_s + DEMAND_S

    def left_s(now_s: float) -> float:
        return vigilance_left_s(now_s, key_s, vigilance_s, moving=True)

    assert left_s(math.nextafter(demanded_s, -1.0)) >= DEMAND_S == left_s(demanded_s)
    assert left_s(demanded_s - 1e-9) > DEMAND_S
    assert left_s(zero_s - 1e-9) > 0.0 == left_s(zero_s)
    assert left_s(zero_s + 1e9) < 0.0


def test_motion_without_any_key_is_at_its_end_and_a_robot_at_rest_needs_none() -> None:
    assert vigilance_left_s(0.0, -math.inf, 120.0, moving=True) == -math.inf
    assert vigilance_left_s(1e9, -math.inf, 2.0, moving=False) == math.inf


@given(vigilance_s=st.floats(2.0, 120.0), round_trip_limit_s=st.floats(0.2, 10.0))
def test_behind_a_dead_link_to_a_silent_terminal_the_robot_drives_at_most_a_metre(
    vigilance_s: float, round_trip_limit_s: float
) -> None:
    limit_m_s = unanswered_limit_m_s(vigilance_s, round_trip_limit_s)
    longest_s = vigilance_s + DEMAND_S + round_trip_limit_s + REACTION_S
    assert 0.0 < limit_m_s * longest_s <= DEAD_LINK_M
    assert (limit_m_s + 0.001) * longest_s > DEAD_LINK_M, "not slower than necessary"


def test_the_default_limit_of_a_silent_terminal() -> None:
    setup = Setup("", "", Control.INCREMENTAL)
    assert unanswered_limit_m_s(setup.vigilance_s, setup.round_trip_limit_s) == 0.071
