"""A base on its way from one twist to another: it goes through what is still left of the first one."""

import math

from supervisor.reckoning import Velocity


def mixtures(has: Velocity, wanted: Velocity, negligible: Velocity) -> list[Velocity]:
    """The twists on the way in which a velocity that is to go meets one that is asked for on the other axis.

    Args:
        has: the base's twist.
        wanted: the commanded one.
        negligible: what is no more than noise, on each axis.
    """
    mixed: list[Velocity] = []
    if wanted.angular_rad_s != 0.0 and _is_to_go(has.linear_m_s, wanted.linear_m_s, negligible.linear_m_s):
        mixed.append(Velocity(has.linear_m_s, wanted.angular_rad_s))
    if wanted.linear_m_s != 0.0 and _is_to_go(
        has.angular_rad_s, wanted.angular_rad_s, negligible.angular_rad_s
    ):
        mixed.append(Velocity(wanted.linear_m_s, has.angular_rad_s))
    return mixed


def _is_to_go(has: float, wanted: float, negligible: float) -> bool:
    """Whether a velocity exceeds the one that is asked for in its direction, by more than noise."""
    return abs(has) > negligible + max(0.0, math.copysign(wanted, has * wanted))


def is_on_another_arc(has: Velocity, wanted: Velocity, rim_m: float, negligible_m_s: float) -> bool:
    """Whether the base's velocity at `rim_m` from its centre is off the arc that is asked for, by more than noise."""
    across = has.linear_m_s * wanted.angular_rad_s - has.angular_rad_s * wanted.linear_m_s
    length_m_s = math.hypot(wanted.linear_m_s, wanted.angular_rad_s * rim_m)
    return abs(across) * rim_m > negligible_m_s * length_m_s
