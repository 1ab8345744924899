"""Pure pursuit along a leg, and the turn on the spot. What comes out is always within the limits.

Pure pursuit steers on the arc that leads through a point of the path some way ahead: at distance d and an
angle α from where the robot moves to, its curvature is 2·sin(α)/d (Coulter, 1992).
"""

import math
from dataclasses import dataclass

from teleop.path.legs import Leg
from teleop.path.pose import Pose, wrap
from teleop.pilot import Velocity

LOOKAHEAD_S = 0.6
MIN_LOOKAHEAD_M = 0.15
MAX_LOOKAHEAD_M = 0.6
CREEP_M_S = 0.05
"""The slowest on the way to the end of a leg; the supervisor takes what is below 0.02 m/s for standing."""
TURN_GAIN_PER_S = 4.0
MIN_TURN_RAD_S = 0.1
NEAR_M = 0.01
"""A point nearer than this has no bearing."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How fast a path is driven; all above zero."""

    speed_m_s: float = 0.4
    turn_rad_s: float = 1.5
    braking_m_s2: float = 0.4
    """Towards the end of a leg."""
    lateral_m_s2: float = 0.5
    """In curves."""


def lookahead_m(speed_m_s: float) -> float:
    """How far ahead to steer for."""
    return min(max(LOOKAHEAD_S * abs(speed_m_s), MIN_LOOKAHEAD_M), MAX_LOOKAHEAD_M)


def turn(error_rad: float, limits: Limits) -> Velocity:
    """On the spot, towards a heading that is `error_rad` further to the left."""
    rate_rad_s = min(max(TURN_GAIN_PER_S * abs(error_rad), MIN_TURN_RAD_S), limits.turn_rad_s)
    return Velocity(0.0, math.copysign(rate_rad_s, error_rad))


def bearing(point_m: tuple[float, float], pose: Pose, *, backwards: bool) -> float:
    """How far to the left of where the robot moves to a point lies [rad]; zero for one that it stands on."""
    dx_m, dy_m = point_m[0] - pose.x_m, point_m[1] - pose.y_m
    if math.hypot(dx_m, dy_m) < NEAR_M:
        return 0.0
    return wrap(math.atan2(dy_m, dx_m) - pose.yaw_rad - (math.pi if backwards else 0.0))


def pursue(
    leg: Leg, point_m: tuple[float, float], along_m: float, left_m: float, pose: Pose, limits: Limits
) -> Velocity:
    """The arc through a point ahead, as fast as its bend, the leg's next bend and the leg's end permit.

    Args:
        leg: what is driven.
        point_m: what is steered for.
        along_m: how far along the leg the robot is.
        left_m: how far it still has to go on it.
        pose: where it is.
        limits: how fast.
    """
    distance_m = max(math.hypot(point_m[0] - pose.x_m, point_m[1] - pose.y_m), NEAR_M)
    curvature_per_m = 2.0 * math.sin(bearing(point_m, pose, backwards=leg.backwards)) / distance_m
    bend_rad = abs(wrap(leg.heading_at(along_m + MAX_LOOKAHEAD_M) - leg.heading_at(along_m)))
    sharpest_per_m = max(abs(curvature_per_m), bend_rad / MAX_LOOKAHEAD_M)
    speed_m_s = min(limits.speed_m_s, math.sqrt(2.0 * limits.braking_m_s2 * max(left_m, 0.0)))
    if sharpest_per_m > 0.0:
        speed_m_s = min(
            speed_m_s, limits.turn_rad_s / sharpest_per_m, math.sqrt(limits.lateral_m_s2 / sharpest_per_m)
        )
    speed_m_s = min(max(speed_m_s, CREEP_M_S), limits.speed_m_s)
    rate_rad_s = min(max(curvature_per_m * speed_m_s, -limits.turn_rad_s), limits.turn_rad_s)
    return Velocity(-speed_m_s if leg.backwards else speed_m_s, rate_rad_s)
