"""What a reading means: REP 117, and the dialects that real sensors speak instead.

REP 117: −Inf is too close to measure, +Inf is nothing within range, NaN is no measurement. Real drivers say
"nothing came back" as 0.0, NaN, a maximum code or a constant below `range_min`: a profile names what its
sensor says. A reading that the profile does not explain is invalid, and what is below `range_min` without
being a code is too close: an obstacle.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import Floats, Mask

CODE_TOLERANCE_M = 1e-4
"""A code constant survives the way through float32 this well."""


@dataclass(frozen=True, slots=True)
class LidarProfile:
    """How one kind of sensor says that nothing came back; +Inf and beyond `range_max` always say so."""

    nan_is_free: bool = False
    zero_is_free: bool = False
    codes_below_m: float = 0.0
    """Readings above zero and below this are error codes: nothing came back."""
    free_codes_m: tuple[float, ...] = ()
    """Constants that say so."""
    silence_limit_s: float = math.inf
    """A beam on which nothing has returned for longer may be covered: that nothing comes back proves nothing."""
    silence_limit_m: float = math.inf
    """Likewise for the robot's way meanwhile: a beam counts as long as either limit holds."""
    trusts_silence_at_start: bool = True
    """A beam counts from the first scan on; else only from its first return."""


LONG_SILENCE_S = 15.0
LONG_WAY_M = 5.0
"""On moving robots with long-range sensors, at most 0.1 % of the beams have no return for so long."""

PROFILES = {
    "rep117": LidarProfile(silence_limit_s=LONG_SILENCE_S, silence_limit_m=LONG_WAY_M),
    "rplidar": LidarProfile(
        zero_is_free=True,
        silence_limit_s=LONG_SILENCE_S,
        silence_limit_m=LONG_WAY_M,
        trusts_silence_at_start=False,
    ),
    # The range of the XV-11 and of the URG-04 is so short that a fifth of the beams may be silent for minutes.
    # The XV-11 repeats 0.053 where nothing came back, below its range_min of 0.06.
    "neato_xv": LidarProfile(zero_is_free=True, nan_is_free=True, free_codes_m=(0.053,)),
    # The URG's codes 0 to 19, in mm, are reasons why there is no distance.
    "hokuyo_urg": LidarProfile(zero_is_free=True, nan_is_free=True, codes_below_m=0.0195),
    # Logs of the LMS carry its largest code where nothing came back.
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
    """How often one kind of sensor sends a scan, and when it has fallen silent."""

    usual_period_s: float
    """The longest that is usual between two of its scans."""
    timeout_s: float
    """Older than this, its newest scan proves nothing, unless the configuration says otherwise."""


TIMINGS = {
    # Its motor is set to 5.5 to 10 Hz.
    "rplidar": SensorTiming(0.18, 0.45),
    # 5 Hz, but for single turns that take twice as long: at 0.24 s it was stale for 8 to 24 % of the time.
    "neato_xv": SensorTiming(0.2, 0.45),
    "hokuyo_urg": SensorTiming(0.1, 0.3),
    # 15 to 50 Hz, by the model and its resolution.
    "sick_lms": SensorTiming(0.07, 0.24),
}
"""For the profiles that name a sensor; `rep117` names a convention."""


class Readings(NamedTuple):
    """One scan's readings, sorted by what they mean; masks over its beams."""

    hit: Mask
    """Something is there, at its distance, or nearer than that can be measured."""
    explained: Mask
    """A hit, or known to be free."""
    distance_m: Floats
    """Where it hits: the reading, or zero for what is too close to be measured. Elsewhere without meaning."""


def explain(
    ranges: npt.NDArray[np.float32], range_min: float, range_max: float, profile: LidarProfile
) -> Readings:
    """Sort readings (n,) [m] by what they mean under a profile."""
    readings = np.asarray(ranges, dtype=np.float64)
    hit, free = readings <= range_max, readings > range_max  # NaN is neither
    if profile.nan_is_free:
        free |= np.isnan(readings)
    if profile.zero_is_free:
        free |= readings == 0.0
    if profile.codes_below_m > 0.0:
        free |= (readings > 0.0) & (readings < profile.codes_below_m)
    for code in profile.free_codes_m:
        free |= np.abs(readings - code) < CODE_TOLERANCE_M
    # What is too close may be anywhere nearer than `range_min`.
    return Readings(hit & ~free, hit | free, np.where(readings < range_min, 0.0, readings))
