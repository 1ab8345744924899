"""Displayed state of the robot: mode, stop reasons, speed, distances and lidar ranges. Pure."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from sim.lidar import Ranges
from wire.reasons import words_of

STOP_DISTANCE_M = 0.30
WARNING_DISTANCE_M = 0.50
"""The supervisor's default; its configuration may differ, but the status does not contain it."""

Rgb = tuple[float, float, float]


class Mode(StrEnum):
    """Modes of SafetyStatus, and one for a missing status."""

    STOPPED = "STOPPED"
    READY = "READY"
    DRIVING = "DRIVING"
    LIMITED = "LIMITED"
    ALONE = "NO SUPERVISOR"

    @classmethod
    def of(cls, number: int) -> "Mode":
        """Return the mode for a number in SafetyStatus; an unknown number counts as stopped."""
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
    """The values to display at one time.

    Attributes:
        mode: The supervisor's mode.
        reasons: The names of the stop reasons, most severe first.
        speed_m_s: Forward speed of the robot.
        nearest_m: Distance from the hull to the nearest object by the supervisor's status; NaN if unknown.
        ranges: Last scan of each lidar in m, shape (beams,); empty before the first scan.
        over: The reasons whose causes have ended, and that still require a neutral command.
    """

    mode: Mode = Mode.ALONE
    reasons: tuple[str, ...] = ()
    speed_m_s: float = 0.0
    nearest_m: float = math.nan
    ranges: Sequence[Ranges] = ()
    over: tuple[str, ...] = ()

    @property
    def why(self) -> str:
        """Text of the reasons that hold; if all are over, of those; empty without reasons."""
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
    """Return the reasons as text in ASCII: names from the network must not draw other characters."""
    known = [(reason, words_of(reason)) for reason in reasons]
    said = [reason.lower().replace("_", " ") if words is None else words.caption for reason, words in known]
    return ", ".join(said).encode("ascii", "replace").decode()[:120]
