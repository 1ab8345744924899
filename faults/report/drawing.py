"""SVG pictures of a campaign for an HTML page, whose style sheet gives the colours. Pure."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from faults.report.figures import ClassFigures
from faults.report.statistics import log_bins
from faults.trial import Injected, Sample, Trial

FIRST_S = 1e-4
DECADES = 5
PER_DECADE = 16
"""The axis of stop times: 0.1 ms to 10 s."""

NAME_PX, STRIP_PX, NOTE_PX, ROW_PX = 210, 560, 110, 24
BEFORE_S, AFTER_S = 0.6, 2.4
"""Time before and after the fault that is drawn."""
POINTS = 300
"""Maximum number of points of a line."""
WIDTH_PX, HEIGHT_PX, LEFT_PX, TOP_PX, REASONS_PX = 560, 130, 40, 18, 34
WORDS_PX = 60
"""Minimum width of a stop that shows its reason."""


def strips(classes: Sequence[ClassFigures]) -> str:
    """Draw the distribution of each class's stop times on a log axis, with its bound; empty without stops."""
    shown = [one for one in classes if one.timed]
    if not shown:
        return ""
    height_px = ROW_PX * len(shown) + 30
    parts = [opened(NAME_PX + STRIP_PX + NOTE_PX, height_px, "Distribution of the stop times by class")]
    for decade in range(DECADES + 1):
        x_px = NAME_PX + STRIP_PX * decade / DECADES
        parts.append(f'<path class="grid" d="M{x_px:.1f} 0V{height_px - 24}"/>')
        label = _time(FIRST_S * 10**decade)
        parts.append(f'<text class="tick" x="{x_px:.1f}" y="{height_px - 8}">{label}</text>')
    for number, one in enumerate(shown):
        parts += _strip(one, number * ROW_PX)
    return "".join([*parts, "</svg>"])


def _strip(one: ClassFigures, top_px: float) -> Iterator[str]:
    times_s = [case.stop_s for case in one.timed if case.stop_s is not None]
    counts = log_bins(times_s, FIRST_S, DECADES, PER_DECADE)
    bin_px, base_px = STRIP_PX / len(counts), top_px + ROW_PX - 2
    yield f'<text class="name" x="{NAME_PX - 8}" y="{top_px + 16:.0f}">{escape(one.name)}</text>'
    bars = "".join(
        # A single stop among thousands must be visible.
        f"M{NAME_PX + place * bin_px:.1f} {base_px:.0f}v-{max(2.0, (ROW_PX - 5) * count / max(counts)):.1f}"
        f"h{bin_px - 0.6:.1f}V{base_px:.0f}z"
        for place, count in enumerate(counts)
        if count
    )
    yield f'<path class="bars" d="{bars}"/>'
    if one.bound_s is not None:
        yield f'<path class="bound" d="M{_place_px(one.bound_s):.1f} {top_px + 1:.0f}V{base_px:.0f}"/>'
    note = f"max {_time(times_s[-1])}, n {len(times_s)}"
    yield f'<text class="note" x="{NAME_PX + STRIP_PX + 6}" y="{top_px + 16:.0f}">{note}</text>'


def _place_px(time_s: float) -> float:
    return NAME_PX + STRIP_PX * min(1.0, max(0.0, math.log10(max(time_s, FIRST_S) / FIRST_S) / DECADES))


def _time(time_s: float) -> str:
    if time_s >= 1.0:
        return f"{time_s:.3g} s"
    return f"{1000 * time_s:.3g} ms"


@dataclass(frozen=True)
class Frame:
    """Maps times and speeds to the coordinates of a picture."""

    begin_s: float
    end_s: float
    low_m_s: float
    high_m_s: float

    def x_px(self, time_s: float) -> float:
        return LEFT_PX + WIDTH_PX * (time_s - self.begin_s) / (self.end_s - self.begin_s)

    def y_px(self, speed_m_s: float) -> float:
        return TOP_PX + HEIGHT_PX * (self.high_m_s - speed_m_s) / (self.high_m_s - self.low_m_s)


BOTTOM_PX = TOP_PX + HEIGHT_PX


def timeline(trial: Trial, one: Injected) -> str:
    """Draw the requested, permitted and true speed around a fault, with the stop reasons; empty without a timeline."""
    begin_s, end_s = one.time_s - BEFORE_S, one.time_s + AFTER_S
    samples = [sample for sample in trial.timeline if begin_s <= sample.time_s <= end_s]
    if len(samples) < 2:
        return ""
    samples = samples[:: math.ceil(len(samples) / POINTS)]
    speeds = [v[0] for s in samples for v in (s.commanded, s.permitted, s.true)]
    frame = Frame(begin_s, end_s, min(0.0, *speeds), max(0.2, *speeds))
    ticks = {f"{after_s:+.1f} s": one.time_s + after_s for after_s in (-0.5, 0.0, 0.5, 1.0, 1.5, 2.0)}
    title = f"Speeds around {one.fault} in the trial of seed {trial.seed}"
    faults = [other for other in trial.faults if begin_s <= other.time_s <= end_s]
    return "".join(
        [
            opened(LEFT_PX + WIDTH_PX + 10, BOTTOM_PX + REASONS_PX + 14, title),
            *axes(frame, ticks, BOTTOM_PX + REASONS_PX + 10),
            *_lines(frame, samples),
            *(part for other in faults for part in moment(frame, other.time_s, other.fault)),
            *_stops(frame, samples),
            "</svg>",
        ]
    )


def axes(frame: Frame, ticks: Mapping[str, float], ticks_px: float) -> Iterator[str]:
    """Draw the axes of speed and time, with labels for some times at a height."""
    for speed_m_s in dict.fromkeys((frame.low_m_s, 0.0, frame.high_m_s)):
        y_px = frame.y_px(speed_m_s)
        yield f'<path class="grid" d="M{LEFT_PX} {y_px:.1f}h{WIDTH_PX}"/>'
        yield f'<text class="name" x="{LEFT_PX - 4}" y="{y_px + 4:.1f}">{speed_m_s:.2f}</text>'
    for label, time_s in ticks.items():
        yield f'<text class="tick" x="{frame.x_px(time_s):.1f}" y="{ticks_px:.0f}">{label}</text>'


def _lines(frame: Frame, samples: Sequence[Sample]) -> Iterator[str]:
    commanded = [(frame.x_px(s.time_s), frame.y_px(s.commanded[0])) for s in samples]
    permitted = [(frame.x_px(s.time_s), frame.y_px(s.permitted[0])) for s in samples]
    yield f'<path class="commanded" d="{_steps(commanded)}"/><path class="permitted" d="{_steps(permitted)}"/>'
    yield true_line(frame, [(s.time_s, s.true[0]) for s in samples])


def true_line(frame: Frame, speeds: Iterable[tuple[float, float]]) -> str:
    """Draw the true speed over time."""
    line = "L".join(f"{frame.x_px(time_s):.1f} {frame.y_px(m_s):.1f}" for time_s, m_s in speeds)
    return f'<path class="true" d="M{line}"/>'


def moment(frame: Frame, time_s: float, name: str) -> Iterator[str]:
    """Draw a vertical line with a name at a time."""
    x_px = frame.x_px(time_s)
    yield f'<path class="bound" d="M{x_px:.1f} {TOP_PX - 4}V{BOTTOM_PX}"/>'
    yield f'<text class="tick" x="{x_px:.1f}" y="{TOP_PX - 7}">{escape(name)}</text>'


def _stops(frame: Frame, samples: Sequence[Sample]) -> Iterator[str]:
    for from_s, until_s, reasons in _reasons(samples):
        left_px, wide_px = frame.x_px(from_s), frame.x_px(until_s) - frame.x_px(from_s)
        yield (
            f'<rect class="stopped" x="{left_px:.1f}" y="{BOTTOM_PX + 6}" width="{wide_px:.1f}" height="16">'
            f"<title>{escape(', '.join(reasons))}</title></rect>"
        )
        if wide_px > WORDS_PX:
            words = escape(f"{reasons[0]}{' …' if len(reasons) > 1 else ''}")
            yield f'<text class="why" x="{left_px + 3:.1f}" y="{BOTTOM_PX + 18}">{words}</text>'


def _reasons(samples: Sequence[Sample]) -> Iterator[tuple[float, float, tuple[str, ...]]]:
    """Return the stops with their times and reasons."""
    start = 0
    for number in range(1, len(samples) + 1):
        if number == len(samples) or samples[number].reasons != samples[start].reasons:
            if samples[start].reasons:
                until_s = samples[min(number, len(samples) - 1)].time_s
                yield samples[start].time_s, until_s, samples[start].reasons
            start = number


def _steps(points: Sequence[tuple[float, float]]) -> str:
    """Return the path of values that hold until the next one."""
    first, *others = points
    return f"M{first[0]:.1f} {first[1]:.1f}" + "".join(f"H{x:.1f}V{y:.1f}" for x, y in others)


def opened(width_px: float, height_px: float, title: str) -> str:
    """Return the first tag of a picture."""
    size = f'viewBox="0 0 {width_px:.0f} {height_px:.0f}" width="{width_px:.0f}"'
    return f'<svg role="img" {size} aria-label="{escape(title)}">'
