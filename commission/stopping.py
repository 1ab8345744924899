"""The dead time and the deceleration of the base, from stops before the wall at several speeds.

After zero is commanded, a base keeps its speed v for the dead time D and then brakes with a. It drives the distance

    x = v·D + v²/2a

This equation is fitted to the stops. The distance x is measured at the wall, so it includes the slip of the wheels, which odometry does
not show. The error of x hardly depends on the speed. A line through x/v would give too much weight to slow stops, and too small intervals.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from commission.estimate import UNKNOWN, Estimate, Floats, least_squares
from supervisor.law.base_braking import UNMEASURED, measure

STEADY_S = 0.4
"""The robot must have driven steadily for this long before the stop."""
UNSTEADY_SHARE = 0.1
LONGEST_GAP = 3.0
"""Between two samples of odometry, in mean gaps. After a longer gap, samples arrived late, and their times show a wrong speed and a wrong distance."""
REST_S = 0.3
LEAST_STOPS = 4
LEAST_SPEED_M_S = 0.08
LEAST_SCANS = 2


class Stop(NamedTuple):
    """One stop toward the wall."""

    speed_m_s: float
    """True speed when zero was commanded."""
    way_m: float
    """Distance from then to the standstill, by the wall."""
    odometry_m: float
    """The same by odometry, corrected by its scale."""


def stop_of(
    stopped_s: float,
    rest_s: float,
    odometry: Floats,
    walls: Floats,
    *,
    is_seen: bool = True,
    scale: float = 1.0,
    latency_s: float = 0.0,
) -> Stop | None:
    """Return a stop; None if the robot did not drive steadily before it, did not come to rest, or samples arrived late.

    Args:
        stopped_s: when zero was commanded.
        rest_s: when the robot had been at rest for `REST_S`.
        odometry: (n, 3) arrival [s], way toward the wall by the poses [m], speed toward it by the velocities [m/s].
        walls: (m, 2) arrival [s], distance [m].
        is_seen: whether odometry is expected between `stopped_s` and the standstill: a gap there then means late odometry.
        scale: true distance divided by distance of odometry.
        latency_s: latency of the scans.
    """
    at_s = odometry[:, 0]
    before = odometry[(at_s > stopped_s - STEADY_S) & (at_s <= stopped_s)]
    after = odometry[(at_s > rest_s - REST_S) & (at_s <= rest_s)]
    seen_s = walls[:, 0] - latency_s
    walls_before = (seen_s > stopped_s - STEADY_S) & (seen_s <= stopped_s)
    walls_after = (seen_s > rest_s - REST_S) & (seen_s <= rest_s)
    if min(len(before), len(after)) < 2 or not walls_before.any() or not walls_after.any():
        return None
    last_s = stopped_s + STEADY_S if is_seen else stopped_s
    gaps_s = np.diff(at_s[(at_s > stopped_s - STEADY_S) & (at_s <= last_s)])
    if gaps_s.max() > LONGEST_GAP * gaps_s.mean():
        return None
    # By the poses: their scale is known, that of the velocities is not.
    line: Floats = np.polyfit(before[:, 0] - stopped_s, before[:, 1], 1)
    speed_m_s, driven_m = scale * float(line[0]), float(line[1])
    if speed_m_s < LEAST_SPEED_M_S or np.ptp(before[:, 2]) > 2 * UNSTEADY_SHARE * abs(before[:, 2].mean()):
        return None
    # At a steady speed, each earlier sample shows where the robot was when zero was commanded.
    then_m = float(np.mean(walls[walls_before, 1] - speed_m_s * (stopped_s - seen_s[walls_before])))
    way_m = then_m - float(walls[walls_after, 1].mean())
    return Stop(speed_m_s, way_m, scale * (float(after[:, 1].mean()) - driven_m))


def steady_speeds(
    stopped_s: float, odometry: Floats, walls: Floats, latency_s: float = 0.0
) -> tuple[float, float] | None:
    """Return the speed before a stop by the poses of odometry and by the wall [m/s]; None without enough scans.

    Args:
        stopped_s: when zero was commanded.
        odometry: as for `stop_of`.
        walls: as for `stop_of`.
        latency_s: latency of the scans.
    """
    seen_s = walls[:, 0] - latency_s
    before = (odometry[:, 0] > stopped_s - STEADY_S) & (odometry[:, 0] <= stopped_s)
    walls_before = (seen_s > stopped_s - STEADY_S) & (seen_s <= stopped_s)
    if min(np.count_nonzero(before), np.count_nonzero(walls_before)) < LEAST_SCANS:
        return None
    by_odometry = np.polyfit(odometry[before, 0] - stopped_s, odometry[before, 1], 1)
    by_wall = np.polyfit(seen_s[walls_before] - stopped_s, walls[walls_before, 1], 1)
    return float(by_odometry[0]), -float(by_wall[0])


def steady_scale(speeds_m_s: Sequence[tuple[float, float]]) -> Estimate:
    """Return the true speed divided by that of odometry while the robot drives steadily, without the slip of starts and stops.

    Args:
        speeds_m_s: the results of `steady_speeds`.
    """
    if not speeds_m_s:
        return UNKNOWN
    by_odometry, by_wall = np.array(speeds_m_s).T
    fit = least_squares(by_odometry[:, None], by_wall)
    return fit.estimate(float(fit.parameters[0]), np.array([1.0]))


class Brakes(NamedTuple):
    """What stops show."""

    dead_time_s: Estimate
    deceleration_m_s2: Estimate
    slip: Estimate
    """Share of the stopping distance that odometry does not show."""


def brakes(stops: Sequence[Stop], scale_u95: float = 0.0, latency_u95_s: float = 0.0) -> Brakes:
    """Return dead time and deceleration from at least `LEAST_STOPS` stops at two or more speeds.

    Args:
        stops: the stops.
        scale_u95: 95 % uncertainty of the scale that the stops were computed with, as a share of the scale.
        latency_u95_s: 95 % uncertainty of the latency that they were computed with [s].
    """
    if len(stops) < LEAST_STOPS:
        return Brakes(UNKNOWN, UNKNOWN, UNKNOWN)
    speeds = np.array([stop.speed_m_s for stop in stops])
    ways = np.array([stop.way_m for stop in stops])
    fit = least_squares(np.stack((speeds, speeds**2), axis=1), ways)
    dead_s, rise = fit.parameters.tolist()
    dead = fit.estimate(dead_s, np.array([1.0, 0.0])).with_errors(latency_u95_s, 0.5 * STEADY_S * scale_u95)
    half_inverse = fit.estimate(rise, np.array([0.0, 1.0]))
    shares = least_squares(ways[:, None], np.array([stop.odometry_m for stop in stops]))
    per_s = float(speeds @ ways) / float(ways @ ways)
    slip = shares.estimate(1.0 - float(shares.parameters[0]), np.array([1.0])).with_errors(
        latency_u95_s * per_s, scale_u95 * (1.0 + 0.5 * STEADY_S * per_s)
    )
    if half_inverse.low <= 0.0:
        return Brakes(dead, UNKNOWN._replace(n=len(stops)), slip)
    value = 1.0 / (2.0 * rise)
    # The lower end of the interval is exact: the smallest deceleration that the fit permits.
    weakest = Estimate(value, value - 1.0 / (2.0 * half_inverse.high), len(stops))
    return Brakes(dead, weakest.with_errors(2.0 * value * scale_u95), slip)


def by_the_law(stopped_s: float, odometry: Floats, commanded_m_s: float, standing_m_s: float) -> float:
    """Return the deceleration that the safety law measures in the same stop [m/s²]; NaN if it measures none.

    Args:
        stopped_s: when zero was commanded.
        odometry: (n, 3) as for `stop_of`.
        commanded_m_s: the speed that was commanded before.
        standing_m_s: a slower base counts as standing still.
    """
    state = UNMEASURED
    for at_s, _, speed_m_s in odometry.tolist():
        since_s = stopped_s if at_s > stopped_s else None
        state = measure(
            state,
            abs(speed_m_s),
            at_s,
            commanded_m_s=commanded_m_s,
            stopped_s=since_s,
            standing_m_s=standing_m_s,
        )
    return state.shown_m_s2[-1] if state.shown_m_s2 else math.nan
