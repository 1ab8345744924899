"""The law's words about a cause: what is known of it beyond its name. Pure."""

import math

from supervisor.model import Reasons
from wire.reasons import SEVERITY, StopReason

AHEAD_DEG = 10
"""Within so much of straight ahead or behind, a direction has no side."""


def detail_of(
    causes: Reasons,
    *,
    scan_problem: str = "",
    block_bearing_rad: float = math.nan,
    writers: tuple[str, ...] = (),
) -> str:
    """Part of a sentence about the most restrictive cause; empty where nothing more is known.

    Args:
        causes: what holds now.
        scan_problem: why the newest scan proves nothing.
        block_bearing_rad: direction of what the barrier stops for, from the base frame; NaN: not known.
        writers: for each sensor whose samples come from several writers, who they are.
    """
    where = bearing_in_words(block_bearing_rad)
    match min(causes, key=SEVERITY.__getitem__, default=None):
        case StopReason.SENSOR_CONFLICT:
            return f"samples come from several writers: {'; '.join(writers)}"
        case StopReason.SCAN_INVALID:
            return scan_problem
        case StopReason.SCAN_BLIND if where:
            return f"unseen space {where}"
        case StopReason.OBSTACLE if where:
            return f"something is too close {where}"
        case _:
            return ""


def bearing_in_words(bearing_rad: float) -> str:
    """A direction from the base frame, counter-clockwise from ahead: "ahead", "at 40° to the left"; NaN: empty."""
    if not math.isfinite(bearing_rad):
        return ""
    degrees = round(math.degrees(math.remainder(bearing_rad, math.tau)))
    if abs(degrees) < AHEAD_DEG:
        return "ahead"
    if abs(degrees) > 180 - AHEAD_DEG:
        return "behind"
    return f"at {abs(degrees)}° to the {'left' if degrees > 0 else 'right'}"
