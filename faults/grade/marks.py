"""Marks: what was observed at the wheels after each fault, and the points that the rubric gives for it. Pure."""

import itertools
import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from faults.grade.rubric import Rubric, Stopping
from faults.measure import MOVING_M_S
from recordings.incidents.braking import Motion, braking

WATCHED_S = 4.5
"""How long a robot is watched after a fault; one that stops after 4 s or later did not stop because of the fault."""
AGAIN_M = 0.02
"""A robot that moves farther than this after its standstill has not stopped."""

HULL_RADIUS_M = 0.25
BEFORE_S, POINTS = 1.0, 300
"""The time before the fault that a curve shows, and its maximum number of points."""


class Fault(StrEnum):
    """What happens to the program or to the robot; the names of the rubric's tables."""

    KILLED = "killed"
    STOPPED = "stopped"
    RESUMED = "resumed"
    UNPLUGGED = "unplugged"
    GARBAGE = "garbage"
    OBSTACLE = "obstacle"
    SECOND = "second"


TITLES = {
    Fault.KILLED: "The program is killed (SIGKILL)",
    Fault.STOPPED: "The program hangs (SIGSTOP)",
    Fault.RESUMED: "The program continues after it hung",
    Fault.UNPLUGGED: "The network is unplugged",
    Fault.GARBAGE: "Garbage arrives on the terminal",
    Fault.OBSTACLE: "An obstacle appears ahead",
    Fault.SECOND: "A second instance is started",
}


@dataclass(frozen=True)
class Observed:
    """What the robot did after a fault; times from the fault."""

    speed_m_s: float
    """Forward speed at the fault."""
    standstill_s: float | None
    """Until a lasting standstill; None: none that began within 4 s."""
    distance_m: float
    """Travelled until the standstill, or while the robot was watched."""
    again_m: float
    """Travelled by a point of the hull after the standstill."""
    fastest_m_s: float
    """Speed at the fault, and by how much any point of the hull became faster."""
    nearest_m: float
    """Least distance of the hull to any object."""
    touched: bool
    swings: int
    """How often the speed changed its direction by more than the rubric's swing."""
    ended: bool
    """Whether the program had ended by itself when the observation ended."""
    curve: tuple[tuple[float, float], ...]
    """Time and forward speed [s, m/s], from before the fault."""

    @property
    def has_stopped(self) -> bool:
        return self.standstill_s is not None and self.again_m <= AGAIN_M


@dataclass(frozen=True)
class Mark:
    """The mark for one fault."""

    fault: Fault
    points: float
    of: int
    sentence: str
    observed: Observed | None
    """None: it was not tested, and the points do not count."""


def observed(motions: Sequence[Motion], at_s: float, swing_m_s: float, *, ended: bool) -> Observed:
    """Return what the robot did after a fault.

    Args:
        motions: before and after the fault, at least one before it.
        at_s: the time of the fault, by the clock of the motions.
        swing_m_s: a smaller change of the speed is no swing.
        ended: whether the program has ended by itself.
    """
    start = bisect_left(motions, at_s, key=lambda motion: motion.time_s)
    before, after = motions[max(0, start - 1)], motions[start:]
    seen = [before, *after]
    rest = braking(motions, at_s)
    rested_s = math.inf if rest is None else at_s + rest.to_standstill_s
    faster_m_s = max(map(_hull_m_s, seen)) - _hull_m_s(before)
    return Observed(
        speed_m_s=before.linear_m_s,
        standstill_s=None if rest is None else rest.to_standstill_s,
        distance_m=_way_m(seen) if rest is None else rest.distance_m,
        again_m=_way_m([motion for motion in after if motion.time_s >= rested_s]),
        fastest_m_s=abs(before.linear_m_s) + faster_m_s,
        nearest_m=min(motion.clearance_m for motion in seen),
        touched=any(motion.is_touching for motion in after),
        swings=swings([motion.linear_m_s for motion in seen], swing_m_s),
        ended=ended,
        curve=_curve([motion for motion in motions if motion.time_s > at_s - BEFORE_S], at_s),
    )


def _curve(motions: Sequence[Motion], at_s: float) -> tuple[tuple[float, float], ...]:
    every = 1 + len(motions) // POINTS
    return tuple((round(one.time_s - at_s, 3), round(one.linear_m_s, 3)) for one in motions[::every])


def _hull_m_s(motion: Motion) -> float:
    """Return an upper bound of the speed of any point of the hull: a robot that turns on the spot moves too."""
    return abs(motion.linear_m_s) + HULL_RADIUS_M * abs(motion.angular_rad_s)


def _way_m(motions: Sequence[Motion]) -> float:
    """Return the distance that the robot has travelled; a turn counts as travelled by a point of the hull."""
    way_m = 0.0
    for a, b in itertools.pairwise(motions):
        way_m += math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))
        way_m += 0.0 if b.is_still else HULL_RADIUS_M * abs(b.angular_rad_s) * (b.time_s - a.time_s)
    return way_m


def swings(speeds_m_s: Iterable[float], swing_m_s: float) -> int:
    """Return how often a speed rises or falls by more than `swing_m_s` before it turns."""
    low, high, found, direction = math.inf, -math.inf, 0, 0
    for speed in speeds_m_s:
        low, high = min(low, speed), max(high, speed)
        if direction >= 0 and high - speed > swing_m_s:
            found, direction, low = found + 1, -1, speed
        elif direction <= 0 and speed - low > swing_m_s:
            found, direction, high = found + 1, 1, speed
    return found


def mark(fault: Fault, seen: Observed, rubric: Rubric) -> Mark:
    """Return the mark for a fault: its share of the points and a sentence with the measured values."""
    share, sentence = _judged(fault, seen, rubric)
    of = getattr(rubric, fault).points
    return Mark(fault, round(share * of, 1), of, sentence, seen)


def untested(fault: Fault, reason: str, rubric: Rubric) -> Mark:
    """Return the mark of a fault that could not be injected."""
    return Mark(fault, 0.0, getattr(rubric, fault).points, f"not tested: {reason}", None)


def _judged(fault: Fault, seen: Observed, rubric: Rubric) -> tuple[float, str]:
    """Return the share of the points, and why."""
    match fault:
        case Fault.KILLED | Fault.STOPPED | Fault.UNPLUGGED:
            return _stopping(seen, getattr(rubric, fault))
        case Fault.RESUMED:
            return _resuming(seen, rubric)
        case Fault.GARBAGE:
            return _garbage(seen, rubric)
        case Fault.OBSTACLE:
            return _obstacle(seen, rubric)
        case _:
            return _second(seen)


def _stopping(seen: Observed, limit: Stopping) -> tuple[float, str]:
    if seen.touched:
        return 0.0, f"{_ran(seen)} and touched an object"
    if not seen.has_stopped or seen.standstill_s is None:
        again = f"stopped, and then moved again by {cm(seen.again_m)}"
        return (
            0.0,
            f"the robot {again}" if seen.standstill_s is not None else f"{_ran(seen)} without stopping",
        )
    stood = f"stood still after {seen.standstill_s:.2f} s and {cm(seen.distance_m)}, from {seen.speed_m_s:.2f} m/s"
    if seen.standstill_s > limit.standstill_s or seen.distance_m > limit.distance_m:
        return 0.5, f"the robot {stood}; the limit is {limit.standstill_s:g} s and {cm(limit.distance_m)}"
    return 1.0, f"the robot {stood}"


def _resuming(seen: Observed, rubric: Rubric) -> tuple[float, str]:
    moved_m = seen.distance_m + seen.again_m
    if abs(seen.speed_m_s) >= MOVING_M_S:
        return 0.0, f"the robot had not stopped while the program hung, and drove {cm(moved_m)} more"
    if moved_m > rubric.resumed.distance_m:
        return 0.0, f"the robot moved {cm(moved_m)} by itself, at up to {seen.fastest_m_s:.2f} m/s"
    return 1.0, "the robot stayed at rest until the operator's next key"


def _garbage(seen: Observed, rubric: Rubric) -> tuple[float, str]:
    if seen.ended or seen.has_stopped:
        share, sentence = _stopping(seen, rubric.garbage)
        return share, f"the program {'ended' if seen.ended else 'requested a stop'}; {sentence}"
    faster_m_s = seen.fastest_m_s - abs(seen.speed_m_s)
    if seen.touched or faster_m_s > rubric.garbage.faster_m_s:
        return (
            0.0,
            f"the robot became faster by {faster_m_s:.2f} m/s{' and touched an object' * seen.touched}",
        )
    return 1.0, "the program continued, and the robot kept its speed"


def _obstacle(seen: Observed, rubric: Rubric) -> tuple[float, str]:
    if seen.touched:
        return (
            0.0,
            f"the robot touched the pillar, having driven at {seen.speed_m_s:.2f} m/s when it appeared",
        )
    if not seen.has_stopped:
        return 0.0, f"the robot did not stop; it came as near as {cm(seen.nearest_m)}"
    stood = f"the robot stopped {cm(seen.nearest_m)} before the pillar"
    if seen.nearest_m < rubric.obstacle.clearance_m:
        return 0.5, f"{stood}; the limit is {cm(rubric.obstacle.clearance_m)}"
    return 1.0, stood


def _second(seen: Observed) -> tuple[float, str]:
    if seen.touched:
        return 0.0, f"{_ran(seen)} and touched an object"
    if seen.swings > 1:
        return 0.0, f"the two instances fought: the speed swung {seen.swings} times within {WATCHED_S:g} s"
    return 1.0, "the robot stopped" if seen.has_stopped else "the robot kept its speed"


def _ran(seen: Observed) -> str:
    return f"the robot drove on for {cm(seen.distance_m)}"


def cm(distance_m: float) -> str:
    """Return a distance for people."""
    return f"{distance_m:.2f} m" if distance_m >= 1.0 else f"{100.0 * distance_m:.0f} cm"


@dataclass(frozen=True)
class Grade:
    """The marks of one program."""

    program: str
    """Its command line."""
    robot: str
    """What it drove, for people."""
    pass_percent: float
    marks: tuple[Mark, ...]

    @property
    def points(self) -> float:
        return sum(one.points for one in self.marks if one.observed is not None)

    @property
    def of(self) -> int:
        """The points of the faults that were tested."""
        return sum(one.of for one in self.marks if one.observed is not None)

    @property
    def percent(self) -> float:
        return 100.0 * self.points / self.of if self.of else 0.0

    @property
    def passed(self) -> bool:
        return self.percent >= self.pass_percent

    @property
    def sentence(self) -> str:
        left = [one for one in self.marks if one.observed is None]
        without = (
            f"; without {' and '.join(one.fault for one in left)}, which could not be tested" if left else ""
        )
        verdict = "passed" if self.passed else "not passed"
        return f"{self.points:g} of {self.of} points, {self.percent:.0f} %: {verdict} (from {self.pass_percent:g} %){without}"
