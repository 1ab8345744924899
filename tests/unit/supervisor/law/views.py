"""Views of a lidar, built from distances per beam, without a scan."""

import math

import numpy as np

from supervisor.law.clearance import Floats
from supervisor.law.reckoning import Pose
from supervisor.law.scan import Geometry, View

BEAMS = 360
BEAM_RAD = 2 * math.pi / BEAMS
GEOMETRY = Geometry(BEAMS, -math.pi, BEAM_RAD)


def view_of(readings: np.ndarray, geometry: Geometry = GEOMETRY, range_max_m: float = 12.0) -> View:
    """A view: a distance for each beam, infinite without a return, NaN where nothing is explained."""
    hit, unknown = np.isfinite(readings), np.isnan(readings)
    times = np.zeros(len(readings))
    return View(
        geometry=geometry,
        taken_s=0.0,
        pose=Pose(0.0, 0.0, 0.0),
        free_m=np.where(hit, readings, np.where(unknown, 0.0, range_max_m)),
        hit=hit,
        is_whole=not unknown.any(),
        range_max_m=range_max_m,
        explained_s=np.where(unknown, -math.inf, 0.0),
        facing_rad=0.0,
        returned_s=times,
        returned_m=times,
    )


def gap_to_rays_m(points: Floats, origin_m: Floats, direction: Floats, free_m: Floats) -> Floats:
    """(n,): from points (n, 2) to the nearest of the rays, each as far as it is free."""
    known = free_m > 0.0
    away = points - origin_m
    along = np.clip(away @ direction[:, known], 0.0, free_m[known])
    gaps: Floats = np.hypot(
        away[:, :1] - along * direction[0, known], away[:, 1:] - along * direction[1, known]
    )
    return gaps.min(axis=1)
