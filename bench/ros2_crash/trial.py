"""The cases, the trials with their file, and the table.

The file has a line for each trial, and one after each run that says where and when it was measured.
"""

import itertools
import json
import math
from collections import Counter, defaultdict
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import IO

from pydantic import TypeAdapter

from bench.rig.sheet import now
from deploy.stack.errors import DeployError
from faults.report.statistics import quantile
from faults.trial import PROVENANCE_BEGINS, Provenance, parse_provenance
from faults.trial_file import commit, machine, whole_lines

SPEED_M_S = 0.5
LIMIT_S = 5.0
"""Time after the fault until which a robot can still stop; after that, it counts as not stopped."""
BLOCK = 5
"""Number of trials of each case that run before the setup changes."""


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

    @property
    def timeout_s(self) -> float | None:
        return 0.5 if self is Robot.TIMEOUT else None


@dataclass(frozen=True)
class Setup:
    """The processes that consecutive trials share."""

    robot: Robot
    lifeline: bool
    cable: bool


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    teleop: Teleop
    fault: Fault
    robot: Robot
    lifeline: bool

    @property
    def setup(self) -> Setup:
        return Setup(self.robot, self.lifeline, self.fault is Fault.UNPLUG)


@dataclass(frozen=True)
class Trial:
    """One fault of one case; all times from the fault."""

    teleop: Teleop
    fault: Fault
    robot: Robot
    lifeline: bool
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
    program: str = ""
    """The beginning of the SHA-256 of a program that is not in this repository; empty for others."""

    @property
    def case(self) -> Case:
        return Case(self.teleop, self.fault, self.robot, self.lifeline)

    def line(self) -> str:
        """Return one line of JSON without the newline."""
        return json.dumps(asdict(self))


def parse(line: str) -> Trial:
    """Parse a trial's line.

    Raises:
        ValueError: the line is not a trial.
    """
    return TypeAdapter(Trial).validate_json(line)


def cases(teleops: Sequence[Teleop], faults: Sequence[Fault], lifeline: Sequence[bool]) -> list[Case]:
    """Return all combinations, for both robots."""
    return [Case(*one) for one in itertools.product(teleops, faults, Robot, lifeline)]


def missing(wanted: Sequence[Case], count: int, done: Iterable[Trial]) -> list[tuple[Case, int]]:
    """Return the trials that are still to run, with their numbers, in blocks that use the same setup.

    Args:
        wanted: the cases.
        count: the number of trials of each.
        done: the trials that have run.
    """
    so_far = Counter(trial.case for trial in done)
    setups = list(dict.fromkeys(case.setup for case in wanted))
    trials = [(case, number) for number in range(1, count + 1) for case in wanted if number > so_far[case]]
    return sorted(trials, key=lambda one: ((one[1] - 1) // BLOCK, setups.index(one[0].setup)))


def read(path: Path) -> list[Trial]:
    """Return the trials of a file; none if there is no file.

    Raises:
        DeployError: a line is not a trial.
    """
    if not path.exists():
        return []
    try:
        return [
            parse(one) for one in whole_lines(path, "the trials") if not one.startswith(PROVENANCE_BEGINS)
        ]
    except ValueError as error:
        raise DeployError(f"{path}: {error}; choose another --out") from error


def read_origins(path: Path) -> list[Provenance]:
    """Return where and when the trials of a file were measured, in the order of the runs."""
    lines = whole_lines(path, "the trials")
    return sorted(
        (parse_provenance(line) for line in lines if line.startswith(PROVENANCE_BEGINS)), key=lambda o: o.date
    )


@contextmanager
def appending(path: Path) -> Generator[IO[str]]:
    """Open a file to append whole lines; at the end, a line says where and when they were measured."""
    whole = "".join(whole_lines(path, "the trials")) if path.exists() else ""
    path.write_text(whole)
    begun = Provenance(command="python -m bench.ros2_crash", date=now(), machine=machine(), commit=commit())
    with path.open("a") as file:
        try:
            yield file
        finally:
            if file.tell() > len(whole.encode()):
                file.write(begun.line() + "\n")


@dataclass(frozen=True)
class Row:
    """The trials of one case."""

    case: Case
    trials: Sequence[Trial]

    def cells(self) -> Iterator[str]:
        """Yield the cells of the table; quantiles of times over the trials that have one."""
        count, stopped = len(self.trials), sum(one.standstill_s is not None for one in self.trials)
        yield from (self.case.teleop, self.case.fault, self.case.robot, "yes" if self.case.lifeline else "no")
        yield f"{count}"
        yield "all" if stopped == count else f"{stopped} within {LIMIT_S:g} s"
        zero_s = quantile(_sorted(one.zero_s for one in self.trials), 0.5)
        yield "none" if math.isnan(zero_s) else f"{zero_s:.3f} s"
        yield _spread(_sorted(one.standstill_s for one in self.trials), "s")
        # A robot that did not stop counts with its distance in `LIMIT_S`.
        more = "" if stopped == count else "> "
        yield f"{more}{_spread(_sorted(one.distance_m for one in self.trials), 'm')}"


def rows(trials: Iterable[Trial]) -> list[Row]:
    """Return a row for each case; those without and with Lifeline follow each other."""
    by_case: dict[Case, list[Trial]] = defaultdict(list)
    for trial in trials:
        by_case[trial.case].append(trial)
    wanted = cases(list(Teleop), list(Fault), [False, True])
    return [Row(case, by_case[case]) for case in wanted if case in by_case]


def markdown(found: Iterable[Row]) -> str:
    """Return the table as markdown."""
    lines = [
        "| teleop | fault | robot | Lifeline | n | stopped | zero p50 | standstill p50 (max) | distance p50 (max) |",
        "|---|---|---|---|---|---|---|---|---|",
        *(f"| {' | '.join(row.cells())} |" for row in found),
    ]
    return "\n".join(lines) + "\n"


def _sorted(values: Iterable[float | None]) -> list[float]:
    return sorted(value for value in values if value is not None)


def _spread(values: Sequence[float], unit: str) -> str:
    return f"{quantile(values, 0.5):.2f} ({values[-1]:.2f}) {unit}" if values else "none"
