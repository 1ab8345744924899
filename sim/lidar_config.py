"""The section `[[sim.lidars]]` of robot.toml, for a robot with several lidars or with a lidar off its axis."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Self

from pydantic import AfterValidator, model_validator

from sim.lidar_geometry import LidarConfig
from wire import topics
from wire.host.config import Angle, Beams, Between, Conflict, Name, Section

MAX_LIDARS = 4
MAX_MOUNT_M = 2.0
"""Maximum distance from the robot's centre along each axis; the largest hull in the models reaches 0.36 m."""
MAX_RANGE_M = 1000.0


def _is_a_topic(topic: str) -> str:
    return topics.lidar_scan(topic).key


Place = Annotated[float, Between(-MAX_MOUNT_M, MAX_MOUNT_M, "in m")]


class SimLidarSection(Section):
    """A lidar of the simulated robot: its frame and key, its mount in base_link, and what it measures."""

    name: Name
    topic: Annotated[str, AfterValidator(_is_a_topic)]
    x_m: Place = 0.0
    y_m: Place = 0.0
    yaw_rad: Angle = 0.0
    beams: Beams = 360
    span_rad: Annotated[float, Between(0.01, math.tau, "in rad: at most a full turn")] = math.tau
    range_min_m: Annotated[float, Between(0.0, 10.0, "in m")] = 0.1
    range_max_m: Annotated[float, Between(0.05, MAX_RANGE_M, "in m")] = 12.0
    noise_m: Annotated[float, Between(0.0, 0.1, "in m")] = 0.002
    dropout: Annotated[float, Between(0.0, 1.0)] = 0.0

    @model_validator(mode="after")
    def _measures_something(self) -> Self:
        if not self.range_min_m < self.range_max_m:
            raise ValueError("range_max_m must be more than range_min_m")
        return self

    def lidar(self) -> LidarConfig:
        return LidarConfig(
            beams=self.beams,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            noise_std_m=self.noise_m,
            span_rad=self.span_rad,
            dropout=self.dropout,
            x_m=self.x_m,
            y_m=self.y_m,
            yaw_rad=self.yaw_rad,
            name=self.name,
            topic=self.topic,
        )


def conflicts_of_lidars(lidars: Sequence[SimLidarSection]) -> Iterator[Conflict]:
    """Yield a conflict if two lidars share a name or topic, or if the first lidar is not on the topic `scan`."""
    if lidars[0].topic != topics.SCAN.key:
        message = f'the first lidar\'s topic must be "{topics.SCAN.key}"'
        yield Conflict(("lidars", 0, "topic"), lidars[0].topic, message)
    for key in ("name", "topic"):
        values = [getattr(lidar, key) for lidar in lidars]
        for index, value in enumerate(values):
            if value in values[:index]:
                yield Conflict(("lidars", index, key), value, f"each lidar needs a {key} of its own")
