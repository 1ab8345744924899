"""Wheel odometry with errors, from two encoders and slightly wrong wheel geometry; and an inertial measurement unit.

Pure except for seeded generators. As on a real robot, the pose drifts because of errors of the wheel radii and the
track, noise that grows with the distance, and the resolution of the encoders.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.drive import WheelGeometry

Matrix = NDArray[np.float64]

MAX_ERROR = 0.2


@dataclass(frozen=True, slots=True)
class EncoderConfig:
    """Resolution of the encoders, and errors of the base's wheel geometry.

    Attributes:
        ticks: encoder ticks per wheel turn.
        left_error: relative error of the assumed left wheel radius; positive if assumed too large.
        right_error: the same for the right wheel.
        track_error: relative error of the assumed track; positive if assumed too wide.
        noise_m: standard deviation of a wheel's counted distance after 1 m; grows with the root of the distance.
    """

    ticks: int = 16384
    left_error: float = 0.001
    right_error: float = 0.0005
    track_error: float = 0.005
    noise_m: float = 0.0005


PERFECT = EncoderConfig(left_error=0.0, right_error=0.0, track_error=0.0, noise_m=0.0)


class Reckoning(NamedTuple):
    """A pose in the frame of the last reset and the mean twist since the previous reading, with their covariances."""

    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    pose_covariance: Matrix
    """(3, 3) of x, y, yaw."""
    twist_covariance: Matrix
    """(2, 2) of v, ω."""


class Odometer:
    """Dead reckoning from wheel angles.

    Args:
        wheels: the true geometry.
        config: the errors of the geometry that the base assumes.
        seed: the seed of the noise; the same seed and path give the same odometry.
    """

    def __init__(self, wheels: WheelGeometry, config: EncoderConfig | None = None, seed: int = 0) -> None:
        self.config = config = config or EncoderConfig()
        self._random = np.random.default_rng((seed, 1))
        self._left_tick_m = math.tau / config.ticks * wheels.radius_m * (1.0 + config.left_error)
        self._right_tick_m = math.tau / config.ticks * wheels.radius_m * (1.0 + config.right_error)
        self._ticks_per_rad = config.ticks / math.tau
        self._track_m = wheels.track_m * (1.0 + config.track_error)
        self._systematic = np.diag(np.square([config.left_error, config.right_error, config.track_error]))
        self._tick_m2 = self._left_tick_m * self._right_tick_m / 12.0  # the variance of a rounded count
        self._ticks_covariance = np.diag(
            [self._tick_m2, self._tick_m2, 2.0 * self._tick_m2 / self._track_m**2]
        )
        self.reset(0.0, 0.0)

    def reset(self, left_rad: float, right_rad: float) -> None:
        """Restart at the origin, with the wheels at these angles."""
        self._left, self._right = self._count(left_rad), self._count(right_rad)
        self._x_m = self._y_m = self._yaw_rad = 0.0
        self._sensitivity = np.zeros((3, 3))
        self._random_covariance = np.zeros((3, 3))

    def read(self, left_rad: float, right_rad: float, elapsed_s: float) -> Reckoning:
        """Add the displacement since the last reading, along the mean heading of the arc.

        Args:
            left_rad: the angle of the left wheel, counted over all turns.
            right_rad: the angle of the right wheel, counted over all turns.
            elapsed_s: the time since the last reading, above zero.
        """
        left, right = self._count(left_rad), self._count(right_rad)
        left_m = self._noisy((left - self._left) * self._left_tick_m)
        right_m = self._noisy((right - self._right) * self._right_tick_m)
        self._left, self._right = left, right
        forward_m, turn_rad = 0.5 * (left_m + right_m), (right_m - left_m) / self._track_m
        heading_rad = self._yaw_rad + 0.5 * turn_rad
        dx_m, dy_m = forward_m * math.cos(heading_rad), forward_m * math.sin(heading_rad)
        if left_m != 0.0 or right_m != 0.0:
            self._doubt(left_m, right_m, turn_rad, heading_rad)
        self._x_m += dx_m
        self._y_m += dy_m
        self._yaw_rad = math.remainder(self._yaw_rad + turn_rad, math.tau)
        return Reckoning(
            self._x_m,
            self._y_m,
            self._yaw_rad,
            forward_m / elapsed_s,
            turn_rad / elapsed_s,
            self._pose_covariance(),
            self._twist_covariance(left_m, right_m, turn_rad, elapsed_s),
        )

    def _count(self, angle_rad: float) -> int:
        return math.floor(angle_rad * self._ticks_per_rad)

    def _noisy(self, way_m: float) -> float:
        if way_m == 0.0 or self.config.noise_m == 0.0:
            return way_m
        return way_m + self._random.normal(0.0, self.config.noise_m * math.sqrt(abs(way_m)))

    def _doubt(self, left_m: float, right_m: float, turn_rad: float, heading_rad: float) -> None:
        """Propagate the errors to the pose, to first order: systematic errors add up, as do variances of random errors.

        Source: Kelly, Linearized error propagation in odometry, IJRR 23 (2004). The systematic errors are known here,
        as for a calibrated base.
        """
        forward_m = 0.5 * (left_m + right_m)
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        move = np.array([[1.0, 0.0, -forward_m * sin], [0.0, 1.0, forward_m * cos], [0.0, 0.0, 1.0]])
        by_forward = np.array([cos, sin, 0.0])
        by_turn = np.array([-0.5 * forward_m * sin, 0.5 * forward_m * cos, 1.0])
        by_left = 0.5 * by_forward - by_turn / self._track_m
        by_right = 0.5 * by_forward + by_turn / self._track_m
        # Transposed: numpy builds rows much faster than columns.
        self._sensitivity = (
            move @ self._sensitivity + np.array((by_left * left_m, by_right * right_m, -by_turn * turn_rad)).T
        )
        variance_m = self.config.noise_m**2
        self._random_covariance = (
            move @ self._random_covariance @ move.T
            + variance_m * abs(left_m) * np.outer(by_left, by_left)
            + variance_m * abs(right_m) * np.outer(by_right, by_right)
        )

    def _pose_covariance(self) -> Matrix:
        systematic = self._sensitivity @ self._systematic @ self._sensitivity.T
        return systematic + self._random_covariance + self._ticks_covariance

    def _twist_covariance(self, left_m: float, right_m: float, turn_rad: float, elapsed_s: float) -> Matrix:
        config = self.config
        left_m2 = (config.left_error * left_m) ** 2 + config.noise_m**2 * abs(left_m) + 2.0 * self._tick_m2
        right_m2 = (
            (config.right_error * right_m) ** 2 + config.noise_m**2 * abs(right_m) + 2.0 * self._tick_m2
        )
        both, difference = 0.25 * (left_m2 + right_m2), 0.5 * (right_m2 - left_m2) / self._track_m
        turn = (left_m2 + right_m2) / self._track_m**2 + (config.track_error * turn_rad) ** 2
        return np.array([[both, difference], [difference, turn]]) / elapsed_s**2


Axes = tuple[float, float, float]
"""Components along the sensor's axes: x forward, y left, z up."""


@dataclass(frozen=True, slots=True)
class ImuConfig:
    """Noise of each reading, as standard deviation on each axis."""

    gyro_noise_rad_s: float = 0.002
    accel_noise_m_s2: float = 0.02


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
