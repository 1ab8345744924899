"""Convert recorded odometry to a path: poses 2 cm apart, without standstill, with turns on the spot and cusps."""

import math

import numpy as np
import numpy.typing as npt

from teleop.path.pose import PathError, Pose, Poses, wrap

STEP_M = 0.02
"""Distance between two poses of the path."""
TURN_RAD = 0.35
"""A larger change of heading within one step is a turn on the spot."""
SAME_PLACE_M = 0.005
CUSP_M = 0.02
"""A shorter motion in the opposite direction does not count as a change of direction."""
LEAST_M = 0.05
"""Minimum length of a path."""
JUMP_M, JUMP_M_S = 0.25, 2.0
"""A displacement between two samples beyond `JUMP_M` plus `JUMP_M_S` times their interval is a jump of the odometry."""


def to_poses(times_s: npt.NDArray[np.float64], samples: Poses) -> Poses:
    """Return the path that a robot drove.

    Args:
        times_s: recording time of each pose, shape (n,).
        samples: the poses, shape (n, 3).

    Raises:
        PathError: the recording has no path, or one that cannot be driven.
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
            # A step of millimetres has no direction: place the turn at the robot's previous position.
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
    """Return the signed distance driven up to each sample [m]; backward motion is negative."""
    (dx_m, dy_m, dyaw), yaw = np.diff(samples, axis=0).T, samples[:-1, 2]
    middle = yaw + np.arctan2(np.sin(dyaw), np.cos(dyaw)) / 2
    return np.concatenate(([0.0], np.cumsum(dx_m * np.cos(middle) + dy_m * np.sin(middle))))


def _cusps(signed_m: npt.NDArray[np.float64]) -> list[int]:
    """Return the indices at which the robot changes between forward and backward."""
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
