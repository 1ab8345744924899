"""Where the robot has gone, by odometry's velocity; for what a scan showed a moment ago.

Only differences count: the odometer starts anywhere and drifts. A velocity that the base cannot have is a
spike, and nothing is reckoned with it.
"""

import math
from typing import NamedTuple

LONGEST_S = 0.25
"""How long a velocity is taken to hold when odometry falls silent."""

NEGLIGIBLE = 1e-3
"""[m, rad] A move below this is not worth looking again."""


class Velocity(NamedTuple):
    """A planar twist."""

    linear_m_s: float
    angular_rad_s: float


STANDSTILL = Velocity(0.0, 0.0)


class Pose(NamedTuple):
    """A planar pose."""

    x_m: float
    y_m: float
    yaw_rad: float


class Odometer(NamedTuple):
    """Dead reckoning since the start, up to the last odometry."""

    pose: Pose = Pose(0.0, 0.0, 0.0)
    turned_rad: float = 0.0
    """The sum of all turns, either way."""
    travelled_m: float = 0.0
    """The sum of all ways, forward and back."""
    velocity: Velocity = STANDSTILL
    at_s: float = 0.0


def reckon(odometer: Odometer, velocity: Velocity, now_s: float, fastest: Velocity) -> Odometer:
    """The odometer after the velocity that has held until now, and with the one that holds from now on.

    Args:
        odometer: at the last odometry.
        velocity: what odometry says now.
        now_s: when it arrived.
        fastest: what the base can do; a velocity beyond it is a spike and counts as none.
    """
    believable = (
        abs(velocity.linear_m_s) <= fastest.linear_m_s
        and abs(velocity.angular_rad_s) <= fastest.angular_rad_s
    )
    held_s = _held(odometer, now_s)
    return Odometer(
        where(odometer, now_s),
        odometer.turned_rad + abs(odometer.velocity.angular_rad_s) * held_s,
        odometer.travelled_m + abs(odometer.velocity.linear_m_s) * held_s,
        velocity if believable else STANDSTILL,
        now_s,
    )


def displacement(odometer: Odometer, then: Pose, now_s: float) -> Pose | None:
    """How the robot has moved since it was at `then`, in its frame of then; None for next to nothing."""
    pose = where(odometer, now_s)
    x_m, y_m, yaw_rad = pose.x_m - then.x_m, pose.y_m - then.y_m, pose.yaw_rad - then.yaw_rad
    if max(abs(x_m), abs(y_m), abs(yaw_rad)) < NEGLIGIBLE:
        return None
    cos, sin = math.cos(then.yaw_rad), math.sin(then.yaw_rad)
    return Pose(cos * x_m + sin * y_m, cos * y_m - sin * x_m, yaw_rad)


def where(odometer: Odometer, now_s: float) -> Pose:
    """The pose by now, if the last velocity holds: an arc, taken at its middle heading."""
    dt_s = _held(odometer, now_s)
    pose, velocity = odometer.pose, odometer.velocity
    heading_rad = pose.yaw_rad + velocity.angular_rad_s * dt_s / 2
    return Pose(
        pose.x_m + velocity.linear_m_s * dt_s * math.cos(heading_rad),
        pose.y_m + velocity.linear_m_s * dt_s * math.sin(heading_rad),
        pose.yaw_rad + velocity.angular_rad_s * dt_s,
    )


def _held(odometer: Odometer, now_s: float) -> float:
    return min(max(0.0, now_s - odometer.at_s), LONGEST_S)
