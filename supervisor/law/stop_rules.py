"""The table of stop rules: each stop reason's origin, the sources on which it is latched, and what clears it.

`safety.py` decides when a reason holds. tests/unit/supervisor/law/test_stop_rules.py checks it against each row.
"""

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from wire.reasons import StopReason


class RaisedBy(Enum):
    """The origin of a reason; it determines on which sources the reason is latched, and how the latch is cleared."""

    EVERYTHING_SHARED = "what all sources share"
    """Sensors, base, supervisor, e-stop. Latched on every source.

    Cleared by a neutral after the cause has ended.
    """
    SOURCE = "the source's own commands and liveliness"
    """Latched on that source, and on every source if it owns the wheels.

    Cleared by a neutral after the cause has ended.
    """
    BARRIER = "the owner's command, at the speed barrier"
    """Latched on every source.

    Cleared by a neutral; on the owner, also by a command that does not close on the blocking point.
    """


class StopRule(NamedTuple):
    """One row of the table."""

    raised_by: RaisedBy
    ends: str
    """The event that ends the cause; only after it does a neutral clear the latch.

    For reasons of the barrier: the event that clears the latch without a neutral.
    """
    routine: bool = False
    """Whether the stop is part of ordinary driving: the black box deletes files of such stops first."""


STOP_RULES: Mapping[StopReason, StopRule] = {
    StopReason.ESTOP: StopRule(
        RaisedBy.EVERYTHING_SHARED, "a reset, which is refused while a live source requests motion"
    ),
    StopReason.ESTOP_STATION_LOST: StopRule(
        RaisedBy.EVERYTHING_SHARED, "the station is heard; after a loss, also a reset as for ESTOP"
    ),
    StopReason.ESTOP_UNRECORDED: StopRule(
        RaisedBy.EVERYTHING_SHARED,
        "a disk that has recorded the last press or reset, and can record the next press",
    ),
    StopReason.BASE_RUNAWAY: StopRule(RaisedBy.EVERYTHING_SHARED, "standstill; after rolling, for 2 s"),
    StopReason.OVERRUN: StopRule(
        RaisedBy.EVERYTHING_SHARED, "the next step on time; after a suspend, one timeout more"
    ),
    StopReason.SENSOR_CONFLICT: StopRule(RaisedBy.EVERYTHING_SHARED, "silence of one of the two writers"),
    StopReason.SENSOR_MISMATCH: StopRule(
        RaisedBy.EVERYTHING_SHARED, "a restart with the right configuration, or scans that agree again"
    ),
    StopReason.BASE_UNRESPONSIVE: StopRule(RaisedBy.EVERYTHING_SHARED, "zero commanded, and standstill"),
    StopReason.ODOM_STALE: StopRule(RaisedBy.EVERYTHING_SHARED, "fresh odometry"),
    StopReason.SCAN_INVALID: StopRule(RaisedBy.EVERYTHING_SHARED, "a valid scan"),
    StopReason.SCAN_STALE: StopRule(RaisedBy.EVERYTHING_SHARED, "a fresh scan"),
    StopReason.SOURCE_LOST: StopRule(RaisedBy.SOURCE, "the return of the token"),
    StopReason.COMMAND_INVALID: StopRule(RaisedBy.SOURCE, "a valid command"),
    StopReason.COMMAND_STALE: StopRule(RaisedBy.SOURCE, "fresh commands"),
    StopReason.COMMAND_TIMEOUT: StopRule(RaisedBy.SOURCE, "fresh commands"),
    StopReason.NO_COMMAND: StopRule(RaisedBy.SOURCE, "a first command", routine=True),
    StopReason.SCAN_BLIND: StopRule(RaisedBy.BARRIER, "a command that does not close on it", routine=True),
    StopReason.OBSTACLE: StopRule(RaisedBy.BARRIER, "a command that does not close on it", routine=True),
}


def raised_by(origin: RaisedBy) -> frozenset[StopReason]:
    """Return the reasons of one origin."""
    return frozenset(reason for reason, rule in STOP_RULES.items() if rule.raised_by is origin)


def cleared_by(rule: StopRule) -> str:
    """Return what clears a latched reason, as a phrase that completes "cleared by"."""
    if rule.raised_by is RaisedBy.BARRIER:
        return f"neutral, or {rule.ends}"
    return f"{rule.ends}; then neutral"


ROUTINE = frozenset(reason for reason, rule in STOP_RULES.items() if rule.routine)
