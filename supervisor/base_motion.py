"""Check whether the base follows its commands within the limits of its ramps.

Two speeds bound what odometry may show on each axis: the *least*, which follows a rising command with the slowest
acceleration of the base, and the *most*, which follows a falling command with the trusted deceleration, slowed so
that both axes reach their command together. Odometry that stays outside of them for `PATIENCE_S`, and comes no nearer
to the command meanwhile, is a base that is blocked, switched off by its own emergency stop, slipping, or measured
wrongly. It stays unresponsive until it is commanded zero and stands.
"""

import math
from typing import NamedTuple

from supervisor.reckoning import STANDSTILL, Velocity

PATIENCE_S = 0.5
"""How long the base may lag: its dead time, and odometry's way."""

LEAST_SHARE = 0.5
MOST_SHARE = 1.3
"""Wheels slip, payloads weigh: so far from what is expected the base still follows."""

SLOW = Velocity(0.1, 0.25)
"""Below this, friction decides."""

PROGRESS_SHARE = 0.2
"""Of `SLOW`: what a base that follows gains at least within `PATIENCE_S`."""


class Following(NamedTuple):
    """What is expected of the base, and since when it does something else."""

    least: Velocity
    most: Velocity
    since_s: float | None
    """Since when odometry has been out of bounds without coming nearer to the command; None: it is within."""
    since: Velocity
    """What odometry said then."""
    unresponsive: bool


FOLLOWING = Following(STANDSTILL, STANDSTILL, None, STANDSTILL, unresponsive=False)


def follow(
    following: Following,
    commanded: Velocity,
    measured: Velocity | None,
    now_s: float,
    dt_s: float,
    slowest: Velocity,
    deceleration: Velocity,
) -> Following:
    """Take note of what has been commanded for `dt_s`, and of what odometry says.

    Args:
        following: until now.
        commanded: the velocity of that time.
        measured: odometry's; None: there is none.
        now_s: the time.
        dt_s: since the last call.
        slowest: the least acceleration of the base [m/s², rad/s²].
        deceleration: the one that the base is trusted with, likewise.
    """
    least = Velocity(
        _rises(following.least.linear_m_s, commanded.linear_m_s, slowest.linear_m_s * dt_s),
        _rises(following.least.angular_rad_s, commanded.angular_rad_s, slowest.angular_rad_s * dt_s),
    )
    before = following.most
    # A base that goes straight from one twist to another takes as long on both axes as on the slower one.
    takes_s = max(
        _takes_s(
            least.linear_m_s,
            before.linear_m_s,
            commanded.linear_m_s,
            slowest.linear_m_s,
            deceleration.linear_m_s,
        ),
        _takes_s(
            least.angular_rad_s,
            before.angular_rad_s,
            commanded.angular_rad_s,
            slowest.angular_rad_s,
            deceleration.angular_rad_s,
        ),
    )
    share = 1.0 if takes_s <= dt_s else dt_s / takes_s
    most = Velocity(
        _falls(before.linear_m_s, commanded.linear_m_s, share),
        _falls(before.angular_rad_s, commanded.angular_rad_s, share),
    )
    if measured is None:
        return Following(least, most, None, STANDSTILL, unresponsive=False)
    lags = (
        _lags(measured.linear_m_s, least.linear_m_s, SLOW.linear_m_s)
        or _lags(measured.angular_rad_s, least.angular_rad_s, SLOW.angular_rad_s)
        or abs(measured.linear_m_s) > MOST_SHARE * abs(most.linear_m_s) + SLOW.linear_m_s
        or abs(measured.angular_rad_s) > MOST_SHARE * abs(most.angular_rad_s) + SLOW.angular_rad_s
    )
    since_s, since = following.since_s, following.since
    if not lags:
        since_s = None
    elif since_s is None or _gains(since, measured, commanded):
        since_s, since = now_s, measured
    too_long = since_s is not None and now_s - since_s > PATIENCE_S and commanded != STANDSTILL
    stands = commanded == STANDSTILL and not moves(measured, SLOW)
    return Following(least, most, since_s, since, too_long or (following.unresponsive and not stands))


def possible_twists(following: Following, measured: Velocity | None) -> list[Velocity]:
    """The twists that the base may have by now.

    Odometry may be stuck, so the most that the base may have counts as well. Without odometry, or while it is out of
    bounds, nothing shows how far each axis follows: the least of one axis goes with the most of the other.

    Args:
        following: what is expected of the base.
        measured: odometry's velocity; None: there is none.
    """
    least, most = following.least, following.most
    twists = [most] if measured is None else [most, measured]
    if measured is None or following.since_s is not None:
        twists.append(Velocity(most.linear_m_s, least.angular_rad_s))
        twists.append(Velocity(least.linear_m_s, most.angular_rad_s))
    return twists


def _gains(since: Velocity, measured: Velocity, commanded: Velocity) -> bool:
    """Whether the base has come nearer to its command, by more than noise: it is slow, but it follows."""
    return _nears(since.linear_m_s, measured.linear_m_s, commanded.linear_m_s, SLOW.linear_m_s) or _nears(
        since.angular_rad_s, measured.angular_rad_s, commanded.angular_rad_s, SLOW.angular_rad_s
    )


def _nears(before: float, now: float, wanted: float, slow: float) -> bool:
    return abs(wanted - before) - abs(wanted - now) > PROGRESS_SHARE * slow


def moves(velocity: Velocity, threshold: Velocity) -> bool:
    """Whether a velocity exceeds a threshold on either axis."""
    return (
        abs(velocity.linear_m_s) > threshold.linear_m_s
        or abs(velocity.angular_rad_s) > threshold.angular_rad_s
    )


def _rises(least: float, commanded: float, step: float) -> float:
    """The signed speed that the slowest base has by now; it falls with the command at once."""
    along = max(0.0, math.copysign(least, least * commanded))
    return math.copysign(min(abs(commanded), along + step), commanded)


def _takes_s(least: float, most: float, commanded: float, slowest: float, deceleration: float) -> float:
    """How long one axis may still take to its command; into the other direction, it brakes first."""
    falls_s = abs(commanded - most) / deceleration
    return falls_s if most * commanded < 0.0 else max(falls_s, abs(commanded - least) / slowest)


def _falls(most: float, commanded: float, share: float) -> float:
    """The signed speed that the base may still have; it rises with the command at once."""
    if share == 1.0 or most * (commanded - most) >= 0.0:
        return commanded
    return most + share * (commanded - most)


def _lags(measured: float, least: float, slow: float) -> bool:
    return abs(least) > slow and measured / least < LEAST_SHARE
