"""Conditions for driving from the supervisor's status: what a source lacks before it may drive, and what stops it.

Text from the network is converted to plain ASCII, so that no payload can send control sequences to the terminal.
"""

import math

from teleop.view import plain
from wire.messages import SafetyStatus, SourceStatus

HEARD_S = 0.2
"""A command older than this has timed out at the supervisor."""


def what_is_missing(status: SafetyStatus, source: str) -> str | None:
    """Return why a neutral source must not begin to drive; None if it may."""
    own = _find(status, source)
    if own is None:
        return f"the supervisor ignores source {source}: add it to [supervisor] sources"
    if status.mode == SafetyStatus.STOPPED:
        return stopped(status)
    if status.mode != SafetyStatus.READY:
        return f"{plain(status.owner)} drives; it must stop first"
    if not own.armed:
        return f"{source} is not armed: {plain(', '.join(own.reasons))}"
    if not own.neutral or not own.age_s <= HEARD_S:
        return f"the supervisor does not hear {source}"
    return None


def what_stops(status: SafetyStatus, source: str) -> str | None:
    """Return why a driving source must stop; None if it may continue.

    A status that was sent before the supervisor received the motion has the previous owner: that is not a take-over.
    """
    if status.mode == SafetyStatus.STOPPED:
        return stopped(status)
    own = _find(status, source)
    if own is not None and not own.neutral and status.owner != source:
        return f"{plain(status.owner)} took over"
    return None


def stopped(status: SafetyStatus) -> str:
    """Return a text of the stop with its reasons, and the nearest obstacle if that is a reason."""
    reasons = status.why() or "no reason given"
    causes, _ = status.causes_and_latched()
    where = f" ({nearest(status)})" if "OBSTACLE" in causes and nearest(status) else ""
    return plain(f"STOPPED: {reasons}{where}")


def nearest(status: SafetyStatus) -> str:
    """Return distance and direction of the nearest obstacle as text; empty if unknown."""
    if not (math.isfinite(status.nearest_m) and math.isfinite(status.nearest_bearing_rad)):
        return ""
    side = ("ahead", "left", "behind", "right")[round(status.nearest_bearing_rad / (math.pi / 2)) % 4]
    return f"{status.nearest_m:.2f} m {side}"


def _find(status: SafetyStatus, source: str) -> SourceStatus | None:
    return next((s for s in status.sources if s.name == source), None)
