"""SVG pictures of runs for the page, whose style sheet gives the colours. Pure."""

import math
from collections.abc import Callable, Iterable, Sequence
from html import escape

from passport.cells import WORDS, Fault
from passport.record import Run
from passport.summary import Row

LEFT_PX, TOP_PX, WIDTH_PX, HEIGHT_PX = 44.0, 20.0, 380.0, 210.0
SMALL_WIDTH_PX, SMALL_HEIGHT_PX = 240.0, 90.0
ROOM = 1.1
"""Length of an axis in its largest value."""

Value = Callable[[Run], float | None]


def stops_over_speed(found: Sequence[Row], title: str, value: Value) -> str:
    """Draw a quantity of each run over its speed.

    Args:
        found: rows with runs.
        title: the quantity, with its unit.
        value: gives it for a run; None: the run does not show it.
    """
    points = [
        (run.v0_m_s, shown, row.cell)
        for row in found
        for run in row.cell.runs
        if (shown := value(run)) is not None
    ]
    most_x = ROOM * max((x for x, _, _ in points), default=1.0)
    most_y = ROOM * max((y for _, y, _ in points), default=1.0) or 1.0
    plot = _Plot(LEFT_PX, TOP_PX, WIDTH_PX, HEIGHT_PX, (0.0, most_x), (0.0, most_y))
    marks = [
        f'<circle class="{"run" if cell.with_lifeline else "without"}" cx="{plot.x(x):.1f}" cy="{plot.y(y):.1f}" r="3"><title>{escape(cell.name)}</title></circle>'
        for x, y, cell in points
    ]
    worst = [(0.0, 0.0)]
    for row in found:
        values = [(run.v0_m_s, shown) for run in row.cell.runs if (shown := value(run)) is not None]
        if row.cell.name == WORDS[Fault.ZERO] and values:
            worst.append(max(values, key=lambda one: one[1]))
    size = (LEFT_PX + WIDTH_PX + 10.0, TOP_PX + HEIGHT_PX + 34.0)
    axes = plot.axes(title, "speed before the fault [m/s]")
    return _picture(size, title, [*axes, plot.line("curve", sorted(worst)), *marks])


def speed_over_time(run: Run, title: str) -> str:
    """Draw the speed of one run over the time from the fault; a frame without a line where there is no trace."""
    times = [sample[0] for sample in run.trace] or [0.0, 1.0]
    most_m_s = ROOM * max(run.v0_m_s, *(sample[1] for sample in run.trace), 0.1)
    least_m_s = min(0.0, *(sample[1] for sample in run.trace), 0.0)
    span = (times[0], max(times[-1], times[0] + 0.1))
    plot = _Plot(34.0, 6.0, SMALL_WIDTH_PX - 50.0, SMALL_HEIGHT_PX - 24.0, span, (least_m_s, most_m_s))
    fault = (
        f'<path class="bound" d="M{plot.x(min(max(0.0, span[0]), span[1])):.1f} {plot.top}v{plot.height}"/>'
    )
    line = plot.line("odom", [(time_s, m_s) for time_s, m_s, _ in run.trace])
    ticks = [
        f'<text class="name" x="{plot.left - 4}" y="{plot.y(value) + 4:.1f}">{value:.1f}</text>'
        for value in (0.0, run.v0_m_s)
    ] + [
        f'<text class="tick" x="{plot.x(value):.1f}" y="{SMALL_HEIGHT_PX - 4}">{value:.1f}</text>'
        for value in span
    ]
    return _picture((SMALL_WIDTH_PX, SMALL_HEIGHT_PX), title, [plot.frame(), fault, line, *ticks])


class _Plot:
    """Maps two quantities to the coordinates of a picture."""

    def __init__(
        self,
        left: float,
        top: float,
        width: float,
        height: float,
        xs: tuple[float, float],
        ys: tuple[float, float],
    ) -> None:
        self.left, self.top, self.width, self.height = left, top, width, height
        self._xs, self._ys = xs, ys

    def x(self, value: float) -> float:
        return self.left + self.width * (value - self._xs[0]) / (self._xs[1] - self._xs[0])

    def y(self, value: float) -> float:
        return self.top + self.height * (self._ys[1] - value) / (self._ys[1] - self._ys[0])

    def frame(self) -> str:
        return f'<path class="grid" d="M{self.left} {self.top}v{self.height}h{self.width}"/>'

    def line(self, kind: str, points: Iterable[tuple[float, float]]) -> str:
        path = "L".join(f"{self.x(x):.1f} {self.y(y):.1f}" for x, y in points)
        return f'<path class="{kind}" d="M{path}"/>' if path else ""

    def axes(self, title: str, below: str) -> list[str]:
        """Draw the axes from zero, with round numbers."""
        parts = [self.frame(), f'<text x="{self.left}" y="{self.top - 8}">{escape(title)}</text>']
        parts += [
            f'<text class="tick" x="{self.x(x):.1f}" y="{self.top + self.height + 14}">{x:g}</text>'
            for x in round_numbers(self._xs[1])
        ]
        parts += [
            f'<text class="name" x="{self.left - 4}" y="{self.y(y) + 4:.1f}">{y:g}</text>'
            for y in round_numbers(self._ys[1])
        ]
        middle = self.left + self.width / 2
        return [*parts, f'<text class="tick" x="{middle}" y="{self.top + self.height + 29}">{below}</text>']


def round_numbers(most: float) -> list[float]:
    """Return the numbers from 0 to `most` in steps of 1, 2 or 5 times a power of ten; at least three and at most six."""
    power = 10.0 ** math.floor(math.log10(most))
    step = next(one * power for one in (0.2, 0.5, 1.0, 2.0) if most / (one * power) < 6.0)
    return [round(number * step, 12) for number in range(int(most / step) + 1)]


def _picture(size: tuple[float, float], title: str, parts: Iterable[str]) -> str:
    width, height = size
    return (
        f'<svg role="img" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" aria-label="{escape(title)}">'
        + "".join(parts)
        + "</svg>"
    )
