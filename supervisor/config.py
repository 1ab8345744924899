"""`[supervisor]` of robot.toml, checked whole before anything starts."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from supervisor.clearance import Circle, ConvexPolygon, Hull
from supervisor.lidar import PROFILES, LidarProfile
from supervisor.model import LawConfig, SourceConfig
from supervisor.scan import Lidar, Mount
from wire.config import Finite, Name, Positive, Section

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Pair = Annotated[tuple[Finite, Finite], Field(strict=False)]  # TOML knows lists only


class SourceSection(Section):
    """A command source; a higher priority takes over from a lower one."""

    name: Name
    priority: Annotated[int, Field(ge=0, le=1000)]


class FootprintSection(Section):
    """The robot's hull: a circle by its radius, or a convex polygon by its corners."""

    radius_m: Positive | None = None
    corners_m: list[Pair] | None = None

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


class ReadingsSection(Section):
    """What the readings of a sensor of one's own mean; +Inf and beyond range_max are always free."""

    nan_is_free: bool = False
    zero_is_free: bool = False
    codes_below_m: NotNegative = 0.0
    free_codes_m: Annotated[tuple[Positive, ...], Field(strict=False)] = ()


class LidarSection(Section):
    """Where the lidar is mounted, what its readings mean, and what is asked of its scans."""

    profile: Literal["rep117", "rplidar", "neato_xv", "hokuyo_urg", "sick_lms", "own"] = "rep117"
    own: ReadingsSection | None = None

    x_m: Finite = 0.0
    y_m: Finite = 0.0
    yaw_rad: Finite = 0.0
    masked_rad: Annotated[tuple[Pair, ...], Field(strict=False)] = ()
    min_beams: Annotated[int, Field(ge=12)] = 90

    @model_validator(mode="after")
    def _knows_its_readings(self) -> Self:
        if (self.profile == "own") != (self.own is not None):
            raise ValueError('profile = "own" and the table `own` go together')
        return self

    def mount(self) -> Mount:
        return Mount(self.x_m, self.y_m, self.yaw_rad, self.masked_rad)

    def readings(self) -> LidarProfile:
        if self.own is None:
            return PROFILES[self.profile]
        own = self.own
        return LidarProfile(own.nan_is_free, own.zero_is_free, own.codes_below_m, own.free_codes_m)


class SupervisorSection(Section):
    """Every number of the safety law and of its service."""

    tick_hz: Positive = 50.0
    status_hz: Positive = 10.0
    command_timeout_s: Positive = 0.2
    scan_timeout_s: Positive = 0.24
    overrun_s: Positive = 0.1
    stop_distance_m: Positive = 0.30
    warning_distance_m: Positive = 0.50
    deceleration_m_s2: Positive = 1.5
    transport_s: Positive = 0.03
    creep_m_s: Positive = 0.02
    max_linear_m_s: Positive = 1.0
    max_angular_rad_s: Positive = 2.0
    blind_creep_m_s: NotNegative = 0.0
    runaway_linear_m_s: Positive = 0.05
    runaway_angular_rad_s: Positive = 0.1
    black_box_s: Positive = 60.0
    black_box_files: Annotated[int, Field(ge=1, le=1000)] = 20
    black_box_dir: Annotated[str, Field(min_length=1)] | None = None
    footprint: FootprintSection = FootprintSection(radius_m=0.25)
    lidar: LidarSection = LidarSection()
    sources: Annotated[tuple[SourceSection, ...], Field(min_length=1, strict=False)] = (
        SourceSection(name="teleop", priority=100),
        SourceSection(name="joy", priority=90),
        SourceSection(name="path", priority=10),
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        tick_s = 1.0 / self.tick_hz
        for key in ("command_timeout_s", "scan_timeout_s", "overrun_s"):
            if getattr(self, key) <= tick_s:
                raise ValueError(f"{key} must be longer than a tick of {tick_s:g} s")
        if self.warning_distance_m < self.stop_distance_m:
            raise ValueError("warning_distance_m must not be less than stop_distance_m")
        names = [source.name for source in self.sources]
        if len(set(names)) != len(names):
            raise ValueError("each source needs a name of its own")
        return self

    def law(self) -> LawConfig:
        """The numbers as the pure core takes them."""
        return LawConfig(
            sources=tuple(SourceConfig(s.name, s.priority) for s in self.sources),
            hull=self.footprint.hull(),
            lidars=(
                Lidar(
                    "lidar",
                    self.lidar.mount(),
                    self.lidar.readings(),
                    self.scan_timeout_s,
                    self.lidar.min_beams,
                ),
            ),
            command_timeout_s=self.command_timeout_s,
            overrun_s=self.overrun_s,
            stop_distance_m=self.stop_distance_m,
            warning_distance_m=self.warning_distance_m,
            deceleration_m_s2=self.deceleration_m_s2,
            transport_s=self.transport_s,
            creep_m_s=self.creep_m_s,
            max_linear_m_s=self.max_linear_m_s,
            max_angular_rad_s=self.max_angular_rad_s,
            blind_creep_m_s=self.blind_creep_m_s,
            runaway_linear_m_s=self.runaway_linear_m_s,
            runaway_angular_rad_s=self.runaway_angular_rad_s,
            smallest_obstacle_m=0.04,
            unseen_memory_s=0.0,
            works_in_the_open=False,
            odometry=True,
            odom_timeout_s=0.3,
            base_acceleration_m_s2=0.5,
            base_angular_acceleration_rad_s2=1.5,
        )
