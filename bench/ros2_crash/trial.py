"""The cases, and the result of one trial. Pure."""

import itertools
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum

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
    try:
        values = json.loads(line)
        return Trial(
            **values
            | {
                "teleop": Teleop(values["teleop"]),
                "fault": Fault(values["fault"]),
                "robot": Robot(values["robot"]),
            }
        )
    except (KeyError, TypeError) as error:
        raise ValueError(f"not a trial of this format: {error}") from error


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
