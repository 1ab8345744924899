"""Twists that are checked besides the commanded twist: intermediate ones, and a faster one in its direction."""

import math

from supervisor.law.reckoning import Velocity


def mixtures(has: Velocity, wanted: Velocity, negligible: Velocity) -> list[Velocity]:
    """Return the twists that combine excess velocity on one axis with the commanded velocity on the other.

    Args:
        has: the base's present twist.
        wanted: the commanded twist.
        negligible: the noise of odometry on each axis.
    """
    mixed: list[Velocity] = []
    if wanted.angular_rad_s != 0.0 and _exceeds(has.linear_m_s, wanted.linear_m_s, negligible.linear_m_s):
        mixed.append(Velocity(has.linear_m_s, wanted.angular_rad_s))
    if wanted.linear_m_s != 0.0 and _exceeds(
        has.angular_rad_s, wanted.angular_rad_s, negligible.angular_rad_s
    ):
        mixed.append(Velocity(wanted.linear_m_s, has.angular_rad_s))
    return mixed


def lags(has: Velocity, wanted: Velocity, negligible: Velocity) -> list[Velocity]:
    """Return the twists of a base that already has the commanded velocity on one axis and lags on the other.

    Args:
        has: the base's present twist.
        wanted: the twist that is about to be commanded.
        negligible: the noise of odometry on each axis.
    """
    lagging: list[Velocity] = []
    if wanted.linear_m_s != 0.0 and _exceeds(
        wanted.angular_rad_s, has.angular_rad_s, negligible.angular_rad_s
    ):
        lagging.append(Velocity(wanted.linear_m_s, has.angular_rad_s))
    if wanted.angular_rad_s != 0.0 and _exceeds(wanted.linear_m_s, has.linear_m_s, negligible.linear_m_s):
        lagging.append(Velocity(has.linear_m_s, wanted.angular_rad_s))
    return lagging


def along(has: Velocity, wanted: Velocity, rim_m: float) -> float:
    """Return the present speed along the commanded twist, as a share of it: of the centre and of a point at `rim_m`."""
    scaled = has.linear_m_s * wanted.linear_m_s + has.angular_rad_s * wanted.angular_rad_s * rim_m * rim_m
    return scaled / (wanted.linear_m_s**2 + (wanted.angular_rad_s * rim_m) ** 2)


def at_least(velocity: Velocity, speed_m_s: float, rim_m: float) -> Velocity:
    """Scale a velocity up, if needed, so that a point at `rim_m` may move at `speed_m_s`; zero stays zero.

    The barrier tolerates slow closing because readings are noisy. Without this, many slow commands would add up.
    """
    has_m_s = abs(velocity.linear_m_s) + abs(velocity.angular_rad_s) * rim_m
    if has_m_s == 0.0 or has_m_s >= speed_m_s:
        return velocity
    return Velocity(
        speed_m_s * (velocity.linear_m_s / has_m_s), speed_m_s * (velocity.angular_rad_s / has_m_s)
    )


def _exceeds(has: float, wanted: float, negligible: float) -> bool:
    """Return whether a velocity is faster than the commanded one, or opposed to it, by more than noise."""
    return abs(has) > negligible + max(0.0, math.copysign(wanted, has * wanted))


def is_on_another_arc(has: Velocity, wanted: Velocity, rim_m: float, negligible_m_s: float) -> bool:
    """Return whether a point at `rim_m` from the base's centre moves across the commanded arc by more than noise."""
    across = has.linear_m_s * wanted.angular_rad_s - has.angular_rad_s * wanted.linear_m_s
    length_m_s = math.hypot(wanted.linear_m_s, wanted.angular_rad_s * rim_m)
    return abs(across) * rim_m > negligible_m_s * length_m_s
