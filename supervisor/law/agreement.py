"""Whether a lidar's scans change as the motion of the robot makes them change. Motion is evidence.

`repeat`: a wide block of beams that repeats the previous scan bit for bit while the robot moves shows a place that the robot has
left. Its returns still count as obstacles, but they prove nothing free.

`agree`: each scan is compared with a reference scan, from which the robot has moved by `STEP_M` or `STEP_RAD`. Odometry and the
mount give the lidar's own motion: they place each new return among the old ones. In a static world, the old scan has
returns there. If it mostly does not, the lidar may be mounted other than configured, or odometry may have a wrong sign. An
explanation is accepted only if it places nearly all returns among the old ones, and if neither the configuration nor a robot
that stood still explains them: people who walk, wheels that slip, and odometry with a wrong scale have no explanation here, so
they stop nothing. `DOUBTS` judgements in a row must agree on one. A judgement that confirms the configuration rules out only the
explanations that its view contradicts: those that fit clearly worse. A translation and a rotation with enough in view rule out all; the
mounting is then confirmed.

Points of a plane are complex numbers [m]. A rotating lidar measures its beams one after the other; at a steady twist, both scans are
skewed alike.
"""

import cmath
import math
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Floats, Mask
from supervisor.law.reckoning import Pose, between
from supervisor.law.scan import Complex, Geometry, LaserScan, Mount, Ranges, ScanReading, View, is_full_turn
from supervisor.law.silence import FAR_SHARE, rows

STEP_M = 0.25
STEP_RAD = 0.4
"""A scan is judged when the robot has moved by one of these since the reference scan."""

MOST_M = 1.0
MOST_RAD = 1.2
MOST_S = 10.0
"""Beyond one of these, two scans are not compared: too much of what they show is hidden from one of them, or has moved."""

DOUBTS = 2
"""Number of consecutive judgements that must agree on an explanation."""

TOLERANCE_M = 0.06
TOLERANCE_SHARE = 0.02
"""A return agrees with the old scan if it is nearer to it than a distance of this share of its range more: three times the
noise of 2 cm, and an error of the heading on slanted surfaces. It differs if it is more than twice as far."""

LEAST_RAD = 0.25
"""Angle of the beams that must decide between two explanations."""

CONFIRMED_SHARE = 0.6
"""The configuration is confirmed if it explains at least this share of the beams that decide."""

EXPLAINED_SHARE = 0.75
"""Least share of the returns that an accepted explanation places among the old ones."""

CLEARLY = 0.2
"""An explanation is clearly better than another if it fails on at most this share of the beams on which the other fails."""

REST = 1e-5
"""[m, rad] The robot rests between two scans if odometry shows less motion than this on every axis: even at 10 m, it changes a
reading by no more than `LEAST_CHANGE_M`."""

NOISY_SHARE = 0.15
APART_SHARE = 0.25
RESTS = 5
LEAST_CHANGE_M = 1e-4
"""A lidar has noise if at most `NOISY_SHARE` of the returns outside of wide blocks changed by less than `LEAST_CHANGE_M` in each of
`RESTS` scans at rest, and if more than `APART_SHARE` of its returns are outside. In the recordings of five sensors, 0.14 is the most;
a sixth rounds to 1 cm, and repeats up to 0.8. A simulated robot rests with much smaller motions, which change each reading."""

BLOCK_RAD = math.radians(10.0)
BLOCK_BEAMS = 6
"""Least width of a block of repeated returns: in the recordings of sensors with noise, the widest is 4 degrees."""


class Explanation(StrEnum):
    """An explanation of how the returns of a lidar have moved; the value completes "motion shows"."""

    CONFIGURED = "the configuration"
    TURNED = "a lidar turned by 180 degrees"
    BACKWARDS = "a wrong forward sign of odometry"
    MIRRORED = "a mirrored lidar"
    TURNS_BACK = "a wrong turn sign of odometry"
    LEFT = "a lidar turned by 90 degrees to the left"
    RIGHT = "a lidar turned by 90 degrees to the right"
    MIRRORED_TURNED = "a mirrored lidar turned by 180 degrees"
    BOTH_SIGNS = "two wrong signs of odometry"


COMBINED = frozenset({Explanation.MIRRORED_TURNED, Explanation.BOTH_SIGNS})
"""Two mistakes at once; not named where one of them explains the same."""


MISTAKES = frozenset(Explanation) - {Explanation.CONFIGURED}


class Shift(NamedTuple):
    """A pose of the lidar in its own frame at the reference scan."""

    to: complex
    turn_rad: float


STILL = Shift(0j, 0.0)


class Agreement(NamedTuple):
    """State of one lidar: how its scans agreed with the motion so far."""

    reference: View | None = None
    doubts: int = 0
    """Number of consecutive judgements with the same explanations, other than the configuration."""
    explanations: frozenset[Explanation] = frozenset()
    """What explained each of these judgements."""
    not_ruled_out: frozenset[Explanation] = MISTAKES
    """The mistakes of mounting and odometry that no judgement has ruled out since the start, or since the last mismatch."""
    rests: int = 0
    """Number of consecutive scans at rest that showed noise, up to `RESTS`."""
    repeated: Mask | None = None
    """(n,): the beams of the newest scan that repeat an earlier one; None if none does."""

    @property
    def mismatch(self) -> str:
        """What the motion shows instead of the configuration, as part of a sentence; empty if nothing is wrong."""
        if self.doubts < DOUBTS:
            return ""
        named = self.explanations - COMBINED or self.explanations
        return ", or ".join(e for e in Explanation if e in named)


def agree(agreement: Agreement, view: View, mount: Mount) -> Agreement:
    """Return the agreement after a new view; its pose and that of the reference are by odometry.

    Args:
        agreement: the agreement before.
        view: the view of the new scan.
        mount: the configured mount of its lidar.
    """
    before = agreement.reference
    if before is None:
        return agreement._replace(reference=view)
    way = between(before.pose, view.pose)
    way_m, turn_rad = math.hypot(way.x_m, way.y_m), abs(way.yaw_rad)
    is_old = view.taken_s - before.taken_s > MOST_S
    if way_m < STEP_M and turn_rad < STEP_RAD and not is_old:
        return agreement
    agreement = agreement._replace(reference=view)
    if way_m > MOST_M or turn_rad > MOST_RAD or is_old:
        return agreement
    found = explain(before, view, mount)
    if found is None:
        return agreement
    again = found & agreement.explanations
    if Explanation.CONFIGURED in found:
        agreement = agreement._replace(not_ruled_out=agreement.not_ruled_out & found)
        return agreement if again else agreement._replace(doubts=0, explanations=frozenset())
    if agreement.doubts >= DOUBTS:
        return agreement
    if again:
        doubts = agreement.doubts + 1
        not_ruled_out = MISTAKES if doubts >= DOUBTS else agreement.not_ruled_out
        return agreement._replace(doubts=doubts, explanations=again, not_ruled_out=not_ruled_out)
    return agreement._replace(doubts=1 if found else 0, explanations=found)


def repeat(agreement: Agreement, before: ScanReading | None, scan: LaserScan, pose: Pose | None) -> Agreement:
    """Return the agreement with the beams of a new scan that repeat the previous scan, bit for bit.

    A merger that republishes a part, or a driver that fills in lost packets, shows a place that the robot has left. A lidar with
    noise never repeats a wide block of returns. A beam stops repeating when its reading changes.

    Args:
        agreement: the agreement before.
        before: the reading of the previous scan.
        scan: the new scan.
        pose: the odometer pose at which it was taken; None without odometry.
    """
    if before is None or before.view is None or pose is None or len(before.ranges) != len(scan.ranges):
        return agreement._replace(repeated=None)
    rests = max(map(abs, between(before.view.pose, pose))) < REST
    same = _unchanged(before.ranges, scan.ranges) if rests else before.ranges == scan.ranges
    least = max(BLOCK_BEAMS, math.ceil(BLOCK_RAD / abs(before.view.geometry.increment)))
    if not rests and np.count_nonzero(same) < least:
        return agreement if agreement.repeated is None else agreement._replace(repeated=None)
    if before.ranges.tobytes() == scan.ranges.tobytes():  # `read_scan` judges a scan that repeats as a whole
        return agreement
    returns = (scan.ranges > scan.range_min) & (scan.ranges < FAR_SHARE * scan.range_max)
    same &= returns
    is_round = is_full_turn(before.view.geometry)
    repeated = _blocks(same, least, is_round=is_round)
    apart = returns & ~repeated
    is_noisy = np.count_nonzero(same & apart) <= NOISY_SHARE * np.count_nonzero(apart)
    if rests:
        is_noisy &= np.count_nonzero(apart) > APART_SHARE * np.count_nonzero(returns)
        agreement = agreement._replace(rests=min(agreement.rests + 1, RESTS) if is_noisy else 0)
    if rests or not is_noisy or agreement.rests < RESTS:
        repeated[:] = False
    if agreement.repeated is not None:
        repeated |= _blocks(agreement.repeated & same, least, is_round=is_round)
    return agreement._replace(repeated=repeated if repeated.any() else None)


def _unchanged(before: Ranges, now: Ranges) -> Mask:
    """Return which readings (n,) of a scan at rest show no noise."""
    with np.errstate(invalid="ignore"):  # a beam without a return in both scans
        return np.abs(now - before) < LEAST_CHANGE_M


def _blocks(same: Mask, least: int, *, is_round: bool) -> Mask:
    """Return which of the marked beams (n,) belong to a row of at least so many; a full turn has no end."""
    blocks = np.zeros(len(same), dtype=np.bool_)
    if np.count_nonzero(same) < least:
        return blocks
    for row in rows(same, is_round=is_round):
        blocks[row] = len(row) >= least
    return blocks


def explain(before: View, view: View, mount: Mount) -> frozenset[Explanation] | None:
    """Return the explanations of what a view shows after the motion since an earlier view of the same lidar.

    Returns the configuration if it is confirmed, with the explanations that it does not explain the view clearly better than; else
    what explains the view clearly better than the configuration; None if the motion changes too little to judge.
    """
    shifts = _shifts(before, view, mount)
    points = view.free_m * directions(view.geometry)
    beam_rad = abs(view.geometry.increment)

    def fits(shift: Shift) -> "_Fit":
        return _fit(before, view, points, shift)

    expected, still = fits(shifts[Explanation.CONFIGURED]), fits(STILL)
    confirms = np.count_nonzero(expected.agrees & still.differs)
    contradicts = np.count_nonzero(expected.differs)
    if (confirms + contradicts) * beam_rad < LEAST_RAD:
        return None
    far = {e: shift for e, shift in shifts.items() if _is_far(shift, shifts[Explanation.CONFIGURED])}
    others = {e: fits(shift) for e, shift in far.items()}
    if confirms >= CONFIRMED_SHARE * (confirms + contradicts):
        worse = {e for e, fit in others.items() if _is_clearly_better(expected, fit, beam_rad)}
        return frozenset(shifts.keys() - worse)
    return frozenset(
        e
        for e, fit in others.items()
        if fit.share >= EXPLAINED_SHARE
        and _is_clearly_better(fit, expected, beam_rad)
        and _is_clearly_better(fit, still, beam_rad)
    )


class _Fit(NamedTuple):
    """How the returns of a view agree with an earlier one under one explanation; arrays over its n beams."""

    agrees: Mask
    differs: Mask
    """A beam may do neither: without a return, next to an unknown one, or on the edge of the tolerance."""
    share: float
    """Share of the comparable beams that agree."""


def _is_clearly_better(fit: _Fit, other: _Fit, beam_rad: float) -> bool:
    """Return whether one explanation explains enough beams that another does not, and the other hardly any that it does not."""
    better = np.count_nonzero(fit.agrees & other.differs)
    worse = np.count_nonzero(other.agrees & fit.differs)
    return bool(better * beam_rad >= LEAST_RAD and worse <= CLEARLY * better)


def _is_far(shift: Shift, other: Shift) -> bool:
    """Return whether two shifts differ by more than the drift of odometry."""
    return abs(shift.to - other.to) >= STEP_M or abs(shift.turn_rad - other.turn_rad) >= STEP_RAD


def _shifts(before: View, view: View, mount: Mount) -> dict[Explanation, Shift]:
    """Return the lidar's motion between two views under each explanation."""
    way = between(before.pose, view.pose)
    to, turn_rad = complex(way.x_m, way.y_m), way.yaw_rad
    configured = shift_of(to, turn_rad, mount)
    mirrored = Shift(configured.to.conjugate(), -turn_rad)
    return {
        Explanation.CONFIGURED: configured,
        Explanation.TURNED: Shift(-configured.to, turn_rad),
        Explanation.BACKWARDS: shift_of(-to, turn_rad, mount),
        Explanation.MIRRORED: mirrored,
        Explanation.TURNS_BACK: shift_of(to.conjugate(), -turn_rad, mount),
        Explanation.LEFT: Shift(configured.to * -1j, turn_rad),
        Explanation.RIGHT: Shift(configured.to * 1j, turn_rad),
        Explanation.MIRRORED_TURNED: Shift(-mirrored.to, -turn_rad),
        Explanation.BOTH_SIGNS: shift_of(-to.conjugate(), -turn_rad, mount),
    }


def shift_of(to: complex, turn_rad: float, mount: Mount) -> Shift:
    """Return the motion of a lidar, in its own frame, from that of the base."""
    at = complex(mount.x_m, mount.y_m)
    turned = (cmath.rect(1.0, turn_rad) - 1.0) * at
    return Shift((to + turned) * cmath.rect(1.0, -mount.yaw_rad), turn_rad)


def _fit(before: View, view: View, points: Complex, shift: Shift) -> _Fit:
    """Compare each new return with the old ranges on both sides of its place.

    Args:
        before: the earlier view.
        view: the new one.
        points: (n,) the ends of its beams in its lidar's frame.
        shift: the pose of this frame in that of the earlier view.
    """
    there = shift.to + cmath.rect(1.0, shift.turn_rad) * points
    low = np.floor(beams_at(before.geometry, there)).astype(np.int64)
    one_m, other_m = ranges_at(before.geometry, returns_m(before), np.add.outer((0, 1), low))
    there_m = np.abs(there)
    error_m = np.maximum(np.minimum(one_m, other_m) - there_m, there_m - np.maximum(one_m, other_m))
    tolerance_m = tolerances_m(there_m)
    agrees = view.hit & (error_m <= tolerance_m)
    known = np.count_nonzero(view.hit & ~np.isnan(error_m))
    share = np.count_nonzero(agrees) / max(known, 1)
    return _Fit(agrees, view.hit & (error_m > 2.0 * tolerance_m), share)


def beams_at(geometry: Geometry, points: Complex) -> Floats:
    """Return the beams (n,) that look at points of the lidar's frame, with the fraction between two beams."""
    turn = math.copysign(2 * math.pi, geometry.increment)
    beams: Floats = ((np.angle(points) - geometry.angle_min) % turn) / geometry.increment
    return beams


def tolerances_m(ranges_m: Floats) -> Floats:
    """Return by how much a return at each range (n,) may differ from an old one and still agree with it [m]."""
    return TOLERANCE_M + TOLERANCE_SHARE * ranges_m


def returns_m(view: View) -> Floats:
    """Return the range of each beam (n,) [m]; NaN without a return."""
    return np.where(view.hit, view.free_m, math.nan)


def ranges_at(geometry: Geometry, ranges_m: Floats, beams: npt.NDArray[np.int64]) -> Floats:
    """Return the ranges [m] of the given beams, in any shape; NaN beyond the ends of a scan.

    Args:
        geometry: the n beams of the scan.
        ranges_m: (n,) their ranges.
        beams: the indices of the beams.
    """
    number = geometry.beams
    if is_full_turn(geometry):
        return ranges_m.take(beams % number)
    return np.append(ranges_m, math.nan).take(np.where((beams >= 0) & (beams < number), beams, number))


@lru_cache(maxsize=16)
def directions(geometry: Geometry) -> Complex:
    """Return the unit vector (n,) of each beam in the lidar's frame."""
    directions: Complex = np.exp(1j * (geometry.angle_min + geometry.increment * np.arange(geometry.beams)))
    return directions
