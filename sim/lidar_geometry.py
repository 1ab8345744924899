"""Where a lidar is mounted, and what it measures."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_BEAMS = 65_536
"""Maximum number of beams in one message."""


@dataclass(frozen=True, slots=True)
class LidarConfig:
    """A lidar's mount, geometry and errors.

    Attributes:
        beams: Number of beams in a scan, spread over the span.
        span_rad: Field of view, centred on the lidar's axis. The first and the last beam are on its edges; in a full
            turn, they are one increment apart.
        height_m: Height of the plane of the beams above the floor.
        range_min_m: Closer objects are too close to measure.
        range_max_m: Objects farther away give no return.
        noise_std_m: Standard deviation of each range.
        dropout: Share of the beams without a measurement, chosen anew for each scan.
        x_m: Mount, forward of the robot's centre.
        y_m: Mount, to the left of the robot's centre.
        yaw_rad: Direction of its axis, counter-clockwise from straight ahead.
        name: Its frame.
        topic: The relative key of its scans.

    Raises:
        ValueError: A value is invalid; the message names it.
    """

    beams: int = 360
    height_m: float = 0.30
    range_min_m: float = 0.10
    range_max_m: float = 12.0
    noise_std_m: float = 0.0
    span_rad: float = math.tau
    dropout: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    name: str = "lidar"
    topic: str = "scan"

    def __post_init__(self) -> None:
        if not 1 <= self.beams <= MAX_BEAMS:
            raise ValueError(f"beams must be from 1 to {MAX_BEAMS}, not {self.beams}.")
        if not 0.0 < self.span_rad <= math.tau:
            raise ValueError(f"span_rad must be above 0 and at most a full turn, not {self.span_rad}.")
        if not 0.0 <= self.dropout <= 1.0:
            raise ValueError(f"dropout must be from 0 to 1, not {self.dropout}.")
        if not (math.isfinite(self.height_m) and self.height_m > 0.0):
            raise ValueError(f"height_m must be positive and finite, not {self.height_m}.")
        if not 0.0 <= self.range_min_m < self.range_max_m < math.inf:
            raise ValueError(f"range_min_m must be in [0, {self.range_max_m}) m, not {self.range_min_m}.")
        if not (math.isfinite(self.noise_std_m) and self.noise_std_m >= 0.0):
            raise ValueError(f"noise_std_m must be finite and not negative, not {self.noise_std_m}.")
        for key in ("x_m", "y_m", "yaw_rad"):
            if not math.isfinite(getattr(self, key)):
                raise ValueError(f"{key} must be finite, not {getattr(self, key)}.")

    @property
    def angle_min_rad(self) -> float:
        return -0.5 * self.span_rad if self.beams > 1 or self._is_full_turn else 0.0

    @property
    def angle_increment_rad(self) -> float:
        gaps = self.beams if self._is_full_turn else max(1, self.beams - 1)
        return self.span_rad / gaps

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam; in a full turn, one increment before the first beam."""
        return self.angle_min_rad + (self.beams - 1) * self.angle_increment_rad

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Return the angles of all beams in the lidar's frame, shape (beams,)."""
        return self.angle_min_rad + self.angle_increment_rad * np.arange(self.beams, dtype=np.float64)

    @property
    def _is_full_turn(self) -> bool:
        return self.span_rad == math.tau
