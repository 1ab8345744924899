"""Check whether the base follows its commands within the limits of its ramps.

Two speeds bound the velocity that odometry may show on each axis. The *least* follows a rising command with the
slowest acceleration of the base. The *most* follows a falling command with the trusted deceleration, slowed so
that both axes reach their command together. The base is unresponsive if odometry stays outside these bounds for
`PATIENCE_S` and its dead time without approaching the command: the base is blocked, switched off by its own emergency stop, slipping, or
measured wrongly. It stays unresponsive until zero is commanded and it stands still.
"""

import math
from typing import NamedTuple

from supervisor.law.reckoning import STANDSTILL, Velocity

PATIENCE_S = 0.5
"""How long the base may lag beyond its dead time; covers the latency of odometry."""

LEAST_SHARE = Velocity(0.5, 0.3)
MOST_SHARE = 1.3
"""The base still follows at these shares of the expected speeds; covers wheel slip and payload. A skid-steer base may turn less than half
as fast as commanded."""

SLOW = Velocity(0.1, 0.25)
"""Speeds below which friction dominates; smaller deviations are ignored."""

PROGRESS_SHARE = 0.2
"""Minimum progress toward the command within `PATIENCE_S`, as a share of `SLOW`."""


class Following(NamedTuple):
    """The expected bounds of the base's velocity, and since when odometry has been outside them."""

    least: Velocity
    most: Velocity
    since_s: float | None
    """Since when odometry has been out of bounds without approaching the command; None while it is within bounds."""
    since: Velocity
    """The measured velocity at `since_s`."""
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
    dead_time_s: float,
) -> Following:
    """Update the expected bounds with the last command, and compare odometry with them.

    Args:
        following: the result of the last call.
        commanded: the velocity that was commanded for the last `dt_s`.
        measured: the velocity by odometry; None without odometry.
        now_s: the time.
        dt_s: the time since the last call.
        slowest: the least acceleration of the base [m/s², rad/s²].
        deceleration: the trusted deceleration of the base [m/s², rad/s²].
        dead_time_s: how long the base keeps its velocity after a command.
    """
    least = Velocity(
        _rises(following.least.linear_m_s, commanded.linear_m_s, slowest.linear_m_s * dt_s),
        _rises(following.least.angular_rad_s, commanded.angular_rad_s, slowest.angular_rad_s * dt_s),
    )
    before = following.most
    # A base that changes both axes in proportion needs as long on each axis as on the slower one.
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
        _lags(measured.linear_m_s, least.linear_m_s, SLOW.linear_m_s, LEAST_SHARE.linear_m_s)
        or _lags(measured.angular_rad_s, least.angular_rad_s, SLOW.angular_rad_s, LEAST_SHARE.angular_rad_s)
        or abs(measured.linear_m_s) > MOST_SHARE * abs(most.linear_m_s) + SLOW.linear_m_s
        or abs(measured.angular_rad_s) > MOST_SHARE * abs(most.angular_rad_s) + SLOW.angular_rad_s
    )
    since_s, since = following.since_s, following.since
    if not lags:
        since_s = None
    elif since_s is None or _gains(since, measured, commanded):
        since_s, since = now_s, measured
    patience_s = PATIENCE_S + dead_time_s
    too_long = since_s is not None and now_s - since_s > patience_s and commanded != STANDSTILL
    stands = commanded == STANDSTILL and not moves(measured, SLOW)
    return Following(least, most, since_s, since, too_long or (following.unresponsive and not stands))


def possible_twists(following: Following, measured: Velocity | None) -> list[Velocity]:
    """Return the twists that the base may have now.

    They include the upper bound, because odometry may be stuck. Without odometry, or while it is out of bounds, the
    axes may follow differently, so they include the least of each axis combined with the most of the other.

    Args:
        following: the expected bounds.
        measured: the velocity by odometry; None without odometry.
    """
    least, most = following.least, following.most
    twists = [most] if measured is None else [most, measured]
    if measured is None or following.since_s is not None:
        twists.append(Velocity(most.linear_m_s, least.angular_rad_s))
        twists.append(Velocity(least.linear_m_s, most.angular_rad_s))
    return twists


def _gains(since: Velocity, measured: Velocity, commanded: Velocity) -> bool:
    """Return whether the base has approached its command by more than noise: it then follows, although slowly."""
    return _nears(since.linear_m_s, measured.linear_m_s, commanded.linear_m_s, SLOW.linear_m_s) or _nears(
        since.angular_rad_s, measured.angular_rad_s, commanded.angular_rad_s, SLOW.angular_rad_s
    )


def _nears(before: float, now: float, wanted: float, slow: float) -> bool:
    return abs(wanted - before) - abs(wanted - now) > PROGRESS_SHARE * slow


def moves(velocity: Velocity, threshold: Velocity) -> bool:
    """Return whether a velocity exceeds a threshold on either axis."""
    return (
        abs(velocity.linear_m_s) > threshold.linear_m_s
        or abs(velocity.angular_rad_s) > threshold.angular_rad_s
    )


def _rises(least: float, commanded: float, step: float) -> float:
    """Return the signed speed that the slowest base has reached; it follows a falling command at once."""
    along = max(0.0, math.copysign(least, least * commanded))
    return math.copysign(min(abs(commanded), along + step), commanded)


def _takes_s(least: float, most: float, commanded: float, slowest: float, deceleration: float) -> float:
    """Return the longest time [s] until one axis reaches its command; on a reversal, only the deceleration counts."""
    falls_s = abs(commanded - most) / deceleration
    return falls_s if most * commanded < 0.0 else max(falls_s, abs(commanded - least) / slowest)


def _falls(most: float, commanded: float, share: float) -> float:
    """Return the highest signed speed that the base may still have; it follows a rising command at once."""
    if share == 1.0 or most * (commanded - most) >= 0.0:
        return commanded
    return most + share * (commanded - most)


def _lags(measured: float, least: float, slow: float, share: float) -> bool:
    return abs(least) > slow and measured / least < share
