"""Interpretation of one lidar's scans: where returns are, and how far each ray is proven free.

A beam with a return proves its ray free up to the return and shows an object there. A beam without a return proves
its ray free up to `range_max`. This is weak evidence, because a dirty beam has no return either. A profile may
therefore accept it only for beams that had a return recently. A reading that the profile does not explain proves
nothing: earlier scans stand in for its direction for one timeout; after that, the direction is a hole. So does silence where
returns vanished that cannot have moved away (silence.py), and so does a sector that repeats (agreement.py).

A scan proves nothing if its numbers contradict each other, if it repeats while the robot moves, if nearly all
returns vanish from one scan to the next, or if the lidar has not had any return since the start. Where the configuration says
that the robot works in the open, silence counts as free without a return before, at a lower speed.
"""

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Floats, Hull, Mask, Surroundings, nothing_around, survey
from supervisor.law.lidar import LidarProfile, explain
from supervisor.law.reckoning import Pose, between
from supervisor.law.silence import FAR_SHARE, LONGEST_S, MOVER_M_S, vanished
from supervisor.law.surface import NOTHING, Surfaces, surfaces
from wire.freshness import Sent

FROZEN_REPEATS = 3
FROZEN_TRAVEL_M = 0.02
"""A lidar is frozen if this many scans repeat an earlier one bit for bit while the hull moves by more than this."""

REPEATED_TRAVEL_M = 0.005
"""A scan that is identical to the previous one although the hull has moved by more than this is not new information."""

BLANK_AFTER_SHARE = 0.1
BLANK_DROP = 0.1
"""A scan is blank if it has less than a tenth of the returns of the previous scan, and that scan had returns on at least a
tenth of its beams. A blank scan counts as missing at first, so that a single one stops nothing; then they are invalid until the
returns come back: a lidar with a failed laser looks the same."""

OPEN_SHARE = 0.1
"""In the open, a smaller share of the beams than this has a return."""

BLANK_SHARE = 0.5
"""Share of the timeout for which blank scans count as missing; below 1, so that the reason is not that there is no scan."""

LEAST_INCREMENT_RAD = 1e-6
"""Smallest accepted angle between neighbouring beams: a thousandth of that of real lidars."""

NOWHERE = complex(math.nan, math.nan)

LEAST_M = 1e-6
"""Smallest distance of a return: a distance of zero denotes a ray that is not proven free."""

ANGLE_SLACK_BEAMS = 2.0
"""Accepted error of `angle_max`, in beams: drivers report the angle of the last beam, of the beam after it, or round."""

JOIN = "if the driver sends a turn in segments, join them"

Ranges = npt.NDArray[np.float32]
Complex = npt.NDArray[np.complex128]
"""Points of a plane, x + iy."""


@dataclass(frozen=True, slots=True)
class Mount:
    """The pose of a lidar in the base frame, and the sectors in which it sees the robot itself."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    masked_rad: tuple[tuple[float, float], ...] = ()
    """Sectors (from, to) in the lidar's frame, counter-clockwise, that show the robot; readings there are ignored."""
    flip: bool = False
    """Whether the lidar is mounted upside down: the angles of its frame then run clockwise, as seen from above."""


@dataclass(frozen=True, slots=True)
class Lidar:
    """Configuration of one lidar."""

    name: str
    mount: Mount
    profile: LidarProfile
    timeout_s: float
    """Maximum age of a usable scan."""
    min_beams: int = 90
    latency_s: float = 0.0
    """Constant time from the measurement to the message, which no stamp shows; part of the age of a scan."""


class Geometry(NamedTuple):
    """The angles of a scan's beams in the lidar's frame [rad], as seen from above: counter-clockwise from its x axis."""

    beams: int
    angle_min: float
    increment: float
    """Angle between neighbouring beams [rad]; negative for a clockwise scan."""

    @classmethod
    def of(cls, scan: "LaserScan", mount: Mount) -> "Geometry":
        """Return the angles of a scan as seen from above."""
        sign = -1.0 if mount.flip else 1.0
        return cls(len(scan.ranges), sign * scan.angle_min, sign * scan.angle_increment)


@dataclass(frozen=True)
class Rays:
    """The n beams of a scan geometry in the base frame; depends only on geometry, mount and hull."""

    origin_m: Floats
    """(2, 1): position of the lidar in the base frame."""
    direction: Floats
    """(2, n): unit vectors in the base frame."""
    looking: Mask
    """(n,): whether the beam lies outside the masked sectors."""
    hull_m: Floats
    """(n,): length of each beam inside the hull [m]; zero if the lidar is outside the hull."""

    def points(self, beams: npt.NDArray[np.intp], distance_m: Floats) -> Floats:
        """Return the end points (m, 2) [m] of the selected beams in the base frame.

        Args:
            beams: (m,) indices of the beams.
            distance_m: (n,) distances along all beams.
        """
        ends: Floats = (self.direction.take(beams, axis=1) * distance_m.take(beams) + self.origin_m).T
        return ends


class View(NamedTuple):
    """Free space, and evidence for it, by beam, from the last valid scan of a lidar and earlier ones."""

    geometry: Geometry
    taken_s: float
    pose: Pose
    """The odometer pose at which the scan was taken."""
    free_m: Floats
    """(n,): distance up to which each ray is proven free; 0 if it is not."""
    hit: Mask
    """(n,): whether the beam has a return."""
    is_whole: bool
    """Whether every ray is proven free for some distance."""
    range_max_m: float
    explained_s: Floats
    """(n,): time of the last explained reading in this direction; directions are relative to `facing_rad`."""
    facing_rad: float
    """The odometer yaw that the directions of `explained_s` are relative to."""
    returned_s: Floats
    """(n,): time of this beam's last return."""
    returned_m: Floats
    """(n,): distance that the robot had travelled at that time."""
    lost_m: Complex | None = None
    """(n,): for a lost beam (silence.py), the place of the return that it lost, x + iy [m] in the odometer's frame; NaN for the
    others. None if no beam is lost."""


class ScanReading(NamedTuple):
    """The newest scan of a lidar, as the law uses it."""

    taken_s: float
    """When the scan was taken, by the local clock: arrival time minus transport time."""
    period_s: float
    """Time since the previous scan; the scan timeout for the first scan."""
    problem: str | None
    """Why the scan proves nothing; None for a valid scan."""
    view: View | None
    """None before the first valid scan."""
    around: Surroundings
    """The returns within reach, in the base frame at `taken_s`, at the distances that count; see surface.py."""
    nearest_m: float
    """Distance from the hull to the nearest return; infinite without returns, NaN if the scan proves nothing."""
    nearest_bearing_rad: float
    ranges: Ranges
    repeats: int
    """How many consecutive scans before this one were identical to it, bit for bit."""
    travelled_m: float
    """Distance that the hull had provenly travelled at the first of these scans."""
    return_share: float
    """Share of the beams with a return; if this scan is blank, that of the last scan that was not."""
    has_returned: bool
    """Whether this lidar has had any return since the start."""
    surfaces: Surfaces = Surfaces()
    """Noise and means of the readings; see surface.py."""
    is_assumed: bool = False
    """Whether silence counts as free only because the robot works in the open: its beams have not had a return lately."""
    missing_beams: int = 0
    """How many beams fewer than the previous scan it has."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When and where a scan was taken."""

    taken_s: float
    period_s: float
    pose: Pose
    """The odometer pose."""
    travelled_m: float
    """Upper bound of the distance that any point of the hull has moved since the start, measured or commanded."""
    proven_m: float
    """The same distance without what was commanded so recently that the base need not have followed."""
    stopped: bool = False
    """Whether zero is commanded."""


@dataclass(frozen=True, slots=True)
class LaserScan:
    """A received scan: the fields of sensor_msgs/LaserScan, in the lidar's frame."""

    ranges: Ranges
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    arrival_s: float
    sent: Sent | None = None
    """The stamp of its attachment, else of its header; None if neither has one."""
    sent_tolerance_s: float | None = None
    """Tolerance for an unsteady clock of the sender; None: the same as for commands."""
    angle_max: float | None = None
    """The angle of the last beam as the sender reports it; None if not reported."""
    lidar: int = 0
    """Index of the lidar in the configuration."""
    writer: bytes = b""
    """Identity of the sender: the gid of the attachment, else the frame id."""


def read_scan(
    previous: ScanReading | None,
    scan: LaserScan,
    moment: Moment,
    lidar: Lidar,
    hull: Hull,
    reach_m: float,
    smallest_m: float,
    *,
    in_the_open: bool,
    repeated: Mask | None = None,
) -> ScanReading:
    """Check a scan and return it as a `ScanReading`, with the free space that it proves.

    Args:
        previous: the last reading of the same lidar; None before the first.
        scan: the scan as received.
        moment: when and where it was taken.
        lidar: the configuration of its lidar.
        hull: the robot's outline.
        reach_m: a return farther than this from the hull limits no motion.
        smallest_m: diameter of the smallest obstacle.
        in_the_open: whether the robot works in the open: silence counts as free without a return before, while less than
            `OPEN_SHARE` of the beams have one.
        repeated: (n,) beams that repeat an earlier scan (agreement.py): their returns count, but prove nothing free.
    """
    before = None if previous is None else previous.view
    geometry = Geometry.of(scan, lidar.mount)
    problem = _contradiction(scan, lidar.min_beams) or _looks_elsewhere(before, geometry)
    if problem is not None:
        return _invalid_reading(previous, scan, moment, problem, hull)
    rays = rays_of(geometry, lidar.mount, hull)
    readings = explain(scan.ranges, scan.range_min, scan.range_max, lidar.profile)
    # No object can be inside the hull: a return inside it is moved outward along its beam to the outline.
    outline_m = np.maximum(rays.hull_m, LEAST_M)
    distance_m = np.maximum(readings.distance_m, outline_m)
    hit = readings.hit & rays.looking
    (hits,) = hit.nonzero()
    share = len(hits) / geometry.beams
    is_open = in_the_open and share < OPEN_SHARE
    explained, shown = readings.explained & rays.looking, hit
    if repeated is not None:
        explained, shown = explained & ~repeated, hit & ~repeated
    view = _view(before, geometry, shown, explained, distance_m, scan, moment, lidar, is_open=is_open)
    has_returned = len(hits) > 0 or (previous is not None and previous.has_returned)
    repeats, since_m = _repetition(previous, scan, moment)
    travel_m = moment.proven_m - since_m
    if previous is not None and _is_blank(share, previous):
        if previous.problem is None and moment.taken_s - previous.taken_s <= BLANK_SHARE * lidar.timeout_s:
            return previous
        problem, share = "nearly all returns disappeared from one scan to the next", previous.return_share
    elif share > 0.0 and repeats >= FROZEN_REPEATS and travel_m > FROZEN_TRAVEL_M:
        problem = (
            f"the same scan {repeats + 1} times while the robot moves: frozen, or simulated without noise"
        )
    elif share > 0.0 and previous is not None and previous.problem is None and travel_m > REPEATED_TRAVEL_M:
        return previous._replace(repeats=repeats)
    elif not view.is_whole and not view.free_m.any():
        problem = "no reading that the profile explains"
    elif not (has_returned or in_the_open):
        problem = "no return since the start; set works_in_the_open = true if that is normal here"
    far_m = hull.radius_m + reach_m + math.hypot(lidar.mount.x_m, lidar.mount.y_m)
    known, counts_m = surfaces(
        _known_surfaces(previous, geometry, moment),
        distance_m,
        hit,
        geometry.increment,
        moment.pose,
        far_m,
        smallest_m,
        is_round=is_full_turn(geometry),
    )
    around, nearest_m, bearing_rad = _within(far_m, hull, rays, np.maximum(counts_m, outline_m), hits)
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
        known,
        is_open and not (has_returned and _is_heard(view, rays, moment, lidar.profile)),
        0 if before is None else max(0, before.geometry.beams - geometry.beams),
    )


def _known_surfaces(previous: ScanReading | None, geometry: Geometry, moment: Moment) -> Surfaces:
    """Return the noise and the means of earlier scans; without means while the base is commanded to move, or if the beams look elsewhere."""
    if previous is None:
        return Surfaces()
    if previous.view is None or not _is_same(previous.view.geometry, geometry) or not moment.stopped:
        return previous.surfaces._replace(mean_m=NOTHING)
    return previous.surfaces


def _is_same(one: Geometry, other: Geometry) -> bool:
    """Return whether the beams of two scans have the same directions, within half a beam: some drivers round differently each time."""
    apart_rad = abs(one.angle_min - other.angle_min) + one.beams * abs(one.increment - other.increment)
    return one.beams == other.beams and apart_rad < 0.5 * abs(one.increment)


def _repetition(previous: ScanReading | None, scan: LaserScan, moment: Moment) -> tuple[int, float]:
    """Return how often the scan repeats the previous one, and the distance travelled at the first of these scans."""
    if previous is None or previous.ranges.tobytes() != scan.ranges.tobytes():
        return 0, moment.proven_m
    return previous.repeats + 1, previous.travelled_m


def _is_blank(share: float, previous: ScanReading) -> bool:
    """Return whether nearly all returns of the previous scan have disappeared."""
    return previous.return_share >= BLANK_AFTER_SHARE and share < BLANK_DROP * previous.return_share


def _invalid_reading(
    previous: ScanReading | None, scan: LaserScan, moment: Moment, problem: str, hull: Hull
) -> ScanReading:
    """Return the reading of an invalid scan; it keeps the previous view."""
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
        moment.proven_m,
        share,
        previous is not None and previous.has_returned,
        Surfaces() if previous is None else previous.surfaces,
    )


def _within(
    far_m: float, hull: Hull, rays: Rays, distance_m: Floats, hits: npt.NDArray[np.intp]
) -> tuple[Surroundings, float, float]:
    """Return the returns nearer than `far_m` to the lidar, and clearance [m] and bearing [rad] of the nearest return.

    If no return is nearer than `far_m`, the nearest of all returns counts.
    """
    far = distance_m.take(hits)
    near = hits[far < far_m]
    if len(near):
        around = survey(hull, rays.points(near, distance_m))
        return around, *around.nearest()
    if len(hits):
        return nothing_around(hull), *survey(hull, rays.points(hits, distance_m)).nearest()
    return nothing_around(hull), math.inf, math.nan


def _view(
    before: View | None,
    geometry: Geometry,
    hit: Mask,
    explained: Mask,
    distance_m: Floats,
    scan: LaserScan,
    moment: Moment,
    lidar: Lidar,
    *,
    is_open: bool,
) -> View:
    """Return the view: how far each ray is proven free, and when each beam last had a return."""
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
    if profile.silence_limit_s < math.inf and not is_open:
        explained &= _heard(returned_s, returned_m, moment, profile)
    lost_m = None
    if before is not None:
        lost_m = _lost(before, hit, explained & ~hit, returned_s, moment, lidar.mount, scan.range_max)
    if lost_m is not None:
        explained &= np.isnan(lost_m)
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
        lost_m,
    )


def _heard(returned_s: Floats, returned_m: Floats, moment: Moment, profile: LidarProfile) -> Mask:
    """Return whether each beam had a return lately, so that its silence proves its ray free."""
    return (returned_s >= moment.taken_s - profile.silence_limit_s) | (
        returned_m >= moment.travelled_m - profile.silence_limit_m
    )


def _is_heard(view: View, rays: Rays, moment: Moment, profile: LidarProfile) -> bool:
    """Return whether every beam outside the masked sectors had a return lately."""
    return bool((_heard(view.returned_s, view.returned_m, moment, profile) | ~rays.looking).all())


def _lost(
    before: View,
    hit: Mask,
    silent: Mask,
    returned_s: Floats,
    moment: Moment,
    mount: Mount,
    range_max_m: float,
) -> Complex | None:
    """Return `View.lost_m` of a scan with these returns, silent beams, and times of the last returns; see silence.py."""
    count, angle_min, increment = before.geometry
    pose, is_round = moment.pose, is_full_turn(before.geometry)
    way, index = between(before.pose, pose), np.arange(count)
    moved_m = math.hypot(way.x_m, way.y_m) + abs(way.yaw_rad) * math.hypot(mount.x_m, mount.y_m)
    # After a gap in the scans, nothing shows that an object moved during the whole gap.
    strip_m = MOVER_M_S * min(moment.taken_s - before.taken_s, LONGEST_S) + moved_m
    shift = round(way.yaw_rad / increment)
    known = before if shift == 0 else _at_beams(before, index + shift)
    remained = known.hit & (known.free_m + strip_m < FAR_SHARE * range_max_m)
    newly = vanished(silent, remained, known.free_m, abs(increment), strip_m, is_round=is_round)
    if before.lost_m is None and not newly.any():
        return None
    lost_m = np.full(count, NOWHERE) if before.lost_m is None else before.lost_m
    facing_rad = pose.yaw_rad + mount.yaw_rad + angle_min
    ahead = np.exp(1j * (facing_rad + increment * index))
    lost_m = np.where(newly & np.isnan(lost_m), _lidar_at(before.pose, mount) + known.free_m * ahead, lost_m)
    lost_m[hit] = NOWHERE
    (beams,) = (~np.isnan(lost_m)).nonzero()
    to_m = lost_m[beams] - _lidar_at(pose, mount)
    turn_rad = math.copysign(2 * math.pi, increment)
    there = np.rint((np.angle(to_m) - facing_rad) % turn_rad / increment).astype(np.int64)
    there = there % count if is_round else there
    inside = there < count
    there = np.minimum(there, count - 1)
    # A beam that has not returned anything since the loss may be as blind as the lost one.
    sees = silent[there] & np.isnan(lost_m[there]) & (returned_s[there] > returned_s[beams])
    lost_m[beams[inside & sees & (np.abs(to_m) < FAR_SHARE * range_max_m)]] = NOWHERE
    return None if np.isnan(lost_m).all() else lost_m


def _lidar_at(pose: Pose, mount: Mount) -> complex:
    """Return where the lidar is, x + iy [m], if the base has a pose."""
    return complex(pose.x_m, pose.y_m) + complex(mount.x_m, mount.y_m) * cmath.rect(1.0, pose.yaw_rad)


def _resampled(before: View, geometry: Geometry) -> View:
    """Resample a view to another scan geometry: lidars with uneven rotation send a new geometry with every scan."""
    angle_rad = geometry.angle_min + geometry.increment * np.arange(geometry.beams)
    beam = np.rint((angle_rad - before.geometry.angle_min) / before.geometry.increment).astype(np.int64)
    return _at_beams(before, beam)._replace(geometry=geometry)


def _turned(before: View, pose: Pose) -> tuple[float, Floats, Floats]:
    """Return the earlier knowledge of each direction, aligned with the beams at the present pose.

    Returns:
        the odometer yaw [rad] that the directions are relative to; the times (n,) of the last explained readings; the
        distances (n,) [m] up to which the rays are still proven free.
    """
    count, _, increment = before.geometry
    shift = round((pose.yaw_rad - before.facing_rad) / increment)
    way = between(before.pose, pose)
    known = before if shift == 0 else _at_beams(before, np.arange(count) + shift)
    known_m = np.maximum(known.free_m - math.hypot(way.x_m, way.y_m), 0.0)
    return before.facing_rad + shift * increment, known.explained_s, known_m


def _at_beams(view: View, beam: npt.NDArray[np.int64]) -> View:
    """Return the view at the given beam indices (n,).

    Indices wrap around in a full turn; otherwise an index outside the view gives a beam that proves nothing.
    """
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
        lost_m=None if view.lost_m is None else np.where(inside, view.lost_m[beam], NOWHERE),
    )


def is_full_turn(geometry: Geometry) -> bool:
    """Return whether the beams cover a full turn, so that the last beam is the first beam's neighbour."""
    return abs(geometry.increment) * (geometry.beams + 0.5) >= 2 * math.pi


def _contradiction(scan: LaserScan, min_beams: int) -> str | None:
    """Return why the scan's numbers contradict each other or the configuration; None if they do not."""
    beams, increment = len(scan.ranges), scan.angle_increment
    if beams < min_beams:
        return f"{beams} beams, fewer than {min_beams}" + (f": {JOIN}" if beams else "")
    if not all(map(math.isfinite, (scan.angle_min, increment, scan.range_min, scan.range_max))):
        return "geometry that is not finite"
    if abs(increment) < LEAST_INCREMENT_RAD or abs(increment) * (beams - 1) > 2 * math.pi + 1e-3:
        return f"{beams} beams of {increment:g} rad span more than a full turn, or no angle"
    last = scan.angle_min + increment * (beams - 1)
    if scan.angle_max is not None and not abs(scan.angle_max - last) <= ANGLE_SLACK_BEAMS * abs(increment):
        differs = f"{beams} beams of {increment:g} rad end at {last:g} rad, not at {scan.angle_max:g}"
        return f"{differs}: {_why_not_there(scan, last, scan.angle_max)}"
    if not 0.0 <= scan.range_min < scan.range_max:
        return f"range_min {scan.range_min:g} m and range_max {scan.range_max:g} m contradict each other"
    return None


def _why_not_there(scan: LaserScan, last_rad: float, angle_max: float) -> str:
    """Return what may be wrong with a scan whose last beam is not at the angle that the sender reports."""
    if scan.angle_increment * (angle_max - scan.angle_min) < 0.0:
        return "the sign of angle_increment is wrong"
    beams = round((angle_max - last_rad) / scan.angle_increment)
    return f"{abs(beams)} beams are {'missing' if beams > 0 else 'too many'}"


def _looks_elsewhere(before: View | None, geometry: Geometry) -> str | None:
    """Return a sentence if the middle of a scan of less than half a turn has moved by more than half its width."""
    width_rad = abs(geometry.increment) * (geometry.beams - 1)
    if before is None or width_rad >= math.pi:
        return None
    was_rad, is_rad = (g.angle_min + g.increment * (g.beams - 1) / 2.0 for g in (before.geometry, geometry))
    has_moved = abs(math.remainder(is_rad - was_rad, 2 * math.pi)) > width_rad / 2.0
    return f"its beams look elsewhere than those before: {JOIN}" if has_moved else None


@lru_cache(maxsize=16)
def rays_of(geometry: Geometry, mount: Mount, hull: Hull) -> Rays:
    """Return the beams of a scan geometry in the base frame."""
    angle: Floats = geometry.angle_min + geometry.increment * np.arange(geometry.beams, dtype=np.float64)
    looking = np.ones(geometry.beams, dtype=np.bool_)
    own = -angle if mount.flip else angle
    for start, end in mount.masked_rad:
        looking &= (own - start) % (2 * math.pi) > (end - start) % (2 * math.pi)
    direction = unit_vectors(mount.yaw_rad + angle)
    origin_m = np.array([[mount.x_m], [mount.y_m]])
    is_inside = hull.clearance(origin_m.T).item() < 0.0
    inside_m = hull.crossing(mount.x_m, mount.y_m, direction).leaves_m
    return Rays(origin_m, direction, looking, inside_m if is_inside else np.zeros(geometry.beams))


def unit_vectors(angle_rad: Floats) -> Floats:
    """Return the unit vectors (2, n) of angles (n,) [rad]."""
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])
