"""The record of one trial, its timeline, and its line of JSON, which campaigns write and reports read.

A line holds no time of day and no name of a machine: the same seed makes the same line, byte for byte. Where
and when a campaign ran is recorded in a separate line, its provenance, after its trials.
"""

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from deploy.stack.errors import DeployError
from faults.seen import Seen

FORMAT = 1
"""The version of the format; a line of another version is refused. It increases with every incompatible change."""

Seconds = Annotated[float, Field(allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]


EXACTLY = ConfigDict(extra="forbid", strict=True)


class _Record(BaseModel):
    model_config = EXACTLY | ConfigDict(frozen=True)


@dataclass(frozen=True, slots=True, config=EXACTLY)
class BrokenPromise:
    """A broken promise, as a sentence; `promise` is its number."""

    promise: Annotated[int, Field(ge=1, le=8)]
    time_s: Annotated[Seconds, AfterValidator(partial(round, ndigits=4))]
    sentence: str


class Injected(_Record):
    """A fault and the stop that it caused; fields are None if they did not happen or could not be observed."""

    fault: str
    """The name of the fault's class."""
    time_s: Seconds
    """Time since the start of the trial."""
    parameters: dict[str, Number | str] = {}
    detector: str | None = None
    """The first stop reason, or the base's own (`base: SUPERVISOR_LOST`)."""
    speed_m_s: Number = 0.0
    """Speed of the robot at the fault."""
    to_zero_s: Seconds | None = None
    """Time to the first zero on cmd_vel; if the base stops by itself, to its own stop."""
    to_standstill_s: Seconds | None = None
    distance_m: Number | None = None
    """Distance to the standstill."""


class Sample(_Record):
    """One moment of a timeline; velocities are (m/s, rad/s)."""

    time_s: Seconds
    commanded: tuple[Number, Number]
    """The velocity that the owner requests."""
    permitted: tuple[Number, Number]
    """The velocity on cmd_vel."""
    true: tuple[Number, Number]
    """The true velocity of the robot."""
    clearance_m: Number
    reasons: tuple[str, ...] = ()


class Trial(_Record):
    """One trial: the injected faults and their consequences."""

    format: Literal[1] = FORMAT
    mode: Literal["virtual", "real"]
    revision: str
    """The revision of the campaign's code; the same seed gives the same trial only within one revision."""
    seed: int
    duration_s: Seconds
    faults: tuple[Injected, ...]
    """The faults in order of time."""
    smallest_clearance_m: Number
    contacts: int
    """Number of contacts of the hull, whichever side moved."""
    violations: tuple[BrokenPromise, ...] = ()
    digest: str = ""
    """Digest of all observations; equal runs have equal digests."""
    timeline: tuple[Sample, ...] = ()

    def line(self) -> str:
        """Return one line of JSON without the newline; default values are omitted."""
        return self.model_dump_json(exclude_defaults=True)[:-1] + f',"format":{self.format}}}'


class Provenance(_Record):
    """The origin of the preceding trials in a file; fields are empty if unknown."""

    origin: Literal[1] = 1
    command: str = ""
    date: str = ""
    machine: str = ""
    commit: str = ""

    def line(self) -> str:
        """Return one line of JSON without the newline."""
        return self.model_dump_json()


PROVENANCE_BEGINS = '{"origin":'


R = TypeVar("R", Trial, Provenance)


def parse(record: type[R], line: str) -> R:
    """Parse the line of a trial or of a provenance.

    Raises:
        DeployError: the line is no such record of this format.
    """
    try:
        return record.model_validate_json(line)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in fault["loc"]) or "the line"
        what = record.__name__.lower()
        sentence = f"not a {what} of format {FORMAT}: {where}: {fault['msg'].lower()}"
        raise DeployError(sentence) from error


# --- the timeline: velocities over time, as samples for a drawing

PERIOD_S = 0.1
FINE_S = 0.02
STEP_M_S, STEP_RAD_S = 0.03, 0.15
"""In a thinned timeline, a smaller difference from the previous sample does not count as a change."""
ROUNDING_S = 1e-6


def timeline(seen: Seen, period_s: float = PERIOD_S) -> Iterator[Sample]:
    """Yield a sample for each period in which the robot was seen."""
    commands, statuses = iter(seen.commands), iter(seen.statuses)
    command, status = next(commands, None), next(statuses, None)
    permitted, commanded, reasons = (0.0, 0.0), (0.0, 0.0), tuple[str, ...]()
    due_s = 0.0
    for motion in seen.motions:
        while command is not None and command.arrival_s <= motion.time_s:
            permitted = (round(command.linear_m_s, 3), round(command.angular_rad_s, 3))
            command = next(commands, None)
        while status is not None and status.arrival_s <= motion.time_s:
            commanded = (round(status.commanded[0], 3), round(status.commanded[1], 3))
            reasons = status.reasons
            status = next(statuses, None)
        if motion.time_s >= due_s:
            due_s = motion.time_s + period_s - ROUNDING_S
            yield Sample(
                time_s=round(motion.time_s, 3),
                commanded=commanded,
                permitted=permitted,
                true=(round(motion.linear_m_s, 3), round(motion.angular_rad_s, 3)),
                clearance_m=round(motion.clearance_m, 4),
                reasons=reasons,
            )


def thinned(samples: Iterable[Sample], from_s: float, until_s: float) -> Iterator[Sample]:
    """The first and the last sample of a window, and between them those that differ from the one kept before.

    A zero differs from what is none, however small that is.
    """
    within = [sample for sample in samples if from_s <= sample.time_s <= until_s]
    kept: Sample | None = None
    for sample in within:
        if kept is None or sample is within[-1] or _differ(kept, sample):
            kept = sample
            yield sample


def _differ(one: Sample, other: Sample) -> bool:
    if one.reasons != other.reasons or _zeros(one) != _zeros(other):
        return True
    return any(
        abs(a - b) > step
        for was, now in (
            (one.commanded, other.commanded),
            (one.permitted, other.permitted),
            (one.true, other.true),
        )
        for a, b, step in zip(was, now, (STEP_M_S, STEP_RAD_S), strict=True)
    )


def _zeros(one: Sample) -> tuple[bool, ...]:
    return tuple(value == 0.0 for value in (*one.commanded, *one.permitted))
