"""What is shown of the robot beside its world: what the supervisor lets it do, why, and what its lidar sees. Pure."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from sim.lidar import Ranges
from wire.reasons import words_of

STOP_DISTANCE_M = 0.30
WARNING_DISTANCE_M = 0.50
"""The supervisor's defaults; it may be told otherwise, but it does not say so."""

Rgb = tuple[float, float, float]


class Mode(StrEnum):
    """SafetyStatus's modes, and what holds while there is none."""

    STOPPED = "STOPPED"
    READY = "READY"
    DRIVING = "DRIVING"
    LIMITED = "LIMITED"
    ALONE = "NO SUPERVISOR"

    @classmethod
    def of(cls, number: int) -> "Mode":
        """By SafetyStatus's number; a stranger's counts as stopped."""
        return _BY_NUMBER.get(number, cls.STOPPED)


_BY_NUMBER = {0: Mode.STOPPED, 1: Mode.READY, 2: Mode.DRIVING, 3: Mode.LIMITED}

COLOURS: dict[Mode, Rgb] = {
    Mode.STOPPED: (0.95, 0.16, 0.12),
    Mode.READY: (0.25, 0.60, 0.95),
    Mode.DRIVING: (0.10, 0.80, 0.30),
    Mode.LIMITED: (1.00, 0.58, 0.05),
    Mode.ALONE: (0.60, 0.64, 0.68),
}


class Shown(NamedTuple):
    """One moment.

    Attributes:
        mode: What the supervisor lets the robot do.
        reasons: Why it stands, by the names of the wire, the most restrictive first.
        speed_m_s: Of the robot, ahead.
        nearest_m: From the hull to what the supervisor takes for the nearest thing; NaN where it knows of none.
        ranges: Each lidar's last scan, in m, shape (beams,); empty before the first.
        over: Those of the reasons that hold no more: only a neutral command is missing.
    """

    mode: Mode = Mode.ALONE
    reasons: tuple[str, ...] = ()
    speed_m_s: float = 0.0
    nearest_m: float = math.nan
    ranges: Sequence[Ranges] = ()
    over: tuple[str, ...] = ()

    @property
    def why(self) -> str:
        """The reasons that hold, in words; where all are over, what they were; empty where there is none."""
        holding = [reason for reason in self.reasons if reason not in self.over]
        if holding or not self.over:
            return in_words(holding)
        return f"over, waits for neutral: {in_words(self.over)}"

    @property
    def speed(self) -> str:
        return f"{self.speed_m_s + 0.0:.2f} m/s" if abs(self.speed_m_s) >= 0.005 else "0.00 m/s"

    @property
    def nearest(self) -> str:
        return f"{self.nearest_m:.2f} m" if math.isfinite(self.nearest_m) else "-"


def in_words(reasons: Sequence[str]) -> str:
    """As a person says it, in ASCII: what comes from the network draws nothing else."""
    known = [(reason, words_of(reason)) for reason in reasons]
    said = [reason.lower().replace("_", " ") if words is None else words.caption for reason, words in known]
    return ", ".join(said).encode("ascii", "replace").decode()[:120]
