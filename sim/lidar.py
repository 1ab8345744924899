"""A planar lidar on the robot's axis: one full turn of ranges, in the order and with the special values of ROS.

The beams are counter-clockwise from straight behind; the middle one looks straight ahead. By REP 117, +inf is a miss
and -inf is something too close to measure. There is no noise unless it is asked for.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim import mj

Ranges = NDArray[np.float32]

# The models put whatever stands in the beams' plane, and nothing of the robot, into this geom group.
SOLID_GROUP = 1


@dataclass(frozen=True, slots=True)
class LidarConfig:
    """A lidar's geometry.

    Attributes:
        beams: Beams of one full turn.
        height_m: The plane of the beams above the floor.
        range_min_m: What is closer is too close to measure.
        range_max_m: What is farther is missed.
        noise_std_m: Standard deviation of each range.

    Raises:
        ValueError: A value makes no sense, by name.
    """

    beams: int = 360
    height_m: float = 0.30
    range_min_m: float = 0.10
    range_max_m: float = 12.0
    noise_std_m: float = 0.0

    def __post_init__(self) -> None:
        if self.beams < 1:
            raise ValueError(f"beams must be at least 1, not {self.beams}.")
        if not (math.isfinite(self.height_m) and self.height_m > 0.0):
            raise ValueError(f"height_m must be positive and finite, not {self.height_m}.")
        if not 0.0 <= self.range_min_m < self.range_max_m < math.inf:
            raise ValueError(f"range_min_m must be in [0, {self.range_max_m}) m, not {self.range_min_m}.")
        if not (math.isfinite(self.noise_std_m) and self.noise_std_m >= 0.0):
            raise ValueError(f"noise_std_m must be finite and not negative, not {self.noise_std_m}.")

    @property
    def angle_min_rad(self) -> float:
        return -math.pi

    @property
    def angle_increment_rad(self) -> float:
        return math.tau / self.beams

    @property
    def angle_max_rad(self) -> float:
        """The last beam's angle, one increment short of a full turn."""
        return self.angle_min_rad + (self.beams - 1) * self.angle_increment_rad


class Lidar:
    """Casts the beams into a MuJoCo world.

    Args:
        model: The world.
        config: The lidar's geometry.
        seed: Of the noise; the same seed makes the same scans.
    """

    def __init__(self, model: mj.Model, config: LidarConfig | None = None, seed: int = 0) -> None:
        self.config = config or LidarConfig()
        self._model = model
        self._random = np.random.default_rng(seed)
        beams = self.config.beams
        angles_rad = self.config.angle_min_rad + self.config.angle_increment_rad * np.arange(beams)
        self._cos, self._sin = np.cos(angles_rad), np.sin(angles_rad)
        self._origin = np.array((0.0, 0.0, self.config.height_m))
        self._directions = np.zeros((beams, 3))
        self._flat_directions = self._directions.reshape(-1)
        self._distances = np.zeros(beams)
        self._geoms = np.zeros(beams, np.int32)
        self._groups = np.zeros(6, np.uint8)
        self._groups[SOLID_GROUP] = 1

    def scan(self, data: mj.Data, x_m: float, y_m: float, yaw_rad: float) -> Ranges:
        """The ranges seen from a pose in the world, in m, shape (beams,), a new array each time."""
        config = self.config
        cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
        self._directions[:, 0] = cos_yaw * self._cos - sin_yaw * self._sin
        self._directions[:, 1] = sin_yaw * self._cos + cos_yaw * self._sin
        self._origin[0], self._origin[1] = x_m, y_m
        mj.multi_ray(
            self._model,
            data,
            self._origin,
            self._flat_directions,
            self._groups,
            True,  # noqa: FBT003 - static geoms too: the walls are static
            -1,
            self._geoms,
            self._distances,
            None,
            config.beams,
            config.range_max_m,
        )
        ranges = self._distances.copy()
        missed = ranges < 0.0
        if config.noise_std_m > 0.0:
            ranges += self._random.normal(0.0, config.noise_std_m, config.beams)
        ranges[ranges < config.range_min_m] = -math.inf
        ranges[missed | (ranges > config.range_max_m)] = math.inf
        return ranges.astype(np.float32)
