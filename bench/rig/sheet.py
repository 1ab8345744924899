"""Tables and verdicts of the benchmarks, for the terminal and for documents."""

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, TypeVar

import numpy as np
from pydantic import BeforeValidator
from rich.console import Console

from bench.rig.stored import origin, was_idle
from deploy.stack import table

T = TypeVar("T")
Column = tuple[str, Callable[[T], str]]
"""The title of a column, and a function that returns its cell in the row of a measurement."""


@dataclass(frozen=True)
class Sheet:
    """One table with explanatory notes."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, title: str, columns: Sequence[Column[T]], measured: Iterable[T], *notes: str) -> "Sheet":
        """Return a table with one row for each measurement."""
        titles = tuple(name for name, _ in columns)
        return cls(title, titles, tuple(tuple(cell(one) for _, cell in columns) for one in measured), notes)

    @property
    def markdown(self) -> str:
        """This sheet as a section of a markdown document."""
        table = markdown_table(self.columns, self.rows, others="--:")
        return "\n".join([f"### {self.title}", "", table, "", *(f"* {note}" for note in self.notes)])

    def with_note(self, note: str) -> "Sheet":
        return replace(self, notes=(*self.notes, note))


@dataclass(frozen=True)
class Verdict:
    """One target and its measurement: the ratio to a reference of the same run, what is above it, or a time with the reference beside it."""

    what: str
    measured: float
    target: float
    unit: str

    @property
    def state(self) -> str:
        """Whether the target is met; if not, by how much it is missed, in % of the target."""
        if self.measured <= self.target:
            return "on target"
        return (
            f"OVER TARGET by {100.0 * (self.measured / self.target - 1.0):.2g} %"
            if self.target
            else "OVER TARGET"
        )

    def sentence(self, *, is_judged: bool) -> str:
        state = self.state if is_judged else "not judged"
        return f"{state}: {self.what} {self.measured:.3g} {self.unit}, at most {self.target:.3g} {self.unit}"


def sentences(verdicts: Iterable[Verdict], run: Mapping[str, str]) -> list[str]:
    """Return a sentence for each target; none is judged if the machine was not idle during the run."""
    return [verdict.sentence(is_judged=was_idle(run)) for verdict in verdicts]


def percentile(values: Iterable[float], percent: float) -> float:
    """Return a percentile, interpolated between two values; NaN if there are no values."""
    found = np.fromiter(values, float)
    return float(np.percentile(found, percent)) if found.size else math.nan


Ms = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""A time [ms]; NaN, in a file null, without samples."""


@dataclass(frozen=True)
class Times:
    """Statistics of some times."""

    samples: int
    p50_ms: Ms
    p99_ms: Ms
    max_ms: Ms

    @classmethod
    def of(cls, times_ms: Iterable[float]) -> "Times":
        found = list(times_ms)
        return cls(len(found), *(percentile(found, percent) for percent in (50, 99, 100)))


def show(sheets: Iterable[Sheet], verdicts: Iterable[Verdict], run: Mapping[str, str]) -> None:
    """Print the tables, the targets and the origin of a run."""
    # A pipe has no width; the default width would truncate the tables.
    console = Console() if sys.stdout.isatty() else Console(width=170)
    for sheet in sheets:
        columns = [table.Column(name, right=number > 0) for number, name in enumerate(sheet.columns)]
        page = table.Table(*columns, title=sheet.title)
        for row in sheet.rows:
            page.add_row(*row)
        console.print(page)
    for sentence in sentences(verdicts, run):
        style = {"on": "green", "OVER": "bold red"}.get(sentence.partition(" ")[0], "dim")
        console.print(sentence, style=style, highlight=False)
    console.print(origin(run), style="dim", highlight=False)


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, others: str = "---") -> str:
    """Return a markdown table.

    Args:
        columns: their titles.
        rows: their cells.
        others: how the columns after the first one are aligned: `---` left, `--:` right.
    """
    head = [f"| {' | '.join(columns)} |", f"|{'|'.join(['---'] + [others] * (len(columns) - 1))}|"]
    return "\n".join([*head, *(f"| {' | '.join(row)} |" for row in rows)])
