"""The seconds around a stop from a black box: a time series, and how the robot came to rest. Pure.

The figures are those of the fault campaign, with odometry in place of the true motion. Their names are those of
SafetyStatus and of the campaign's records.
"""

import math
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

from deploy.stack.formatting import number
from recordings.incidents.braking import Braking, Motion, braking
from recordings.incidents.incident import IncidentError, damage_of, id_of
from supervisor.blackbox.reader import Act, BlackBoxError, BlackBoxReader, Step, Stop
from supervisor.law.decision import Decision
from supervisor.law.reckoning import Odometer, Pose, Velocity, reckon, where
from supervisor.messages import to_status
from wire.message_types import MODES
from wire.text import printable

BEFORE_S = 1.0
"""Time before the stop in which the last odometry must have arrived."""
MAX_STEPS = 100_000
"""Steps that are kept in memory, with 200 bytes each; a black box of a minute has 3,000 to 9,000."""


class Sample(NamedTuple):
    """One step of the law; velocities are in the base frame."""

    time_s: float
    """Time since the first stop."""
    mode: str
    why: str
    """The stop reasons, and those that limit the motion; see SafetyStatus."""
    owner: str
    """The command source whose commands are executed."""
    commanded: Velocity
    """The velocity that the owner requests, clamped to the limits."""
    permitted: Velocity
    """The velocity on cmd_vel."""
    measured: Velocity | None
    """The last velocity of odometry; None before the first."""
    nearest_m: float
    """Distance from the hull to the nearest point; NaN if unknown."""
    nearest_bearing_rad: float
    detail: str
    """Details of the first cause."""

    @property
    def velocities(self) -> tuple[Velocity, Velocity, Velocity | None]:
        """The commanded, permitted and measured velocities."""
        return self.commanded, self.permitted, self.measured

    def to_json(self) -> dict[str, Any]:
        return {
            "time_s": number(self.time_s),
            "mode": self.mode,
            "why": printable(self.why),
            "owner": printable(self.owner),
            "commanded": [number(value) for value in self.commanded],
            "permitted": [number(value) for value in self.permitted],
            "measured": None if self.measured is None else [number(value) for value in self.measured],
            "nearest_m": number(self.nearest_m),
        }


@dataclass(frozen=True, slots=True)
class Incident:
    """A black box: its stops, and the steps around them."""

    path: Path
    stops: tuple[Stop, ...]
    samples: tuple[Sample, ...]
    """In order; from a time before the first stop to the end of the file."""
    stop_distance_m: float
    braking: Braking | None
    """None if the robot did not move at the first stop, did not come to rest, or has no odometry."""
    acts: tuple[Act, ...]
    """What people did until the file was written, in order of time."""
    left_out: int
    """Number of older steps that were left out for lack of space."""
    problem: str
    """Why a part of the file cannot be read; empty if it is complete."""

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons of all stops, in order of time."""
        return tuple(dict.fromkeys(printable(reason) for stop in self.stops for reason in stop.reasons))

    @property
    def at_stop(self) -> Sample | None:
        """The step of the first stop; None if it cannot be read."""
        return next((sample for sample in self.samples if sample.time_s >= 0.0), None)

    @property
    def velocity(self) -> Velocity | None:
        """The last velocity of odometry before the first stop."""
        before = [*takewhile(lambda sample: sample.time_s <= 0.0, self.samples)]
        return before[-1].measured if before else None

    def to_json(self) -> dict[str, Any]:
        """Return the summary; a value is None if it is unknown."""
        at, velocity, rest = self.at_stop, self.velocity, self.braking
        return {
            "id": id_of(self.path),
            "file": str(self.path),
            "utc": f"{self.stops[0].utc}Z",
            "reasons": list(self.reasons),
            "stops": [
                {
                    "time_s": number(stop.now_s - self.stops[0].now_s),
                    "reasons": [printable(reason) for reason in stop.reasons],
                }
                for stop in self.stops
            ],
            "owner": None if at is None else printable(at.owner),
            "speed_m_s": None if velocity is None else number(abs(velocity.linear_m_s)),
            "angular_rad_s": None if velocity is None else number(velocity.angular_rad_s),
            "to_standstill_s": None if rest is None else number(rest.to_standstill_s),
            "distance_m": None if rest is None else number(rest.distance_m),
            "nearest_m": None if at is None else number(at.nearest_m),
            "nearest_bearing_rad": None if at is None else number(at.nearest_bearing_rad),
            "detail": None if at is None else printable(at.detail),
            "people": [{name: printable(text) for name, text in act._asdict().items()} for act in self.acts],
            "problem": printable(self.problem) or None,
        }


def read_incident(path: Path, before_s: float = BEFORE_S) -> Incident:
    """Read the steps from `before_s` before the first stop to the end of the file.

    Raises:
        IncidentError: not even the header can be read, or the file has more steps than fit into memory.
    """
    with damage_of(path):
        reader = BlackBoxReader(path)
        law = reader.law
        stop_s = reader.stops[0].now_s
        samples: list[Sample] = []
        motion = _Motion(stop_s, law.believable)
        problem = ""
        try:
            for step in reader.steps(stop_s - max(before_s, BEFORE_S)):
                if len(samples) == MAX_STEPS:
                    raise IncidentError(f"{path} has more than {MAX_STEPS:,} steps: choose a shorter time")
                motion.follow(step)
                samples.append(sample_of(step.now_s - stop_s, step.decision, motion.velocity))
        except BlackBoxError as error:
            problem = str(error)
        shown = tuple(sample for sample in samples if sample.time_s >= -before_s)
        return Incident(
            path,
            reader.stops,
            shown,
            law.stop_distance_m,
            motion.braking(),
            reader.acts,
            reader.left_out,
            problem,
        )


class _Motion:
    """The motion of the base by its odometry; times are relative to the first stop."""

    def __init__(self, stop_s: float, fastest: Velocity) -> None:
        self._stop_s = stop_s
        self._fastest = fastest
        self._odometer = Odometer()
        self._motions: list[Motion] = []
        self._at_stop: Motion | None = None
        self.velocity: Velocity | None = None
        """The last measured velocity; None before the first."""

    def follow(self, step: Step) -> None:
        """Add the odometry of a step."""
        sample = step.inputs.odometry
        if sample is not None:
            self._odometer = reckon(self._odometer, sample.velocity, sample.arrival_s, self._fastest)
            self.velocity = sample.velocity
            self._add(sample.arrival_s, self._odometer.pose, sample.velocity)
        if self._at_stop is None and self.velocity is not None and step.now_s >= self._stop_s:
            self._at_stop = self._add(self._stop_s, where(self._odometer, self._stop_s), self.velocity)

    def braking(self) -> Braking | None:
        """Return time and distance from the stop to the standstill."""
        if self._at_stop is None or self._at_stop.is_still:
            return None
        return braking(self._motions, math.nextafter(0.0, 1.0))

    def _add(self, time_s: float, pose: Pose, velocity: Velocity) -> Motion:
        motion = Motion(time_s - self._stop_s, pose.x_m, pose.y_m, *velocity)
        self._motions.append(motion)
        return motion


def sample_of(time_s: float, decision: Decision, measured: Velocity | None) -> Sample:
    """Return the sample of a step at a time since the first stop, with the last velocity of odometry."""
    return Sample(
        time_s,
        MODES[decision.mode],
        to_status(decision, time_s).why(),
        decision.owner,
        decision.commanded,
        decision.output,
        measured,
        decision.nearest_m,
        decision.nearest_bearing_rad,
        decision.detail,
    )
