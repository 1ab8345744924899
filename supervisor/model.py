"""The words of the law: why it stops, what it is told, what it remembers, what it decides.

Times are seconds of the supervisor's own monotonic clock, velocities m/s and rad/s in the base frame.
What the law remembers is made of named tuples: it takes a new one for each fact, at a third of the cost of a
frozen dataclass.
"""

import math
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import Block, Hull
from supervisor.lidar import LidarProfile
from supervisor.reckoning import STANDSTILL, Odometer, Pose, Velocity
from supervisor.scan import Mount, ScanReading
from wire.freshness import Sent, Track, Verdict


class StopReason(StrEnum):
    """Why the robot stands; the most restrictive first, in the order that the status names them."""

    ESTOP = "ESTOP"
    BASE_RUNAWAY = "BASE_RUNAWAY"
    OVERRUN = "OVERRUN"
    SCAN_INVALID = "SCAN_INVALID"
    SCAN_STALE = "SCAN_STALE"
    SOURCE_LOST = "SOURCE_LOST"
    COMMAND_INVALID = "COMMAND_INVALID"
    COMMAND_STALE = "COMMAND_STALE"
    COMMAND_TIMEOUT = "COMMAND_TIMEOUT"
    NO_COMMAND = "NO_COMMAND"
    SCAN_BLIND = "SCAN_BLIND"
    OBSTACLE = "OBSTACLE"


SEVERITY = {reason: rank for rank, reason in enumerate(StopReason)}

Reasons = frozenset[StopReason]


class Mode(IntEnum):
    """What the robot does; the numbers are SafetyStatus's."""

    STOPPED = 0
    READY = 1
    DRIVING = 2
    LIMITED = 3


@dataclass(frozen=True, slots=True)
class SourceConfig:
    """A command source; the live one of the highest priority that asks for motion owns the wheels."""

    name: str
    priority: int


@dataclass(frozen=True)
class LawConfig:
    """The numbers of the law. `config.py` refuses what makes no sense before one of these exists."""

    sources: tuple[SourceConfig, ...]
    hull: Hull
    mount: Mount
    profile: LidarProfile
    command_timeout_s: float
    scan_timeout_s: float
    overrun_s: float
    stop_distance_m: float
    warning_distance_m: float
    deceleration_m_s2: float
    transport_s: float
    """What the way from a scan to the wheels takes, beside its age and period."""
    creep_m_s: float
    """A motion that the barrier leaves slower than this is not worth moving for."""
    max_linear_m_s: float
    max_angular_rad_s: float
    blind_creep_m_s: float
    """How fast the hull may move to where nobody looks."""
    runaway_linear_m_s: float
    runaway_angular_rad_s: float
    min_beams: int
    min_valid_share: float


# --- what it is told


@dataclass(frozen=True, slots=True)
class Command:
    """A command that arrived from a source."""

    source: str
    velocity: Velocity | None
    """None: undecodable, or with components that a ground robot does not have."""
    arrival_s: float
    sent: Sent | None = None
    """None: the source sends no attachment."""


@dataclass(frozen=True, slots=True)
class Liveliness:
    """A source's token appeared or went."""

    source: str
    alive: bool


@dataclass(frozen=True, slots=True)
class LaserScan:
    """A scan that arrived: sensor_msgs/LaserScan's fields, in its own frame."""

    ranges: npt.NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    arrival_s: float
    sent: Sent | None = None
    """From its attachment, else from its header; None where neither says when it was taken."""
    sent_tolerance_s: float | None = None
    """How unsteady the sender's clock may be; None: as steady as a command's."""
    angle_max: float | None = None
    """What the sender takes for the last beam's angle; None: it does not say."""


@dataclass(frozen=True, slots=True)
class Odometry:
    """What the base says of its own motion."""

    velocity: Velocity
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Inputs:
    """What came since the last step, each kind in order of arrival."""

    commands: tuple[Command, ...] = ()
    liveliness: tuple[Liveliness, ...] = ()
    scan: LaserScan | None = None
    undecodable_scan: bool = False
    odometry: Odometry | None = None
    strangers: tuple[str, ...] = ()
    """Sources outside the configuration that were heard."""
    estop: bool = False
    reset: bool = False
    suspended_s: float = 0.0
    """How long the machine slept since the last step: time that `now_s` does not show."""


# --- what it remembers


class Counts(NamedTuple):
    """Commands of one source, by what became of them."""

    accepted: int = 0
    late: int = 0
    sequence: int = 0
    epoch: int = 0
    invalid: int = 0

    def add(self, verdict: Verdict) -> "Counts":
        if verdict is Verdict.UNPROVEN:
            return self
        if verdict is Verdict.FRESH:
            return Counts(self.accepted + 1, *self[1:])
        return self._replace(**{verdict.value: getattr(self, verdict.value) + 1})


class Source(NamedTuple):
    """One command source, as far as it is known."""

    config: SourceConfig
    track: Track = Track()
    velocity: Velocity | None = None
    """Its last accepted command, clamped to the limits; None before the first."""
    sent_s: float = -math.inf
    """When that command was sent, by our clock: its arrival less its time on the way."""
    neutral_s: float = -math.inf
    """When its last accepted neutral command arrived."""
    refused_s: float = -math.inf
    """When a command of it was last refused as not fresh."""
    stamped: bool = False
    alive: bool | None = None
    """None: it never had a token."""
    invalid: bool = False
    """Its last command was no command."""
    latched: Reasons = frozenset({StopReason.NO_COMMAND})
    """Every stop since it was last neutral. Armed means: none."""
    caused_s: float = -math.inf
    """The last step at which something kept it from driving: only a neutral after that arms."""
    block: Block | None = None
    """What it was driving at when OBSTACLE was latched."""
    counts: Counts = Counts()

    @property
    def armed(self) -> bool:
        return not self.latched

    @property
    def neutral(self) -> bool:
        return self.velocity is None or self.velocity == STANDSTILL


class State(NamedTuple):
    """All that the law remembers between two steps."""

    config: LawConfig
    sources: tuple[Source, ...]
    owner: str = ""
    now_s: float | None = None
    """The last step's time; None before the first."""
    scan: ScanReading | None = None
    scan_track: Track = Track()
    scan_counts: Counts = Counts()
    odometry: Odometry | None = None
    odometer: Odometer = Odometer()
    scan_pose: Pose = Odometer().pose
    """Where the odometer was when the scan was taken in."""
    estop: bool = False
    output: Velocity = STANDSTILL
    stopped_s: float | None = None
    """Since when zero is commanded; None while driving."""
    runaway: bool = False
    strangers: tuple[str, ...] = ()
    resumed_s: float = -math.inf
    """When the machine was last found to have been suspended."""


# --- what it decides


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a reset."""

    success: bool
    message: str


class Decision(NamedTuple):
    """What goes to the wheels now, and everything that explains it."""

    mode: Mode
    output: Velocity
    reasons: tuple[StopReason, ...]
    owner: str
    commanded: Velocity
    scale: float
    nearest_m: float
    nearest_bearing_rad: float
    warning: bool
    alarm: bool
    scan_age_s: float
    scan_problem: str
    scan_counts: Counts
    sources: tuple[Source, ...]
    strangers: tuple[str, ...]
    reset_reply: Reply | None = None
