"""Scans and speeds of a robot that drives at a wall with the barrier active: the law's slowest case."""

import math

import numpy as np
import numpy.typing as npt

Ranges = npt.NDArray[np.float32]

ROOM_M = 3.0
WALL_M = 0.75
"""Distance from the lidar; near enough that the barrier limits `FORWARD_M_S`."""
WALL_SHARE = 1 / 6
NOISE_M = 0.002
RANGE_MIN_M, RANGE_MAX_M = 0.05, 12.0
ANGLE_MIN = -math.pi

FORWARD_M_S = 0.9
TURN_RAD_S = 0.2
ODOMETRY_M_S = 0.5


def scans(beams: int, count: int, *, wall_m: float = WALL_M) -> list[Ranges]:
    """Return `count` scans of shape (beams,) [m] with independent noise; a sixth of the beams hit the wall."""
    noise = np.random.default_rng(0)
    clean = np.full(beams, ROOM_M)
    half = round(beams * WALL_SHARE / 2)
    clean[beams // 2 - half : beams // 2 + half] = wall_m
    return [(clean + noise.normal(0.0, NOISE_M, beams)).astype(np.float32) for _ in range(count)]


def angle_increment(beams: int) -> float:
    """Return the angle between two beams of a full turn [rad]."""
    return 2 * math.pi / beams
