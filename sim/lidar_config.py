"""A simulated lidar: where it is mounted, and what it measures; also the section `[[sim.lidars]]` of robot.toml."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from wire import topics
from wire.host.config import Angle, Beams, Between, Conflict, Name, Section

MAX_LIDARS = 4
MAX_MOUNT_M = 2.0
"""Maximum distance from the robot's centre along each axis; the largest hull in the models reaches 0.36 m."""


def _is_a_topic(topic: str) -> str:
    return topics.lidar_scan(topic).key


Place = Annotated[float, Between(-MAX_MOUNT_M, MAX_MOUNT_M, "in m")]
Span = Annotated[float, Between(0.01, math.tau, "in rad: at most a full turn")]
NoiseM = Annotated[float, Between(0.0, 0.1, "in m")]
Topic = Annotated[str, AfterValidator(_is_a_topic)]


class LidarConfig(Section):
    """A lidar's frame and key, its mount in base_link, its geometry and its errors.

    Attributes:
        height_m: Height of the plane of the beams above the floor.
        name: Its frame.
        topic: The relative key of its scans.
        yaw_rad: Direction of its axis, counter-clockwise from straight ahead.
        beams: Number of beams in a scan, spread over the span.
        span_rad: Field of view, centred on the lidar's axis. The first and the last beam are on its edges; in a full
            turn, they are one increment apart.
        range_min_m: Closer objects are too close to measure.
        range_max_m: Objects farther away give no return.
        noise_m: Standard deviation of each range.
        dropout: Share of the beams without a measurement, chosen anew for each scan.
    """

    height_m: ClassVar = 0.30

    name: Name = "lidar"
    topic: Topic = topics.SCAN.key
    x_m: Place = 0.0
    y_m: Place = 0.0
    yaw_rad: Angle = 0.0
    beams: Beams = 360
    span_rad: Span = math.tau
    range_min_m: Annotated[float, Between(0.0, 10.0, "in m")] = 0.1
    range_max_m: Annotated[float, Between(0.05, 1000.0, "in m")] = 12.0
    noise_m: NoiseM = 0.0
    dropout: Annotated[float, Between(0.0, 1.0)] = 0.0

    def conflicts(self) -> Iterator[Conflict]:
        if not self.range_min_m < self.range_max_m:
            yield Conflict(("range_max_m",), self.range_max_m, "range_max_m must be more than range_min_m")

    @property
    def angle_min_rad(self) -> float:
        return -0.5 * self.span_rad if self.beams > 1 or self._is_full_turn else 0.0

    @property
    def angle_increment_rad(self) -> float:
        gaps = self.beams if self._is_full_turn else max(1, self.beams - 1)
        return self.span_rad / gaps

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Return the angles of all beams in the lidar's frame, shape (beams,)."""
        return self.angle_min_rad + self.angle_increment_rad * np.arange(self.beams, dtype=np.float64)

    @property
    def _is_full_turn(self) -> bool:
        return self.span_rad == math.tau


class SimLidarSection(LidarConfig):
    """One of several lidars, or a lidar off the robot's axis."""

    name: Name  # pyright: ignore[reportGeneralTypeIssues] - required here
    topic: Topic  # pyright: ignore[reportGeneralTypeIssues]
    noise_m: NoiseM = 0.002


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
