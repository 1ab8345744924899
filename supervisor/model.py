"""The types of the law: configuration, inputs, state and decision.

Times are seconds of the supervisor's own monotonic clock, velocities m/s and rad/s in the base frame.
What the law remembers is made of named tuples: it takes a new one for each fact, at a third of the cost of a
frozen dataclass.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

from supervisor.base_motion import FOLLOWING, Following
from supervisor.clearance import NO_POINTS, Block, Floats, Hull, Surroundings
from supervisor.near_memory import Remembered
from supervisor.reckoning import STANDSTILL, Odometer, Pose, Velocity
from supervisor.scan import LaserScan, Lidar, ScanReading, View
from wire.freshness import Sent, Track, Verdict
from wire.reasons import StopReason

Reasons = frozenset[StopReason]


class Mode(IntEnum):
    """What the robot does; the numbers are SafetyStatus's."""

    STOPPED = 0
    READY = 1
    DRIVING = 2
    LIMITED = 3


RESIDUAL_M_S = 0.05


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
    lidars: tuple[Lidar, ...]
    """At least one."""
    command_timeout_s: float
    overrun_s: float
    stop_distance_m: float
    warning_distance_m: float
    deceleration_m_s2: float
    transport_s: float
    """Share of the reaction time beside the age and the period of a scan: transport and one tick."""
    creep_m_s: float
    """Minimum useful speed: where the barrier permits less, the output is zero."""
    max_linear_m_s: float
    max_angular_rad_s: float
    blind_creep_m_s: float
    """How fast the hull may close on a place that no scan rules out."""
    runaway_linear_m_s: float
    runaway_angular_rad_s: float
    smallest_obstacle_m: float
    """The diameter of the smallest thing that must be seen."""
    unseen_memory_s: float
    """For so long a place counts as free that was seen free."""
    works_in_the_open: bool
    """A lidar on which nothing has ever returned is believed."""
    odometry: bool
    """The base says how it moves; else the law goes by its own commands."""
    odom_timeout_s: float
    base_acceleration_m_s2: float
    """The base gains at least so much speed when it is asked to."""
    base_angular_acceleration_rad_s2: float

    @cached_property
    def reach_m(self) -> float:
        """What is farther than this from the hull limits no motion, whatever the age of a scan that still counts."""
        fastest_m_s = self.max_linear_m_s + self.max_angular_rad_s * self.hull.radius_m
        reaction_s = 2.0 * max(lidar.timeout_s for lidar in self.lidars) + self.transport_s
        braking_m = fastest_m_s * fastest_m_s / (2.0 * self.deceleration_m_s2)
        return self.stop_distance_m + fastest_m_s * reaction_s + braking_m + 0.05

    @cached_property
    def longest_timeout_s(self) -> float:
        """What is older than this counts no more, be it a command or a scan."""
        return max(self.command_timeout_s, *(lidar.timeout_s for lidar in self.lidars))

    @cached_property
    def believable(self) -> Velocity:
        """Odometry beyond this is a spike."""
        return Velocity(2.0 * self.max_linear_m_s, 2.0 * self.max_angular_rad_s)

    @cached_property
    def slowest(self) -> Velocity:
        """The least acceleration of the base [m/s², rad/s²]."""
        return Velocity(self.base_acceleration_m_s2, self.base_angular_acceleration_rad_s2)

    @cached_property
    def trusted(self) -> Velocity:
        """The deceleration that the base is trusted with [m/s², rad/s²]: the barrier's."""
        return Velocity(self.deceleration_m_s2, self.deceleration_m_s2 / self.hull.radius_m)

    @cached_property
    def residual(self) -> Velocity:
        """A base that is slower than this counts as standing [m/s, rad/s]."""
        return Velocity(RESIDUAL_M_S, RESIDUAL_M_S / self.hull.radius_m)


# --- inputs


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
class Odometry:
    """What the base says of its own motion."""

    velocity: Velocity
    arrival_s: float
    writer: bytes = b""
    """Who sent it: the gid of its attachment, else its frame."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """What came since the last step, each kind in order of arrival."""

    commands: tuple[Command, ...] = ()
    liveliness: tuple[Liveliness, ...] = ()
    scans: tuple[LaserScan, ...] = ()
    undecodable_lidars: tuple[int, ...] = ()
    """The lidars from which something came that is no scan."""
    odometry: Odometry | None = None
    """The newest."""
    odometry_writers: tuple[bytes, ...] = ()
    """Who sent odometry, whether it is the newest or not."""
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
    """Its last accepted command, clamped to the limits; None before the first, and once it has left at rest."""
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


class Writer(NamedTuple):
    """Who publishes on one sensor's key, and when that was last heard, and the time before."""

    gid: bytes
    heard_s: float
    before_s: float = -math.inf


class Past(NamedTuple):
    """A view of a moment ago, for places that are out of view by now."""

    lidar: str
    view: View


class Sight(NamedTuple):
    """One lidar, as far as it is known."""

    scan: ScanReading | None = None
    track: Track = Track()
    counts: Counts = Counts()
    writers: tuple[Writer, ...] = ()
    earlier: Floats = NO_POINTS
    """Near points of the scans before the newest, in its base frame, whether it shows them again or not."""


class Place(NamedTuple):
    """Points that belong to no single scan, and the odometer's pose that they are given in."""

    pose: Pose
    around: Surroundings


class State(NamedTuple):
    """All that the law remembers between two steps."""

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
    """The odometer's pose that these are given in."""
    past: tuple[Past, ...] = ()
    """Views of the last `unseen_memory_s`."""
    places: tuple[Place, ...] = ()
    """What is remembered, and what may be hidden."""
    looking: tuple[int, ...] = ()
    """The lidars whose scans those hidden places are from."""
    odometry: Odometry | None = None
    odometry_writers: tuple[Writer, ...] = ()
    odometer: Odometer = Odometer()
    odometers: tuple[Odometer, ...] = ()
    """Those of a moment ago: a scan shows where things were when it was taken."""
    way_m: float = 0.0
    """How far any point of the hull has moved, measured or commanded, whichever was more."""
    following: Following = FOLLOWING
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
    causes: tuple[StopReason, ...] = ()
    """Stop reasons that hold now, the most restrictive first; may limit the motion without a stop."""
    latched: tuple[StopReason, ...] = ()
    """Stop reasons that are over; the owner's neutral command is missing."""
    detail: str = ""
    """What is known of the first cause beyond its name, as part of a sentence; empty: nothing."""
