"""Stored trials of keyboard nodes that drive a ROS 2 robot at 0.5 m/s: docs/campaign/ros2_crash.jsonl, and their table.

The file has a line for each trial, and one after each run that says where and when it was measured. The command of those runs was
replaced by `lifeline grade --ros2`, which injects the same faults into any program.
"""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from bench.rig.sheet import markdown_table
from bench.rig.stored import read_appended
from faults.report.statistics import quantile
from faults.trial import Provenance

LIMIT_S = 5.0
"""Time after the fault until which a robot can still stop; after that, it counts as not stopped."""


class Teleop(StrEnum):
    """The operator's node."""

    LAB = "lab_teleop"
    KEYBOARD = "teleop_twist_keyboard"


class Fault(StrEnum):
    """What happens to the operator's node."""

    KILL = "SIGKILL"
    STOP = "SIGSTOP"
    UNPLUG = "unplug"


class Robot(StrEnum):
    """What the robot does when no more commands arrive."""

    KEEPS = "keeps the last command"
    TIMEOUT = "stops after 0.5 s"


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    teleop: Teleop
    fault: Fault
    robot: Robot
    lifeline: bool


@dataclass(frozen=True)
class Trial(Case):
    """One fault of one case; all times from the fault."""

    number: int
    """Number of the trial in its case, from 1."""
    speed_m_s: float
    """True speed at the fault."""
    zero_s: float | None
    """First zero on the robot's /cmd_vel; None: none within `LIMIT_S`."""
    standstill_s: float | None
    """Until the true speed is below 0.005 m/s; None: not within `LIMIT_S`."""
    distance_m: float
    """True distance until standstill, or within `LIMIT_S`."""

    @property
    def case(self) -> Case:
        return Case(self.teleop, self.fault, self.robot, self.lifeline)


def cases(teleops: Iterable[Teleop], faults: Iterable[Fault]) -> list[Case]:
    """Return all combinations, for both robots, without and with Lifeline."""
    return [Case(*one) for one in itertools.product(teleops, faults, Robot, (False, True))]


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
    by_case: dict[Case, list[Trial]] = defaultdict(list)
    for trial in trials:
        by_case[trial.case].append(trial)
    columns = ("teleop", "fault", "robot", "Lifeline", "n", "stopped")
    columns += ("zero p50", "standstill p50 (max)", "distance p50 (max)")
    rows = (list(_cells(case, by_case[case])) for case in cases(Teleop, Fault) if case in by_case)
    return "\n".join(markdown_table(columns, rows)) + "\n"


def _cells(case: Case, trials: Sequence[Trial]) -> Iterator[str]:
    """Yield the cells of a row; quantiles of times over the trials that have one."""
    count, stopped = len(trials), sum(one.standstill_s is not None for one in trials)
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
