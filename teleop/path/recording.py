"""The odometry of a recording -> a path, without standstill, with turns on the spot and changes of direction."""

import math
from itertools import pairwise

import numpy as np

from teleop.path.course import STEP_M, Floats, PathError, Pose, Poses, is_backwards, wrap

TURN_RAD = 0.35
"""A larger change of heading within one step is a turn on the spot."""
SAME_PLACE_M = 0.005
LEAST_M = 0.05
"""Minimum length of a path."""
JUMP_M, JUMP_M_S = 0.25, 2.0
"""A displacement between two samples beyond `JUMP_M` plus `JUMP_M_S` times their interval is a jump of the odometry."""


def to_poses(times_s: Floats, samples: Poses) -> Poses:
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
    poses = [Pose(*row) for row in samples.tolist()]
    kept = [poses[0]]
    was_backwards: bool | None = None
    farthest = poses[0]
    """The pose farthest from the last kept one: a robot that changes direction turned round there."""
    for pose in poses:
        last = kept[-1]
        away_m = _distance_m(last, pose)
        if abs(wrap(pose.yaw_rad - last.yaw_rad)) > TURN_RAD:
            # A step of millimetres has no direction: place the turn at the robot's previous position.
            kept.append(last._replace(yaw_rad=pose.yaw_rad) if away_m < SAME_PLACE_M else pose)
        elif away_m >= STEP_M:
            backwards = is_backwards(last, pose)
            if was_backwards is not None and backwards != was_backwards and farthest != last:
                kept.append(farthest)
            kept.append(pose)
            was_backwards = backwards
        if kept[-1] != last or away_m > _distance_m(last, farthest):
            farthest = pose
    if kept[-1] != poses[-1]:
        kept.append(poses[-1])
    if sum(_distance_m(*pair) for pair in pairwise(kept)) < LEAST_M:
        raise PathError("the robot of this recording does not drive: record it while it does")
    return np.array(kept)


def _distance_m(here: Pose, there: Pose) -> float:
    return math.hypot(there.x_m - here.x_m, there.y_m - here.y_m)


def _check_steady(times_s: Floats, samples: Poses) -> None:
    steps_m = np.hypot(*np.diff(samples[:, :2], axis=0).T)
    jumps = np.flatnonzero(steps_m > JUMP_M + JUMP_M_S * np.maximum(np.diff(times_s), 0.0))
    if len(jumps):
        at = int(jumps[0])
        raise PathError(
            f"the odometry jumps by {steps_m[at]:.2f} m, {times_s[at + 1] - times_s[0]:.1f} s after the recording's "
            "start (a reset?): such a path cannot be driven; record one without"
        )
