"""Intermediate twists between the present and the commanded one."""

import pytest

from supervisor.law.reckoning import Velocity
from supervisor.law.transition import at_least, is_on_another_arc, lags, mixtures

NOISE = Velocity(0.0625, 0.25)
"""In powers of two: sums of them are exact."""


@pytest.mark.parametrize(
    ("has", "wanted", "mixed"),
    [
        pytest.param(
            (0.5, 0.0),
            (-0.5, 1.0),
            [(0.5, 1.0)],
            id="forward velocity opposes the command, a turn is commanded",
        ),
        pytest.param((-0.5, 0.0), (0.5, -1.0), [(-0.5, -1.0)], id="the same mirrored"),
        pytest.param((0.5, 0.0), (0.0, 0.5), [(0.5, 0.5)], id="a turn on the spot is commanded"),
        pytest.param((0.0, 1.0), (0.5, 0.0), [(0.5, 1.0)], id="an excess turn"),
        pytest.param((0.0, -1.0), (2.0, 0.5), [(2.0, -1.0)], id="the opposite turn is commanded"),
        pytest.param((1.0, -1.0), (0.5, 0.5), [(1.0, 0.5), (0.5, -1.0)], id="excess on both axes"),
        pytest.param((0.5, 1.0), (0.5, 1.0), [], id="no excess"),
        pytest.param((0.5, 1.0), (1.0, 2.0), [], id="more is commanded"),
        pytest.param((0.5, 0.0), (-0.5, 0.0), [], id="reversing on the same line is no mixture"),
        pytest.param((0.0, 1.0), (0.0, -1.0), [], id="nor is turning back on the spot"),
        pytest.param((0.5625, 0.0), (0.5, 1.0), [], id="faster by noise"),
        pytest.param((0.625, 0.0), (0.5, 1.0), [(0.625, 1.0)], id="faster by more"),
        pytest.param((-0.5625, 0.0), (-0.5, 1.0), [], id="faster backwards by noise"),
        pytest.param((0.0625, 0.0), (-0.5, 1.0), [], id="noise in the other direction"),
        pytest.param((0.0, 0.25), (0.5, -1.0), [], id="noise in the other turn"),
    ],
)
def test_excess_velocity_on_one_axis_is_combined_with_the_command_on_the_other(
    has: tuple[float, float], wanted: tuple[float, float], mixed: list[tuple[float, float]]
) -> None:
    assert mixtures(Velocity(*has), Velocity(*wanted), NOISE) == [Velocity(*one) for one in mixed]


@pytest.mark.parametrize(
    ("has", "wanted", "is_other"),
    [
        pytest.param((1.0, 1.0), (0.5, 0.5), False, id="the same arc, faster"),
        pytest.param((1.0, 1.0), (-0.5, -0.5), False, id="the same arc, backwards"),
        pytest.param((1.0, -1.0), (0.5, 0.5), True, id="the arc to the other side"),
        pytest.param((0.0, 0.5), (1.0, 0.0), True, id="a turn, where straight on is commanded"),
        pytest.param((0.0, 0.25), (1.0, 0.0), False, id="a turn by noise"),
        pytest.param((0.5, 0.0), (0.0, 1.0), True, id="straight on, where a turn is commanded"),
        pytest.param((0.0625, 0.0), (0.0, 1.0), False, id="straight on by noise"),
        pytest.param((0.0, 0.0), (1.0, 1.0), False, id="it stands"),
    ],
)
def test_a_base_is_on_another_arc_when_its_rim_moves_across_the_commanded_one(
    has: tuple[float, float], wanted: tuple[float, float], *, is_other: bool
) -> None:
    assert is_on_another_arc(Velocity(*has), Velocity(*wanted), rim_m=0.25, negligible_m_s=0.0625) is is_other


def test_the_length_of_both_axes_counts_in_what_is_across() -> None:
    # Across by 0.5 · 1 rad/s · 0.5 m = 0.25, on an arc of hypot(0.75, 2 · 0.5) = 1.25 m/s: exactly 0.2 m/s.
    has, wanted = Velocity(0.25, 0.0), Velocity(0.75, 2.0)
    assert is_on_another_arc(has, wanted, rim_m=0.5, negligible_m_s=0.1999)
    assert not is_on_another_arc(has, wanted, rim_m=0.5, negligible_m_s=0.2001)


@pytest.mark.parametrize(
    ("has", "wanted", "lagging"),
    [
        pytest.param(
            (0.0, 0.0), (0.5, 1.0), [(0.5, 0.0), (0.0, 1.0)], id="from standstill either axis may lag"
        ),
        pytest.param((0.5, 0.0), (0.5, 1.0), [(0.5, 0.0)], id="only the turn lags"),
        pytest.param((0.0, 1.0), (0.5, 1.0), [(0.0, 1.0)], id="only the speed lags"),
        pytest.param((-0.25, -0.5), (-0.5, -1.0), [(-0.5, -0.5), (-0.25, -1.0)], id="backwards"),
        pytest.param((0.5, 1.0), (-0.5, -1.0), [(-0.5, 1.0), (0.5, -1.0)], id="the other way"),
        pytest.param((0.5, 1.0), (0.5, 1.0), [], id="it follows"),
        pytest.param((1.0, 2.0), (0.5, 1.0), [], id="it is faster"),
        pytest.param((0.0, 0.0), (0.5, 0.0), [], id="a straight line has one axis"),
        pytest.param((0.0, 0.0), (0.0, 1.0), [], id="so has a turn on the spot"),
        pytest.param((0.4375, 0.75), (0.5, 1.0), [], id="slower by noise"),
        pytest.param((0.375, 0.625), (0.5, 1.0), [(0.5, 0.625), (0.375, 1.0)], id="slower by more"),
    ],
)
def test_a_base_that_lags_on_one_axis_has_the_command_on_the_other(
    has: tuple[float, float], wanted: tuple[float, float], lagging: list[tuple[float, float]]
) -> None:
    assert lags(Velocity(*has), Velocity(*wanted), NOISE) == [Velocity(*one) for one in lagging]


@pytest.mark.parametrize(
    ("slow", "raised"),
    [
        pytest.param((0.0625, 0.0), (0.25, 0.0), id="straight"),
        pytest.param((0.0, -0.125), (0.0, -0.5), id="a turn"),
        pytest.param((-0.03125, 0.0625), (-0.125, 0.25), id="an arc"),
        pytest.param((5e-324, 0.0), (0.25, 0.0), id="the least that a float can say"),
    ],
)
def test_a_slow_command_is_raised_in_its_direction(
    slow: tuple[float, float], raised: tuple[float, float]
) -> None:
    assert at_least(Velocity(*slow), speed_m_s=0.25, rim_m=0.5) == Velocity(*raised)


@pytest.mark.parametrize(
    "fast", [(0.25, 0.0), (0.0, 0.5), (0.125, -0.25), (1.0, 1.0), (0.0, 0.0), (0.0, 5e-324)]
)
def test_a_command_that_is_fast_enough_or_moves_nothing_stays_as_it_is(fast: tuple[float, float]) -> None:
    velocity = Velocity(*fast)
    assert at_least(velocity, speed_m_s=0.25, rim_m=0.25 if fast == (0.0, 5e-324) else 0.5) is velocity
