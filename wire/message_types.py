"""Lifeline's own message types, and the interface of all message types.

They need no codec: a process that passes messages on as bytes, such as `ros2`, imports only these.
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, TypeVar

from wire.ros import Header, Time, Twist, Vector3


class UndecodableError(ValueError):
    """The bytes are not a message of the expected type."""


class Message(Protocol):
    """Any message type of the type store: a dataclass with its ROS type name."""

    __msgtype__: ClassVar[str]


M = TypeVar("M", bound=Message)


def zero_twist() -> Twist:
    return planar_twist(0.0, 0.0)


def planar_twist(linear_m_s: float, angular_rad_s: float) -> Twist:
    """Return a Twist with forward velocity [m/s] and turn rate [rad/s, counter-clockwise], all other components zero."""
    return Twist(Vector3(linear_m_s, 0.0, 0.0), Vector3(0.0, 0.0, angular_rad_s))


@dataclass
class SourceStatus:
    """`lifeline_msgs/msg/SourceStatus`; msg/SourceStatus.msg documents the fields."""

    UNKNOWN: ClassVar[int] = 0
    ALIVE: ClassVar[int] = 1
    LOST: ClassVar[int] = 2

    name: str
    priority: int
    liveliness: int
    armed: bool
    neutral: bool
    stamped: bool
    age_s: float
    reasons: list[str]
    accepted: int
    refused_late: int
    refused_sequence: int
    refused_epoch: int
    refused_invalid: int
    __msgtype__: ClassVar[str] = "lifeline_msgs/msg/SourceStatus"


@dataclass
class EstopLease:
    """`lifeline_msgs/msg/EstopLease`; msg/EstopLease.msg documents the fields."""

    challenge: int
    response: int = 0
    stop: bool = False
    leaves: bool = False
    __msgtype__: ClassVar[str] = "lifeline_msgs/msg/EstopLease"


@dataclass
class EstopStationStatus:
    """`lifeline_msgs/msg/EstopStationStatus`; msg/EstopStationStatus.msg documents the fields."""

    UNHEARD: ClassVar[int] = 0
    HEARD: ClassVar[int] = 1
    LOST: ClassVar[int] = 2
    LEFT: ClassVar[int] = 3

    name: str
    required: bool
    state: int
    pressed: bool
    __msgtype__: ClassVar[str] = "lifeline_msgs/msg/EstopStationStatus"

    @property
    def is_missed(self) -> bool:
        """Whether it should be heard and is not: a station that is not required may be absent, but not be lost."""
        return self.state == self.LOST or (self.required and self.state != self.HEARD)

    def words(self) -> str:
        """Return its state as text: "heard, pressed"."""
        known = {self.UNHEARD: "not heard yet", self.HEARD: "heard", self.LOST: "lost", self.LEFT: "has left"}
        state = known.get(self.state, f"state {self.state}")
        return f"{state}, pressed" if self.pressed and self.state == self.HEARD else state


MODES = ("STOPPED", "READY", "DRIVING", "LIMITED")
"""The modes of SafetyStatus, in the order of their numbers."""


@dataclass
class SafetyStatus:
    """`lifeline_msgs/msg/SafetyStatus`; msg/SafetyStatus.msg documents the fields."""

    STOPPED: ClassVar[int] = 0
    READY: ClassVar[int] = 1
    DRIVING: ClassVar[int] = 2
    LIMITED: ClassVar[int] = 3

    header: Header
    mode: int = STOPPED
    reasons: list[str] = field(default_factory=list[str])
    warning: bool = False
    alarm: bool = False
    owner: str = ""
    commanded: Twist = field(default_factory=zero_twist)
    permitted: Twist = field(default_factory=zero_twist)
    scale: float = 0.0
    nearest_m: float = math.nan
    nearest_bearing_rad: float = math.nan
    scan_age_s: float = math.nan
    scan_problem: str = ""
    scans_accepted: int = 0
    scans_refused: int = 0
    unknown_sources: list[str] = field(default_factory=list[str])
    sources: list[SourceStatus] = field(default_factory=list[SourceStatus])
    causes: list[str] = field(default_factory=list[str])
    latched: list[str] = field(default_factory=list[str])
    detail: str = ""
    estop_record_problem: str = ""
    rmw_zenoh_nodes: list[str] = field(default_factory=list[str])
    estop_stations: list[EstopStationStatus] = field(default_factory=list[EstopStationStatus])
    source_times: list[Time] = field(default_factory=list[Time])
    __msgtype__: ClassVar[str] = "lifeline_msgs/msg/SafetyStatus"

    def causes_and_latched(self) -> tuple[list[str], list[str]]:
        """Return the reasons that hold now, and those that are over but latched.

        An older supervisor does not distinguish them; then all reasons are treated as holding now.
        """
        if self.causes or self.latched:
            return self.causes, self.latched
        return self.reasons, []

    def source(self, name: str) -> SourceStatus | None:
        """Return the status of a source; None if there is none of this name."""
        return next((source for source in self.sources if source.name == name), None)

    def source_time_ns(self, source: str) -> int | None:
        """Return the stamp [ns] of a source's newest command; 0: there is none; None: the status does not report it."""
        times = (
            time for own, time in zip(self.sources, self.source_times, strict=False) if own.name == source
        )
        return next((time.sec * 1_000_000_000 + time.nanosec for time in times), None)

    def why(self) -> str:
        """Return the names of the stop reasons as text, with a mark if over: "SCAN_STALE, OVERRUN (over)"."""
        causes, latched = self.causes_and_latched()
        return ", ".join([*causes, *(f"{name} (over)" for name in latched)])


@dataclass
class TriggerResponse:
    """`std_srvs/srv/Trigger` response: whether the request succeeded, and a sentence for the operator."""

    success: bool
    message: str
    __msgtype__: ClassVar[str] = "std_srvs/srv/Trigger_Response"
