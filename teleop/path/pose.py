"""Planar poses, and paths as arrays of poses."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wire.messages import Odometry, yaw_of


class PathError(ValueError):
    """The path does not exist or cannot be driven; the message says why, and what to do."""


class Pose(NamedTuple):
    """Planar pose of the robot; yaw counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(message: Odometry) -> "Pose":
        """Return the pose in an odometry message."""
        pose = message.pose.pose
        return Pose(pose.position.x, pose.position.y, yaw_of(pose.orientation))

    @property
    def is_finite(self) -> bool:
        return all(math.isfinite(value) for value in self)


Poses = npt.NDArray[np.float64]
"""A path: shape (n, 3), each row x [m], y [m], yaw [rad]. Two rows at one place are a turn on the spot. A row behind its
predecessor, in the frame of the latter, is reached backwards."""


def wrap(angle_rad: float) -> float:
    """Return the same angle in [-π, π]."""
    return math.remainder(angle_rad, math.tau)


def placed(poses: Poses, frame: Pose) -> Poses:
    """Transform poses (n, 3) from the frame `frame` to its parent frame."""
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    x, y, yaw = poses.T
    return np.stack(
        (frame.x_m + cos * x - sin * y, frame.y_m + sin * x + cos * y, yaw + frame.yaw_rad), axis=1
    )


def seen_from(pose: Pose, frame: Pose) -> Pose:
    """Return `pose` in the frame `frame`."""
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    dx_m, dy_m = pose.x_m - frame.x_m, pose.y_m - frame.y_m
    return Pose(cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m, wrap(pose.yaw_rad - frame.yaw_rad))
