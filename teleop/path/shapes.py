"""Square and circle in the robot's frame at the start: it stands at the origin and faces along x."""

import math

import numpy as np

from teleop.path.pose import Poses

STEP_M = 0.02
"""Distance between two poses of a curve."""
MIN_STEPS = 72
"""Minimum number of steps of a full circle."""


def square(side_m: float, laps: int = 1, *, clockwise: bool = False) -> Poses:
    """Return a square: the first side is straight ahead, each corner a turn on the spot; it ends at the start pose."""
    quarter_rad = -math.pi / 2 if clockwise else math.pi / 2
    x_m = y_m = 0.0
    rows: list[tuple[float, float, float]] = []
    for side in range(4 * laps):
        yaw_rad = side * quarter_rad
        rows.append((x_m, y_m, yaw_rad))
        x_m += side_m * round(math.cos(yaw_rad))
        y_m += side_m * round(math.sin(yaw_rad))
        rows.append((x_m, y_m, yaw_rad))
    rows.append((x_m, y_m, 4 * laps * quarter_rad))
    return np.array(rows)


def circle(radius_m: float, laps: int = 1, *, clockwise: bool = False) -> Poses:
    """Return a circle with its centre to the left, or to the right if clockwise; it ends at the start pose."""
    steps = max(MIN_STEPS, math.ceil(math.tau * radius_m / STEP_M))
    angle = np.linspace(0.0, laps * math.tau, laps * steps + 1)
    side = -1.0 if clockwise else 1.0
    return np.stack((radius_m * np.sin(angle), side * radius_m * (1.0 - np.cos(angle)), side * angle), axis=1)
