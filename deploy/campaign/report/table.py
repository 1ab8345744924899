"""What trials come to: a table by class of fault, and the story of one."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

from deploy.campaign.classes import CLASSES
from deploy.campaign.report.figures import classes_in
from deploy.campaign.report.statistics import quantile
from deploy.campaign.trial import Injected, Trial

MIN_WIDTH = 150
"""Columns where there is no terminal to ask."""


@dataclass(frozen=True, slots=True)
class Row:
    """One class of faults over all trials; NaN where nothing was measured."""

    fault: str
    count: int
    stops: int
    """How often it stopped a robot that was commanded to move."""
    detectors: tuple[tuple[str, int], ...]
    """Who noticed it, the most frequent first."""
    p50_s: float
    p99_s: float
    max_s: float
    """To zero on cmd_vel."""
    distance_m: float
    """The longest way to a standstill."""
    clearance_m: float
    """The smallest of the trials that it was in."""
    broken: int
    """Trials with it that broke a promise."""


def rows(trials: Iterable[Trial]) -> list[Row]:
    """A row for each class that happened, in the order of the table of classes."""
    by_class: dict[str, list[tuple[Injected, Trial]]] = {}
    for trial in trials:
        for name, one in classes_in(trial):
            by_class.setdefault(name, []).append((one, trial))
    order = {one.name: number for number, one in enumerate(CLASSES)}
    return [
        _row(name, by_class[name]) for name in sorted(by_class, key=lambda name: order.get(name, len(order)))
    ]


def _row(name: str, cases: Sequence[tuple[Injected, Trial]]) -> Row:
    zeros_s = sorted(one.to_zero_s for one, _ in cases if one.to_zero_s is not None)
    ways_m = [one.distance_m for one, _ in cases if one.distance_m is not None]
    detectors = Counter(one.detector for one, _ in cases if one.detector is not None)
    return Row(
        name,
        len(cases),
        len(zeros_s),
        tuple(detectors.most_common()),
        quantile(zeros_s, 0.5),
        quantile(zeros_s, 0.99),
        quantile(zeros_s, 1.0),
        max(ways_m, default=math.nan),
        min(trial.smallest_clearance_m for _, trial in cases),
        sum(bool(trial.violations) for _, trial in cases),
    )


def print_table(trials: Sequence[Trial]) -> None:
    """By class of fault."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=MIN_WIDTH)
    table = Table(title="faults, and the stops that they led to", title_justify="left")
    for name, justify in (
        ("fault", "left"),
        ("n", "right"),
        ("stops", "right"),
        ("noticed by", "left"),
        ("zero p50", "right"),
        ("p99", "right"),
        ("max ms", "right"),
        ("way cm", "right"),
        ("clear cm", "right"),
        ("broken", "right"),
    ):
        table.add_column(name, justify=justify, no_wrap=True)  # pyright: ignore[reportArgumentType]
    for row in rows(trials):
        table.add_row(
            row.fault,
            str(row.count),
            str(row.stops),
            ", ".join(f"{name} {count}" for name, count in row.detectors[:3]),
            *(_number(1000 * value) for value in (row.p50_s, row.p99_s, row.max_s)),
            _number(100 * row.distance_m),
            _number(100 * row.clearance_m),
            f"[bold red]{row.broken}[/]" if row.broken else "0",
        )
    console.print(table)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1f}"


def story(trial: Trial) -> Iterator[str]:
    """One trial in full."""
    yield f"seed {trial.seed}, {trial.duration_s:g} s, code {trial.revision}, digest {trial.digest}"
    events: list[tuple[float, str]] = []
    for one in trial.faults:
        details = ", ".join(f"{name} {value}" for name, value in one.parameters.items())
        zero = "" if one.to_zero_s is None else f", zero after {1000 * one.to_zero_s:.1f} ms"
        noticed = f"noticed by {one.detector or 'nobody'}{zero}"
        events.append((one.time_s, f"FAULT {one.fault} ({details}) at {one.speed_m_s:.2f} m/s: {noticed}"))
    reasons: tuple[str, ...] | None = None
    for sample in trial.timeline:
        if sample.reasons != reasons:
            reasons = sample.reasons
            events.append((sample.time_s, f"{', '.join(reasons) or 'free to drive'}; {_moving(sample.true)}"))
    events += [(v.time_s, f"BROKEN {v.promise}: {v.sentence}") for v in trial.violations]
    for time_s, sentence in sorted(events):
        yield f"{time_s:8.3f} s  {sentence}"
    yield (
        f"smallest clearance {100 * trial.smallest_clearance_m:.1f} cm, contacts {trial.contacts}, "
        f"promises broken {len(trial.violations)}"
    )


def _moving(velocity: tuple[float, float]) -> str:
    return f"{velocity[0]:.2f} m/s, {velocity[1]:.2f} rad/s"
