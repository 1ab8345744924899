"""A planar lidar on the robot, with beam order and special values as in ROS.

The beams are counter-clockwise in the lidar's frame; a full turn starts straight behind the lidar. By REP 117, +inf is
no return, -inf is an object too close to measure, and NaN is no measurement. By default there is no noise.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim import mj
from sim.lidar_config import LidarConfig

Ranges = NDArray[np.float32]

# In the models, this geom group has all objects in the plane of the beams, without the robot.
SOLID_GROUP = 1


class Lidar:
    """Simulates a lidar by ray casting in a MuJoCo world.

    Args:
        model: The world.
        config: The lidar's geometry and errors.
        seed: Seed of noise and dropout; the same seed gives the same scans.
    """

    def __init__(
        self, model: mj.Model, config: LidarConfig | None = None, seed: int | Sequence[int] = 0
    ) -> None:
        self.config = config or LidarConfig()
        self._model = model
        self.random = np.random.default_rng(seed)
        """The generator of the noise; with the state of an earlier moment, it repeats the noise that followed."""
        beams, angles_rad = self.config.beams, self.config.angles_rad
        self._cos, self._sin = np.cos(angles_rad), np.sin(angles_rad)
        self._origin = np.array((0.0, 0.0, self.config.height_m))
        self._directions = np.zeros((beams, 3))
        self._flat_directions = self._directions.reshape(-1)
        self._distances = np.zeros(beams)
        self._geoms = np.zeros(beams, np.int32)
        self._groups = np.zeros(6, np.uint8)
        self._groups[SOLID_GROUP] = 1

    def scan(self, data: mj.Data, x_m: float, y_m: float, yaw_rad: float) -> Ranges:
        """Return the ranges [m] with the robot at a pose in the world, shape (beams,), in a new array."""
        config = self.config
        cos_robot, sin_robot = math.cos(yaw_rad), math.sin(yaw_rad)
        self._origin[0] = x_m + cos_robot * config.x_m - sin_robot * config.y_m
        self._origin[1] = y_m + sin_robot * config.x_m + cos_robot * config.y_m
        cos_yaw, sin_yaw = math.cos(yaw_rad + config.yaw_rad), math.sin(yaw_rad + config.yaw_rad)
        self._directions[:, 0] = cos_yaw * self._cos - sin_yaw * self._sin
        self._directions[:, 1] = sin_yaw * self._cos + cos_yaw * self._sin
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
        if config.noise_m > 0.0:
            ranges += self.random.normal(0.0, config.noise_m, config.beams)
        ranges[ranges < config.range_min_m] = -math.inf
        ranges[missed | (ranges > config.range_max_m)] = math.inf
        if config.dropout > 0.0:
            ranges[self.random.random(config.beams) < config.dropout] = math.nan
        return ranges.astype(np.float32)
