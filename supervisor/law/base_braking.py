"""Measure the deceleration that the base shows at each stop.

The barrier trusts the base to brake with a configured deceleration. Payload, slope, floor and worn brakes make a base
weaker, and every stop shows it in odometry. A stop is measured while zero is commanded, from the first sample at which
the base has visibly slowed down to the last one at which it still moves:

    a = (v1² - v2²) / 2x

with the speeds v1 and v2 at these two samples, and the distance x that odometry shows between them. The speed is the one
that the barrier has to brake: max(|v|, |ω|·radius).

* Dead time does not count: x begins when the base has slowed down. It is configured (`base_dead_time_s`).
* Noise: v1 is compared with the mean speed before the stop, and x is a sum. The error of a is about 2σ/v1.
* A base that follows a slowly falling command does not count, nor does a stop that begins during one: for its dead time,
  the base still follows the falling command.
* Slopes and load: the second smallest of the last `KEPT` results counts, so that a stop downhill is remembered for
  several stops uphill, and a single outlier is forgotten at the next stop.

Odometry does not show the slip of the wheels, and a wrong scale of odometry changes a by the same factor.
"""

import math
from typing import NamedTuple

LEAST_SPEED_M_S = 0.4
"""A stop from a lower speed is too short to be measured."""

BEGUN_SHARE = 0.9
"""The base has visibly slowed down below this share of its mean speed before the stop."""

SMOOTHING = 0.2
"""Weight of a new sample in the mean speed before the stop."""

LONGEST_GAP_S = 0.15
"""A stop with a longer gap between two samples of odometry is not measured."""

LEAST_M_S2 = 0.1
"""The weakest brakes that can be configured. A base that shows less was pushed or rolled; with its number, a moving base
would be detected only after many seconds."""

GREATEST_M_S2 = 10.0
"""More than this exceeds the grip of a tyre: odometry was wrong."""

WEAK_SHARE = 0.9
"""The base is reported as weak if it shows less than this share of the configured deceleration; the rest is the error of a
measurement, although the law uses the lower number at once."""

KEPT = 10


class Braking(NamedTuple):
    """The stop that is being measured, and the results of the last stops."""

    mean_m_s: float = 0.0
    """Mean speed of the base while it was commanded to move."""
    stopping: bool = False
    """Whether the present or the next stop is measured."""
    first_m_s: float = 0.0
    """Speed at which the base had visibly slowed down."""
    way_m: float = 0.0
    """Distance since then."""
    last_m_s: float = 0.0
    """Speed of the newest sample."""
    last_s: float = -math.inf
    """Time of the newest sample."""
    shown_m_s2: tuple[float, ...] = ()
    """Decelerations of the last stops, the oldest first."""


UNMEASURED = Braking()


def measure(
    braking: Braking, speed_m_s: float, at_s: float, *, is_driven: bool, standing_m_s: float
) -> Braking:
    """Process the newest sample of odometry.

    Args:
        braking: the result of the last call.
        speed_m_s: the measured speed, max(|v|, |ω|·radius).
        at_s: arrival time of the sample; a sample that is not newer than the last one changes nothing.
        is_driven: whether a motion was commanded until now.
        standing_m_s: noise of odometry: a slower base counts as standing still.
    """
    before_m_s, gap_s = braking.last_m_s, at_s - braking.last_s
    if gap_s <= 0.0:
        return braking
    braking = braking._replace(last_m_s=speed_m_s, last_s=at_s)
    if is_driven:
        mean_m_s = braking.mean_m_s + SMOOTHING * (speed_m_s - braking.mean_m_s)
        stopping = mean_m_s >= LEAST_SPEED_M_S and speed_m_s >= BEGUN_SHARE * mean_m_s
        return braking._replace(mean_m_s=mean_m_s, stopping=stopping, first_m_s=0.0, way_m=0.0)
    if not braking.stopping or gap_s > LONGEST_GAP_S:
        return braking._replace(mean_m_s=0.0, stopping=False)
    if speed_m_s <= standing_m_s:
        return _finish(braking, before_m_s)
    if before_m_s >= BEGUN_SHARE * braking.mean_m_s or braking.first_m_s == 0.0:
        return braking._replace(first_m_s=speed_m_s, way_m=0.0)
    return braking._replace(way_m=braking.way_m + (before_m_s + speed_m_s) / 2.0 * gap_s)


def bound_m_s2(braking: Braking) -> float:
    """Return the deceleration that the last stops have shown [m/s²]; infinite before the first.

    A single result counts as it is. Of more, the second smallest counts.
    """
    shown = sorted(braking.shown_m_s2)
    return shown[min(1, len(shown) - 1)] if shown else math.inf


def _finish(braking: Braking, last_m_s: float) -> Braking:
    """Add the result of a stop that has ended; one without a distance between two samples has none."""
    ended = braking._replace(mean_m_s=0.0, stopping=False)
    if braking.way_m <= 0.0:
        return ended
    shown_m_s2 = (braking.first_m_s**2 - last_m_s**2) / (2.0 * braking.way_m)
    if not 0.0 < shown_m_s2 <= GREATEST_M_S2:
        return ended
    return ended._replace(shown_m_s2=(*braking.shown_m_s2, max(LEAST_M_S2, shown_m_s2))[-KEPT:])
