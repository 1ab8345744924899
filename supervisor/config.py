"""The section `[supervisor]` of robot.toml: its keys, their bounds, and the checks against each other and against the base.

All checks run before any process starts.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.estop_stations import StationConfig
from supervisor.law.lidar import PROFILES, TIMINGS, LidarProfile, SensorTiming
from supervisor.law.model import LawConfig, SourceConfig
from supervisor.law.scan import Lidar, Mount
from wire import topics
from wire.access import Contract
from wire.host.config import (
    TAKEN_NAMES,
    Acceleration,
    Angle,
    AngularAcceleration,
    BaseSection,
    Beams,
    Between,
    ConfigError,
    Conflict,
    Distance,
    FreeName,
    Name,
    Range,
    Section,
    Sections,
    Speed,
    TurnRate,
)

FreeCode = Annotated[float, Between(0.001, 200.0)]
Memory = Annotated[float, Between(0.0, 10.0, "a person may have entered space that was seen longer ago")]
ScanTimeout = Annotated[float, Between(0.03, 3.0, "a slower lidar does not detect obstacles in time")]
OUTSIDE_M = 0.02
"""Accepted distance of a mount outside the footprint: a mount is measured to a centimetre or two. A lidar farther outside
would look past the hull, and the law does not search the shadows of objects there (docs/decisions/0039)."""
FULL_TURN_SLACK_RAD = 1e-3
"""Tolerance for a full turn that is written as a rounded multiple of pi."""
Sector = Annotated[tuple[Angle, Angle], Field(strict=False)]


def _is_a_sensors_topic(topic: str) -> str:
    if topic in TAKEN_NAMES - {topics.SCAN.key}:
        raise ValueError("is a node or another topic of the wire; choose a name such as scan_rear")
    return topic


class ReadingsSection(Section):
    """Meaning of the readings of a sensor without a profile. +Inf and readings from range_max on always mean "no return"."""

    nan_is_free: bool = False
    zero_is_free: bool = False
    # Codes are a few mm or cm. With larger ones, obstacles right in front of the lidar would count as "no return".
    codes_below_m: Annotated[float, Between(0.0, 0.5)] = 0.0
    free_codes_m: Annotated[tuple[FreeCode, ...], Field(max_length=16, strict=False)] = ()


class LidarSection(Section):
    """Mount of a lidar, meaning of its readings, and requirements on its scans."""

    profile: Literal["rep117", "rplidar", "neato_xv", "hokuyo_urg", "sick_lms", "own"] = "rep117"
    own: ReadingsSection | None = None

    x_m: Distance = 0.0
    y_m: Distance = 0.0
    yaw_rad: Angle = 0.0
    flip: bool = False
    """Whether it is mounted upside down."""
    masked_rad: Annotated[tuple[Sector, ...], Field(max_length=16, strict=False)] = ()
    # Fewer beams cannot show the surroundings; no planar lidar has more than 4,096.
    min_beams: Annotated[int, Between(12, 4096)] = 90
    timeout_s: ScanTimeout | None = None
    """None: `scan_timeout_s` if the file has it, else the profile's timeout."""
    period_s: Annotated[float, Between(0.002, 2.0)] | None = None
    """Time between two scans; None: the profile's usual period."""
    # A larger value is a mistake: scans that are half a second old show a place that the robot has left.
    latency_s: Annotated[float, Between(0.0, 0.5)] | None = None
    """Constant time from the measurement to the message, which no stamp shows. None: the profile's, and the timeout counts from
    the message."""

    view_rad: Sector | None = None
    """Angles of the first and the last beam in its own frame. Only `lifeline check` uses this key and the next two."""
    beams: Beams | None = None
    range_max_m: Range | None = None

    @model_validator(mode="after")
    def _knows_its_readings(self) -> Self:
        if (self.profile == "own") != (self.own is not None):
            raise ValueError('profile = "own" requires the table `own`, and the table requires this profile')
        return self

    def mount(self) -> Mount:
        return Mount(self.x_m, self.y_m, self.yaw_rad, self.masked_rad, self.flip)

    def readings(self) -> LidarProfile:
        if self.own is None:
            return PROFILES[self.profile]
        own = self.own
        return LidarProfile(own.nan_is_free, own.zero_is_free, own.codes_below_m, own.free_codes_m)

    def timing(self) -> SensorTiming | None:
        """Timing of the sensor that the profile names; None if it does not name a sensor."""
        return TIMINGS.get(self.profile)

    def usual_period_s(self) -> float | None:
        """Scan period from the configuration, else from the profile; None if neither has one."""
        timing = self.timing()
        return self.period_s if self.period_s is not None or timing is None else timing.usual_period_s

    def usual_latency_s(self) -> float:
        """Latency from the configuration, else from the profile; zero if neither has one."""
        timing = self.timing()
        if self.latency_s is not None:
            return self.latency_s
        return 0.0 if timing is None else timing.latency_s

    def contradictions(self, stop_distance_m: float, hull: Hull) -> Iterator[Conflict]:
        """Yield a conflict for each value that does not fit the robot.

        Args:
            stop_distance_m: the stop distance of the robot's hull.
            hull: the robot's outline.
        """
        outside_m = hull.clearance(np.array([[self.x_m, self.y_m]])).item()
        if outside_m > OUTSIDE_M:
            key = "x_m" if abs(self.x_m) >= abs(self.y_m) else "y_m"
            message = (
                f"puts the lidar {outside_m:.2f} m outside the footprint, but it is part of the robot: correct the mount, "
                "or make the footprint include the lidar"
            )
            yield Conflict((key,), getattr(self, key), message)
        if self.own is not None and self.own.codes_below_m >= stop_distance_m:
            message = (
                f"must be less than stop_distance_m = {stop_distance_m:g}: what is nearer than this to the lidar "
                "would count as nothing"
            )
            yield Conflict(("own", "codes_below_m"), self.own.codes_below_m, message)
        if self.beams is not None and self.beams < self.min_beams:
            message = f"is less than min_beams = {self.min_beams}, so every scan would be refused"
            yield Conflict(("beams",), self.beams, message)
        if (
            self.view_rad is not None
            and not 0.0 < self.view_rad[1] - self.view_rad[0] <= math.tau + FULL_TURN_SLACK_RAD
        ):
            message = "must be [from, to], counter-clockwise, and at most a full turn"
            yield Conflict(("view_rad",), list(self.view_rad), message)


class NamedLidarSection(LidarSection):
    """Section of one of several lidars, with its name and topic."""

    name: Name
    topic: Annotated[Name, AfterValidator(_is_a_sensors_topic)]
    """Its key below the namespace."""


Pair = Annotated[tuple[Distance, Distance], Field(strict=False)]  # TOML has only lists

MAX_ESTOP_STATIONS = 8

PERIODS_IN_TIMEOUT = 1.5
"""Minimum scan timeout in scan periods: with a shorter timeout, each scan that is slightly late stops the robot."""


class SourceSection(Section):
    """A command source. A source with a higher priority takes over from one with a lower priority."""

    name: FreeName
    priority: Annotated[int, Between(0, 1000)]


class FootprintSection(Section):
    """The robot's hull: a circle given by its radius, or a convex polygon given by its corners."""

    radius_m: Annotated[float, Between(0.05, 5.0, "in m")] | None = None
    corners_m: Annotated[list[Pair], Field(max_length=64)] | None = None

    @model_validator(mode="after")
    def _is_one_shape(self) -> Self:
        if (self.radius_m is None) == (self.corners_m is None):
            raise ValueError("give either radius_m or corners_m")
        self.hull()
        return self

    def hull(self) -> Hull:
        if self.corners_m is not None:
            return ConvexPolygon(tuple(self.corners_m))
        assert self.radius_m is not None
        return Circle(self.radius_m)


class EstopStationSection(Section):
    """An e-stop station: a program with an emergency stop that proves that it is connected (docs/how-to/estop-station.md)."""

    name: Name
    required: bool = True
    """Whether the robot moves only while the station is heard."""


class SupervisorSection(Section):
    """All parameters of the safety law and of the supervisor process."""

    # Fast enough for every timeout and distance of the law, and slow enough for one process to sustain.
    tick_hz: Annotated[float, Between(10.0, 1000.0)] = 50.0
    # Displays treat a supervisor that is silent for one second as dead.
    status_hz: Annotated[float, Between(1.0, 100.0)] = 10.0
    # At 1 m/s, a command timeout of 2 s lets the robot drive 2 m after the operator's program hangs.
    command_timeout_s: Annotated[float, Between(0.03, 2.0)] = 0.2
    scan_timeout_s: ScanTimeout = 0.24
    """Timeout of a lidar without its own `timeout_s`. If the file does not have it, the timeout of the lidar's profile applies."""
    overrun_s: Annotated[float, Between(0.02, 1.0, "nothing is supervised while the supervisor hangs")] = 0.1
    # Below 5 cm, the errors of lidar, mount and braking are as large as the distance.
    stop_distance_m: Annotated[float, Between(0.05, 2.0)] = 0.30
    warning_distance_m: Annotated[float, Between(0.05, 5.0)] = 0.50
    # More than 10 m/s² exceeds the grip of a tyre; with 0.1 m/s², stopping from 1 m/s takes 5 m.
    deceleration_m_s2: Annotated[float, Between(0.1, 10.0)] = 1.5
    base_acceleration_m_s2: Acceleration = 0.5
    base_angular_acceleration_rad_s2: AngularAcceleration = 1.5
    # A larger value is a mistake: a base that reacts half a second late cannot be driven by keyboard.
    base_dead_time_s: Annotated[float, Between(0.0, 0.5)] = 0.0
    base_timeout_s: Annotated[
        float, Between(0.02, 2.0, "a base without a timeout drives on if the supervisor dies")
    ] = 0.15
    transport_s: Annotated[float, Between(0.001, 0.5)] = 0.03
    creep_m_s: Annotated[float, Between(0.001, 0.1)] = 0.02
    max_linear_m_s: Speed = 1.0
    max_angular_rad_s: TurnRate = 2.0
    # The bounds are the width of a cord and that of a person.
    smallest_obstacle_m: Annotated[float, Between(0.005, 0.5)] = 0.04
    unseen_memory_s: Memory = 0.0
    mounts_confirmed: bool = False
    """Whether a person has checked where each lidar looks; if not, motion must confirm it before the robot drives faster."""
    works_in_the_open: bool = False
    # Above this speed, a bumper would not stop a robot whose lidar is covered.
    open_m_s: Annotated[float, Between(0.05, 1.0)] = 0.5
    # From a higher speed, the base could not stop within a hand's width.
    blind_creep_m_s: Annotated[float, Between(0.0, 0.2)] = 0.0
    blind_budget_m: Annotated[float, Between(0.01, 2.0)] = 0.2
    odometry: bool = True
    odom_timeout_s: Annotated[float, Between(0.03, 2.0)] = 0.3
    runaway_linear_m_s: Annotated[float, Between(0.01, 0.5)] = 0.05
    runaway_angular_rad_s: Annotated[float, Between(0.01, 1.0)] = 0.1
    black_box_s: Annotated[float, Between(1.0, 600.0)] = 60.0
    black_box_files: Annotated[int, Between(1, 1000)] = 20
    black_box_dir: Annotated[str, Field(min_length=1)] | None = None
    footprint: FootprintSection = FootprintSection(radius_m=0.25)
    lidar: LidarSection = LidarSection()
    lidars: (
        Annotated[tuple[NamedLidarSection, ...], Field(min_length=1, max_length=4, strict=False)] | None
    ) = None
    """Used instead of `lidar` if there are several lidars."""
    sources: Annotated[tuple[SourceSection, ...], Field(min_length=1, max_length=16, strict=False)] = (
        SourceSection(name="teleop", priority=100),
        SourceSection(name="joy", priority=90),
        SourceSection(name="path", priority=10),
    )

    estop_stations: (
        Annotated[tuple[EstopStationSection, ...], Field(max_length=MAX_ESTOP_STATIONS, strict=False)] | None
    ) = None

    accepted_risks: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=200)], ...], Field(max_length=64, strict=False)
    ] = ()
    """Settings, as `lifeline check` prints them with their values, whose risk a person has accepted. Nothing else reads this."""

    def station_names(self) -> tuple[str, ...]:
        """Return the names of the e-stop stations."""
        return tuple(station.name for station in self.estop_stations or ())

    def all_topics(self) -> Iterator[topics.Topic[Any]]:
        """Yield every topic of a robot with this configuration."""
        for topic in topics.TOPICS:
            if topics.SOURCE_PLACEHOLDER in topic.key:
                yield from (topics.source_cmd_vel(source.name) for source in self.sources)
            elif topic.key == topics.LIDAR_PLACEHOLDER:
                others = (lidar.topic for lidar in self.all_lidars() if lidar.topic != topics.SCAN.key)
                yield from (topics.lidar_scan(name) for name in others)
            elif topics.STATION_PLACEHOLDER not in topic.key:
                yield topic
        for name in self.station_names():
            yield from (topics.estop_presence(name), topics.estop_challenge(name))

    def all_lidars(self) -> tuple[NamedLidarSection, ...]:
        """Return all lidars with name and topic; `[supervisor.lidar]` has the name `lidar` and the topic `scan`."""
        if self.lidars is not None:
            return self.lidars
        one = {key: getattr(self.lidar, key) for key in LidarSection.model_fields}
        return (NamedLidarSection.model_construct(name="lidar", topic=topics.SCAN.key, **one),)

    def scan_timeout_of(self, lidar: LidarSection) -> float:
        """Return a lidar's scan timeout [s]: its own, else the section's if given, else its profile's."""
        if lidar.timeout_s is not None:
            return lidar.timeout_s
        timing = lidar.timing()
        if timing is None or "scan_timeout_s" in self.model_fields_set:
            return self.scan_timeout_s
        return timing.timeout_s

    def conflicts(self) -> Iterator[Conflict]:
        yield from self._conflicts_with_tick()
        yield from self._conflicts_of_distances()
        yield from self._conflicts_of_lidars()
        yield from self._conflicts_of_names()

    def _conflicts_with_tick(self) -> Iterator[Conflict]:
        tick_s = 1.0 / self.tick_hz
        for key in ("command_timeout_s", "scan_timeout_s", "overrun_s", "odom_timeout_s", "base_timeout_s"):
            if (value := getattr(self, key)) <= tick_s:
                yield Conflict((key,), value, f"must be longer than a tick of {tick_s:g} s")
        if self.transport_s < tick_s:
            message = f"must be at least a tick of {tick_s:g} s, which it includes: increase it, or set a higher tick_hz"
            yield Conflict(("transport_s",), self.transport_s, message)

    def _conflicts_of_distances(self) -> Iterator[Conflict]:
        if self.warning_distance_m < self.stop_distance_m:
            message = (
                f"must not be less than stop_distance_m = {self.stop_distance_m:g}: warn before the stop"
            )
            yield Conflict(("warning_distance_m",), self.warning_distance_m, message)
        for key, limit in (
            ("creep_m_s", "max_linear_m_s"),
            ("blind_creep_m_s", "max_linear_m_s"),
            ("runaway_linear_m_s", "max_linear_m_s"),
            ("runaway_angular_rad_s", "max_angular_rad_s"),
        ):
            if not (value := getattr(self, key)) < (most := getattr(self, limit)):
                yield Conflict((key,), value, f"must be less than {limit} = {most:g}")
        if self.blind_budget_m < (least_m := self._least_budget_m()):
            message = (
                f"permits less than creep_m_s = {self.creep_m_s:g} once a command is half as old as command_timeout_s = "
                f"{self.command_timeout_s:g}: set at least {math.ceil(least_m * 1e4) / 1e4:g}, or a shorter timeout"
            )
            yield Conflict(("blind_budget_m",), self.blind_budget_m, message)

    def _least_budget_m(self) -> float:
        """Return the budget [m] with which a command of half the age of its timeout still permits the minimum useful speed."""
        timeout_s = self.command_timeout_s
        return self.creep_m_s * (timeout_s + self.transport_s / 2.0) ** 2 / timeout_s

    def _conflicts_of_lidars(self) -> Iterator[Conflict]:
        if self.lidars is not None and "lidar" in self.model_fields_set:
            message = "give either [supervisor.lidar] or [[supervisor.lidars]]: move its keys into the list"
            yield Conflict(("lidar",), None, message)
        hull = self.footprint.hull()
        for path, lidar in self.lidars_with_paths():
            for key, value, message in lidar.contradictions(self.stop_distance_m, hull):
                yield Conflict((*path, *key), value, message)
            period_s = lidar.usual_period_s()
            if period_s is not None:
                yield from self.conflicts_of_period(path, lidar, period_s)
            timeout_s = self.scan_timeout_of(lidar)
            if lidar.latency_s is not None and lidar.latency_s >= timeout_s:
                message = f"must be less than the scan timeout of {timeout_s:g} s, or every scan is too old"
                yield Conflict((*path, "latency_s"), lidar.latency_s, message)
            if lidar.timeout_s is not None and timeout_s <= 1.0 / self.tick_hz:
                message = f"must be longer than a tick of {1.0 / self.tick_hz:g} s"
                yield Conflict((*path, "timeout_s"), timeout_s, message)

    def conflicts_of_period(
        self, path: tuple[str | int, ...], lidar: LidarSection, period_s: float
    ) -> Iterator[Conflict]:
        """Yield a conflict if a lidar's timeout is too short for the time between two of its scans."""
        timeout_s = self.scan_timeout_of(lidar)
        least_s = PERIODS_IN_TIMEOUT * period_s + (lidar.latency_s or 0.0)
        if timeout_s < least_s - 1e-9:  # rounding error of the product
            where = ("scan_timeout_s",) if lidar.timeout_s is None else (*path, "timeout_s")
            timing = lidar.timing()
            otherwise = (
                ""
                if timing is None
                else f", or leave it out for the {timing.timeout_s:g} s of {lidar.profile}"
            )
            late = f" and latency_s = {lidar.latency_s:g}" if lidar.latency_s else ""
            message = (
                f"must be at least {PERIODS_IN_TIMEOUT:g} scan periods of {period_s:.4g} s{late}, or the robot stops "
                f"whenever a scan is slightly late: set {least_s:.4g}{otherwise}"
            )
            yield Conflict(where, timeout_s, message)

    def lidars_with_paths(self) -> Iterator[tuple[tuple[str | int, ...], NamedLidarSection]]:
        """Yield each lidar with the path of its section, relative to this one."""
        for index, lidar in enumerate(self.all_lidars()):
            yield ("lidar",) if self.lidars is None else ("lidars", index), lidar

    def _conflicts_of_names(self) -> Iterator[Conflict]:
        sources = [source.name for source in self.sources]
        for index, name in enumerate(sources):
            if name in sources[:index]:
                yield Conflict(("sources", index, "name"), name, "each source needs a name of its own")
        stations = self.station_names()
        for index, name in enumerate(stations):
            if name in stations[:index]:
                message = "each e-stop station needs a name of its own"
                yield Conflict(("estop_stations", index, "name"), name, message)
        lidars = self.lidars or ()
        for index, lidar in enumerate(lidars):
            if lidar.name in [other.name for other in lidars[:index]]:
                yield Conflict(("lidars", index, "name"), lidar.name, "each lidar needs a name of its own")
            where = ("lidars", index, "topic")
            if lidar.topic in [other.topic for other in lidars[:index]]:
                yield Conflict(where, lidar.topic, "each lidar needs a topic of its own")
            if lidar.topic in sources:
                yield Conflict(where, lidar.topic, "is a command source: choose another topic")
            if lidar.topic == topics.SCAN.key and index > 0:
                yield Conflict(where, lidar.topic, "only the first lidar may be on this topic: list it first")

    def contract(self, more_keys: Iterable[str]) -> Contract:
        """Return the robot's own keys, for the hub's access control.

        Raises:
            ConfigError: one of the other keys is that of a command source or a lidar.
        """
        sources = tuple(source.name for source in self.sources)
        lidars = tuple(lidar.topic for lidar in self.all_lidars())
        taken = {name.partition("/")[0] for name in (*sources, *lidars)}
        for key in more_keys:
            if key.partition("/")[0] in taken:
                raise ConfigError(
                    f"[bus] more_keys: {key!r} begins like a command source or a lidar; choose another name"
                )
        return Contract(sources, lidars, tuple(more_keys), self.station_names())

    def _oldest_s(self, lidar: LidarSection) -> float:
        """Return the maximum age of a usable scan of a lidar, its latency included."""
        timeout_s = self.scan_timeout_of(lidar)
        return timeout_s + lidar.usual_latency_s() if lidar.latency_s is None else timeout_s

    def law(self, *, is_base_known: bool = True, are_mounts_known: bool = True) -> LawConfig:
        """Return the configuration of the pure law.

        Args:
            is_base_known: whether the configuration describes the base. If not, the base is slow until a stop has measured it.
            are_mounts_known: whether the mounts of the lidars are known to be right; if not, the robot is slow until motion confirms them.
        """
        same = {f.name: getattr(self, f.name) for f in fields(LawConfig) if f.name in type(self).model_fields}
        own: dict[str, Any] = {
            "sources": tuple(SourceConfig(s.name, s.priority) for s in self.sources),
            "hull": self.footprint.hull(),
            "lidars": tuple(
                Lidar(s.name, s.mount(), s.readings(), self._oldest_s(s), s.min_beams, s.usual_latency_s())
                for s in self.all_lidars()
            ),
            "estop_stations": tuple(StationConfig(s.name, s.required) for s in self.estop_stations or ()),
            "unmeasured_m_s": math.inf if is_base_known else UNMEASURED_M_S,
            "unconfirmed_m_s": math.inf if are_mounts_known or self.mounts_confirmed else UNCONFIRMED_M_S,
        }
        return LawConfig(**(same | own))


# --- against the base

UNMEASURED_M_S = 0.5
"""Maximum speed of an unknown base. At this speed, a base with a third of the default braking and a dead time of 0.2 s does not
touch. It is above 0.4 m/s, the least speed from which a stop measures the base."""


UNCONFIRMED_M_S = 0.3
"""Fastest speed of the hull until motion has confirmed where the lidars look: at 0.5 m/s, a lidar that is turned by 180 degrees was found
after 0.62 m."""


def is_simulated(document: Mapping[str, Any]) -> bool:
    """Return whether a configuration, with valid sections, is for the simulated robot: it says so, or describes no robot."""
    return "sim" in document or not ("supervisor" in document or "ros2" in document)


def is_base_known(document: Mapping[str, Any]) -> bool:
    """Return whether a configuration states how the base brakes: it has the deceleration, or it is for the simulated base."""
    return is_simulated(document) or "deceleration_m_s2" in document.get("supervisor", {})


TICKS_IN_BASE_TIMEOUT = 2.0
"""Minimum timeout of the base in ticks: with a shorter timeout, the base brakes between two commands."""


def fit_to_base(sections: Sections) -> Iterator[Conflict]:
    """Yield a conflict for each value of `[supervisor]` that is unsafe or useless with the values of `[sim]`."""
    config, base = sections.get(SupervisorSection), sections.get(BaseSection)
    if config is None or base is None:
        return
    yield from _motion(config, base)
    yield from _timing(config, base)
    for path, lidar in config.lidars_with_paths():
        for key, value, message in config.conflicts_of_period(path, lidar, 1.0 / base.scan_hz):
            yield Conflict(("supervisor", *key), value, f"[sim] scan_hz = {base.scan_hz:g}: {message}")


def _motion(config: SupervisorSection, base: BaseSection) -> Iterator[Conflict]:
    trusted = config.deceleration_m_s2
    if trusted > base.braking_m_s2:
        yield _more_than(config, "deceleration_m_s2", "braking_m_s2", base.braking_m_s2)
    # On an arc, the rim of the hull must brake as hard as its centre.
    rim = base.angular_braking_rad_s2 * (radius_m := config.footprint.hull().radius_m)
    if trusted > rim:
        message = (
            f"is more than the {rim:.3g} m/s² that result from [sim] angular_braking_rad_s2 = {base.angular_braking_rad_s2:g} "
            f"at the hull's radius of {radius_m:.3g} m: set at most {rim:.3g}"
        )
        yield Conflict(("supervisor", "deceleration_m_s2"), trusted, message)
    for key, of_base in (
        ("base_acceleration_m_s2", "acceleration_m_s2"),
        ("base_angular_acceleration_rad_s2", "angular_acceleration_rad_s2"),
    ):
        if getattr(config, key) > getattr(base, of_base):
            yield _more_than(config, key, of_base, getattr(base, of_base))


def _more_than(config: SupervisorSection, key: str, of_base: str, limit: float) -> Conflict:
    message = f"is more than the base does, [sim] {of_base} = {limit:g}: set at most {limit:g}"
    return Conflict(("supervisor", key), getattr(config, key), message)


def _timing(config: SupervisorSection, base: BaseSection) -> Iterator[Conflict]:
    if config.base_timeout_s < base.command_timeout_s:
        message = (
            f"is less than the base's own, [sim] command_timeout_s = {base.command_timeout_s:g}: set at least "
            f"{base.command_timeout_s:g}"
        )
        yield Conflict(("supervisor", "base_timeout_s"), config.base_timeout_s, message)
    least_s = TICKS_IN_BASE_TIMEOUT / config.tick_hz
    if base.command_timeout_s < least_s:
        message = (
            f"must be at least {TICKS_IN_BASE_TIMEOUT:g} ticks of [supervisor] tick_hz = {config.tick_hz:g}, or the "
            f"base brakes between two commands: set {least_s:.4g}"
        )
        yield Conflict(("sim", "command_timeout_s"), base.command_timeout_s, message)
    least_s = PERIODS_IN_TIMEOUT / base.odom_hz
    if config.odometry and config.odom_timeout_s < least_s:
        message = f"must be at least {PERIODS_IN_TIMEOUT:g} periods of [sim] odom_hz = {base.odom_hz:g}: set {least_s:.4g}"
        yield Conflict(("supervisor", "odom_timeout_s"), config.odom_timeout_s, message)
