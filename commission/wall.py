"""Finds a flat wall in a scan, and follows it: a robust line through the returns.

A line is found by random pairs of returns (RANSAC, with a fixed seed), and fitted by total least squares to the returns near it.
"""

import math
from typing import NamedTuple

import numpy as np

from commission.estimate import Floats

LEAST_LENGTH_M = 1.0
"""A shorter flat surface is not used as a wall."""
LEAST_RETURNS = 10
WIDEST_GAP_M = 0.5
"""A wider gap between two returns along a line ends the wall."""
PAIRS = 300
MOST_POINTS = 2000
"""Of more returns, every second or third one votes for a line."""
LINES = 6
"""Number of lines that are searched for the nearest wall."""
ON_LINE_M = 0.03
FOLLOW_M = 0.25
"""How far from its previous place a wall may be in the next scan."""
LEAST_SIGMA_M = 1e-4
FITS = 4


class Wall(NamedTuple):
    """A flat wall in the frame of the angles that it was found with."""

    distance_m: float
    """Perpendicular distance of the origin."""
    bearing_rad: float
    """Direction from the origin to the nearest point of its line."""
    length_m: float


def nearest_wall(angles_rad: Floats, ranges_m: Floats) -> Wall | None:
    """Return the nearest flat wall; None if there is none.

    Args:
        angles_rad: (n,) angles of the beams, counter-clockwise.
        ranges_m: (n,) distances; a beam without a return is not finite.
    """
    points = _points(angles_rad, ranges_m)
    random = np.random.default_rng(0)
    walls: list[Wall] = []
    for _ in range(LINES):
        if len(points) < LEAST_RETURNS:
            break
        on_line = _best_line(points, random)
        wall = _fit(points[on_line])
        if wall is not None:
            walls.append(wall)
        points = points[~on_line]
    return min(walls, key=lambda wall: wall.distance_m, default=None)


def follow(wall: Wall, angles_rad: Floats, ranges_m: Floats, turned_rad: float = 0.0) -> Wall | None:
    """Return the same wall in the next scan; None if it is lost.

    Args:
        wall: the wall in the previous scan.
        angles_rad: (n,) angles of the beams.
        ranges_m: (n,) distances; a beam without a return is not finite.
        turned_rad: the expected change of its bearing since then.
    """
    points = _points(angles_rad, ranges_m)
    bearing_rad = wall.bearing_rad + turned_rad
    normal = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    near = np.abs(points @ normal - wall.distance_m) < FOLLOW_M
    found = _fit(points[near]) if np.count_nonzero(near) >= LEAST_RETURNS else None
    if found is None or abs(found.distance_m - wall.distance_m) > FOLLOW_M:
        return None
    return found


def _points(angles_rad: Floats, ranges_m: Floats) -> Floats:
    """Return the ends (m, 2) of the beams with a return."""
    seen = np.isfinite(ranges_m) & (ranges_m > 0.0) & np.isfinite(angles_rad)
    angles, ranges = angles_rad[seen], ranges_m[seen]
    return np.stack((ranges * np.cos(angles), ranges * np.sin(angles)), axis=1)


def _best_line(points: Floats, random: np.random.Generator) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return a mask (n,) of the points on the line through a random pair that has the most."""
    one, other = random.integers(len(points), size=(2, PAIRS))
    some = points[:: len(points) // MOST_POINTS + 1]
    along = points[other] - points[one]
    lengths = np.hypot(along[:, 0], along[:, 1])
    along = along / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    normals = np.stack((-along[:, 1], along[:, 0]), axis=1)
    offsets = np.sum(normals * points[one], axis=1)
    on_line = np.abs(normals @ some.T - offsets[:, None]) < ON_LINE_M
    best = int(np.argmax(np.count_nonzero(on_line, axis=1) * (lengths > ON_LINE_M)))
    return np.abs(points @ normals[best] - offsets[best]) < ON_LINE_M


def _fit(points: Floats) -> Wall | None:
    """Fit a line to points (n, 2) by total least squares, without outliers and without what lies beyond a gap."""
    kept = points
    centre, normal, sigma_m = kept.mean(axis=0), np.zeros(2), 0.0
    for _ in range(FITS):
        if len(kept) < LEAST_RETURNS:
            return None
        centre = kept.mean(axis=0)
        scatter = np.linalg.eigh(np.cov((kept - centre).T))
        normal = scatter.eigenvectors[:, 0]
        off_m = (points - centre) @ normal
        mine_m = (kept - centre) @ normal
        sigma_m = max(LEAST_SIGMA_M, 1.4826 * float(np.median(np.abs(mine_m - np.median(mine_m)))))
        kept = _longest_part(points[np.abs(off_m) <= 3.5 * sigma_m], normal)
    if len(kept) < LEAST_RETURNS:
        return None
    centre = kept.mean(axis=0)
    distance_m = float(centre @ normal)
    if distance_m < 0.0:
        distance_m, normal = -distance_m, -normal
    length_m = float(np.ptp(_along(kept, normal)))
    if length_m < LEAST_LENGTH_M:
        return None
    return Wall(distance_m, math.atan2(normal[1], normal[0]), length_m)


def _along(points: Floats, normal: Floats) -> Floats:
    """Return how far along a line points (m, 2) lie."""
    return points @ np.array([-normal[1], normal[0]])


def _longest_part(points: Floats, normal: Floats) -> Floats:
    """Return the points (m, 2) of the longest part of a line without a wide gap."""
    if len(points) == 0:
        return points
    along_m = _along(points, normal)
    order = np.argsort(along_m)
    ends = np.flatnonzero(np.diff(along_m[order]) > WIDEST_GAP_M) + 1
    parts = np.split(order, ends)
    return points[max(parts, key=lambda part: float(np.ptp(along_m[part])) if len(part) else 0.0)]
