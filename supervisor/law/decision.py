"""The decision of a step, and its explanation in words."""

import math
from enum import IntEnum
from typing import NamedTuple

from supervisor.law.base_braking import LEAST_SPEED_M_S
from supervisor.law.estop_stations import Station
from supervisor.law.interlock import Reply, Source
from supervisor.law.model import Counts, Reasons
from supervisor.law.reckoning import Velocity
from wire.reasons import SEVERITY, Limit, StopReason
from wire.text import bearing_in_words


class Mode(IntEnum):
    """Mode of the robot; the numbers are those of SafetyStatus."""

    STOPPED = 0
    READY = 1
    DRIVING = 2
    LIMITED = 3


class Decision(NamedTuple):
    """The velocity for the wheels, and everything that explains it."""

    mode: Mode
    output: Velocity
    reasons: tuple[StopReason, ...]
    owner: str
    commanded: Velocity
    scale: float
    nearest_m: float
    nearest_bearing_rad: float
    warning: bool
    alarm: bool
    scan_age_s: float
    scan_problem: str
    scan_counts: Counts
    sources: tuple[Source, ...]
    strangers: tuple[str, ...]
    reset_reply: Reply | None = None
    causes: tuple[StopReason, ...] = ()
    """Stop reasons that hold now, most severe first; they may limit the motion without a stop."""
    latched: tuple[StopReason, ...] = ()
    """Stop reasons whose causes have ended, but that the owner has not yet cleared with a neutral command."""
    limit: Limit | None = None
    """What reduces the speed without a cause; None: nothing, or the barrier."""
    detail: str = ""
    """Details of the first cause, as part of a sentence; empty if there are none."""
    stations: tuple[Station, ...] = ()


def detail_of(
    causes: Reasons,
    limit: Limit | None = None,
    *,
    is_too_fast: bool = False,
    scan_problem: str = "",
    block_bearing_rad: float = math.nan,
    advice: str = "",
    writers: tuple[str, ...] = (),
    mismatch: str = "",
    stations: str = "",
    weakness: str = "",
    open_m_s: float = math.nan,
) -> str:
    """Return part of a sentence with the details of the most severe cause; empty if there are none.

    Args:
        causes: the causes that hold now.
        limit: what reduces the command without a cause.
        is_too_fast: whether the age of the command limits its speed even while it is new.
        scan_problem: why the newest scan proves nothing.
        block_bearing_rad: bearing of the blocking point in the base frame; NaN if there is none.
        advice: what may explain this point that the surroundings do not; empty if nothing.
        writers: for each sensor with several active writers, its name and theirs.
        mismatch: what motion shows instead of the configuration.
        stations: which e-stop stations are pressed or missing.
        weakness: what the base does worse than configured.
        open_m_s: the highest speed on silence that only `works_in_the_open` explains.
    """
    if not causes and limit is not None:
        return {
            Limit.BASE_WEAK: weakness,
            Limit.BASE_UNMEASURED: f"stop once from {LEAST_SPEED_M_S:g} m/s or more, or set deceleration_m_s2",
            Limit.MOUNT_UNCONFIRMED: "to confirm it, drive straight on and turn, with walls in sight",
            Limit.IN_THE_OPEN: f"open_m_s permits {open_m_s:g} m/s while a lidar is silent",
            Limit.COMMAND_AGE: "blind_budget_m permits less than this speed"
            if is_too_fast
            else "the next command is late",
        }[limit]
    where, but = bearing_in_words(block_bearing_rad), f"; {advice}" if advice else ""
    match min(causes, key=SEVERITY.__getitem__, default=None):
        case StopReason.ESTOP | StopReason.ESTOP_STATION_LOST:
            return stations
        case StopReason.SENSOR_CONFLICT:
            return f"samples come from several writers: {'; '.join(writers)}"
        case StopReason.SENSOR_MISMATCH:
            return f"motion shows {mismatch}"
        case StopReason.SCAN_INVALID:
            return scan_problem
        case StopReason.SCAN_BLIND if where:
            return f"unseen space {where}{but}"
        case StopReason.OBSTACLE if where:
            return f"something is too close {where}{but}"
        case _:
            return ""


def by_severity(reasons: Reasons) -> tuple[StopReason, ...]:
    """Return the reasons in order, the most severe first."""
    return tuple(sorted(reasons, key=SEVERITY.__getitem__))
