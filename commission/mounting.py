"""Computes the yaw of a lidar, and the scale and the signs of odometry, from straight drives and turns before a wall.

When the base drives the distance s by odometry, the distance of a wall at the bearing φ from the lidar changes by

    Δd = -k · s · cos(φ - ψ)

with the scale k (true distance divided by distance of odometry) and the direction ψ of the base's x axis in the lidar's frame. The yaw of the
mount is -ψ. Drives at two headings determine both. When the base turns, the bearing of the wall changes by the opposite angle; of
a mirrored lidar, by the same.

Motion alone cannot separate a mirrored lidar from a wrong turn sign of odometry, or a lidar that is turned by 180 degrees from a
wrong forward sign: a person who sees the robot decides.

The scale is that of odometry's poses. The law uses odometry's velocity: both must show the same motion.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from commission.estimate import UNKNOWN, Estimate, least_squares, of_repeats
from commission.wall import Wall

LEAST_M = 0.1
LEAST_RAD = 0.3
"""A shorter drive or turn is not judged."""
MOVED_M, MOVED_RAD = 0.01, 0.03
"""A smaller change of the wall's distance or bearing does not show a motion."""
SPEED_SHARE = 0.1
"""How much the integral of odometry's velocity may differ from the change of its pose."""
SCALE_SHARE = 0.35
"""Permitted difference between the motions by the wall and by odometry, as a share of that by odometry.

A first drive that is not perpendicular to the wall explains a difference of up to 13 %. The drives end by odometry: if it shows
much less than the true motion, the next drives come too close to the wall.
"""


class Motion(NamedTuple):
    """A straight drive or a turn on the spot, from rest to rest."""

    odometry: float
    """The distance ahead [m] or the turn counter-clockwise [rad], by the poses of odometry."""
    by_speed: float
    """The same by the integral of odometry's velocity."""
    before: Wall
    after: Wall
    """The wall in the lidar's frame, as seen from above."""

    @property
    def speed_disagrees(self) -> bool:
        return abs(self.by_speed - self.odometry) > SPEED_SHARE * abs(self.odometry)

    @property
    def nearer_m(self) -> float:
        return self.before.distance_m - self.after.distance_m

    @property
    def bearing_rad(self) -> float:
        """Mean bearing of the wall."""
        return self.before.bearing_rad + 0.5 * turn_between(self.before, self.after)


def turn_between(before: Wall, after: Wall) -> float:
    """Return the change of a wall's bearing, in [-π, π]."""
    return math.remainder(after.bearing_rad - before.bearing_rad, math.tau)


def is_moved(before: Wall, after: Wall) -> bool:
    """Return whether a wall shows that the robot has moved."""
    is_nearer = abs(before.distance_m - after.distance_m) >= MOVED_M
    return is_nearer or abs(turn_between(before, after)) >= MOVED_RAD


class Heading(NamedTuple):
    """What straight drives show."""

    yaw_rad: Estimate
    """Direction of the lidar's x axis in the base frame."""
    scale: Estimate
    """True distance divided by distance of odometry."""


def heading(straights: Sequence[Motion]) -> Heading:
    """Return the yaw of the lidar and the scale of odometry, from at least three straight drives at two headings."""
    driven = [one for one in straights if abs(one.odometry) >= LEAST_M]
    if not driven:
        return Heading(UNKNOWN, UNKNOWN)
    bearings = np.array([one.bearing_rad for one in driven])
    ways = np.array([one.odometry for one in driven])
    design = np.stack((ways * np.cos(bearings), ways * np.sin(bearings)), axis=1)
    fit = least_squares(design, np.array([one.nearer_m for one in driven]))
    a, b = fit.parameters.tolist()
    scale = math.hypot(a, b)
    if scale == 0.0:
        return Heading(UNKNOWN, UNKNOWN)
    yaw = fit.estimate(-math.atan2(b, a), np.array([b, -a]) / scale**2)
    return Heading(yaw, fit.estimate(scale, np.array([a, b]) / scale))


def turn_scale(turns: Sequence[Motion]) -> Estimate:
    """Return the true turn divided by the turn of odometry; negative if lidar and odometry disagree on the direction."""
    turned = [one for one in turns if abs(one.odometry) >= LEAST_RAD]
    return of_repeats([-turn_between(one.before, one.after) / one.odometry for one in turned])


class Mistake(StrEnum):
    """A wrong sign or mount; the value is the sentence for the person."""

    BASE_DRIFTS = (
        "the robot moves although zero is commanded: switch it off, and correct the zero of its drives"
    )
    BASE_BACKWARDS = (
        "the base drives backwards when it is commanded ahead: correct the sign in its driver or its wiring"
    )
    BASE_TURNS_BACK = "the base turns right when it is commanded to turn left: correct the sign in its driver or swap its motors"
    ODOMETRY_BACKWARDS = "odometry has the wrong forward sign: correct it in the base's driver"
    ODOMETRY_TURNS_BACK = "odometry has the wrong turn sign: correct it in the base's driver"
    ODOMETRY_DISTANCE = "odometry and the wall show different distances: correct the wheel radius or the gear ratio in the base's driver"
    ODOMETRY_TURN = "odometry and the wall show different turns: correct the track width in the base's driver"
    ODOMETRY_SPEED = "the velocity of odometry is not that of its poses: correct it in the base's driver"
    LIDAR_TURNED = "the surface ahead, by the lidar's mount, is not ahead of the robot: correct yaw_rad, by π for example"
    LIDAR_MIRRORED = "the lidar is mirrored: change flip in its table"


def forward_mistakes(drive: Motion, *, seen_ahead: bool) -> frozenset[Mistake]:
    """Return what is wrong after a drive that was commanded ahead, toward the wall.

    Args:
        drive: the drive.
        seen_ahead: whether a person saw the robot drive ahead.
    """
    kinds = (
        Mistake.BASE_BACKWARDS,
        Mistake.ODOMETRY_BACKWARDS,
        Mistake.ODOMETRY_DISTANCE,
        Mistake.LIDAR_TURNED,
    )
    return _mistakes(drive, drive.nearer_m, kinds, as_commanded=seen_ahead)


def turn_mistakes(turn: Motion, *, seen_left: bool) -> frozenset[Mistake]:
    """Return what is wrong after a turn that was commanded to the left.

    Args:
        turn: the turn.
        seen_left: whether a person saw the robot turn left.
    """
    kinds = (
        Mistake.BASE_TURNS_BACK,
        Mistake.ODOMETRY_TURNS_BACK,
        Mistake.ODOMETRY_TURN,
        Mistake.LIDAR_MIRRORED,
    )
    return _mistakes(turn, -turn_between(turn.before, turn.after), kinds, as_commanded=seen_left)


def _mistakes(
    motion: Motion, by_lidar: float, kinds: tuple[Mistake, Mistake, Mistake, Mistake], *, as_commanded: bool
) -> frozenset[Mistake]:
    base, odometry, scale, lidar = kinds
    found = {
        base: not as_commanded,
        odometry: (motion.odometry > 0.0) is not as_commanded,
        scale: not abs(abs(by_lidar) - abs(motion.odometry)) <= SCALE_SHARE * abs(motion.odometry),
        Mistake.ODOMETRY_SPEED: motion.speed_disagrees,
        lidar: (by_lidar > 0.0) is not as_commanded,
    }
    return frozenset(mistake for mistake, is_made in found.items() if is_made)
