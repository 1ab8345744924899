"""The observations of a run from outside. Times are seconds of one monotonic clock."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

STILL_M_S = 0.01
STILL_RAD_S = 0.02
"""Below both speeds, the robot stands."""


class Command(NamedTuple):
    """A sample of `cmd_vel`."""

    arrival_s: float
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_zero(self) -> bool:
        return self.linear_m_s == 0.0 and self.angular_rad_s == 0.0


class Status(NamedTuple):
    """A status of the supervisor."""

    arrival_s: float
    reasons: tuple[str, ...]
    """The stop reasons, most restrictive first; empty if there is no stop."""
    owner: str = ""
    commanded: tuple[float, float] = (0.0, 0.0)
    """The velocity that the owner requests [m/s, rad/s]."""

    @property
    def is_stopped(self) -> bool:
        return bool(self.reasons)


class Motion(NamedTuple):
    """The true pose of the robot and its clearance."""

    time_s: float
    x_m: float
    y_m: float
    linear_m_s: float
    angular_rad_s: float
    clearance_m: float = math.inf
    """Distance from the hull to the nearest object; at most 0 on contact."""
    own_approach_m: float = 0.0
    """How much nearer it came since the sample before by its own motion alone: the clearance that the pose
    of before has in the world of now, less the clearance now."""
    is_touching: bool = False
    appeared_m: float = math.inf
    """Distance from the hull to an object that was placed since the previous sample."""

    @property
    def is_still(self) -> bool:
        return abs(self.linear_m_s) < STILL_M_S and abs(self.angular_rad_s) < STILL_RAD_S


class Asked(NamedTuple):
    """A request of a source, with its time."""

    sent_s: float
    source: str
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_neutral(self) -> bool:
        return self.linear_m_s == 0.0 and self.angular_rad_s == 0.0


@dataclass(slots=True)
class Seen:
    """All observations of one run, each list in order of time."""

    commands: list[Command] = field(default_factory=list[Command])
    statuses: list[Status] = field(default_factory=list[Status])
    motions: list[Motion] = field(default_factory=list[Motion])
    asked: list[Asked] = field(default_factory=list[Asked])
    driven: list[tuple[float, bool]] = field(default_factory=list[tuple[float, bool]])
    """Whether the drive's target is not zero, at each change; empty if it was not observed."""
