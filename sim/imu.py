"""An inertial measurement unit with noise. Pure except for a seeded generator."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

Axes = tuple[float, float, float]
"""Components along the sensor's axes: x forward, y left, z up."""


@dataclass(frozen=True, slots=True)
class ImuConfig:
    """Noise of each reading, as standard deviation on each axis.

    Raises:
        ValueError: A value is negative or not finite.
    """

    gyro_noise_rad_s: float = 0.002
    accel_noise_m_s2: float = 0.02

    def __post_init__(self) -> None:
        for name in ("gyro_noise_rad_s", "accel_noise_m_s2"):
            value: float = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be finite and not negative, not {value}.")


class Motion(NamedTuple):
    """One reading of the unit."""

    gyro_rad_s: Axes
    accel_m_s2: Axes
    """The specific force: at rest it points up with 9.81 m/s²."""


class Imu:
    """Adds the noise of a sensor to the true motion; the same seed makes the same noise."""

    def __init__(self, config: ImuConfig | None = None, seed: int = 0) -> None:
        self.config = config or ImuConfig()
        self._random = np.random.default_rng((seed, 2))
        self._scale = np.repeat((self.config.gyro_noise_rad_s, self.config.accel_noise_m_s2), 3)

    def read(self, gyro_rad_s: Axes, accel_m_s2: Axes) -> Motion:
        """Return the sensor's reading for a true motion."""
        noise = (self._scale * self._random.standard_normal(6)).tolist()
        gx, gy, gz = gyro_rad_s
        ax, ay, az = accel_m_s2
        return Motion(
            (gx + noise[0], gy + noise[1], gz + noise[2]), (ax + noise[3], ay + noise[4], az + noise[5])
        )
