"""Selection of the points that may limit a motion of the base, by their distance from the hull.

No point of the hull moves faster than V = |v| + |ω|·radius. A point limits no such twist if it is farther from the hull
than

    d + e + V·T + V²/2a

with the stop distance d, the reaction time T and the deceleration a of the barrier, and the extra distance e on an arc
(`STRAY_M`), all of clearance.py. There the permitted speed κ is at least V, and the base stops on its path before it comes
within d + e of the point. On a free path no point is selected, and the barrier permits the whole command.
"""

import math
from typing import NamedTuple

from supervisor.law.clearance import STRAY_M, Barrier, Surroundings, moved, survey
from supervisor.law.reckoning import Odometer, Pose, displacement


class Place(NamedTuple):
    """Points that do not belong to a single scan, and the odometer pose that is their frame."""

    pose: Pose
    around: Surroundings


class KnownPoints(NamedTuple):
    """Points that are known from one pose, seen or hidden, and the barrier that applies to them."""

    around: Surroundings
    """The points in the base frame at that pose."""
    here: Surroundings | None
    """The points in the present base frame by odometry; None if the robot has hardly moved since."""
    barrier: Barrier


def reach_m(fastest_m_s: float, barrier: Barrier) -> float:
    """Return the distance from the hull beyond which no point limits a motion [m].

    Args:
        fastest_m_s: an upper bound of the speed of any point of the hull.
        barrier: the parameters of this step.
    """
    braking_m = fastest_m_s * fastest_m_s / (2.0 * barrier.deceleration_m_s2)
    return barrier.stop_distance_m + STRAY_M + fastest_m_s * barrier.reaction_s + braking_m


def in_reach(
    place: Place, odometer: Odometer, now_s: float, barrier: Barrier, fastest_m_s: float
) -> KnownPoints | None:
    """Return the points of a place that may limit a motion now; None if there are none.

    Args:
        place: the points, and the odometer pose that is their frame.
        odometer: the newest odometer.
        now_s: the present time.
        barrier: the parameters of this step.
        fastest_m_s: an upper bound of the speed of any point of the hull.
    """
    hull = place.around.hull
    way = displacement(odometer, place.pose, now_s)
    # By odometry, a point has come nearer by no more than the hull has moved.
    moved_m = 0.0 if way is None else math.hypot(way.x_m, way.y_m) + abs(way.yaw_rad) * hull.radius_m
    around = nearer_than(place.around, reach_m(fastest_m_s, barrier) + moved_m)
    if around is None:
        return None
    here = None if way is None else survey(hull, moved(around.points, way), around.kind)
    return KnownPoints(around, here, barrier)


def nearer_than(around: Surroundings, distance_m: float) -> Surroundings | None:
    """Return the points that are nearer to the hull than a distance [m], in the same order; None if there are none."""
    (near,) = (around.clearance_m < distance_m).nonzero()
    if len(near) == 0:
        return None
    return Surroundings(
        around.hull,
        around.kind,
        around.points.take(near, axis=0),
        around.clearance_m.take(near),
        around.per_linear.take(near),
        around.per_angular.take(near),
    )
