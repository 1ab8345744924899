"""A campaign on a terminal: its progress, a table by class of fault with the broken promises, and the events of one trial."""

import json
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from deploy.stack.table import Column, Table
from faults.report.figures import ClassFigures, class_of, figures_of, replay
from faults.trial import Trial
from wire.text import printable

MIN_WIDTH = 160
"""Columns of the table if the output is not a terminal."""
BROKEN_SHOWN = 20
LINE_PERIOD_S = 30.0
"""Time between two lines of progress, if the output is no terminal."""

COLUMNS = ("trials", "stops", "detected by", "bound", "zero p50", "limit", "max", "stands after", "within", "clearance", "broken")  # fmt: skip


class Progressing:
    """Shows the progress of a campaign: a bar on a terminal, otherwise a line every `LINE_PERIOD_S`."""

    def __init__(self, console: Console, total: int) -> None:
        self._console, self._total = console, total
        self._number = self._broken = 0
        self._line_s = 0.0
        # Drawn on changes only, without a thread, because a measurement may be running.
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            auto_refresh=False,
            transient=True,
        )
        self._task = self._bar.add_task("", total=total)

    def begin(self, name: str) -> None:
        """Show that a trial begins."""
        broken = f"  [red]{self._broken} broken[/]" if self._broken else ""
        self._bar.update(self._task, description=f"{name}{broken}", refresh=self._console.is_terminal)

    def end(self, *, broken: bool) -> None:
        """Show that a trial has ended."""
        self._number += 1
        self._broken += broken
        self._bar.update(self._task, advance=1, refresh=self._console.is_terminal)
        elapsed_s = self._bar.tasks[0].elapsed or 0.0
        if not self._console.is_terminal and elapsed_s - self._line_s > LINE_PERIOD_S:
            self._line_s = elapsed_s
            self._console.print(f"  {self._number} of {self._total} trials, {self._broken} broken")

    def say(self, sentence: str) -> None:
        """Print a line that remains."""
        self._console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    @contextmanager
    def shown(self) -> Generator[None]:
        if not self._console.is_terminal:
            yield
            return
        with self._bar:
            yield


def print_results(trials: Sequence[Trial], console: Console | None = None, *, as_json: bool = False) -> None:
    """Print the table, and the first broken promises with the commands that replay them; or JSON on standard output."""
    if as_json:
        print(json.dumps(results(trials), indent=2), flush=True)
        return
    console = console or Console()
    if not console.is_terminal and console.width < MIN_WIDTH:
        console = Console(width=MIN_WIDTH, stderr=console.stderr)
    table = Table("fault", *(Column(title, right=title != "detected by") for title in COLUMNS))
    for one in figures_of(trials):
        table.add_row(one.name, *_cells(one))
    console.print(table)
    for line in broken_sentences(trials)[: 2 * BROKEN_SHOWN]:
        console.print(printable(line), style="red", markup=False, highlight=False, soft_wrap=True)


def _cells(one: ClassFigures) -> Iterator[str | Text]:
    """Yield the cells of `COLUMNS`; empty if nothing was measured."""
    stop, standstill, distance = one.stop, one.standstill, one.distance
    yield str(one.trials)
    yield str(len(one.stops))
    yield ", ".join(f"{name} {count}" for name, count in one.detectors[:3])
    yield one.bound_ms and f"{one.bound_ms} ms"
    for time_s in (None,) * 3 if stop is None else (stop.median, stop.limit, stop.worst):
        yield "" if time_s is None else f"{1000 * time_s:.1f} ms"
    yield "" if standstill is None else f"{1000 * standstill.median:.0f} ms"
    yield "" if distance is None else f"{100 * distance.worst:.1f} cm"
    yield f"{100 * one.clearance_m:.1f} cm"
    yield Text(printable(str(one.broken)), "bold red") if one.broken else ""


def broken_sentences(trials: Sequence[Trial]) -> list[str]:
    """Return two lines for each broken promise: what happened, and the command that replays it."""
    return [
        line
        for trial in trials
        for broken in trial.violations
        for line in (
            f"{class_of(trial)}, seed {trial.seed}, promise {broken.promise}, {broken.time_s:.3f} s: {broken.sentence}",
            f"  replay: {replay(trial)}",
        )
    ]


def results(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the figures of each class, and every broken promise with the command that replays it."""
    return {
        "trials": len(trials),
        "broken_trials": sum(bool(trial.violations) for trial in trials),
        "classes": [_class(one) for one in figures_of(trials)],
        "broken": [
            {
                "class": class_of(trial),
                "seed": trial.seed,
                "promise": broken.promise,
                "time_s": broken.time_s,
                "sentence": broken.sentence,
                "replay": replay(trial),
            }
            for trial in trials
            for broken in trial.violations
        ],
    }


def _class(one: ClassFigures) -> dict[str, Any]:
    return {
        "class": one.name,
        "trials": one.trials,
        "stops": len(one.stops),
        "detectors": dict(one.detectors),
        "bound_s": one.bound_s,
        "to_zero_s": one.stop and one.stop._asdict(),
        "to_standstill_s": one.standstill and one.standstill._asdict(),
        "distance_m": one.distance and one.distance._asdict(),
        "clearance_m": one.clearance_m,
        "broken_trials": one.broken,
    }


def story(trial: Trial) -> Iterator[str]:
    """Yield the events of one trial in order of time, one line each."""
    yield f"seed {trial.seed}, {trial.duration_s:g} s, code {trial.revision}, digest {trial.digest}"
    events: list[tuple[float, str]] = []
    for one in trial.faults:
        details = ", ".join(f"{name} {value}" for name, value in one.parameters.items())
        zero = "" if one.to_zero_s is None else f", zero after {1000 * one.to_zero_s:.1f} ms"
        detected = f"detected by {one.detector}" if one.detector else "not detected"
        events.append(
            (one.time_s, f"FAULT {one.fault} ({details}) at {one.speed_m_s:.2f} m/s: {detected}{zero}")
        )
    reasons: tuple[str, ...] | None = None
    for sample in trial.timeline:
        if sample.reasons != reasons:
            reasons = sample.reasons
            moving = f"{sample.true[0]:.2f} m/s, {sample.true[1]:.2f} rad/s"
            events.append((sample.time_s, f"{', '.join(reasons) or 'no stop'}; {moving}"))
    events += [(v.time_s, f"BROKEN {v.promise}: {v.sentence}") for v in trial.violations]
    for time_s, sentence in sorted(events):
        yield f"{time_s:8.3f} s  {printable(sentence)}"
    yield (
        f"smallest clearance {100 * trial.smallest_clearance_m:.1f} cm, contacts {trial.contacts}, "
        f"broken promises {len(trial.violations)}"
    )
