"""What the trials of the real campaign came to: for each class how often, how soon, how far; the broken promises."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from deploy.campaign.classes import BY_NAME, CLASSES
from deploy.campaign.report.figures import PAIR, Spread, spread
from deploy.campaign.trial import Trial

BROKEN_SHOWN = 20


def class_of(trial: Trial) -> str:
    """The class that a trial was one of."""
    first, *others = trial.faults
    return PAIR if others or PAIR in first.parameters else first.fault


def by_class(trials: Sequence[Trial]) -> dict[str, list[Trial]]:
    """In the order of the table of classes."""
    found: dict[str, list[Trial]] = {one.name: [] for one in CLASSES}
    for trial in trials:
        found[class_of(trial)].append(trial)
    return {name: ones for name, ones in found.items() if ones}


def print_summary(console: Console, trials: Sequence[Trial]) -> None:
    """A table, and every broken promise in a sentence."""
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("fault", no_wrap=True)
    for title in (
        "trials",
        "bound",
        "zero p50",
        "p99",
        "wheels p50",
        "p99",
        "stands after",
        "within",
        "broken",
    ):
        table.add_column(title, justify="right", no_wrap=True)
    for name, ones in by_class(trials).items():
        bound_s = BY_NAME[name].bound_s
        faults = [trial.faults[0] for trial in ones] if name != PAIR else []
        zeros = spread([f.to_zero_s for f in faults if _is_stopped_by_zero(name)])
        wheels = spread([float(f.parameters["to_wheels_s"]) for f in faults if "to_wheels_s" in f.parameters])
        rests = spread([f.to_standstill_s for f in faults])
        ways = spread([f.distance_m for f in faults])
        broken = sum(bool(trial.violations) for trial in ones)
        table.add_row(
            name,
            str(len(ones)),
            "" if bound_s is None else f"{1000 * bound_s:.0f} ms",
            *_ms(zeros),
            *_ms(wheels),
            "" if rests is None else f"{1000 * rests.median:.0f} ms",
            "" if ways is None else f"{100 * ways.median:.1f} cm",
            f"[bold red]{broken}[/]" if broken else "",
        )
    console.print(table)
    for line in broken_sentences(trials)[:BROKEN_SHOWN]:
        console.print(line, style="red", markup=False, highlight=False, soft_wrap=True)


def broken_sentences(trials: Sequence[Trial]) -> list[str]:
    """Which promise, in which trial, how."""
    return [
        f"{class_of(trial)}, seed {trial.seed}, promise {broken.promise}, {broken.time_s:.3f} s: {broken.sentence}"
        for trial in trials
        for broken in trial.violations
    ]


def _is_stopped_by_zero(name: str) -> bool:
    """A supervisor that is gone says no zero: the base's own brakes are the measure."""
    return not name.startswith("supervisor")


def _ms(found: Spread | None) -> tuple[str, str]:
    return ("", "") if found is None else (f"{1000 * found.median:.1f} ms", f"{1000 * found.p99:.1f} ms")
