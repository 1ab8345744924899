"""Detect a base that rolls or turns slowly although zero is commanded: on a slope, with a drifting drive, or pushed.

Below `runaway_linear_m_s` a single velocity proves nothing, because odometry is noisy. Over some seconds noise cancels, and a
motion adds up. At standstill the base must therefore not move by more than `ROLLED_M` within `WINDOW_S`, net and at the hull's rim.
"""

import math
from typing import NamedTuple

from supervisor.law.reckoning import Pose, between

ROLLED_M = 0.03
WINDOW_S = 10.0
STOOD_S = 2.0
"""A base that has rolled counts as standing when it has moved by at most `ROLLED_M` for this time."""


class Rest(NamedTuple):
    """Where the base has stood."""

    pose: Pose
    """The odometer pose at `since_s`."""
    since_s: float
    rolls: bool = False


def watch(rest: Rest | None, pose: Pose, now_s: float, radius_m: float) -> Rest:
    """Compare the pose of a base at zero command with that at the beginning of the window.

    Args:
        rest: the result of the last call; None if the base was commanded to move, or was still braking.
        pose: the odometer pose.
        now_s: its time.
        radius_m: of the hull.
    """
    if rest is None:
        return Rest(pose, now_s)
    moved = between(rest.pose, pose)
    if math.hypot(moved.x_m, moved.y_m) + abs(moved.yaw_rad) * radius_m > ROLLED_M:
        return Rest(pose, now_s, rolls=True)
    if now_s - rest.since_s > (STOOD_S if rest.rolls else WINDOW_S):
        return Rest(pose, now_s)
    return rest
