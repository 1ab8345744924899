"""Apply sensor faults to a lidar's ranges. Pure except for a seeded generator: ranges in, ranges out."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.sensor_faults import LidarFaults, Sector

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
