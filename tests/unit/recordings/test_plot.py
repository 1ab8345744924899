"""Plots as text: where a value is drawn, and what the axes say."""

import math

import pytest

from recordings.incidents.commands import PLOT_LABEL, Series, plot

TIMES_S = [-1.0 + 0.01 * i for i in range(201)]


def lines(*series: Series, width: int = 80, height: int = 5) -> list[str]:
    return plot("speed, m/s", TIMES_S, series, width=width, height=height).plain.splitlines()


def ramp(name: str = "measured", glyph: str = "x") -> Series:
    """From 1 m/s to zero at time zero."""
    return Series(name, glyph, "", [max(0.0, -time_s) for time_s in TIMES_S])


def test_a_falling_value_is_drawn_from_the_upper_left_to_the_zero_line() -> None:
    title, top, *_, bottom, axis = lines(ramp())
    assert title.startswith("speed, m/s: x measured")
    assert top.startswith("  1.00 ┤x")
    assert bottom.startswith("  0.00 ┤")
    assert bottom.endswith("x" * 36)
    assert axis.split() == ["-1.0", "s", "0", "+1.0", "s"]


@pytest.mark.parametrize("width", [40, 80, 160])
def test_a_plot_is_as_wide_as_requested_and_the_stop_is_in_one_column(width: int) -> None:
    found = lines(ramp(), width=width)
    assert {len(line) for line in found[1:-1]} == {width}
    (stop,) = {line.index("│") for line in found[1:4]}
    assert stop == pytest.approx(PLOT_LABEL + (width - PLOT_LABEL) / 2, abs=1)
    assert found[-1].index(" 0 ") + 1 == stop


def test_the_last_of_two_equal_series_is_visible() -> None:
    text = "\n".join(lines(ramp("requested", "."), ramp())[1:])
    assert "x" in text
    assert "." not in text.replace("0.", "").replace("1.", "")


def test_negative_values_are_below_the_zero_line() -> None:
    _, top, *_, bottom, _ = lines(Series("measured", "x", "", [-0.4] * len(TIMES_S)))
    assert top.startswith("  0.00 ┤┈")
    assert bottom.startswith(" -0.40 ┤x")


def test_values_that_are_not_finite_are_left_out() -> None:
    text = "\n".join(lines(Series("nearest", "x", "", [math.nan, math.inf, -math.inf] * 67))[1:])
    assert "x" not in text
    assert "  1.00 ┤" in text


def test_a_single_moment_is_a_plot() -> None:
    found = plot("speed", [0.0], [Series("measured", "x", "", [0.5])], width=10, height=3).plain.splitlines()
    assert found[1].startswith("  0.50 ┤x")
