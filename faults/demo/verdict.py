"""Verdicts on the promises: bound, measurement and outcome."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rich.console import Console
from rich.table import Table
from rich.text import Text

MIN_WIDTH = 110
"""Width of the table in columns if the output is not a terminal."""

MEASURING_S = 0.010
"""Delay that a busy machine may add to a time measured from outside the process."""


class Outcome(StrEnum):
    """Outcome of the check of a promise."""

    KEPT = "kept"
    LATE = "late"
    """Beyond the bound by at most `MEASURING_S`: reported, but not counted as broken."""
    BROKEN = "BROKEN"


COLOURS = {Outcome.KEPT: "green", Outcome.LATE: "yellow", Outcome.BROKEN: "bold red"}


@dataclass(frozen=True, slots=True)
class Verdict:
    """A line of the demo's table."""

    number: int
    """Number of the promise; faults/promises.py lists them."""
    promise: str
    bound: str
    measured: str
    outcome: Outcome


def judged(*, kept: bool) -> Outcome:
    """Return the outcome of a promise that has no time tolerance."""
    return Outcome.KEPT if kept else Outcome.BROKEN


def timed(measured_s: float, bound_s: float) -> Outcome:
    """Return the outcome of a promise about a time."""
    if measured_s <= bound_s:
        return Outcome.KEPT
    return Outcome.LATE if measured_s <= bound_s + MEASURING_S else Outcome.BROKEN


def worst(*outcomes: Outcome) -> Outcome:
    return max(outcomes, key=list(Outcome).index)


def summary(verdicts: Sequence[Verdict]) -> str:
    """Summarize the verdicts in one sentence."""
    counts = {outcome: sum(v.outcome is outcome for v in verdicts) for outcome in Outcome}
    sentence = f"{counts[Outcome.KEPT]} of {len(verdicts)} promises kept"
    if counts[Outcome.LATE]:
        sentence += f", {counts[Outcome.LATE]} late by at most {MEASURING_S * 1000:.0f} ms (a busy machine?)"
    if counts[Outcome.BROKEN]:
        sentence += f", {counts[Outcome.BROKEN]} BROKEN"
    return sentence


def print_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print the verdicts as a table, in order of their numbers."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=MIN_WIDTH)
    table = Table(title="promises and measurements", title_justify="left")
    table.add_column("№", justify="right")
    table.add_column("promise")
    table.add_column("bound")
    table.add_column("measured")
    table.add_column("")
    for verdict in sorted(verdicts, key=lambda v: v.number):
        word = Text(verdict.outcome, style=COLOURS[verdict.outcome])
        table.add_row(str(verdict.number), verdict.promise, verdict.bound, verdict.measured, word)
    console.print(table)
