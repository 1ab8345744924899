"""Draw the samples of a soak as SVG, without a plotting library."""

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape

from faults.soak.sample import Sample

WIDTH, PANEL, LEFT, RIGHT, TOP, GAP = 900, 170, 70, 130, 40, 50
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
TICKS = 4


class _Series(NamedTuple):
    name: str
    points: list[tuple[float, float]]


def svg(samples: Sequence[Sample], title: str) -> str:
    """Return plots of memory, descriptors and lateness over time, one below the other."""
    unit, per_s = ("h", 3600.0) if samples[-1].time_s > 7200.0 else ("min", 60.0)
    names = dict.fromkeys(name for sample in samples for name in sample.processes)

    def of(name: str, attribute: str, share: float) -> _Series:
        return _Series(
            name,
            [
                (s.time_s / per_s, getattr(s.processes[name], attribute) / share)
                for s in samples
                if name in s.processes
            ],
        )

    panels = [
        ("memory (RSS) [MB]", [of(name, "rss_bytes", 1e6) for name in names]),
        ("open descriptors", [of(name, "descriptors", 1.0) for name in names]),
        (
            "gaps of cmd_vel [ms]",
            [
                _Series(label, [(s.time_s / per_s, getattr(s.ticks, field)) for s in samples])
                for label, field in (("p50", "p50_ms"), ("p99", "p99_ms"), ("max", "max_ms"))
            ],
        ),
        (
            "lateness of the heartbeat [ms]",
            [
                _Series(label, [(s.time_s / per_s, getattr(s.heartbeat, field)) for s in samples])
                for label, field in (("p50", "p50_ms"), ("p99", "p99_ms"), ("max", "max_ms"))
            ],
        ),
    ]
    height = TOP + len(panels) * (PANEL + GAP)
    last = max(samples[-1].time_s / per_s, 1e-9)
    body = [
        _panel(name, series, TOP + number * (PANEL + GAP), last, unit)
        for number, (name, series) in enumerate(panels)
    ]
    return "\n".join(
        [
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" '
                f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12">'
            ),
            f'<rect width="{WIDTH}" height="{height}" fill="white"/>',
            f'<text x="{LEFT}" y="20" font-size="14">{escape(title)}</text>',
            *body,
            "</svg>\n",
        ]
    )


def _panel(name: str, series: list[_Series], top: float, last: float, unit: str) -> str:
    finite = [y for one in series for _, y in one.points if math.isfinite(y)]
    high = 1.1 * max([*finite, 1e-9])
    wide = WIDTH - LEFT - RIGHT
    bottom = top + PANEL

    def place(x: float, y: float) -> str:
        return f"{LEFT + wide * x / last:.1f},{bottom - PANEL * y / high:.1f}"

    lines = [
        f'<text x="{LEFT}" y="{top - 6}">{escape(name)}</text>',
        f'<rect x="{LEFT}" y="{top}" width="{wide}" height="{PANEL}" fill="none" stroke="#999"/>',
    ]
    for tick in range(TICKS + 1):
        share = tick / TICKS
        y, x = bottom - PANEL * share, LEFT + wide * share
        lines += [
            f'<text x="{LEFT - 6}" y="{y + 4}" text-anchor="end">{high * share:.4g}</text>',
            f'<text x="{x}" y="{bottom + 16}" text-anchor="middle">{last * share:.3g} {unit}</text>',
            f'<line x1="{LEFT}" x2="{LEFT + wide}" y1="{y}" y2="{y}" stroke="#eee"/>',
        ]
    for number, one in enumerate(series):
        colour = COLOURS[number % len(COLOURS)]
        points = " ".join(place(x, y) for x, y in one.points if math.isfinite(y))
        lines += [
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>',
            f'<text x="{LEFT + wide + 8}" y="{top + 14 + 16 * number}" fill="{colour}">{escape(one.name)}</text>',
        ]
    return "\n".join(lines)
