"""The real campaign: every class of faults once per round, on real processes.

Each trial's line is written before the next trial begins. An interrupted campaign resumes: a class and seed that the
file contains is not run again.
"""

import itertools
import json
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from deploy.stack.errors import DeployError
from faults.classes import BY_NAME, Group, real_classes
from faults.real.real_faults import planned, why_not
from faults.real.rig.stage import Route, Stage, routes_for
from faults.real.trial_run import complete_trial
from faults.report.figures import class_of, time_in
from faults.report.table import print_results, results
from faults.trial import Trial
from faults.trial_file import appending, known_trials

REVISION = "2"
"""Revision of this campaign; it increases when the meaning of a seed changes."""
LINE_PERIOD_S = 30.0
"""Time between two lines of progress, if the output is no terminal."""
KEPT_TIMELINES = 4
"""Number of trials of a class that always keep their timeline, to show a typical one."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What to run.

    Attributes:
        trials: number of trials of each class.
        classes: names of the classes; empty: all.
        seed: seed of each class's first trial; it increases by one for each further trial.
        out: the file; None: keep no results.
        minutes: start no trial after this time, even within a round; None: no limit.
    """

    trials: int
    classes: tuple[str, ...] = ()
    seed: int = 0
    out: Path | None = None
    minutes: float | None = None


def chosen(classes: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the selected classes; a name that ends with `*` selects by prefix.

    Raises:
        DeployError: a name selects no class.
    """
    known = [one.name for one in real_classes()]
    if not classes:
        return tuple(known)
    found: dict[str, None] = {}
    for wanted in classes:
        matching = [
            name for name in known if name == wanted or (wanted[-1:] == "*" and name.startswith(wanted[:-1]))
        ]
        if not matching:
            raise DeployError(f"there is no class {wanted!r} of faults; there are {', '.join(known)}")
        found.update(dict.fromkeys(matching))
    return tuple(found)


def schedule(orders: Orders, names: Sequence[str], there: Sequence[Trial]) -> list[tuple[str, int]]:
    """Return class and seed of each remaining trial, in a different random order for each round.

    Within a round, trials with the same routes to the hub are grouped, because a change of route restarts a process.
    """
    done = {(class_of(trial), trial.seed) for trial in there}
    found: list[tuple[str, int]] = []
    for number in range(orders.trials):
        seed = orders.seed + number
        chance = Random(f"{seed} round")  # noqa: S311 - to be repeated is what it is for
        turn = [(name, seed) for name in names if (name, seed) not in done]
        chance.shuffle(turn)
        turn.sort(key=lambda one: _place(*one), reverse=number % 2 == 1)
        found += turn
    return found


def _place(name: str, seed: int) -> tuple[int, int]:
    teleop, sim = routes_for([one for one, _ in planned(name, seed)])
    order = list(Route)
    return len(order) * order.index(sim) + order.index(teleop), int(BY_NAME[name].group is Group.SUPERVISORD)


class Made:
    """The results of a campaign so far; decides which trials keep their timeline.

    Args:
        there: the earlier trials in the file.

    Attributes:
        trials: the trials of this run.
        impossible: classes that cannot be run on this machine.
    """

    def __init__(self, there: Iterable[Trial]) -> None:
        self.trials: list[Trial] = []
        self.impossible: list[str] = []
        self._timelines: Counter[str] = Counter()
        self._longest_s: dict[str, float] = {}
        for trial in there:
            self._count(trial)

    def add(self, trial: Trial) -> Trial:
        """Add a trial; return it as it is written to the file.

        The first trials of a class keep their timeline, and so do each new longest one and those that broke a promise.
        This suffices to show a typical trial and the worst one, even after thousands of trials.
        """
        name = class_of(trial)
        is_worst = (time_in(trial, name) or 0.0) > self._longest_s.get(name, 0.0)
        if self._timelines[name] >= KEPT_TIMELINES and not is_worst and not trial.violations:
            trial = trial.model_copy(update={"timeline": ()})
        self._count(trial)
        self.trials.append(trial)
        return trial

    def _count(self, trial: Trial) -> None:
        name = class_of(trial)
        self._timelines[name] += bool(trial.timeline)
        self._longest_s[name] = max(self._longest_s.get(name, 0.0), time_in(trial, name) or 0.0)


def run(orders: Orders, *, as_json: bool = False) -> int:
    """Run the campaign; return 0 if every promise was kept and every possible class was tried, else 1.

    Raises:
        DeployError: the orders are invalid, or the robot cannot be started.
    """
    names = chosen(orders.classes)
    console = Console(stderr=as_json)
    with appending(orders.out) as append:
        there = known_trials(orders.out, "real", REVISION)
        plan = schedule(orders, names, there)
        made = Made(there)
        interrupted = _run_plan(orders, plan, made, console, append) if plan else None
    wanted = set(names)
    everything = [*(one for one in there if class_of(one) in wanted), *made.trials]
    if as_json:
        print(json.dumps(results(everything), indent=2), flush=True)
    elif everything:
        print_results(everything, console)
    _say_what_became(console, orders, everything)
    missing, without = untried(orders, [name for name in names if name not in made.impossible], everything)
    _say_what_is_missing(console, missing, without)
    if interrupted is not None:
        raise interrupted
    return int(bool(without) or any(trial.violations for trial in everything))


def _say_what_became(console: Console, orders: Orders, trials: Sequence[Trial]) -> None:
    broken = sum(bool(trial.violations) for trial in trials)
    where = f" in {orders.out}" if orders.out is not None else ""
    console.print(
        f"{len(trials)} trials{where}: "
        + (f"{broken} with a broken promise" if broken else "every promise was kept"),
        highlight=False,
        markup=False,
        soft_wrap=True,
    )


def untried(orders: Orders, names: Sequence[str], trials: Iterable[Trial]) -> tuple[int, list[str]]:
    """Return the number of missing trials, and the classes without any trial."""
    wanted = range(orders.seed, orders.seed + orders.trials)
    there = {(class_of(trial), trial.seed) for trial in trials if trial.seed in wanted}
    tried = {name for name, _ in there}
    missing = sum((name, seed) not in there for name in names for seed in wanted)
    return missing, [name for name in names if name not in tried]


def _say_what_is_missing(console: Console, missing: int, without: Sequence[str]) -> None:
    what = f"no results for {', '.join(without)}" if without else "every class was tried at least once"
    if missing:
        console.print(f"{missing} trials were not run: {what}", highlight=False, soft_wrap=True)


def _run_plan(
    orders: Orders,
    plan: Sequence[tuple[str, int]],
    made: Made,
    console: Console,
    append: Callable[[str], None],
) -> KeyboardInterrupt | None:
    """Run every trial of the plan on one stage; return the interrupt that ended it early, if any."""
    console.print("starting supervisord, supervisor, sim and teleop")
    stage = Stage()
    return stage.run(lambda: _play(stage, orders, plan, made, console, append))


async def _play(
    stage: Stage,
    orders: Orders,
    plan: Sequence[tuple[str, int]],
    made: Made,
    console: Console,
    append: Callable[[str], None],
) -> None:
    end_s = None if orders.minutes is None else time.monotonic() + 60.0 * orders.minutes
    made.impossible = _what_cannot_be(stage, dict.fromkeys(name for name, _ in plan), console)
    plan = [(name, seed) for name, seed in plan if name not in made.impossible]
    counts = itertools.count(1)
    progress = Progressing(console, len(plan))
    with progress.shown():
        for name, seed in plan:
            if end_s is not None and time.monotonic() > end_s:
                break
            progress.begin(name, next(counts))
            trial = made.add(await complete_trial(stage, name, seed, REVISION, progress.say))
            append(trial.line())
            for broken in trial.violations:
                progress.say(f"{name}, seed {seed}: promise {broken.promise}: {broken.sentence}")
            progress.end(broken=bool(trial.violations))


def _what_cannot_be(stage: Stage, names: Iterable[str], console: Console) -> list[str]:
    """Return the classes that cannot be run on this machine."""
    found: list[str] = []
    for name in names:
        if (reason := why_not(name, stage)) is not None:
            found.append(name)
            console.print(f"{name} is skipped: {reason}", highlight=False)
    return found


class Progressing:
    """Shows progress: a bar on a terminal, otherwise a line every `LINE_PERIOD_S`; call it for each trial."""

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
