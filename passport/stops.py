"""Computes one run from what was recorded around a fault.

The distance is measured at the wall. At a steady speed, each scan before the fault shows where the robot was at the fault. Speeds are
those of odometry; where it is silent, those of the wall. All times are times of arrival.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from commission.estimate import Floats
from commission.stopping import STEADY_S, stop_of
from commission.trace import Command
from passport.record import MAX_SAMPLES, Run
from wire.standstill import STILL_M_S, STILL_RAD_S

STARTED_SHARE = 0.95
"""Below this share of the speed at the fault, the robot brakes."""
STILL_S = 0.2
SLIP_M, SLIP_SHARE = 0.02, 0.05
BEFORE_S, AFTER_S = 0.5, 0.3
"""What a trace shows before the fault and after the standstill."""
MOST_M_S, MOST_M = 20.0, 200.0
"""What a record may contain; odometry may say anything."""
SILENT_S = 0.3
"""After a longer gap, odometry does not show the stop."""


def run_of(
    fault_s: float,
    rest_s: float,
    commands: Sequence[Command],
    odometry: Floats,
    walls: Floats,
    *,
    is_seen: bool = True,
    scale: float = 1.0,
    latency_s: float = 0.0,
    uncertainty_m: float = 0.0,
    is_turn: bool = False,
) -> Run | None:
    """Return the run; None if the robot did not drive steadily before the fault, or the wall or odometry is missing.

    For a turn, each m means rad, and `walls` contains the bearing of the wall instead of its distance.

    Args:
        fault_s: when the fault began.
        rest_s: when the robot had been at rest for 0.3 s.
        commands: those of the supervisor to the base.
        odometry: (n, 3) arrival [s], distance driven toward the wall by the poses [m], speed toward it [m/s].
        walls: (m, 2) arrival [s], distance [m].
        is_seen: whether the recorder heard the robot from the fault to the standstill.
        scale: true distance divided by distance of odometry.
        latency_s: latency of the scans.
        uncertainty_m: a smaller difference between lidar and odometry is no slip.
        is_turn: whether the robot turns on the spot.
    """
    stop = stop_of(fault_s, rest_s, odometry, walls, is_seen=is_seen, scale=scale, latency_s=latency_s)
    if stop is None:
        return None
    apart_m = abs(stop.way_m - stop.odometry_m)
    still = STILL_RAD_S if is_turn else STILL_M_S
    times = (
        _times(fault_s, rest_s, commands, odometry, walls, scale, latency_s, still) if is_seen else NOT_SEEN
    )
    least_m = math.inf if is_turn else SLIP_M
    braking_s = 0.0 if times.t2_s is None or times.t3_s is None else times.t3_s - times.t2_s
    try:
        return Run(
            **times._asdict(),
            v0_m_s=stop.speed_m_s,
            distance_m=stop.way_m,
            odometry_m=stop.odometry_m,
            deceleration_m_s2=STARTED_SHARE * stop.speed_m_s / braking_s if braking_s > 0.0 else None,
            slip=apart_m > least_m or apart_m > max(SLIP_SHARE * abs(stop.way_m), uncertainty_m),
            stopped=True,
        )
    except ValidationError:  # no robot is that fast, or drives that far
        return None


class _Times(NamedTuple):
    """The fields of a `Run` that need the recorder."""

    t0_s: float | None = None
    t1_s: float | None = None
    t2_s: float | None = None
    t3_s: float | None = None
    trace: tuple[tuple[float, float, float], ...] = ()


NOT_SEEN = _Times()


def no_stop(
    speed_m_s: float,
    fault_s: float,
    now_s: float,
    commands: Sequence[Command],
    odometry: Floats,
    *,
    is_seen: bool = True,
) -> Run:
    """Return the run of a robot that did not stop.

    Args:
        speed_m_s: the commanded speed.
        fault_s: when the fault began.
        now_s: when the recording ended.
        commands: those of the supervisor to the base.
        odometry: as for `run_of`.
        is_seen: as for `run_of`.
    """
    times = NOT_SEEN
    if is_seen:
        trace = _trace(_by_odometry(odometry, fault_s, 1.0), now_s - fault_s)
        times = _Times(t0_s=0.0, t1_s=_zero(commands, fault_s, now_s), trace=trace)
    return Run(
        **times._asdict(),
        v0_m_s=speed_m_s,
        distance_m=None,
        odometry_m=None,
        deceleration_m_s2=None,
        slip=False,
        stopped=False,
    )


def _times(
    fault_s: float,
    rest_s: float,
    commands: Sequence[Command],
    odometry: Floats,
    walls: Floats,
    scale: float,
    latency_s: float,
    still: float,
) -> _Times:
    motion = _by_odometry(odometry, fault_s, scale)
    if _longest_gap_s(motion[:, 0], 0.0, rest_s - fault_s) > SILENT_S:
        motion = _by_wall(walls, fault_s + latency_s)
    before = motion[(motion[:, 0] > -STEADY_S) & (motion[:, 0] <= 0.0)]
    t3_s = _standstill(motion, still)
    return _Times(
        0.0,
        _zero(commands, fault_s, rest_s),
        _after_last(motion, np.abs(motion[:, 1]) >= STARTED_SHARE * float(before[:, 1].mean())),
        t3_s,
        _trace(motion, rest_s - fault_s if t3_s is None else t3_s + AFTER_S),
    )


def _by_odometry(odometry: Floats, fault_s: float, scale: float) -> Floats:
    """Return (n, 3): time from the fault [s], speed [m/s], distance from the fault [m]."""
    at_s, ways = odometry[:, 0] - fault_s, scale * odometry[:, 1]
    here_m = np.interp(0.0, at_s, ways) if len(at_s) else 0.0
    return np.stack((at_s, scale * odometry[:, 2], ways - here_m), axis=1)


def _by_wall(walls: Floats, seen_s: float) -> Floats:
    """Return the same by the distances of the wall.

    Args:
        walls: (m, 2) arrival [s], distance [m].
        seen_s: when a scan of the time of the fault arrived.
    """
    at_s, distances = walls[:, 0] - seen_s, walls[:, 1]
    at_s, first = np.unique(at_s, return_index=True)
    distances = distances[first]
    there_m = np.interp(0.0, at_s, distances)
    return np.stack((at_s, -np.gradient(distances, at_s), there_m - distances), axis=1)


def _longest_gap_s(times_s: Floats, begin_s: float, end_s: float) -> float:
    between = times_s[(times_s > begin_s) & (times_s < end_s)].tolist()
    return max(b - a for a, b in itertools.pairwise([begin_s, *between, end_s]))


def _after_last(motion: Floats, holds: "np.ndarray[tuple[int], np.dtype[np.bool_]]") -> float | None:
    """Return the time of the sample after the last for which something holds; None if there is none after the fault."""
    last = np.flatnonzero(holds)
    later = motion[last[-1] + 1 :, 0] if len(last) else motion[:, 0]
    later = later[later > 0.0]
    return float(later[0]) if len(later) else None


def _standstill(motion: Floats, still: float) -> float | None:
    """Return the time from which the speed remains below that of a standing robot for `STILL_S`; None if it never does."""
    since_s = math.nan
    for at_s, speed_m_s, _ in motion[motion[:, 0] > 0.0].tolist():
        if abs(speed_m_s) >= still:
            since_s = math.nan
        elif math.isnan(since_s):
            since_s = at_s
        elif at_s - since_s >= STILL_S:
            return since_s
    return None


def _zero(commands: Sequence[Command], fault_s: float, rest_s: float) -> float | None:
    """Return the time of the first zero on cmd_vel after which no other command came until the rest."""
    between = [one for one in commands if fault_s < one.at_s <= rest_s]
    zeros = list(itertools.takewhile(lambda one: one.is_zero, reversed(between)))
    return zeros[-1].at_s - fault_s if zeros else None


def _trace(motion: Floats, until_s: float) -> tuple[tuple[float, float, float], ...]:
    """Return at most `MAX_SAMPLES` samples of the time around the stop."""
    around = motion[(motion[:, 0] >= -BEFORE_S) & (motion[:, 0] <= until_s)]
    around = np.clip(around, [-BEFORE_S, -MOST_M_S, -MOST_M], [until_s, MOST_M_S, MOST_M])
    every = len(around) // MAX_SAMPLES + 1
    return tuple(
        (round(at_s, 4), round(speed, 4), round(way_m, 4)) for at_s, speed, way_m in around[::every].tolist()
    )
