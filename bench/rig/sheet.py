"""Tables and verdicts of the benchmarks, on the terminal and in markdown."""

import math
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table

MEASURED = ("sim", "supervisor", "teleop", "wire")
"""The measured packages."""

T = TypeVar("T")
Column = tuple[str, Callable[[T], str]]
"""The title of a column, and a function that returns its cell in the row of a measurement."""

_LOAD_BEFORE = os.getloadavg()[0]
"""The machine's load average before the benchmarks."""


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

    def section(self, heading: str) -> list[str]:
        """Return the lines of a section of a document, with a heading such as `##`."""
        table = _table(self.columns, self.rows)
        return [f"{heading} {self.title}", "", *table, "", *(f"* {note}" for note in self.notes)]

    def with_note(self, note: str) -> "Sheet":
        return replace(self, notes=(*self.notes, note))


VERDICT_COLUMNS = ("target", "measured", "at most", "unit", "result")


@dataclass(frozen=True)
class Verdict:
    """One target and its measurement."""

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

    def row(self) -> tuple[str, ...]:
        """Return the cells of a table, as `VERDICT_COLUMNS`."""
        return self.what.rstrip(","), f"{self.measured:.3g}", f"{self.target:.3g}", self.unit, self.state

    def sentence(self) -> str:
        return f"{self.state}: {self.what} {self.measured:.3g} {self.unit}, at most {self.target:.3g} {self.unit}"


def percentile(values: Iterable[float], percent: float) -> float:
    """Return a percentile, interpolated between two values; NaN if there are no values."""
    found = np.fromiter(values, float)
    return float(np.percentile(found, percent)) if found.size else math.nan


def machine() -> str:
    """Describe the machine, without its name."""
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), load average {_LOAD_BEFORE:.1f} before, {platform.system()}, "
        f"Python {platform.python_version()}, numpy {version('numpy')}, eclipse-zenoh {version('eclipse-zenoh')}"
    )


def commit() -> str:
    """Return the measured commit, and the measured packages with local changes."""
    revision = _git("rev-parse", "--short", "HEAD")
    if not revision:
        return "unknown"
    changed = [package for package in MEASURED if _git("status", "--porcelain", "--", package)]
    return f"{revision}, with changes in {', '.join(changed)}" if changed else revision


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], capture_output=True, text=True, check=False, timeout=10)
    except OSError:
        return ""
    return done.stdout.strip()


def show(sheets: Iterable[Sheet], verdicts: Iterable[Verdict]) -> None:
    """Print the tables and verdicts."""
    # A pipe has no width; the default width would truncate the tables.
    console = Console() if sys.stdout.isatty() else Console(width=130)
    for sheet in sheets:
        table = Table(title=sheet.title, title_justify="left", title_style="bold")
        for number, column in enumerate(sheet.columns):
            table.add_column(column, justify="left" if number == 0 else "right")
        for row in sheet.rows:
            table.add_row(*row)
        console.print(table)
    for verdict in verdicts:
        sentence = verdict.sentence()
        console.print(sentence, style="bold red" if sentence.startswith("OVER") else "green", highlight=False)
    console.print(f"{machine()}; commit {commit()}", style="dim", highlight=False)


def write_markdown(
    path: Path, heading: str, command: str, sheets: Iterable[Sheet], verdicts: Iterable[Verdict]
) -> None:
    """Write the markdown document.

    Args:
        path: the file.
        heading: title and introduction.
        command: that wrote the document.
        sheets: its tables.
        verdicts: its targets.
    """
    parts = [
        heading,
        "Written by the command below; do not edit.",
        "",
        f"* command: `{command}`",
        f"* date: {now()}",
        f"* machine: {machine()}",
        f"* commit: {commit()}",
        "",
        "## Targets",
        "",
        *_table(VERDICT_COLUMNS, [verdict.row() for verdict in verdicts]),
    ]
    parts += [line for sheet in sheets for line in ("", *sheet.section("##"))]
    path.write_text("\n".join(parts) + "\n")


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a markdown table."""
    return [
        f"| {' | '.join(columns)} |",
        f"|{'|'.join(['---'] + ['--:'] * (len(columns) - 1))}|",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]


def now() -> str:
    """Return the date and time of day in UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
