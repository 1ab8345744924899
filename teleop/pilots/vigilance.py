"""Vigilance: in control by steps, the operator must press a key at intervals, as on trains. Pure.

A terminal multiplexer or mosh answers teleop's status requests also when no person sees the screen
(docs/decisions/0061).
"""

import math

DEMAND_S = 3.0
"""Time from the demand for a key to zero."""
DEAD_LINK_M = 1.0
"""The farthest that the robot drives behind a dead link to a terminal that answers no status requests."""
REACTION_S = 0.5
"""Time from the end of vigilance to standstill, without the transport of the command."""


def vigilance_left_s(now_s: float, key_s: float, vigilance_s: float, *, moving: bool) -> float:
    """Return the time until zero is sent for lack of a key [s]; up to `DEMAND_S`, the screen asks for one.

    Args:
        now_s: the time of any monotonic clock.
        key_s: the time of the newest key that counted.
        vigilance_s: the time without a key after which the screen asks for one.
        moving: whether motion is requested; without it, no key is needed, and the result is infinite.
    """
    return vigilance_s + DEMAND_S - (now_s - key_s) if moving else math.inf


def unanswered_limit_m_s(vigilance_s: float, round_trip_limit_s: float) -> float:
    """Return the maximum speed with a terminal that answers no status requests, in whole mm/s.

    Behind a dead link, only vigilance stops the robot; until then, it drives at most `DEAD_LINK_M`.
    """
    longest_s = vigilance_s + DEMAND_S + round_trip_limit_s + REACTION_S
    return math.floor(1000 * DEAD_LINK_M / longest_s) / 1000
