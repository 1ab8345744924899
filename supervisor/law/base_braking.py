"""Measure the deceleration and the dead time that the base shows at each stop.

The barrier trusts the base to brake with a configured deceleration after a configured dead time. Payload, slope, floor and
worn brakes make a base weaker, its controller and network make it later, and every stop shows it in odometry.

The deceleration is measured while zero is commanded, from the first sample at which the base has visibly slowed down to
the last one at which it still moves:

    a = (v1² - v2²) / 2x

with the speeds v1 and v2 at these two samples, and the distance x that odometry shows between them. The speed is the one
that the barrier has to brake: max(|v|, |ω|·radius).

* Dead time does not count: x begins when the base has slowed down.
* Noise: v1 is compared with the mean speed before the stop, and x is a sum. The error of a is about 2σ/v1.
* A base that follows a slowly falling command does not count, nor does a stop that begins during one: for its dead time,
  the base still follows the falling command.
* Slopes and load: the second smallest of the last `KEPT` results counts, so that a stop downhill is remembered for
  several stops uphill, and a single outlier is forgotten at the next stop.

The dead time is the part of the stopping distance that braking does not explain. The base keeps its speed v for this time:

    D = (x - v²/2b) / v

with the mean speed v before the stop, the distance x since zero was commanded, and the slope b of the line through the
samples of the same stop. A line has half the noise of a. D contains the latency of odometry.

* Only a base that has reached its command shows its dead time: another one may still accelerate during it.
* A dead time that half a gap between two samples, a tick and transport explain counts as zero.
* The second largest of the last `KEPT` results counts, and a single one as it is.

Odometry does not show the slip of the wheels, and a wrong scale of odometry changes a by the same factor. Where the scans show how
much farther the robot moved (slip.py), this distance s replaces the result of the stop:

    a = v² / 2(x - v·D + s)
"""

import math
from typing import NamedTuple

LEAST_SPEED_M_S = 0.4
"""A stop from a lower speed is too short to be measured."""

BEGUN_SHARE = 0.9
"""The base has visibly slowed down below this share of its mean speed before the stop."""

SMOOTHING_S = 0.08
"""Time constant of the mean speed before the stop: a fifth is the weight of a new sample at 50 Hz."""

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

REACHED_SHARE = 0.05
"""The base has reached its command if its mean speed differs from it by at most this share."""

SAMPLING_S = 0.03
"""A tick and transport: a dead time of at most this and half a gap between two samples counts as zero."""

LONGEST_DEAD_S = 0.5
"""The longest dead time that can be configured. A base that shows more was pushed or rolled on."""

LATE_S = 0.04
"""The base is reported as late if it shows this more than the configured dead time; the rest is the error of a measurement,
although the law uses the longer time at once."""


LEAST_SPREAD_S2 = 1e-9
"""More than the rounding error of the sums over samples of up to 10 s; less than two samples 0.1 ms apart have."""


class Line(NamedTuple):
    """Sums over the samples through which a line is fitted: time [s] since zero was commanded, speed [m/s]."""

    n: int = 0
    t: float = 0.0
    v: float = 0.0
    tt: float = 0.0
    tv: float = 0.0

    def add(self, t_s: float, v_m_s: float) -> "Line":
        return Line(self.n + 1, self.t + t_s, self.v + v_m_s, self.tt + t_s * t_s, self.tv + t_s * v_m_s)

    def brakes_m_s2(self) -> float:
        """Return the deceleration of the least squares; infinite if all samples are from one time."""
        spread = self.n * self.tt - self.t * self.t
        return (self.t * self.v - self.n * self.tv) / spread if spread > LEAST_SPREAD_S2 else math.inf


NO_LINE = Line()


class Stop(NamedTuple):
    """A stop that is measured."""

    began_s: float
    """Since when zero has been commanded."""
    speed_m_s: float
    """Mean speed before it."""


class Ended(NamedTuple):
    """A stop that has ended, as odometry shows it."""

    speed_m_s: float
    """Mean speed before it."""
    braked_m: float
    """Distance since zero was commanded, without that of the dead time."""
    is_measured: bool
    """Whether it has shown a deceleration."""


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
    reached: bool = False
    """Whether the base had reached its command, so that the stop shows its dead time."""
    whole_m: float = 0.0
    """Distance since zero was commanded."""
    gap_s: float = 0.0
    """Longest time between two samples since then."""
    line: Line = NO_LINE
    """The samples since the base has visibly slowed down."""
    shown_dead_s: tuple[float, ...] = ()
    """Dead times of the last stops, the oldest first."""
    ended: Ended | None = None
    """The last stop until the scans have shown whether the wheels slipped, or the next command; None if nothing waits for it."""
    shown_slip_m: tuple[float, ...] = ()
    """By how much the last stops were longer than odometry shows, the oldest first; zero without slip."""


UNMEASURED = Braking()


def measure(
    braking: Braking,
    speed_m_s: float,
    at_s: float,
    *,
    commanded_m_s: float,
    stopped_s: float | None,
    standing_m_s: float,
) -> Braking:
    """Process the newest sample of odometry.

    Args:
        braking: the result of the last call.
        speed_m_s: the measured speed, max(|v|, |ω|·radius).
        at_s: arrival time of the sample; a sample that is not newer than the last one changes nothing.
        commanded_m_s: the speed that was commanded until now, in the same sense.
        stopped_s: since when zero has been commanded; None while a motion is commanded.
        standing_m_s: noise of odometry: a slower base counts as standing still.
    """
    before_m_s, gap_s = braking.last_m_s, at_s - braking.last_s
    if gap_s <= 0.0:
        return braking
    if stopped_s is None:
        weight = 1.0 - SMOOTHING_S / (SMOOTHING_S + gap_s)
        mean_m_s = braking.mean_m_s + weight * (speed_m_s - braking.mean_m_s)
        return UNMEASURED._replace(
            mean_m_s=mean_m_s,
            stopping=mean_m_s >= LEAST_SPEED_M_S and speed_m_s >= BEGUN_SHARE * mean_m_s,
            reached=abs(mean_m_s - commanded_m_s) <= REACHED_SHARE * commanded_m_s,
            last_m_s=speed_m_s,
            last_s=at_s,
            shown_m_s2=braking.shown_m_s2,
            shown_dead_s=braking.shown_dead_s,
            shown_slip_m=braking.shown_slip_m,
        )
    braking = braking._replace(last_m_s=speed_m_s, last_s=at_s)
    if not braking.stopping or gap_s > LONGEST_GAP_S:
        return braking._replace(mean_m_s=0.0, stopping=False)
    braking = braking._replace(gap_s=max(braking.gap_s, gap_s))
    if speed_m_s <= standing_m_s:
        return _finish(braking, before_m_s)
    since_s = max(0.0, at_s - stopped_s)
    driven_m = (before_m_s + speed_m_s) / 2.0 * gap_s
    if braking.first_m_s == 0.0:  # zero was commanded between the last two samples
        whole_m = (braking.mean_m_s + speed_m_s) / 2.0 * since_s
    else:
        whole_m = braking.whole_m + driven_m
    # Also at the first sample after zero was commanded: otherwise this stop is not measured.
    if before_m_s >= BEGUN_SHARE * braking.mean_m_s:
        return braking._replace(
            first_m_s=speed_m_s, way_m=0.0, whole_m=whole_m, line=NO_LINE.add(since_s, speed_m_s)
        )
    return braking._replace(
        way_m=braking.way_m + driven_m, whole_m=whole_m, line=braking.line.add(since_s, speed_m_s)
    )


def bound_m_s2(braking: Braking) -> float:
    """Return the deceleration that the last stops have shown [m/s²]; infinite before the first.

    A single result counts as it is. Of more, the second smallest counts.
    """
    shown = sorted(braking.shown_m_s2)
    return shown[min(1, len(shown) - 1)] if shown else math.inf


def bound_dead_s(braking: Braking) -> float:
    """Return the dead time that the last stops have shown [s]; zero before the first.

    A single result counts as it is. Of more, the second largest counts.
    """
    shown = sorted(braking.shown_dead_s)
    return shown[-min(2, len(shown))] if shown else 0.0


def _finish(braking: Braking, last_m_s: float) -> Braking:
    """Add the results of a stop that has ended; one without a distance between two samples shows no deceleration."""
    ended = braking._replace(mean_m_s=0.0, stopping=False)
    dead_s = 0.0
    if braking.reached and (brakes_m_s2 := braking.line.brakes_m_s2()) > 0.0:
        dead_s = _dead_s(braking, last_m_s, brakes_m_s2)
        ended = ended._replace(shown_dead_s=(*braking.shown_dead_s, dead_s)[-KEPT:])
    stop = Ended(braking.mean_m_s, max(0.0, braking.whole_m - braking.mean_m_s * dead_s), is_measured=False)
    ended = ended._replace(ended=stop)
    if braking.way_m <= 0.0:
        return ended
    shown_m_s2 = (braking.first_m_s**2 - last_m_s**2) / (2.0 * braking.way_m)
    if not 0.0 < shown_m_s2 <= GREATEST_M_S2:
        return ended
    return ended._replace(
        shown_m_s2=(*braking.shown_m_s2, max(LEAST_M_S2, shown_m_s2))[-KEPT:],
        ended=stop._replace(is_measured=True),
    )


def slipped(braking: Braking, slip_m: float) -> Braking:
    """Return the results with what the scans show of the stop that has ended.

    Args:
        braking: the results with this stop.
        slip_m: by how much it was longer than odometry shows; NaN if the scans do not show it.
    """
    stop, braking = braking.ended, braking._replace(ended=None)
    if stop is None or math.isnan(slip_m):
        return braking
    braking = braking._replace(shown_slip_m=(*braking.shown_slip_m, slip_m)[-KEPT:])
    if slip_m == 0.0:
        return braking
    shown_m_s2 = stop.speed_m_s**2 / (2.0 * (stop.braked_m + slip_m))
    others = braking.shown_m_s2[:-1] if stop.is_measured else braking.shown_m_s2
    return braking._replace(shown_m_s2=(*others, max(LEAST_M_S2, shown_m_s2))[-KEPT:])


def _dead_s(braking: Braking, last_m_s: float, brakes_m_s2: float) -> float:
    """Return the dead time of a stop [s], zero if its sampling explains it."""
    mean_m_s = braking.mean_m_s
    braked_m = (mean_m_s**2 - last_m_s**2) / (2.0 * brakes_m_s2)
    dead_s = (braking.whole_m - braked_m) / mean_m_s
    return min(dead_s, LONGEST_DEAD_S) if dead_s > braking.gap_s / 2.0 + SAMPLING_S else 0.0
