"""Where the robot has gone, by odometry's velocity; for what a scan showed a moment ago.

Only differences count: the odometer starts anywhere and drifts. A velocity that the base cannot have is a
spike, and nothing is reckoned with it.
"""

import math
from typing import NamedTuple

LONGEST_S = 0.25
"""How long a velocity is taken to hold when odometry falls silent."""

RECALL_STEP_S = 0.01
"""Of the odometry of a moment ago, so far apart is remembered: at 1 m/s, the robot has gone 1 cm."""

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
    return Odometer(where(odometer, now_s), velocity if believable else STANDSTILL, now_s)


def remembered(earlier: tuple[Odometer, ...], odometer: Odometer, since_s: float) -> tuple[Odometer, ...]:
    """The odometers since `since_s`, and this one."""
    if earlier and odometer.at_s < earlier[-1].at_s + RECALL_STEP_S:
        return earlier
    return (*(one for one in earlier if one.at_s >= since_s), odometer)


def back_then(earlier: tuple[Odometer, ...], odometer: Odometer, then_s: float) -> Pose:
    """The pose at a time that may lie before the last odometry; at the earliest, that of the first one remembered."""
    if odometer.at_s <= then_s or not earlier:
        return where(odometer, then_s)
    return where(next((one for one in reversed(earlier) if one.at_s <= then_s), earlier[0]), then_s)


def displacement(odometer: Odometer, then: Pose, now_s: float) -> Pose | None:
    """How the robot has moved since it was at `then`, in its frame of then; None for next to nothing."""
    way = between(then, where(odometer, now_s))
    return None if max(abs(way.x_m), abs(way.y_m), abs(way.yaw_rad)) < NEGLIGIBLE else way


def between(then: Pose, now: Pose) -> Pose:
    """The pose `now` in the frame of the pose `then`."""
    x_m, y_m = now.x_m - then.x_m, now.y_m - then.y_m
    cos, sin = math.cos(then.yaw_rad), math.sin(then.yaw_rad)
    return Pose(cos * x_m + sin * y_m, cos * y_m - sin * x_m, now.yaw_rad - then.yaw_rad)


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
