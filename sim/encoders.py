"""Odometry as a real base has it: two wheel encoders and a geometry that is never quite right.

Pure but for a seeded generator. The pose drifts away from the true one as it does on a robot: by what each wheel is
smaller than the base takes it for, by what the track is, by what the floor does to every metre, and by whole ticks.
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
    """What the encoders count, and what the base has wrong.

    Attributes:
        ticks: of one turn of a wheel.
        left_error: the share by which the base takes the left wheel for larger than it is.
        right_error: likewise.
        track_error: the share by which it takes the wheels for farther apart than they are.
        noise_m: standard deviation of what a wheel has counted after 1 m; it grows with the root of the way.

    Raises:
        ValueError: A value makes no sense, by name.
    """

    ticks: int = 16384
    left_error: float = 0.001
    right_error: float = 0.0005
    track_error: float = 0.005
    noise_m: float = 0.0005

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise ValueError(f"ticks must be at least 1, not {self.ticks}.")
        for name in ("left_error", "right_error", "track_error"):
            if not abs(getattr(self, name)) <= MAX_ERROR:
                raise ValueError(
                    f"{name} must be from -{MAX_ERROR} to {MAX_ERROR}, not {getattr(self, name)}."
                )
        if not (math.isfinite(self.noise_m) and self.noise_m >= 0.0):
            raise ValueError(f"noise_m must be finite and not negative, not {self.noise_m}.")


PERFECT = EncoderConfig(left_error=0.0, right_error=0.0, track_error=0.0, noise_m=0.0)


class Reckoning(NamedTuple):
    """A pose in the frame of the last reset, the mean twist since the reading before, and how sure both are."""

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
        config: what is wrong with the base's idea of it.
        seed: of the noise; the same seed and way make the same odometry.
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
        self.reset(0.0, 0.0)

    def reset(self, left_rad: float, right_rad: float) -> None:
        """Starts anew at the origin, with the wheels at these angles."""
        self._left, self._right = self._count(left_rad), self._count(right_rad)
        self._x_m = self._y_m = self._yaw_rad = 0.0
        self._sensitivity = np.zeros((3, 3))
        self._random_covariance = np.zeros((3, 3))

    def read(self, left_rad: float, right_rad: float, elapsed_s: float) -> Reckoning:
        """Adds the way since the last reading, as an arc taken at its middle heading.

        Args:
            left_rad: the wheel's angle, counted over all turns.
            right_rad: likewise.
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
        """How the errors reach the pose, to first order: the systematic ones add up, the random ones' variances.

        Kelly, Linearized error propagation in odometry, IJRR 23 (2004). The size of the systematic errors is known
        here, as it is for a base after its calibration.
        """
        forward_m = 0.5 * (left_m + right_m)
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        move = np.array([[1.0, 0.0, -forward_m * sin], [0.0, 1.0, forward_m * cos], [0.0, 0.0, 1.0]])
        by_forward = np.array([cos, sin, 0.0])
        by_turn = np.array([-0.5 * forward_m * sin, 0.5 * forward_m * cos, 1.0])
        by_left = 0.5 * by_forward - by_turn / self._track_m
        by_right = 0.5 * by_forward + by_turn / self._track_m
        self._sensitivity = move @ self._sensitivity + np.column_stack(
            (by_left * left_m, by_right * right_m, -by_turn * turn_rad)
        )
        variance_m = self.config.noise_m**2
        self._random_covariance = (
            move @ self._random_covariance @ move.T
            + variance_m * abs(left_m) * np.outer(by_left, by_left)
            + variance_m * abs(right_m) * np.outer(by_right, by_right)
        )

    def _pose_covariance(self) -> Matrix:
        systematic = self._sensitivity @ self._systematic @ self._sensitivity.T
        ticks = np.diag([self._tick_m2, self._tick_m2, 2.0 * self._tick_m2 / self._track_m**2])
        return systematic + self._random_covariance + ticks

    def _twist_covariance(self, left_m: float, right_m: float, turn_rad: float, elapsed_s: float) -> Matrix:
        config = self.config
        left_m2 = (config.left_error * left_m) ** 2 + config.noise_m**2 * abs(left_m) + 2.0 * self._tick_m2
        right_m2 = (
            (config.right_error * right_m) ** 2 + config.noise_m**2 * abs(right_m) + 2.0 * self._tick_m2
        )
        both, difference = 0.25 * (left_m2 + right_m2), 0.5 * (right_m2 - left_m2) / self._track_m
        turn = (left_m2 + right_m2) / self._track_m**2 + (config.track_error * turn_rad) ** 2
        return np.array([[both, difference], [difference, turn]]) / elapsed_s**2
