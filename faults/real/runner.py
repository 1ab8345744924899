"""The real campaign: every class of faults once per round, on real processes.

Each trial's line is written before the next trial begins. An interrupted campaign resumes: a class and seed that the
file contains is not run again.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from rich.console import Console

from deploy.stack.errors import DeployError
from faults.classes import BY_NAME, Group, real_classes
from faults.real.real_faults import planned, why_not
from faults.real.rig.stage import Route, Stage, routes_for
from faults.real.trial_run import complete_trial
from faults.report.figures import class_of, time_in
from faults.report.table import Progressing, print_results
from faults.trial import Trial
from faults.trial_file import appending, known_trials

REVISION = "2"
"""Revision of this campaign; it increases when the meaning of a seed changes."""
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


def keeps_timeline(trial: Trial, before: Iterable[Trial]) -> bool:
    """Return whether a trial keeps its timeline in the file.

    The first trials of a class do, and so do each new longest one and those that broke a promise. This suffices to show
    a typical trial and the worst one, even after thousands of trials.
    """
    name = class_of(trial)
    same = [one for one in before if class_of(one) == name]
    longest_s = max((time_in(one, name) or 0.0 for one in same), default=0.0)
    is_worst = (time_in(trial, name) or 0.0) > longest_s
    return bool(trial.violations) or is_worst or sum(bool(one.timeline) for one in same) < KEPT_TIMELINES


def run(orders: Orders, *, as_json: bool = False) -> int:
    """Run the campaign; return 0 if every promise was kept and every possible class was tried, else 1.

    Raises:
        DeployError: the orders are invalid, or the robot cannot be started.
    """
    names = chosen(orders.classes)
    console = Console(stderr=as_json, highlight=False)
    interrupted: KeyboardInterrupt | None = None
    with appending(orders.out) as append:
        trials, impossible = known_trials(orders.out, "real", REVISION), list[str]()
        if plan := schedule(orders, names, trials):
            console.print("starting supervisord, supervisor, sim and teleop")
            stage = Stage()
            interrupted = stage.run(lambda: _play(stage, orders, plan, trials, impossible, console, append))
    everything = [one for one in trials if class_of(one) in names]
    if as_json or everything:
        print_results(everything, console, as_json=as_json)
    broken = sum(bool(trial.violations) for trial in everything)
    where = f" in {orders.out}" if orders.out is not None else ""
    verdict = f"{broken} with a broken promise" if broken else "every promise was kept"
    console.print(f"{len(everything)} trials{where}: {verdict}", markup=False, soft_wrap=True)
    missing, without = untried(orders, [name for name in names if name not in impossible], everything)
    if missing:
        what = f"no results for {', '.join(without)}" if without else "every class was tried at least once"
        console.print(f"{missing} trials were not run: {what}", soft_wrap=True)
    if interrupted is not None:
        raise interrupted
    return int(bool(without or broken))


def untried(orders: Orders, names: Sequence[str], trials: Iterable[Trial]) -> tuple[int, list[str]]:
    """Return the number of missing trials, and the classes without any trial."""
    wanted = range(orders.seed, orders.seed + orders.trials)
    there = {(class_of(trial), trial.seed) for trial in trials if trial.seed in wanted}
    tried = {name for name, _ in there}
    missing = sum((name, seed) not in there for name in names for seed in wanted)
    return missing, [name for name in names if name not in tried]


async def _play(
    stage: Stage,
    orders: Orders,
    plan: Sequence[tuple[str, int]],
    trials: list[Trial],
    impossible: list[str],
    console: Console,
    append: Callable[[str], None],
) -> None:
    """Run every trial of the plan on one stage.

    Args:
        stage: the open stage.
        orders: the limit of time.
        plan: class and seed of each trial.
        trials: the trials of the file; each new one is added.
        impossible: the classes that cannot be run on this machine are added.
        console: for the progress.
        append: writes a line to the file.
    """
    end_s = math.inf if orders.minutes is None else time.monotonic() + 60.0 * orders.minutes
    for name in dict.fromkeys(name for name, _ in plan):
        if (reason := why_not(name, stage)) is not None:
            impossible.append(name)
            console.print(f"{name} is skipped: {reason}")
    plan = [(name, seed) for name, seed in plan if name not in impossible]
    progress = Progressing(console, len(plan))
    with progress.shown():
        for name, seed in plan:
            if time.monotonic() > end_s:
                break
            progress.begin(name)
            trial = await complete_trial(stage, name, seed, REVISION, progress.say)
            if not keeps_timeline(trial, trials):
                trial = trial.model_copy(update={"timeline": ()})
            trials.append(trial)
            append(trial.line())
            for broken in trial.violations:
                progress.say(f"{name}, seed {seed}: promise {broken.promise}: {broken.sentence}")
            progress.end(broken=bool(trial.violations))
