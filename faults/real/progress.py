"""Progress of the real campaign: a bar on a terminal, otherwise a line from time to time."""

import time
from collections.abc import Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

LINE_PERIOD_S = 30.0


class Progressing:
    """Shows the progress; call it for each trial."""

    def __init__(self, console: Console, total: int) -> None:
        self._console, self._total = console, total
        self._number = self._broken = 0
        self._line_s = time.monotonic()
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

    def begin(self, name: str, number: int) -> None:
        """Show that the trial with this number begins."""
        if self._console.is_terminal:
            broken = f"  [red]{self._broken} broken[/]" if self._broken else ""
            self._bar.update(self._task, description=f"{name} {number}{broken}", refresh=True)

    def end(self, *, broken: bool) -> None:
        self._number += 1
        self._broken += broken
        self._bar.update(self._task, advance=1, refresh=self._console.is_terminal)
        if not self._console.is_terminal and time.monotonic() - self._line_s > LINE_PERIOD_S:
            self._line_s = time.monotonic()
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
