"""The hull's own way: what the hull occupied a moment ago was free then, although no lidar looked at it.

A lidar at the front never sees the space behind it. The robot has proven more than its views: no object was where the hull
was. For `unseen_memory_s`, this space counts as seen free, as in `seen_space.py`. Nothing beside it does: the hull may have
passed an object without touching it, so the barrier keeps its distance from what lies just outside the way.

Only poses that odometry has measured are kept, `STEP_M` apart. What a round hull leaves between two of them counts as unseen.
"""

import math
from typing import NamedTuple

import numpy as np

from supervisor.law.clearance import Floats, Hull, Mask
from supervisor.law.reckoning import NEGLIGIBLE, Pose, between

STEP_M = 0.1
"""The hull moves so far from one kept pose to the next: between them, a round hull of 0.25 m leaves 5 mm at its sides."""

MOST_STANDS = 64
"""Maximum number of kept poses; the newest are kept: 6.4 m of a straight way."""


class Stand(NamedTuple):
    """A pose at which the hull was."""

    pose: Pose
    """The odometer pose."""
    until_s: float
    """When the hull was there last."""


def went(way: tuple[Stand, ...], pose: Pose, at_s: float, since_s: float, hull: Hull) -> tuple[Stand, ...]:
    """Return the own way after the hull was at a pose, without the poses that it left before `since_s`."""
    kept = tuple(stand for stand in way if stand.until_s >= since_s)[-MOST_STANDS:]
    if not kept:
        return (Stand(pose, at_s),)
    last = kept[-1]
    step = between(last.pose, pose)
    moved_m = math.hypot(step.x_m, step.y_m) + abs(step.yaw_rad) * hull.radius_m
    if moved_m < NEGLIGIBLE:
        return (*kept[:-1], Stand(last.pose, max(last.until_s, at_s)))
    return (*kept, Stand(pose, at_s)) if moved_m >= STEP_M else kept


class OwnWay(NamedTuple):
    """The hull's poses in the base frame of a view, as evidence for that view's hidden places."""

    hull: Hull
    poses: Floats
    """(m, 3): x [m], y [m], yaw [rad]."""

    def proves_free(self, points: Floats, smallest_m: float) -> Mask:  # noqa: ARG002 - as other evidence
        """Return whether the hull has covered each of the points (n, 2) [m] of the base frame."""
        places = self.poses[:, :2]
        nearest, farthest = places.min(axis=0) - self.hull.radius_m, places.max(axis=0) + self.hull.radius_m
        (near,) = ((points >= nearest) & (points <= farthest)).all(axis=1).nonzero()
        covered = np.zeros(len(points), dtype=np.bool_)
        covered[near] = self.hull.covers_along(points[near], self.poses).any(axis=0)
        return covered


def own_way(way: tuple[Stand, ...], hull: Hull, pose: Pose) -> OwnWay:
    """Return the own way in the base frame of an odometer pose.

    Args:
        way: the kept poses, at least one.
        hull: the robot's outline.
        pose: the odometer pose.
    """
    return OwnWay(hull, np.array([between(pose, stand.pose) for stand in way]))
