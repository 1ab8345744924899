"""Poses in a plane, and paths as arrays of them."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wire.messages import Odometry, yaw_of


class PathError(ValueError):
    """There is no such path, or it cannot be driven; the message says why, and what to do."""


class Pose(NamedTuple):
    """Where the robot is and where its front points; yaw counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(message: Odometry) -> "Pose":
        """What odometry says."""
        pose = message.pose.pose
        return Pose(pose.position.x, pose.position.y, yaw_of(pose.orientation))

    @property
    def is_finite(self) -> bool:
        return all(math.isfinite(value) for value in self)


Poses = npt.NDArray[np.float64]
"""A path: shape (n, 3), each row x [m], y [m], yaw [rad]. Two rows at one place are a turn on the spot;
a row behind its predecessor, as that one looks, is reached backwards."""


def wrap(angle_rad: float) -> float:
    """The same angle in [-π, π]."""
    return math.remainder(angle_rad, math.tau)


def placed(poses: Poses, frame: Pose) -> Poses:
    """Poses that are given as seen from `frame`, in the frame in which `frame` itself is given."""
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    x, y, yaw = poses.T
    return np.stack(
        (frame.x_m + cos * x - sin * y, frame.y_m + sin * x + cos * y, yaw + frame.yaw_rad), axis=1
    )


def seen_from(pose: Pose, frame: Pose) -> Pose:
    """`pose` as seen from `frame`."""
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    dx_m, dy_m = pose.x_m - frame.x_m, pose.y_m - frame.y_m
    return Pose(cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m, wrap(pose.yaw_rad - frame.yaw_rad))
