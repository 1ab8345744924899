"""What one lidar's scans prove: where something is, and how far each ray is free.

A beam proves its ray free up to its return, and shows an object there. A beam without a return proves its ray
free up to `range_max` and nothing beyond; that is weak evidence, which dirt gives as well, so a profile may
count it only for beams that have lately shown that they can see. A reading that the profile does not explain
proves nothing: for one timeout the scans before it speak for its direction, then it is a hole.

A scan whose numbers contradict each other, that repeats itself while the robot moves, that goes blank from
one to the next, or that came before anything ever returned, proves nothing at all.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.clearance import Floats, Hull, Mask, Surroundings, nothing_around, survey
from supervisor.lidar import LidarProfile, explain
from supervisor.reckoning import Pose, between
from wire.freshness import Sent

FROZEN_REPEATS = 3
FROZEN_TRAVEL_M = 0.02
"""So many identical scans in a row while the hull has moved so far: the sensor repeats itself."""

REPEATED_TRAVEL_M = 0.005
"""A scan that is the one before to the bit, although the hull has moved so far, shows nothing new."""

BLANK_AFTER_SHARE = 0.1
BLANK_DROP = 0.1
"""A scan with less than a tenth of the returns, right after one with returns on a tenth of its beams, is no
scan. It stays so until returns come back: a lidar that has lost its light looks just the same."""

LEAST_INCREMENT_RAD = 1e-6
"""Of no lidar are neighbouring beams closer; a thousandth of what real ones have."""

LEAST_M = 1e-6
"""What is at the lidar itself is this far away: zero stands for a ray of which nothing is known."""

ANGLE_SLACK_BEAMS = 2.0
"""Drivers count the last beam, the one after it, or round."""

Ranges = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a lidar sits on the robot, and what it sees of the robot itself."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    masked_rad: tuple[tuple[float, float], ...] = ()
    """Sectors (from, to) in the lidar's frame, counter-clockwise, that show the robot: nothing is seen there."""


@dataclass(frozen=True, slots=True)
class Lidar:
    """One lidar of the configuration."""

    name: str
    mount: Mount
    profile: LidarProfile
    timeout_s: float
    """An older scan proves nothing."""
    min_beams: int = 90


class Geometry(NamedTuple):
    """Where the beams of a scan point, in the lidar's frame [rad]."""

    beams: int
    angle_min: float
    increment: float
    """From beam to beam [rad]; negative for a clockwise scan."""


@dataclass(frozen=True)
class Rays:
    """The beams of a geometry on the robot; what depends on these alone."""

    origin_m: Floats
    """(2, 1): of the lidar in the base frame."""
    direction: Floats
    """(2, n): unit vectors in the base frame."""
    looking: Mask
    """Not masked."""
    hull_m: Floats
    """How far each beam runs inside the hull [m]; zero where the lidar is outside of it."""

    def points(self, beams: npt.NDArray[np.intp], distance_m: Floats) -> Floats:
        """Where some of the beams (m,) end, in the base frame: (m, 2), for the distances (n,) of all."""
        ends: Floats = (self.direction.take(beams, axis=1) * distance_m.take(beams) + self.origin_m).T
        return ends


class View(NamedTuple):
    """What the last valid scan of a lidar proves, beam by beam."""

    geometry: Geometry
    taken_s: float
    pose: Pose
    """The odometer's when the scan was taken."""
    free_m: Floats
    """(n,): so far each ray is free; 0: it is not known to be."""
    hit: Mask
    """Something returned."""
    is_whole: bool
    """All of them are free for some way."""
    range_max_m: float
    explained_s: Floats
    """(n,): when a reading last explained this direction, seen from `facing_rad`."""
    facing_rad: float
    """The odometer's yaw that the directions of `explained_s` belong to."""
    returned_s: Floats
    """(n,): when this beam last had a return."""
    returned_m: Floats
    """(n,): how far the robot had travelled then."""


class ScanReading(NamedTuple):
    """The newest scan of a lidar, as the law uses it."""

    taken_s: float
    """When, by our clock: its arrival less its time on the way."""
    period_s: float
    """Between it and the one before; the scan timeout for the first one."""
    problem: str | None
    """Why it proves nothing; None for a valid scan."""
    view: View | None
    """None before the first valid scan."""
    around: Surroundings
    """Its returns within reach, in the base frame of its time."""
    nearest_m: float
    """From the hull to the nearest return; infinite where there is none, NaN where the scan proves nothing."""
    nearest_bearing_rad: float
    ranges: Ranges
    repeats: int
    """How many scans right before it were the same to the bit."""
    travelled_m: float
    """The hull's way at the first of those."""
    return_share: float
    """Of the beams; of the last scan that was not blank, if this one is."""
    has_returned: bool
    """Something has returned to this lidar, now or at any time before."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When and where a scan was taken."""

    taken_s: float
    period_s: float
    pose: Pose
    """The odometer's."""
    travelled_m: float
    """How far any point of the hull has moved since the start, measured or commanded, whichever is more."""


@dataclass(frozen=True, slots=True)
class LaserScan:
    """A scan that arrived: sensor_msgs/LaserScan's fields, in its own frame."""

    ranges: Ranges
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    arrival_s: float
    sent: Sent | None = None
    """From its attachment, else from its header; None where neither says when it was taken."""
    sent_tolerance_s: float | None = None
    """How unsteady the sender's clock may be; None: as steady as a command's."""
    angle_max: float | None = None
    """What the sender takes for the last beam's angle; None: it does not say."""
    lidar: int = 0
    """Its place among the configured lidars."""
    writer: bytes = b""
    """Who sent it: the gid of its attachment, else its frame."""


def read_scan(
    previous: ScanReading | None,
    scan: LaserScan,
    moment: Moment,
    lidar: Lidar,
    hull: Hull,
    reach_m: float,
    *,
    in_the_open: bool,
) -> ScanReading:
    """What a scan proves, in the light of the one before.

    Args:
        previous: the last reading of the same lidar.
        scan: as it came.
        moment: when and where it was taken.
        lidar: its configuration.
        hull: the robot's outline.
        reach_m: no return farther than this from the hull can limit a motion.
        in_the_open: whether a lidar on which nothing has ever returned is believed.
    """
    problem = _contradiction(scan, lidar.min_beams)
    before = None if previous is None else previous.view
    if problem is not None:
        return _of_no_use(previous, scan, moment, problem, hull)
    geometry = Geometry(len(scan.ranges), scan.angle_min, scan.angle_increment)
    rays = rays_of(geometry, lidar.mount, hull)
    readings = explain(scan.ranges, scan.range_min, scan.range_max, lidar.profile)
    # Nothing can be inside the hull: what reads so is at its outline, in the direction of its beam.
    distance_m = np.maximum(readings.distance_m, np.maximum(rays.hull_m, LEAST_M))
    hit = readings.hit & rays.looking
    (hits,) = hit.nonzero()
    share = len(hits) / geometry.beams
    view = _view(before, geometry, hit, readings.explained & rays.looking, distance_m, scan, moment, lidar)
    if not view.is_whole and not view.free_m.any():
        problem = "no reading that the profile explains"
    has_returned = len(hits) > 0 or (previous is not None and previous.has_returned)
    if problem is None and not (has_returned or in_the_open):
        problem = "no return since the start; set works_in_the_open = true if that is normal here"
    repeats, since_m = 0, moment.travelled_m
    if previous is not None and problem is None:
        if previous.ranges.tobytes() == scan.ranges.tobytes():
            repeats, since_m = previous.repeats + 1, previous.travelled_m
        travel_m = moment.travelled_m - since_m
        if share > 0.0 and repeats >= FROZEN_REPEATS and travel_m > FROZEN_TRAVEL_M:
            problem = f"the same scan {repeats + 1} times while the robot moves"
        elif share > 0.0 and travel_m > REPEATED_TRAVEL_M and previous.problem is None:
            return previous._replace(repeats=repeats)
        elif previous.return_share >= BLANK_AFTER_SHARE and share < BLANK_DROP * previous.return_share:
            problem, share = "nearly all returns disappeared from one scan to the next", previous.return_share
    far_m = hull.radius_m + reach_m + math.hypot(lidar.mount.x_m, lidar.mount.y_m)
    around, nearest_m, bearing_rad = _within(far_m, hull, rays, distance_m, hits)
    if problem is not None:
        nearest_m = math.nan
    return ScanReading(
        moment.taken_s,
        moment.period_s,
        problem,
        view,
        around,
        nearest_m,
        bearing_rad,
        scan.ranges,
        repeats,
        since_m,
        share,
        has_returned,
    )


def _of_no_use(
    previous: ScanReading | None, scan: LaserScan, moment: Moment, problem: str, hull: Hull
) -> ScanReading:
    """A scan that is none: what the one before proved of each beam stays."""
    view, share = (None, 0.0) if previous is None else (previous.view, previous.return_share)
    return ScanReading(
        moment.taken_s,
        moment.period_s,
        problem,
        view,
        nothing_around(hull),
        math.nan,
        math.nan,
        scan.ranges,
        0,
        moment.travelled_m,
        share,
        previous is not None and previous.has_returned,
    )


def _within(
    far_m: float, hull: Hull, rays: Rays, distance_m: Floats, hits: npt.NDArray[np.intp]
) -> tuple[Surroundings, float, float]:
    """What returns from nearer than `far_m`, and clearance and bearing of the nearest return of all."""
    far = distance_m.take(hits)
    near = hits[far < far_m]
    around = survey(hull, rays.points(near, distance_m))
    if len(near):
        return around, *around.nearest()
    if len(hits):
        return around, *survey(hull, rays.points(hits, distance_m)).nearest()
    return around, math.inf, math.nan


def _view(
    before: View | None,
    geometry: Geometry,
    hit: Mask,
    explained: Mask,
    distance_m: Floats,
    scan: LaserScan,
    moment: Moment,
    lidar: Lidar,
) -> View:
    """How far each ray is free, and since when its beam is known to see."""
    profile, taken_s = lidar.profile, moment.taken_s
    if before is not None and before.geometry != geometry:
        before = _resampled(before, geometry)
    if hit.all():
        times = np.full(geometry.beams, taken_s)
        ways = np.full(geometry.beams, moment.travelled_m)
        return View(
            geometry=geometry,
            taken_s=taken_s,
            pose=moment.pose,
            free_m=distance_m,
            hit=hit,
            is_whole=True,
            range_max_m=scan.range_max,
            explained_s=times,
            facing_rad=moment.pose.yaw_rad,
            returned_s=times,
            returned_m=ways,
        )
    if before is not None:
        returned_s = np.where(hit, taken_s, before.returned_s)
        returned_m = np.where(hit, moment.travelled_m, before.returned_m)
    elif profile.trusts_silence_at_start:
        returned_s = np.full(geometry.beams, taken_s)
        returned_m = np.full(geometry.beams, moment.travelled_m)
    else:
        returned_s = np.where(hit, taken_s, -math.inf)
        returned_m = np.where(hit, moment.travelled_m, -math.inf)
    if profile.silence_limit_s < math.inf:
        able = (returned_s >= taken_s - profile.silence_limit_s) | (
            returned_m >= moment.travelled_m - profile.silence_limit_m
        )
        explained &= able
    free_m = np.where(hit, distance_m, scan.range_max)
    facing_rad, explained_s = moment.pose.yaw_rad, np.full(geometry.beams, taken_s)
    if not explained.all():
        free_m[~explained] = 0.0
        explained_s[~explained] = -math.inf
        if before is not None:
            facing_rad, known_s, known_m = _turned(before, moment.pose)
            explained_s = np.maximum(explained_s, known_s)
            lately = ~explained & (known_s >= taken_s - lidar.timeout_s)
            free_m[lately] = known_m[lately]
    return View(
        geometry,
        taken_s,
        moment.pose,
        free_m,
        hit,
        bool(free_m.all()),
        scan.range_max,
        explained_s,
        facing_rad,
        returned_s,
        returned_m,
    )


def _resampled(before: View, geometry: Geometry) -> View:
    """A view as another geometry has it, beam by beam: some motors turn unevenly, and no two scans are alike."""
    angle_rad = geometry.angle_min + geometry.increment * np.arange(geometry.beams)
    beam = np.rint((angle_rad - before.geometry.angle_min) / before.geometry.increment).astype(np.int64)
    return _at_beams(before, beam)._replace(geometry=geometry)


def _turned(before: View, pose: Pose) -> tuple[float, Floats, Floats]:
    """What was known of each direction, beam by beam as the lidar faces now; and the yaw that this belongs to."""
    count, _, increment = before.geometry
    shift = round((pose.yaw_rad - before.facing_rad) / increment)
    way = between(before.pose, pose)
    known = before if shift == 0 else _at_beams(before, np.arange(count) + shift)
    known_m = np.maximum(known.free_m - math.hypot(way.x_m, way.y_m), 0.0)
    return before.facing_rad + shift * increment, known.explained_s, known_m


def _at_beams(view: View, beam: npt.NDArray[np.int64]) -> View:
    """What a view proves, at these of its beams (n,), counted on around a full turn; beyond its ends, nothing."""
    if is_full_turn(view.geometry):
        beam = beam % view.geometry.beams
    inside = (beam >= 0) & (beam < view.geometry.beams)
    beam = np.clip(beam, 0, view.geometry.beams - 1)
    return view._replace(
        free_m=np.where(inside, view.free_m[beam], 0.0),
        hit=inside & view.hit[beam],
        explained_s=np.where(inside, view.explained_s[beam], -math.inf),
        returned_s=np.where(inside, view.returned_s[beam], -math.inf),
        returned_m=np.where(inside, view.returned_m[beam], -math.inf),
    )


def is_full_turn(geometry: Geometry) -> bool:
    """Whether the last beam is as near to the first one as to the one before it."""
    return abs(geometry.increment) * (geometry.beams + 0.5) >= 2 * math.pi


def _contradiction(scan: LaserScan, min_beams: int) -> str | None:
    """Why numbers that do not fit together describe no scan."""
    beams, increment = len(scan.ranges), scan.angle_increment
    if beams < min_beams:
        return f"{beams} beams, fewer than {min_beams}"
    if not all(map(math.isfinite, (scan.angle_min, increment, scan.range_min, scan.range_max))):
        return "geometry that is not finite"
    if abs(increment) < LEAST_INCREMENT_RAD or abs(increment) * (beams - 1) > 2 * math.pi + 1e-3:
        return f"{beams} beams of {increment:g} rad span more than a full turn, or no angle"
    last = scan.angle_min + increment * (beams - 1)
    if scan.angle_max is not None and not abs(scan.angle_max - last) <= ANGLE_SLACK_BEAMS * abs(increment):
        return f"{beams} beams of {increment:g} rad end at {last:g} rad, not at {scan.angle_max:g}"
    if not 0.0 <= scan.range_min < scan.range_max:
        return f"range_min {scan.range_min:g} m and range_max {scan.range_max:g} m contradict each other"
    return None


@lru_cache(maxsize=16)
def rays_of(geometry: Geometry, mount: Mount, hull: Hull) -> Rays:
    """The beams of a geometry on the robot."""
    angle: Floats = geometry.angle_min + geometry.increment * np.arange(geometry.beams, dtype=np.float64)
    looking = np.ones(geometry.beams, dtype=np.bool_)
    for start, end in mount.masked_rad:
        looking &= (angle - start) % (2 * math.pi) > (end - start) % (2 * math.pi)
    direction = unit_vectors(mount.yaw_rad + angle)
    origin_m = np.array([[mount.x_m], [mount.y_m]])
    is_inside = hull.clearance(origin_m.T).item() < 0.0
    inside_m = hull.crossing(mount.x_m, mount.y_m, direction).leaves_m
    return Rays(origin_m, direction, looking, inside_m if is_inside else np.zeros(geometry.beams))


def unit_vectors(angle_rad: Floats) -> Floats:
    """The unit vectors (2, n) of directions (n,)."""
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])
