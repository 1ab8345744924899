"""What is seen of a run from outside. Times are seconds of one monotonic clock."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from deploy.stack.samples import Command, is_still


class Status(NamedTuple):
    """What the supervisor said of itself."""

    arrival_s: float
    reasons: tuple[str, ...]
    """Why it stops, most restrictive first; empty: it does not."""
    owner: str = ""
    commanded: tuple[float, float] = (0.0, 0.0)
    """What the owner asks for [m/s, rad/s]."""

    @property
    def is_stopped(self) -> bool:
        return bool(self.reasons)


class Motion(NamedTuple):
    """Where the robot truly is, and how near its hull is to anything."""

    time_s: float
    x_m: float
    y_m: float
    linear_m_s: float
    angular_rad_s: float
    clearance_m: float = math.inf
    """Hull to the nearest thing; at most 0 when it touches."""
    own_approach_m: float = 0.0
    """How much nearer it came since the sample before by its own motion alone: the clearance that the pose
    of before has in the world of now, less the clearance now."""
    is_touching: bool = False
    appeared_m: float = math.inf
    """How far from the hull something was put that was not there at the sample before."""

    @property
    def is_still(self) -> bool:
        return is_still(self.linear_m_s, self.angular_rad_s)


class Asked(NamedTuple):
    """What a source asked for, when it said so."""

    sent_s: float
    source: str
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_neutral(self) -> bool:
        return self.linear_m_s == 0.0 and self.angular_rad_s == 0.0


@dataclass(slots=True)
class Seen:
    """Everything of one run, each list in order of time."""

    commands: list[Command] = field(default_factory=list[Command])
    statuses: list[Status] = field(default_factory=list[Status])
    motions: list[Motion] = field(default_factory=list[Motion])
    asked: list[Asked] = field(default_factory=list[Asked])
    driven: list[tuple[float, bool]] = field(default_factory=list[tuple[float, bool]])
    """Whether the drive is asked for anything but zero, each time that it changed; empty where nobody tells."""
