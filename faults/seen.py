"""The observations of a run from outside. Times are seconds of one monotonic clock."""

from dataclasses import dataclass, field
from typing import NamedTuple

from recordings.incidents.braking import Motion
from wire.message_types import SafetyStatus
from wire.ros import Twist


class Command(NamedTuple):
    """A sample of `cmd_vel`."""

    arrival_s: float
    linear_m_s: float
    angular_rad_s: float

    @classmethod
    def of(cls, arrival_s: float, twist: Twist) -> "Command":
        return cls(arrival_s, twist.linear.x, twist.angular.z)

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

    @classmethod
    def of(cls, arrival_s: float, status: SafetyStatus) -> "Status":
        commanded = (status.commanded.linear.x, status.commanded.angular.z)
        return cls(arrival_s, tuple(status.reasons), status.owner, commanded)

    @property
    def is_stopped(self) -> bool:
        return bool(self.reasons)


class Asked(NamedTuple):
    """A request of a source, with its time."""

    sent_s: float
    source: str
    linear_m_s: float
    angular_rad_s: float

    @classmethod
    def of(cls, sent_s: float, source: str, twist: Twist) -> "Asked":
        return cls(sent_s, source, twist.linear.x, twist.angular.z)

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
