"""What can be wrong with the robot's sensors, on request. Pure: text in, faults out; ranges in, ranges out."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ranges = NDArray[np.float32]

MIN_RATE_HZ = 0.01
MAX_RATE_HZ = 500.0
EDGE_RAD = 1e-9
"""A beam on a sector's very edge is in it, however its angle was rounded."""
FORMS = (
    "none, freeze, all_nan, silent, blocked FROM TO (rad in the lidar's frame, counter-clockwise), "
    f"rate HZ (of the scans, {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}), no_odom; several are joined with ';'"
)


class FaultError(ValueError):
    """The text names no faults; the message lists what there is."""


class Sector(NamedTuple):
    """Directions in the lidar's frame, counter-clockwise from one to the other [rad]."""

    start_rad: float
    end_rad: float


@dataclass(frozen=True, slots=True)
class SensorFaults:
    """The faults in force.

    Attributes:
        freeze: the same ranges come again and again, while time goes on.
        all_nan: no beam reads anything.
        silent: no scans come.
        blocked: what is behind dirt on the lidar's window: its beams read nothing, NaN.
        rate_hz: of the scans, in place of the configured one.
        no_odom: no odometry comes.
    """

    freeze: bool = False
    all_nan: bool = False
    silent: bool = False
    blocked: tuple[Sector, ...] = ()
    rate_hz: float | None = None
    no_odom: bool = False

    def __str__(self) -> str:
        """As `parse_faults` reads it."""
        words = [name for name in ("freeze", "all_nan", "silent") if getattr(self, name)]
        words += [f"blocked {start_rad:g} {end_rad:g}" for start_rad, end_rad in self.blocked]
        words += [] if self.rate_hz is None else [f"rate {self.rate_hz:g}"]
        words += ["no_odom"] if self.no_odom else []
        return "; ".join(words) or "none"


NO_FAULTS = SensorFaults()


def parse_faults(text: str) -> SensorFaults:
    """The faults that a line names.

    Raises:
        FaultError: one of them is none of the forms.
    """
    if text.strip() == "none":
        return NO_FAULTS
    faults = NO_FAULTS
    for part in text.split(";"):
        faults = _with(faults, part.strip())
    return faults


def _with(faults: SensorFaults, part: str) -> SensorFaults:
    match part.split():
        case ["freeze"]:
            return replace(faults, freeze=True)
        case ["all_nan"]:
            return replace(faults, all_nan=True)
        case ["silent"]:
            return replace(faults, silent=True)
        case ["no_odom"]:
            return replace(faults, no_odom=True)
        case ["rate", number] if MIN_RATE_HZ <= (rate_hz := _number(number)) <= MAX_RATE_HZ:
            return replace(faults, rate_hz=rate_hz)
        case ["blocked", start, end] if _is_open(sector := Sector(_number(start), _number(end))):
            return replace(faults, blocked=(*faults.blocked, sector))
        case _:
            pass
    raise FaultError(f"{part!r} is no sensor fault; there are: {FORMS}")


def _is_open(sector: Sector) -> bool:
    return math.isfinite(sector.end_rad - sector.start_rad) and sector.start_rad != sector.end_rad


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def spoil(faults: SensorFaults, ranges: Ranges, angles_rad: NDArray[np.float64]) -> Ranges:
    """What a lidar with these faults makes of what it sees.

    A blocked sector covers a direction within one turn, so one that is as wide as a turn covers everything.

    Args:
        faults: those in force; what concerns the time of the scans is not done here.
        ranges: (n,) in m; they are not changed.
        angles_rad: (n,) the beams' directions in the lidar's frame.
    """
    if faults.all_nan:
        return np.full_like(ranges, np.nan)
    for start_rad, end_rad in faults.blocked:
        width_rad = end_rad - start_rad
        if width_rad < 0.0:
            width_rad %= math.tau
        behind = (angles_rad - start_rad + EDGE_RAD) % math.tau <= width_rad + 2.0 * EDGE_RAD
        ranges = np.where(behind, np.float32(np.nan), ranges)
    return ranges
