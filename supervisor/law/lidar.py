"""Meaning of lidar readings: REP 117, and the deviating conventions of real sensors.

REP 117: −Inf is too close to measure, +Inf is nothing within range, NaN is no measurement. A reading of exactly `range_max` is
no return either: simulators and drivers cut off there. Real drivers encode "no
return" as 0.0, NaN, a maximum code or a constant below `range_min`. A profile defines the codes of a sensor. A reading
that the profile does not explain is invalid. A reading below `range_min` that is not a code is an obstacle too close
to measure.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Floats, Mask

CODE_TOLERANCE_M = 1e-4
"""Tolerance for comparing a reading with a code constant; covers the rounding to float32."""


@dataclass(frozen=True, slots=True)
class LidarProfile:
    """How one kind of sensor encodes "no return"; +Inf and readings from `range_max` on always mean it."""

    nan_is_free: bool = False
    zero_is_free: bool = False
    codes_below_m: float = 0.0
    """Readings above zero and below this are codes for "no return"."""
    free_codes_m: tuple[float, ...] = ()
    """Further constants that mean "no return"."""
    silence_limit_s: float = math.inf
    """If a beam has had no return for longer than this, it may be covered: "no return" then proves nothing."""
    silence_limit_m: float = math.inf
    """The same limit for the distance travelled since the last return; a beam counts while either limit holds."""
    trusts_silence_at_start: bool = True
    """Whether a beam counts from the first scan on, or only from its first return."""


LONG_SILENCE_S = 15.0
LONG_WAY_M = 5.0
"""On moving robots with long-range sensors, at most 0.1 % of the beams have no return over this distance."""

PROFILES = {
    "rep117": LidarProfile(silence_limit_s=LONG_SILENCE_S, silence_limit_m=LONG_WAY_M),
    "rplidar": LidarProfile(
        zero_is_free=True,
        silence_limit_s=LONG_SILENCE_S,
        silence_limit_m=LONG_WAY_M,
        trusts_silence_at_start=False,
    ),
    # The range of the XV-11 and the URG-04 is so short that a fifth of the beams may have no return for minutes.
    # The XV-11 reports 0.053 for "no return", which is below its range_min of 0.06.
    "neato_xv": LidarProfile(zero_is_free=True, nan_is_free=True, free_codes_m=(0.053,)),
    # The URG's readings 0 to 19, in mm, are error codes.
    "hokuyo_urg": LidarProfile(zero_is_free=True, nan_is_free=True, codes_below_m=0.0195),
    # Logs of the LMS contain its largest code for "no return".
    "sick_lms": LidarProfile(
        zero_is_free=True,
        free_codes_m=(81.83, 81.9, 81.91, 50.0),
        silence_limit_s=LONG_SILENCE_S,
        silence_limit_m=LONG_WAY_M,
        trusts_silence_at_start=False,
    ),
}


@dataclass(frozen=True, slots=True)
class SensorTiming:
    """Scan period, timeout and latency of one kind of sensor."""

    usual_period_s: float
    """Longest usual time between two scans."""
    timeout_s: float
    """Maximum age of a usable scan, unless the configuration gives another."""
    latency_s: float
    """Mean age of the readings of a turn when the driver sends them: half of the time that the turn takes."""


TIMINGS = {
    # Its motor is set to 5.5 to 10 Hz.
    "rplidar": SensorTiming(0.18, 0.45, 0.09),
    # 5 Hz, except that single turns take twice as long: with 0.24 s it was stale for 8 to 24 % of the time.
    "neato_xv": SensorTiming(0.2, 0.45, 0.1),
    # It looks at three quarters of a turn.
    "hokuyo_urg": SensorTiming(0.1, 0.3, 0.04),
    # 15 to 50 Hz, depending on model and resolution.
    "sick_lms": SensorTiming(0.07, 0.24, 0.03),
}
"""Timing of the profiles that name a sensor; `rep117` has none, because it names a convention."""


class Readings(NamedTuple):
    """The readings of one scan, classified by their meaning; arrays over its n beams."""

    hit: Mask
    """(n,): whether the beam has a return, or one too close to measure."""
    explained: Mask
    """(n,): whether the profile explains the reading, as a hit or as "no return"."""
    distance_m: Floats
    """(n,): for a hit, the reading, or zero if it is too close to measure; elsewhere undefined."""


def explain(
    ranges: npt.NDArray[np.float32], range_min: float, range_max: float, profile: LidarProfile
) -> Readings:
    """Classify readings (n,) [m] by their meaning under a profile."""
    readings = np.asarray(ranges, dtype=np.float64)
    hit, free = readings < range_max, readings >= range_max  # NaN is neither
    if profile.nan_is_free:
        free |= np.isnan(readings)
    if profile.zero_is_free:
        free |= readings == 0.0
    if profile.codes_below_m > 0.0:
        free |= (readings > 0.0) & (readings < profile.codes_below_m)
    for code in profile.free_codes_m:
        free |= np.abs(readings - code) < CODE_TOLERANCE_M
    # An object too close to measure may be at any distance below `range_min`.
    return Readings(hit & ~free, hit | free, np.where(readings < range_min, 0.0, readings))
