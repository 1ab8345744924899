"""Sensor faults: their text form, and their effect on a lidar's ranges and on odometry. Pure except for a seeded generator."""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from sim.motion_sensors import Reckoning

MIN_RATE_HZ = 0.01
MAX_RATE_HZ = 500.0
MAX_ANGLE_RAD = 100.0
MAX_CODE_M = 1000.0
MIN_REACH_M = 0.1
MAX_SCALE = 10.0
FORMS = (
    "none, freeze, all_nan, silent, blocked FROM TO [CODE] (rad in the lidar's frame, counter-clockwise), "
    "dropout SHARE [CODE] (share of the scans without the nearest object), beams SHARE [CODE] (share of single beams), "
    "stray SHARE (share of the scans with one false reading near the hull), "
    f"reach METRES (a smaller range_max, {MIN_REACH_M:g} to {MAX_CODE_M:g}), "
    f"rate HZ (scan rate, {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g}), "
    "no_odom, odom_zero, odom_freeze, odom_scale FACTOR "
    f"(-{MAX_SCALE:g} to {MAX_SCALE:g}); join several with ';'. "
    "SHARE is above 0 and at most 1. CODE is the reading of an affected beam: nan, inf, -inf or "
    f"0 to {MAX_CODE_M:g} m (default: nan, for dropout inf). The prefix NAME: limits a lidar fault to one lidar"
)
NAME = re.compile(r"([a-z][a-z0-9_]*):(.*)")


class FaultError(ValueError):
    """The text is not a list of faults; the message lists the possible ones."""


class Sector(NamedTuple):
    """A sector in the lidar's frame, counter-clockwise from start to end [rad], and the reading of its beams [m]."""

    start_rad: float
    end_rad: float
    code_m: float = math.nan


class Missing(NamedTuple):
    """The share of missing measurements, above 0 and at most 1, and the reading in their place [m]."""

    share: float
    code_m: float


@dataclass(frozen=True, slots=True)
class LidarFaults:
    """Faults of a lidar.

    Attributes:
        freeze: all scans repeat the same ranges with new stamps.
        all_nan: all readings are NaN.
        silent: no scans are sent.
        blocked: sectors behind dirt on the lidar's window; their beams read a code, by default NaN.
        dropout: the share of scans in which the nearest object within 2 m is missing, chosen at random.
        beams: the share of missing beams, chosen anew for each scan.
        stray: the share of scans with one false reading within 0.3 m of the hull; 0 for none.
        rate_hz: the scan rate in place of the configured one.
        reach_m: the maximum range, also in `range_max`, if it is less than the configured one.
    """

    freeze: bool = False
    all_nan: bool = False
    silent: bool = False
    blocked: tuple[Sector, ...] = ()
    dropout: Missing | None = None
    beams: Missing | None = None
    stray: float = 0.0
    rate_hz: float | None = None
    reach_m: float | None = None

    def words(self) -> list[str]:
        """Return the text of each fault for `parse_faults`."""
        words = [name for name in ("freeze", "all_nan", "silent") if getattr(self, name)]
        words += [f"blocked {_numbers(start, end)}{_code(code)}" for start, end, code in self.blocked]
        words += [] if self.dropout is None else [_missing("dropout", self.dropout, math.inf)]
        words += [] if self.beams is None else [_missing("beams", self.beams, math.nan)]
        words += [f"stray {_numbers(self.stray)}"] if self.stray > 0.0 else []
        words += [] if self.rate_hz is None else [f"rate {_numbers(self.rate_hz)}"]
        words += [] if self.reach_m is None else [f"reach {_numbers(self.reach_m)}"]
        return words


@dataclass(frozen=True, slots=True)
class SensorFaults(LidarFaults):
    """The faults in force: those of every lidar, those of single ones, and those of odometry.

    Attributes:
        only: additional faults of single lidars, by name.
        no_odom: no odometry is sent.
        odom_zero: odometry reports standstill at the last pose.
        odom_freeze: odometry repeats pose and velocity.
        odom_scale: factor on every distance and turn in odometry.
    """

    only: tuple[tuple[str, LidarFaults], ...] = ()
    no_odom: bool = False
    odom_zero: bool = False
    odom_freeze: bool = False
    odom_scale: float | None = None

    def of(self, lidar: str) -> LidarFaults:
        """Return the faults of one lidar."""
        own = dict(self.only).get(lidar, LidarFaults())
        return LidarFaults(
            freeze=self.freeze or own.freeze,
            all_nan=self.all_nan or own.all_nan,
            silent=self.silent or own.silent,
            blocked=self.blocked + own.blocked,
            dropout=own.dropout or self.dropout,
            beams=own.beams or self.beams,
            stray=max(self.stray, own.stray),
            rate_hz=own.rate_hz or self.rate_hz,
            reach_m=own.reach_m or self.reach_m,
        )

    def __str__(self) -> str:
        """Return the text for `parse_faults`."""
        words = self.words()
        words += [f"{name}: {word}" for name, own in self.only for word in own.words()]
        words += [name for name in ("no_odom", "odom_zero", "odom_freeze") if getattr(self, name)]
        words += [] if self.odom_scale is None else [f"odom_scale {_numbers(self.odom_scale)}"]
        return "; ".join(words) or "none"


NO_FAULTS = SensorFaults()
F = TypeVar("F", bound=LidarFaults)


def parse_faults(text: str, lidars: Collection[str] | None = None) -> SensorFaults:
    """Parse a line of faults.

    Args:
        text: see `FORMS`.
        lidars: the names of the existing lidars; None: any name is accepted.

    Raises:
        FaultError: a fault has none of the forms, or names a lidar that does not exist.
    """
    if text.strip() == "none":
        return NO_FAULTS
    faults = NO_FAULTS
    for part in text.split(";"):
        faults = _with(faults, part.strip(), lidars)
    return faults


def _with(faults: SensorFaults, part: str, lidars: Collection[str] | None) -> SensorFaults:
    match part.split():
        case ["no_odom"]:
            return replace(faults, no_odom=True)
        case ["odom_zero"]:
            return replace(faults, odom_zero=True)
        case ["odom_freeze"]:
            return replace(faults, odom_freeze=True)
        case ["odom_scale", number] if abs(scale := _number(number)) <= MAX_SCALE:
            return replace(faults, odom_scale=scale)
        case _:
            pass
    named = NAME.fullmatch(part)
    if named is None:
        changed = _of_lidar(faults, part)
        if changed is None:
            raise FaultError(f"{part!r} is no sensor fault; there are: {FORMS}")
        return changed
    name, word = named[1], named[2].strip()
    if lidars is not None and name not in lidars:
        raise FaultError(f"{part!r}: there is no lidar {name!r}; there are: {', '.join(lidars)}")
    only = dict(faults.only)
    own = _of_lidar(only.get(name, LidarFaults()), word)
    if own is None:
        raise FaultError(f"{part!r} is no fault of a lidar; there are: {FORMS}")
    return replace(faults, only=tuple((only | {name: own}).items()))


def _of_lidar(faults: F, part: str) -> F | None:
    """Return the faults with one more lidar fault; None if the text is not one."""
    match part.split():
        case ["freeze" | "all_nan" | "silent" as name]:
            return replace(faults, **{name: True})
        case ["rate", number] if MIN_RATE_HZ <= (rate_hz := _number(number)) <= MAX_RATE_HZ:
            return replace(faults, rate_hz=rate_hz)
        case ["reach", number] if MIN_REACH_M <= (reach_m := _number(number)) <= MAX_CODE_M:
            return replace(faults, reach_m=reach_m)
        case ["stray", number] if _is_share(share := _number(number)):
            return replace(faults, stray=share)
        case ["dropout" | "beams" as name, number, *code] if len(code) <= 1 and _is_share(
            share := _number(number)
        ):
            default = "inf" if name == "dropout" else "nan"
            code_m = _code_m((code or [default])[0])
            return None if code_m is None else replace(faults, **{name: Missing(share, code_m)})
        case ["blocked", start, end, *code] if len(code) <= 1:
            sector, code_m = (_number(start), _number(end)), _code_m((code or ["nan"])[0])
            if code_m is None or not _is_open(*sector):
                return None
            return replace(faults, blocked=(*faults.blocked, Sector(*sector, code_m)))
        case _:
            return None


def _is_open(start_rad: float, end_rad: float) -> bool:
    return abs(start_rad) <= MAX_ANGLE_RAD and abs(end_rad) <= MAX_ANGLE_RAD and start_rad != end_rad


def _is_share(value: float) -> bool:
    return 0.0 < value <= 1.0


def _code_m(text: str) -> float | None:
    """Return the reading in a code [m]; None if it is not a code. NaN is always the same object, so that faults compare."""
    if text.lower() == "nan":
        return math.nan
    value = _number(text)
    return value if math.isinf(value) or 0.0 <= value <= MAX_CODE_M else None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _numbers(*values: float) -> str:
    """Return the shortest text that gives the same numbers again."""
    return " ".join(short if float(short := f"{value:g}") == value else repr(value) for value in values)


def _code(code_m: float, default_m: float = math.nan) -> str:
    """Return the text of a code with a leading space; empty for the default."""
    is_default = code_m == default_m or (math.isnan(code_m) and math.isnan(default_m))
    return "" if is_default else f" {'nan' if math.isnan(code_m) else _numbers(code_m)}"


def _missing(name: str, missing: Missing, default_m: float) -> str:
    return f"{name} {_numbers(missing.share)}{_code(missing.code_m, default_m)}"


# --- a lidar's ranges

Ranges = NDArray[np.float32]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

EDGE_RAD = 1e-9
"""Tolerance for rounding, so that a beam exactly on a sector's edge is inside the sector."""
NEAR_M = 2.0
"""Only an object nearer than this can be missing."""
SAME_OBJECT_M = 0.15
"""Two neighbouring beams whose ranges differ by no more than this hit the same object."""
STRAY_M = 0.3
"""Maximum distance of a stray reading from the hull."""


class FaultyLidar:
    """One lidar and its faults.

    Args:
        angles_rad: (n,) angles of the beams in the lidar's frame, counter-clockwise.
        way_out_m: (n,) distance at which each beam leaves the robot's hull.
        range_min_m: the shortest distance that it measures.
        seed: seed of random faults; the same seed and scans give the same faults.
    """

    def __init__(
        self, angles_rad: Floats, way_out_m: Floats, range_min_m: float, seed: int | Sequence[int] = 0
    ) -> None:
        self._angles_rad, self._way_out_m, self._range_min_m = angles_rad, way_out_m, range_min_m
        self._random = np.random.default_rng(seed)
        self._frozen: Ranges | None = None

    def thaw(self) -> None:
        """Discard the frozen scan, because other faults are now active."""
        self._frozen = None

    def spoil(self, faults: LidarFaults, ranges: Ranges) -> Ranges:
        """Return a scan with these faults; with a freeze, the first scan is repeated.

        Args:
            faults: the active faults; those that concern the timing of scans are not applied here.
            ranges: (n,) in m; not modified.
        """
        if self._frozen is None:
            ranges = self._seen(faults, ranges)
            if not faults.freeze:
                return ranges
            self._frozen = ranges
        return self._frozen

    def _seen(self, faults: LidarFaults, ranges: Ranges) -> Ranges:
        if faults.all_nan:
            return np.full_like(ranges, np.nan)
        ranges, random = ranges.copy(), self._random
        if faults.reach_m is not None:
            ranges[ranges > faults.reach_m] = math.inf
        if faults.dropout is not None and random.random() < faults.dropout.share:
            ranges[nearest_object(ranges, self._angles_rad)] = faults.dropout.code_m
        if faults.beams is not None:
            ranges[random.random(len(ranges)) < faults.beams.share] = faults.beams.code_m
        if faults.stray > 0.0 and random.random() < faults.stray:
            beam = int(random.integers(len(ranges)))
            stray_m = self._way_out_m[beam] + random.uniform(0.0, STRAY_M)
            ranges[beam] = np.fmin(ranges[beam], np.float32(max(stray_m, self._range_min_m)))
        for sector in faults.blocked:
            ranges[_behind(sector, self._angles_rad)] = sector.code_m
        return ranges


def nearest_object(ranges: Ranges, angles_rad: Floats) -> Mask:
    """Return a mask (n,) of the beams that hit the nearest object; all false if none is within `NEAR_M`.

    An object consists of neighbouring beams without a step in range. An object too close to measure has the range 0.
    """
    distance_m = np.where(np.isnan(ranges), np.inf, np.maximum(ranges, 0.0))
    nearest = int(np.argmin(distance_m))
    near = distance_m < NEAR_M
    if not near[nearest]:
        return near
    depth_m = np.where(near, distance_m, 0.0)
    # Whether each beam hits the same object as the next beam; in a full turn, the first beam follows the last.
    joined = near & np.roll(near, -1) & (np.abs(np.roll(depth_m, -1) - depth_m) <= SAME_OBJECT_M)
    joined[-1] &= _is_full_turn(angles_rad)
    things = np.concatenate(((0,), np.cumsum(~joined[:-1])))
    if joined[-1]:
        things[things == things[-1]] = things[0]
    return things == things[nearest]


def _is_full_turn(angles_rad: Floats) -> bool:
    """Return whether the beams cover a full turn, so that the first beam is next to the last."""
    count = len(angles_rad)
    return count > 1 and math.isclose(
        (angles_rad[-1] - angles_rad[0]) * count / (count - 1), math.tau, rel_tol=1e-6
    )


def _behind(sector: Sector, angles_rad: Floats) -> Mask:
    """Return a mask of the beams in a sector; a sector as wide as a full turn contains all beams."""
    width_rad = sector.end_rad - sector.start_rad
    if width_rad < 0.0:
        width_rad %= math.tau
    return (angles_rad - sector.start_rad + EDGE_RAD) % math.tau <= width_rad + 2.0 * EDGE_RAD


# --- odometry

START = (0.0, 0.0, 0.0)
Pose = tuple[float, float, float]


class FaultyOdometry:
    """Wheel odometry with faults; errors of the pose remain after a fault ends."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Restart at the origin, together with the odometry itself."""
        self._counted: Pose = START
        self._said: Pose = START
        self._frozen: Reckoning | None = None

    def spoil(self, faults: SensorFaults, true: Reckoning) -> Reckoning | None:
        """Return the reading with these faults; None if no odometry is sent.

        Args:
            faults: the active faults.
            true: the reading without faults.
        """
        factor = 0.0 if faults.odom_zero else 1.0 if faults.odom_scale is None else faults.odom_scale
        if factor == 1.0 and self._said == self._counted:
            self._said = true[:3]  # bit for bit equal as long as no fault was ever active
        else:
            self._said = _moved(self._said, self._counted, true[:3], factor)
        self._counted = true[:3]
        x_m, y_m, yaw_rad = self._said
        said = true._replace(
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            linear_m_s=factor * true.linear_m_s,
            angular_rad_s=factor * true.angular_rad_s,
        )
        if not faults.odom_freeze:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = said
        return None if faults.no_odom else self._frozen or said


def _moved(said: Pose, before: Pose, after: Pose, factor: float) -> Pose:
    """Return the pose `said`, moved by `factor` times the displacement from `before` to `after`."""
    dx_m, dy_m, turn_rad = after[0] - before[0], after[1] - before[1], after[2] - before[2]
    angle_rad = said[2] - before[2]
    cos, sin = factor * math.cos(angle_rad), factor * math.sin(angle_rad)
    turn_rad = factor * math.remainder(turn_rad, math.tau)
    return (
        said[0] + cos * dx_m - sin * dy_m,
        said[1] + sin * dx_m + cos * dy_m,
        math.remainder(said[2] + turn_rad, math.tau),
    )
