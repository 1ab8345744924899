"""Stored trials of keyboard nodes that drive a ROS 2 robot at 0.5 m/s: docs/campaign/ros2_crash.jsonl, and their table.

The file has a line for each trial, and one after each run that says where and when it was measured. The command of those runs was
replaced by `lifeline grade --ros2`, which injects the same faults into any program.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.rig.sheet import markdown_table
from bench.rig.stored import read_appended
from faults.report.statistics import quantile
from faults.trial import Provenance

LIMIT_S = 5.0
"""Time after the fault until which a robot can still stop; after that, it counts as not stopped."""
KILL, KEEPS = "SIGKILL", "keeps the last command"
"""A fault, and what a robot does when no more commands arrive."""


@dataclass(frozen=True)
class Trial:
    """One fault; all times are from the fault. The file has further fields, which are not read."""

    teleop: str
    """The operator's node."""
    fault: str
    """What happens to this node."""
    robot: str
    """What the robot does when no more commands arrive."""
    lifeline: bool
    zero_s: float | None
    """First zero on the robot's /cmd_vel; None: none within `LIMIT_S`."""
    standstill_s: float | None
    """Until the true speed is below 0.005 m/s; None: not within `LIMIT_S`."""
    distance_m: float
    """True distance until standstill, or within `LIMIT_S`."""


def read(path: Path) -> list[Trial]:
    """Return the trials of a file.

    Raises:
        DeployError: the file cannot be read.
        ValueError: a line is not a trial.
    """
    return read_appended(path, Trial)[0]


def read_origins(path: Path) -> list[Provenance]:
    """Return where and when the trials of a file were measured, in the order of the runs."""
    return sorted(read_appended(path, Trial)[1], key=lambda origin: origin.date)


def markdown(trials: Iterable[Trial]) -> str:
    """Return a table with a row for each case; those without and with Lifeline follow each other."""
    cases: dict[tuple[str, str, str], dict[bool, list[Trial]]] = defaultdict(lambda: defaultdict(list))
    for one in trials:
        cases[one.teleop, one.fault, one.robot][one.lifeline].append(one)
    columns = ("teleop", "fault", "robot", "Lifeline", "n", "stopped")
    columns += ("zero p50", "standstill p50 (max)", "distance p50 (max)")
    rows = (list(_cells(case[lifeline])) for case in cases.values() for lifeline in sorted(case))
    return markdown_table(columns, rows) + "\n"


def _cells(trials: Sequence[Trial]) -> Iterator[str]:
    """Yield the cells of a row; quantiles of times over the trials that have one."""
    case, count, stopped = trials[0], len(trials), sum(one.standstill_s is not None for one in trials)
    yield from (case.teleop, case.fault, case.robot, "yes" if case.lifeline else "no", f"{count}")
    yield "all" if stopped == count else f"{stopped} within {LIMIT_S:g} s"
    zero_s = quantile(_sorted(one.zero_s for one in trials), 0.5)
    yield "none" if math.isnan(zero_s) else f"{zero_s:.3f} s"
    yield _spread(_sorted(one.standstill_s for one in trials), "s")
    # A robot that did not stop counts with its distance in `LIMIT_S`.
    more = "" if stopped == count else "> "
    yield f"{more}{_spread(_sorted(one.distance_m for one in trials), 'm')}"


def _sorted(values: Iterable[float | None]) -> list[float]:
    return sorted(value for value in values if value is not None)


def _spread(values: Sequence[float], unit: str) -> str:
    return f"{quantile(values, 0.5):.2f} ({values[-1]:.2f}) {unit}" if values else "none"
