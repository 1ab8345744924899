"""The types of the law: configuration, inputs, state and decision.

Times are seconds of the supervisor's own monotonic clock, velocities m/s and rad/s in the base frame.
The state consists of named tuples, because the law replaces them often: they cost a third of a frozen dataclass.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

from supervisor.law.base_braking import UNMEASURED, Braking
from supervisor.law.base_motion import FOLLOWING, Following
from supervisor.law.clearance import NO_POINTS, Block, Floats, Hull, Surroundings
from supervisor.law.estop_stations import Presence, Station, StationConfig, Stations, TokenEnd
from supervisor.law.near_memory import Remembered
from supervisor.law.reckoning import STANDSTILL, Odometer, Pose, Velocity
from supervisor.law.scan import LaserScan, Lidar, ScanReading, View
from wire.freshness import Sent, Track, Verdict
from wire.reasons import Limit, StopReason

Reasons = frozenset[StopReason]


class Mode(IntEnum):
    """Mode of the robot; the numbers are those of SafetyStatus."""

    STOPPED = 0
    READY = 1
    DRIVING = 2
    LIMITED = 3


RESIDUAL_M_S = 0.05


@dataclass(frozen=True, slots=True)
class SourceConfig:
    """Configuration of a command source; of the live sources that request motion, the highest priority owns the wheels."""

    name: str
    priority: int


@dataclass(frozen=True)
class LawConfig:
    """The configuration of the law; `config.py` checks all values before it is created."""

    sources: tuple[SourceConfig, ...]
    hull: Hull
    lidars: tuple[Lidar, ...]
    """At least one."""
    command_timeout_s: float
    overrun_s: float
    stop_distance_m: float
    warning_distance_m: float
    deceleration_m_s2: float
    transport_s: float
    """Part of the reaction time in addition to a scan's age and period: transport and one tick."""
    creep_m_s: float
    """Minimum useful speed: if the barrier permits less, the output is zero."""
    max_linear_m_s: float
    max_angular_rad_s: float
    blind_creep_m_s: float
    """Closing speed of the hull that is always permitted toward a hidden place."""
    runaway_linear_m_s: float
    runaway_angular_rad_s: float
    smallest_obstacle_m: float
    """Diameter of the smallest obstacle that must be detected."""
    unseen_memory_s: float
    """How long a place counts as free after it was seen free."""
    works_in_the_open: bool
    """Whether to accept scans of a lidar that has not had any return since the start."""
    odometry: bool
    """Whether the base publishes odometry; if not, the law uses its own commands."""
    odom_timeout_s: float
    base_acceleration_m_s2: float
    """Least acceleration of the base toward its command."""
    base_angular_acceleration_rad_s2: float
    blind_budget_m: float = math.inf
    """How far the base may drive on a command that is not renewed; infinite in recordings that do not have it."""
    estop_stations: tuple[StationConfig, ...] = ()
    base_dead_time_s: float = 0.0
    """How long the base keeps its speed after a command; part of the reaction time."""
    base_timeout_s: float = 0.0
    """How long the base drives on without a command; zero in recordings that do not have it."""
    shown_m_s2: float = math.inf
    """Deceleration that the base has shown in its last stops; infinite before the first. No setting: the law measures it."""

    @property
    def braking_m_s2(self) -> float:
        """Deceleration that the law trusts: the worse of the configured and the measured one."""
        return min(self.deceleration_m_s2, self.shown_m_s2)

    @cached_property
    def reach_m(self) -> float:
        """Distance from the hull beyond which a point limits no motion, at any permitted age of its scan."""
        fastest_m_s = self.max_linear_m_s + self.max_angular_rad_s * self.hull.radius_m
        oldest_s = max(lidar.timeout_s for lidar in self.lidars)
        reaction_s = oldest_s + max(oldest_s, self.base_timeout_s) + self.transport_s + self.base_dead_time_s
        braking_m = fastest_m_s * fastest_m_s / (2.0 * self.braking_m_s2)
        return self.stop_distance_m + fastest_m_s * reaction_s + braking_m + 0.05

    @cached_property
    def longest_timeout_s(self) -> float:
        """Longest timeout of commands and scans: older ones are not used."""
        return max(self.command_timeout_s, *(lidar.timeout_s for lidar in self.lidars))

    @cached_property
    def believable(self) -> Velocity:
        """Fastest plausible velocity; faster odometry is a spike."""
        return Velocity(2.0 * self.max_linear_m_s, 2.0 * self.max_angular_rad_s)

    @cached_property
    def slowest(self) -> Velocity:
        """The least acceleration of the base [m/s², rad/s²]."""
        return Velocity(self.base_acceleration_m_s2, self.base_angular_acceleration_rad_s2)

    @cached_property
    def trusted(self) -> Velocity:
        """The trusted deceleration of the base [m/s², rad/s²], as the barrier uses it."""
        return Velocity(self.braking_m_s2, self.braking_m_s2 / self.hull.radius_m)

    @cached_property
    def residual(self) -> Velocity:
        """Noise of odometry [m/s, rad/s]: a slower base counts as standing still."""
        return Velocity(RESIDUAL_M_S, RESIDUAL_M_S / self.hull.radius_m)


# --- inputs


@dataclass(frozen=True, slots=True)
class Command:
    """A received command of a source."""

    source: str
    velocity: Velocity | None
    """None if undecodable, or with components that a ground robot does not have."""
    arrival_s: float
    sent: Sent | None = None
    """None if the source sends no attachment."""


@dataclass(frozen=True, slots=True)
class Liveliness:
    """A source's liveliness token appeared or disappeared."""

    source: str
    alive: bool
    epoch: bytes = b""
    """Of the token of one run of the source; empty for the source's token, which other clients may hold too."""


@dataclass(frozen=True, slots=True)
class Odometry:
    """The base's velocity by its own measurement."""

    velocity: Velocity
    arrival_s: float
    writer: bytes = b""
    """Identity of the sender: the gid of the attachment, else the frame id."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything received since the last step, each kind in order of arrival."""

    commands: tuple[Command, ...] = ()
    liveliness: tuple[Liveliness, ...] = ()
    scans: tuple[LaserScan, ...] = ()
    undecodable_lidars: tuple[int, ...] = ()
    """Indices of the lidars from which an undecodable message arrived."""
    odometry: Odometry | None = None
    """The newest sample."""
    odometry_writers: tuple[bytes, ...] = ()
    """Senders of all odometry samples."""
    strangers: tuple[str, ...] = ()
    """Sources that sent commands but are not configured."""
    estop: bool = False
    estop_unrecorded: bool = False
    """Whether an e-stop, or the reset of one, is not proven to outlive the supervisor."""
    presences: tuple[Presence, ...] = ()
    """Messages of the e-stop stations."""
    station_ends: tuple[TokenEnd, ...] = ()
    station_challenge: int = 0
    """Random number that is sent to the e-stop stations after this step; 0: none."""
    reset: bool = False
    suspended_s: float = 0.0
    """How long the machine was suspended since the last step; `now_s` does not include this time."""


# --- state


class Counts(NamedTuple):
    """Numbers of a source's commands, or of a lidar's scans, by verdict."""

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
    """State of one command source."""

    config: SourceConfig
    track: Track = Track()
    velocity: Velocity | None = None
    """Its last accepted command, clamped to the limits; None before the first, and after the source left while neutral."""
    sent_s: float = -math.inf
    """When that command was sent, by the local clock: arrival time minus transport time."""
    neutral_s: float = -math.inf
    """When its last accepted neutral command was sent, as `sent_s`: one that waited for this process came before the stop ended."""
    refused_s: float = -math.inf
    """When one of its commands was last refused as not fresh."""
    stamped: bool = False
    alive: bool | None = None
    """Whether its liveliness token exists; None if it never had one."""
    lost: bool = False
    """Whether the token of the run whose commands arrived last was deleted, and is not back."""
    invalid: bool = False
    """Whether its last command was invalid."""
    latched: Reasons = frozenset({StopReason.NO_COMMAND})
    """Latched stop reasons; the source is armed if there are none."""
    caused_s: float = -math.inf
    """Time of the last step at which a cause prevented it from driving; only a later neutral arms it."""
    block: Block | None = None
    """The point that it was approaching when the barrier latched a stop."""
    counts: Counts = Counts()

    @property
    def armed(self) -> bool:
        return not self.latched

    @property
    def neutral(self) -> bool:
        return self.velocity is None or self.velocity == STANDSTILL


class Writer(NamedTuple):
    """A writer on one sensor's key, with the times at which it was last heard and heard before that."""

    gid: bytes
    heard_s: float
    before_s: float = -math.inf


class Past(NamedTuple):
    """A recent view of one lidar, for places that are no longer in view."""

    lidar: str
    view: View


class Sight(NamedTuple):
    """State of one lidar."""

    scan: ScanReading | None = None
    track: Track = Track()
    counts: Counts = Counts()
    writers: tuple[Writer, ...] = ()
    earlier: Floats = NO_POINTS
    """(n, 2) [m]: near points of the scans before the newest, in the newest scan's base frame; it may show them again."""


class Place(NamedTuple):
    """Points that do not belong to a single scan, and the odometer pose that is their frame."""

    pose: Pose
    around: Surroundings


class State(NamedTuple):
    """Everything that the law remembers between two steps."""

    config: LawConfig
    sources: tuple[Source, ...]
    owner: str = ""
    now_s: float | None = None
    """The last step's time; None before the first."""
    sights: tuple[Sight, ...] = ()
    """One for each configured lidar."""
    memory: Remembered = Remembered()
    """Near points of earlier scans."""
    memory_pose: Pose = Odometer().pose
    """The odometer pose that is the frame of `memory`."""
    past: tuple[Past, ...] = ()
    """Views of the last `unseen_memory_s`."""
    places: tuple[Place, ...] = ()
    """The remembered points and the hidden places."""
    looking: tuple[int, ...] = ()
    """Indices of the lidars from whose scans the hidden places were computed."""
    odometry: Odometry | None = None
    odometry_writers: tuple[Writer, ...] = ()
    odometer: Odometer = Odometer()
    odometers: tuple[Odometer, ...] = ()
    """Recent odometers, for the robot's pose at the time a scan was taken."""
    way_m: float = 0.0
    """Upper bound of the distance that any point of the hull has moved, measured or commanded."""
    following: Following = FOLLOWING
    braking: Braking = UNMEASURED
    estop: bool = False
    output: Velocity = STANDSTILL
    stopped_s: float | None = None
    """Since when zero has been commanded; None while driving."""
    runaway: bool = False
    strangers: tuple[str, ...] = ()
    resumed_s: float = -math.inf
    """When a suspend of the machine was last detected."""
    stations: Stations = Stations()
    """The leases of the e-stop stations."""

    @property
    def is_estop_latched(self) -> bool:
        """Whether only a reset permits motion again."""
        return self.estop or self.stations.latched


# --- decision


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a reset."""

    success: bool
    message: str


class Decision(NamedTuple):
    """The velocity for the wheels, and everything that explains it."""

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
    causes: tuple[StopReason, ...] = ()
    """Stop reasons that hold now, most severe first; they may limit the motion without a stop."""
    latched: tuple[StopReason, ...] = ()
    """Stop reasons whose causes have ended, but that the owner has not yet cleared with a neutral command."""
    limit: Limit | None = None
    """What reduces the speed without a cause; None: nothing, or the barrier."""
    detail: str = ""
    """Details of the first cause, as part of a sentence; empty if there are none."""
    stations: tuple[Station, ...] = ()
