"""The sections `[supervisor.lidar]` and `[[supervisor.lidars]]` of robot.toml: mounts, readings, timing of lidars."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from supervisor.law.clearance import Hull
from supervisor.law.lidar import PROFILES, TIMINGS, LidarProfile, SensorTiming
from supervisor.law.scan import Mount
from wire import topics
from wire.host.config import TAKEN_NAMES, Angle, Beams, Between, Conflict, Distance, Name, Range, Section

# Codes are a few mm or cm; a profile with larger codes would miss obstacles right in front of the lidar.
CodeLimit = Annotated[float, Between(0.0, 0.5)]
FreeCode = Annotated[float, Between(0.001, 200.0)]
Timeout = Annotated[float, Between(0.03, 3.0, "a slower lidar does not detect obstacles in time")]
Period = Annotated[float, Between(0.002, 2.0)]
# Fewer beams cannot show the surroundings; no planar lidar has more than 4,096.
MinBeams = Annotated[int, Between(12, 4096)]
OUTSIDE_M = 0.02
"""Accepted distance of a mount outside the footprint; a mount is measured to a centimetre or two. From farther outside,
a lidar would look past the hull, and the law does not search the shadows of objects there (docs/decisions/0039)."""
FULL_TURN_SLACK_RAD = 1e-3
"""Tolerance for a full turn that is written as a rounded multiple of pi."""
Sector = Annotated[tuple[Angle, Angle], Field(strict=False)]


def _is_a_sensors_topic(topic: str) -> str:
    if topic in TAKEN_NAMES - {topics.SCAN.key}:
        raise ValueError("is a node or another topic of the wire; choose a name such as scan_rear")
    return topic


class ReadingsSection(Section):
    """Meaning of the readings of a sensor without a profile; +Inf and readings beyond range_max are always free."""

    nan_is_free: bool = False
    zero_is_free: bool = False
    codes_below_m: CodeLimit = 0.0
    free_codes_m: Annotated[tuple[FreeCode, ...], Field(max_length=16, strict=False)] = ()


class LidarSection(Section):
    """Mount of a lidar, meaning of its readings, and requirements on its scans."""

    profile: Literal["rep117", "rplidar", "neato_xv", "hokuyo_urg", "sick_lms", "own"] = "rep117"
    own: ReadingsSection | None = None

    x_m: Distance = 0.0
    y_m: Distance = 0.0
    yaw_rad: Angle = 0.0
    masked_rad: Annotated[tuple[Sector, ...], Field(max_length=16, strict=False)] = ()
    min_beams: MinBeams = 90
    timeout_s: Timeout | None = None
    """None: `scan_timeout_s` if given, else the profile's timeout."""
    period_s: Period | None = None
    """Time between two scans; None: the profile's usual period."""

    view_rad: Sector | None = None
    """Angles of the first and the last beam in its own frame; used, like the next two, by `lifeline check` only."""
    beams: Beams | None = None
    range_max_m: Range | None = None

    @model_validator(mode="after")
    def _knows_its_readings(self) -> Self:
        if (self.profile == "own") != (self.own is not None):
            raise ValueError('profile = "own" requires the table `own`, and the table requires this profile')
        return self

    def mount(self) -> Mount:
        return Mount(self.x_m, self.y_m, self.yaw_rad, self.masked_rad)

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
