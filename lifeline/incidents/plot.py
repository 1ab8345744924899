"""Plots of a few series over time as text, for a terminal of any width; the glyphs differ also without colour. Pure."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from rich.text import Text

LABEL = 8
"""Columns of the axis labels and the axis."""
MIN_COLUMNS = 20


@dataclass(frozen=True, slots=True)
class Series:
    """One value for each time; a value that is not finite is not drawn."""

    name: str
    glyph: str
    style: str
    values: Sequence[float]


def plot(title: str, times_s: Sequence[float], series: Sequence[Series], *, width: int, height: int) -> Text:
    """Return a plot; of several series at one place, the last is visible.

    Args:
        title: what is plotted, with its unit.
        times_s: (n,), increasing; the vertical line is at zero.
        series: of n values each.
        width: columns of the whole plot.
        height: lines of the plot without title and time axis.
    """
    columns = max(MIN_COLUMNS, width - LABEL)
    drawn = [value for one in series for value in one.values if math.isfinite(value)]
    low, high = min([0.0, *drawn]), max([0.0, *drawn])
    if high == low:
        high = low + 1.0
    cells = [[(" ", "")] * columns for _ in range(height)]
    first_s, span_s = times_s[0], max(1e-9, times_s[-1] - times_s[0])
    stop = round(-first_s / span_s * (columns - 1))
    zero = round(high / (high - low) * (height - 1))
    cells[zero] = [("┈", "dim")] * columns
    if 0 <= stop < columns:
        for row in cells:
            row[stop] = ("│", "dim")
    for one in series:
        for column in range(columns):
            value = one.values[_at(times_s, first_s + column * span_s / (columns - 1))]
            if math.isfinite(value):
                cells[round((high - value) / (high - low) * (height - 1))][column] = (one.glyph, one.style)
    text = Text(f"{title}: ", no_wrap=True, overflow="crop")
    for one in series:
        text.append(f"{one.glyph} {one.name}  ", one.style)
    for number, row in enumerate(cells):
        value = high - number * (high - low) / (height - 1)
        text.append(f"\n{value + 0.0:6.2f} ┤")
        for glyph, style in row:
            text.append(glyph, style)
    return text.append(f"\n{' ' * LABEL}{_time_axis(first_s, times_s[-1], stop, columns)}")


def _at(times_s: Sequence[float], time_s: float) -> int:
    """Return the index of the last time that is not after `time_s`, else the first."""
    return max(0, bisect_right(times_s, time_s + 1e-9) - 1)


def _time_axis(first_s: float, last_s: float, stop: int, columns: int) -> str:
    """Return the first time, zero at the vertical line, and the last time, as far as there is room."""
    axis = [" "] * columns
    labels = [(0, f"{first_s:+.1f} s"), (columns, f"{last_s:+.1f} s"), (stop, "0")]
    for place, label in labels:
        begin = min(max(0, place), columns - len(label))
        if all(char == " " for char in axis[max(0, begin - 1) : begin + len(label) + 1]):
            axis[begin : begin + len(label)] = label
    return "".join(axis).rstrip()
