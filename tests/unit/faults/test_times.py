"""The time from the fault to a lasting zero."""

import math

from hypothesis import given
from hypothesis import strategies as st

from faults.measure import (
    STALL_S,
    BaseReport,
    longest_gap_s,
    since,
    stood_s,
    to_lasting_rest_s,
    to_lasting_zero_s,
)
from faults.seen import Asked, Command, Motion, Seen, Status

END_S = 10.0


def _commands(*speeds_m_s: float) -> list[Command]:
    """One each second, from second 0."""
    return [Command(float(at_s), speed, 0.0) for at_s, speed in enumerate(speeds_m_s)]


def test_the_first_zero_after_the_fault_counts() -> None:
    assert to_lasting_zero_s(_commands(0.5, 0.5, 0.0, 0.0), 0.5, END_S) == 1.5


def test_a_zero_that_is_followed_by_motion_does_not_count() -> None:
    assert to_lasting_zero_s(_commands(0.5, 0.0, 0.5, 0.0), 0.5, END_S) == 2.5


def test_motion_after_somebody_was_neutral_again_does_not_count() -> None:
    assert to_lasting_zero_s(_commands(0.5, 0.0, 0.5), 0.5, 2.0) == 0.5


def test_zeros_that_did_not_last_are_no_zero() -> None:
    assert to_lasting_zero_s(_commands(0.5, 0.0, 0.5), 0.5, END_S) is None


def test_nothing_came_after_the_fault() -> None:
    assert to_lasting_zero_s(_commands(0.5), 0.5, END_S) is None


def test_what_was_zero_already_measures_nothing() -> None:
    assert to_lasting_zero_s(_commands(0.0, 0.0), 0.5, END_S) is None
    assert to_lasting_zero_s([], 0.5, END_S) is None
    assert to_lasting_zero_s(_commands(0.5, 0.0), -1.0, END_S) is None


@given(
    st.lists(st.sampled_from((0.0, 0.4)), min_size=1, max_size=12),
    st.floats(0.0, 12.0),
    st.floats(0.0, 12.0),
)
def test_nothing_but_zeros_follows_a_lasting_zero(
    speeds: list[float], fault_s: float, until_s: float
) -> None:
    commands = _commands(*speeds)
    took_s = to_lasting_zero_s(commands, fault_s, until_s)
    if took_s is not None:
        zero_s = fault_s + took_s
        later = [c for c in commands if zero_s - 1e-9 <= c.arrival_s < until_s]
        assert later
        assert all(c.is_zero for c in later)


def test_the_wheels_rest_when_they_are_asked_for_zero_for_the_last_time() -> None:
    driven = [(0.0, False), (1.0, True), (2.0, False), (2.1, True), (2.5, False), (4.0, True)]
    assert to_lasting_rest_s(driven, 1.5, 3.0) == 1.0


def test_wheels_that_were_at_rest_or_still_turn_measure_nothing() -> None:
    assert to_lasting_rest_s([(0.0, False), (2.0, True), (3.0, False)], 1.0, END_S) is None
    assert to_lasting_rest_s([(0.0, True)], 1.0, END_S) is None
    assert to_lasting_rest_s([(0.0, True), (2.0, False), (3.0, True)], 1.0, END_S) is None
    assert to_lasting_rest_s([], 1.0, END_S) is None


def test_all_times_are_shifted() -> None:
    seen = Seen(
        [Command(101.0, 0.1, 0.2)],
        [Status(102.0, ("ESTOP",))],
        [Motion(103.0, 1.0, 2.0, 0.3, 0.4)],
        [Asked(104.0, "teleop", 0.1, 0.0)],
        [(106.0, True)],
    )
    shifted, base = since(100.0, seen, [BaseReport(105.0, "OK")])
    assert shifted == Seen(
        [Command(1.0, 0.1, 0.2)],
        [Status(2.0, ("ESTOP",))],
        [Motion(3.0, 1.0, 2.0, 0.3, 0.4)],
        [Asked(4.0, "teleop", 0.1, 0.0)],
        [(6.0, True)],
    )
    assert base == [BaseReport(5.0, "OK")]
    assert math.isinf(shifted.motions[0].clearance_m)


def test_the_longest_gap_begins_with_the_last_moment_before() -> None:
    times_s = [0.0, 1.0, 3.0, 3.5, 9.0]
    assert longest_gap_s(times_s, 2.0, 4.0) == 2.0
    assert longest_gap_s(times_s, 3.2, 4.0) == 0.5
    assert longest_gap_s(times_s, 0.0, 10.0) == 5.5
    assert longest_gap_s([], 0.0, 10.0) == 0.0


# --- a simulation that stood still


def _motions(*times_s: float) -> list[Motion]:
    return [Motion(time_s, 0.0, 0.0, 0.5, 0.0) for time_s in times_s]


def test_a_simulation_that_reports_its_motion_in_time_has_not_stood() -> None:
    assert stood_s(_motions(0.99, 1.0, 1.01, 1.02, 1.04), 1.005, 1.04) == 0.0


def test_what_a_gap_has_beyond_a_stall_is_time_in_which_the_simulation_stood() -> None:
    motions = _motions(0.99, 1.0, 1.1, 1.11, 1.2)
    assert math.isclose(stood_s(motions, 1.0, 1.11), 0.1 - STALL_S)
    assert math.isclose(stood_s(motions, 1.0, 1.2), 0.1 + 0.09 - 2 * STALL_S)
    assert math.isclose(stood_s([], 1.0, 1.2), 0.2 - STALL_S)


def test_a_simulation_that_stood_before_the_fault_has_no_excuse() -> None:
    assert stood_s(_motions(0.5, 1.0, 1.01), 1.0, 1.02) == 0.0
