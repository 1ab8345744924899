"""Format the mode, speed and nearest distance of a robot as text and as JSON numbers."""

import math
from typing import Any

from wire.message_types import MODES, SafetyStatus
from wire.ros import Twist
from wire.text import bearing_in_words

COLOURS = {"STOPPED": "bold red", "READY": "green", "DRIVING": "bold green", "LIMITED": "yellow"}

CHECK_NETWORK = "check the name, the address and the network, and whether the robot runs"

GO_NEUTRAL = "release the keys or the stick (teleop: s)"
"""How a person has the source that drives send neutral."""

HEARD_LIMIT_S = 1.0
"""A robot counts as heard while its last status is not older; at least ten statuses arrive in this period."""


def mode_name(status: SafetyStatus) -> str:
    """Return the name of the mode; an unknown mode of a newer supervisor has the last name."""
    return MODES[min(status.mode, len(MODES) - 1)]


def number(value: float | None) -> float | None:
    """Return None for NaN and infinity, which JSON cannot represent."""
    return None if value is None or not math.isfinite(value) else round(value, 4)


def status_json(status: SafetyStatus | None, twist: Twist | None) -> dict[str, Any]:
    """Return what a robot does and why as JSON values; unknown values are None."""
    causes, latched = status.causes_and_latched() if status else (None, None)
    return {
        "mode": mode_name(status) if status else None,
        "reasons": None if causes is None or latched is None else [*causes, *latched],
        "causes": causes,
        "latched": latched,
        "detail": status.detail if status else None,
        "owner": status.owner if status else None,
        "warning": status.warning if status else None,
        "alarm": status.alarm if status else None,
        "linear_m_s": number(twist.linear.x if twist else None),
        "angular_rad_s": number(twist.angular.z if twist else None),
        "nearest_m": number(status.nearest_m if status else None),
        "nearest_bearing_rad": number(status.nearest_bearing_rad if status else None),
    }


def speed(twist: Twist) -> str:
    """Format the forward velocity [m/s] and the turn rate [rad/s]."""
    # Adding zero turns −0.0 into 0.0.
    return f"{round(twist.linear.x, 2) + 0.0:.2f} m/s, {round(twist.angular.z, 2) + 0.0:.2f} rad/s"


def nearest(distance_m: float, bearing_rad: float, origin: str = "") -> str:
    """Format the distance and direction of the nearest point; `origin` follows the distance."""
    if not math.isfinite(distance_m):
        return "unknown"
    where = bearing_in_words(bearing_rad)
    return f"{distance_m:.2f} m{origin}{f', {where}' if where else ''}"
