"""Dead reckoning from odometry's velocity, to move the points of recent scans into the present base frame.

Only pose differences are used: the origin is arbitrary and the pose drifts. A velocity that the base cannot reach is
a spike and is replaced by zero.
"""

import math
from typing import NamedTuple

LONGEST_S = 0.25
"""Longest time for which the last velocity is extrapolated when odometry falls silent."""

RECALL_STEP_S = 0.01
"""Minimum time between two remembered odometers: 1 cm of travel at 1 m/s."""

NEGLIGIBLE = 1e-3
"""[m, rad] A displacement below this on every axis is ignored."""


class Velocity(NamedTuple):
    """A planar twist in the base frame."""

    linear_m_s: float
    angular_rad_s: float


STANDSTILL = Velocity(0.0, 0.0)


class Pose(NamedTuple):
    """A planar pose."""

    x_m: float
    y_m: float
    yaw_rad: float


class Odometer(NamedTuple):
    """Dead-reckoned pose and velocity at the last odometry message."""

    pose: Pose = Pose(0.0, 0.0, 0.0)
    velocity: Velocity = STANDSTILL
    at_s: float = 0.0


def reckon(odometer: Odometer, velocity: Velocity, now_s: float, fastest: Velocity) -> Odometer:
    """Integrate the odometer's velocity up to now, and return the odometer with the new velocity.

    Args:
        odometer: the odometer at the previous odometry message.
        velocity: the newly measured velocity.
        now_s: its arrival time.
        fastest: the fastest plausible velocity; a faster one is a spike and counts as zero.
    """
    believable = (
        abs(velocity.linear_m_s) <= fastest.linear_m_s
        and abs(velocity.angular_rad_s) <= fastest.angular_rad_s
    )
    return Odometer(where(odometer, now_s), velocity if believable else STANDSTILL, now_s)


def remembered(earlier: tuple[Odometer, ...], odometer: Odometer, since_s: float) -> tuple[Odometer, ...]:
    """Append an odometer to the earlier ones and drop those before `since_s`.

    Returns the earlier ones unchanged if the odometer is less than `RECALL_STEP_S` newer than the last of them.
    """
    if earlier and odometer.at_s < earlier[-1].at_s + RECALL_STEP_S:
        return earlier
    return (*(one for one in earlier if one.at_s >= since_s), odometer)


def back_then(earlier: tuple[Odometer, ...], odometer: Odometer, then_s: float) -> Pose:
    """Return the pose at `then_s`, which may be before the last odometry.

    For times before the first remembered odometer, that odometer's pose is returned.
    """
    if odometer.at_s <= then_s or not earlier:
        return where(odometer, then_s)
    return where(next((one for one in reversed(earlier) if one.at_s <= then_s), earlier[0]), then_s)


def displacement(odometer: Odometer, then: Pose, now_s: float) -> Pose | None:
    """Return the robot's displacement since the pose `then`, in the frame of `then`; None if it is negligible."""
    way = between(then, where(odometer, now_s))
    return None if max(abs(way.x_m), abs(way.y_m), abs(way.yaw_rad)) < NEGLIGIBLE else way


def between(then: Pose, now: Pose) -> Pose:
    """Return the pose `now` in the frame of the pose `then`."""
    x_m, y_m = now.x_m - then.x_m, now.y_m - then.y_m
    cos, sin = math.cos(then.yaw_rad), math.sin(then.yaw_rad)
    return Pose(cos * x_m + sin * y_m, cos * y_m - sin * x_m, now.yaw_rad - then.yaw_rad)


def where(odometer: Odometer, now_s: float) -> Pose:
    """Return the pose at `now_s`, extrapolated with the last velocity along the mean heading of the arc."""
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
