"""The odometry of a recording -> a path: poses 2 cm apart, without the standing, with turns on the spot and cusps kept."""

import math

import numpy as np
import numpy.typing as npt

from teleop.path.pose import PathError, Pose, Poses, wrap

STEP_M = 0.02
"""Between two poses of the path."""
TURN_RAD = 0.35
"""More than this within one step is a turn on the spot."""
SAME_PLACE_M = 0.005
CUSP_M = 0.02
"""Rolling back by less than this is no change of direction."""
LEAST_M = 0.05
"""A path shorter than this is none."""
JUMP_M, JUMP_M_S = 0.25, 2.0
"""Odometry that goes farther than both together between two samples was set to another value."""


def to_poses(times_s: npt.NDArray[np.float64], samples: Poses) -> Poses:
    """The path that a robot drove.

    Args:
        times_s: when each pose was recorded, shape (n,).
        samples: the poses, shape (n, 3).

    Raises:
        PathError: there is no path in it, or none that can be driven.
    """
    if len(samples) < 2 or not np.isfinite(samples).all():
        raise PathError("the recording's odometry is empty, or has poses that are not of finite numbers")
    _check_steady(times_s, samples)
    signed_m = _travel(samples)
    if float(np.abs(np.diff(signed_m)).sum()) < LEAST_M:
        raise PathError("the robot of this recording does not drive: record it while it does")
    ends = {*_cusps(signed_m), len(samples) - 1}
    poses = [Pose(*row) for row in samples.tolist()]
    kept = [poses[0]]
    for i, pose in enumerate(poses):
        last = kept[-1]
        away_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
        if i in ends or abs(wrap(pose.yaw_rad - last.yaw_rad)) > TURN_RAD:
            # A step of millimetres has no direction: the turn is where the robot was.
            kept.append(last._replace(yaw_rad=pose.yaw_rad) if away_m < SAME_PLACE_M else pose)
        elif away_m >= STEP_M:
            kept.append(pose)
    return np.array(kept)


def _check_steady(times_s: npt.NDArray[np.float64], samples: Poses) -> None:
    steps_m = np.hypot(*np.diff(samples[:, :2], axis=0).T)
    jumps = np.flatnonzero(steps_m > JUMP_M + JUMP_M_S * np.maximum(np.diff(times_s), 0.0))
    if len(jumps):
        at = int(jumps[0])
        raise PathError(
            f"the odometry jumps by {steps_m[at]:.2f} m, {times_s[at + 1] - times_s[0]:.1f} s after the recording's "
            "start (a reset?): such a path cannot be driven; record one without"
        )


def _travel(samples: Poses) -> npt.NDArray[np.float64]:
    """How far the robot has driven, backwards counted negative, up to each sample [m]."""
    (dx_m, dy_m, dyaw), yaw = np.diff(samples, axis=0).T, samples[:-1, 2]
    middle = yaw + np.arctan2(np.sin(dyaw), np.cos(dyaw)) / 2
    return np.concatenate(([0.0], np.cumsum(dx_m * np.cos(middle) + dy_m * np.sin(middle))))


def _cusps(signed_m: npt.NDArray[np.float64]) -> list[int]:
    """Where the robot changes between forwards and backwards."""
    cusps: list[int] = []
    direction, farthest = 0.0, 0
    for i, travel_m in enumerate(signed_m.tolist()):
        gain_m = travel_m - float(signed_m[farthest])
        if direction == 0.0:
            if abs(gain_m) > CUSP_M:
                direction, farthest = math.copysign(1.0, gain_m), i
        elif gain_m * direction >= 0.0:
            farthest = i
        elif abs(gain_m) > CUSP_M:
            cusps.append(farthest)
            direction, farthest = -direction, i
    return cusps
