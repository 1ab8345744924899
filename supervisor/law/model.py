"""The types of the law's configuration and inputs.

Times are seconds of the supervisor's own monotonic clock, velocities m/s and rad/s in the base frame.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from supervisor.law.clearance import Hull
from supervisor.law.estop_stations import Presence, StationConfig, TokenEnd
from supervisor.law.reckoning import Velocity
from supervisor.law.scan import LaserScan, Lidar
from supervisor.law.transition import at_least
from wire.freshness import Sent, Verdict
from wire.reasons import StopReason

Reasons = frozenset[StopReason]


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
    """Whether the silence of a lidar that hardly has returns counts as free, at up to `open_m_s`."""
    odometry: bool
    """Whether the base publishes odometry; if not, the law uses its own commands."""
    odom_timeout_s: float
    base_acceleration_m_s2: float
    """Least acceleration of the base toward its command."""
    base_angular_acceleration_rad_s2: float
    blind_budget_m: float = math.inf
    """How far the base may drive on a command that is not renewed; infinite in recordings that do not have it."""
    open_m_s: float = math.inf
    """Fastest speed of the hull on silence that only `works_in_the_open` explains; infinite in recordings that do not have it."""
    estop_stations: tuple[StationConfig, ...] = ()
    base_dead_time_s: float = 0.0
    """How long the base keeps its speed after a command; part of the reaction time."""
    base_timeout_s: float = 0.0
    """How long the base drives on without a command; zero in recordings that do not have it."""
    unmeasured_m_s: float = math.inf
    """Fastest speed until a stop has measured the base; finite if the configuration does not describe the base."""
    unconfirmed_m_s: float = math.inf
    """Fastest speed of the hull until motion has confirmed the mounting of every lidar; infinite if the configuration does."""
    shown_m_s2: float = math.inf
    """Deceleration that the base has shown in its last stops; infinite before the first. No setting: the law measures it."""
    shown_dead_s: float = 0.0
    """Dead time that the base has shown in its last stops; likewise."""

    @cached_property
    def braking_m_s2(self) -> float:
        """Deceleration that the law trusts: the worse of the configured and the measured one."""
        return min(self.deceleration_m_s2, self.shown_m_s2)

    @cached_property
    def dead_time_s(self) -> float:
        """Dead time that the law expects: the worse of the configured and the measured one."""
        return max(self.base_dead_time_s, self.shown_dead_s)

    @cached_property
    def late_s(self) -> float:
        """How late a command acts: transport, one tick and dead time.

        Without odometry, the law takes the base to move as commanded, which it does a dead time later: this counts again.
        """
        return self.transport_s + self.dead_time_s * (1.0 if self.odometry else 2.0)

    @cached_property
    def reach_m(self) -> float:
        """Distance from the hull beyond which a point limits no motion, at any permitted age of its scan."""
        fastest_m_s = self.max_linear_m_s + self.max_angular_rad_s * self.hull.radius_m
        oldest_s = max(lidar.timeout_s for lidar in self.lidars)
        reaction_s = oldest_s + max(oldest_s, self.base_timeout_s) + self.late_s
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

    def hull_speed_m_s(self, velocity: Velocity) -> float:
        """Return an upper bound of the speed of any point of the hull [m/s]."""
        return abs(velocity.linear_m_s) + abs(velocity.angular_rad_s) * self.hull.radius_m

    def rim_speed_m_s(self, velocity: Velocity) -> float:
        """Return the speed that the barrier has to brake [m/s]: of the centre or of the hull's rim, the larger one."""
        return max(abs(velocity.linear_m_s), abs(velocity.angular_rad_s) * self.hull.radius_m)

    def useful(self, velocity: Velocity) -> Velocity:
        """Return the velocity, scaled up to the minimum useful speed if it is slower."""
        return at_least(velocity, self.creep_m_s, self.hull.radius_m)


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
