"""People and forklifts that move along waypoints. Pure: the position is a function of the time in motion.

A path leads through waypoints at a constant speed, with a pause at each. A loop continues from the last waypoint to the
first. Any other path is traversed back and forth: a person turns around, a forklift reverses.
"""

import bisect
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from sim.floorplan import Rectangle

Point = tuple[float, float]

CLOSEST_WAYPOINTS_M = 0.05
_TURN_STEP_RAD = math.radians(15.0)


class MoverKind(StrEnum):
    """Kind of a mover; each kind has a model of the same name."""

    PERSON = "person"
    FORKLIFT = "forklift"


class Body(NamedTuple):
    """Footprint of a kind in its own frame: x of its rear and of its front, and half its width."""

    rear_m: float
    front_m: float
    half_width_m: float
    yields_m: float
    """Default distance ahead within which it waits for an obstacle."""


BODIES = {
    MoverKind.PERSON: Body(-0.25, 0.25, 0.25, yields_m=0.45),
    MoverKind.FORKLIFT: Body(-0.75, 1.65, 0.45, yields_m=0.80),
}


class Placed(NamedTuple):
    """Pose of a mover in the world, and its direction of motion: 1 forward, -1 backward, 0 at rest."""

    x_m: float
    y_m: float
    yaw_rad: float
    way: int


class _Leg(NamedTuple):
    """A segment of the path: either a straight line at constant yaw, or a turn on the spot."""

    from_m: Point
    to_m: Point
    duration_s: float
    yaw_rad: float
    turn_rad: float
    way: int


@dataclass(frozen=True, slots=True)
class Way:
    """The waypoints and the speed of a mover; `layout` checks each number.

    Raises:
        ValueError: Two successive waypoints are equal.
    """

    waypoints_m: tuple[Point, ...]
    speed_m_s: float
    dwell_s: float = 0.0
    loop: bool = False
    backs_up: bool = False

    def __post_init__(self) -> None:
        for a, b in itertools.pairwise(self._stops()):
            if math.dist(a, b) < CLOSEST_WAYPOINTS_M:
                raise ValueError(f"the waypoints {a} and {b} of a path are at the same place.")

    def _stops(self) -> list[Point]:
        """Return the waypoints of one round; the last equals the first."""
        there = list(self.waypoints_m)
        return [*there, there[0]] if self.loop else [*there, *there[-2::-1]]

    def legs(self) -> list[_Leg]:
        """Return the segments of one round, beginning at the first waypoint toward the second."""
        lines: list[_Leg] = []
        stops = self._stops()
        for number, (a, b) in enumerate(itertools.pairwise(stops)):
            backwards = self.backs_up and not self.loop and number >= len(self.waypoints_m) - 1
            dx_m, dy_m = b[0] - a[0], b[1] - a[1]
            yaw_rad = math.atan2(-dy_m, -dx_m) if backwards else math.atan2(dy_m, dx_m)
            way = -1 if backwards else 1
            lines.append(_Leg(a, b, math.hypot(dx_m, dy_m) / self.speed_m_s, yaw_rad, 0.0, way))
        legs: list[_Leg] = []
        for line, following in zip(lines, [*lines[1:], lines[0]], strict=True):
            turn_rad = math.remainder(following.yaw_rad - line.yaw_rad, math.tau)
            legs += [line, _Leg(line.to_m, line.to_m, self.dwell_s, line.yaw_rad, turn_rad, 0)]
        return legs


class Mover:
    """A person or forklift on its path.

    Args:
        name: Its name in contacts and errors.
        kind: Person or forklift.
        way: Its path.
        yields_m: It waits while an obstacle is this close ahead; None: it never waits.

    Attributes:
        period_s: Duration of one round without waiting.
    """

    def __init__(self, name: str, kind: MoverKind, way: Way, yields_m: float | None) -> None:
        self.name, self.kind, self.way, self.yields_m = name, kind, way, yields_m
        self._legs = way.legs()
        self._ends_s = list(itertools.accumulate(leg.duration_s for leg in self._legs))
        self.period_s = self._ends_s[-1]
        body = BODIES[kind]
        self._reach_m = math.hypot(max(body.front_m, -body.rear_m), body.half_width_m) + (yields_m or 0.0)

    def placed(self, walked_s: float) -> Placed:
        """Return its pose after this time in motion, excluding waiting."""
        since_s = walked_s % self.period_s
        index = bisect.bisect_right(self._ends_s, since_s)
        (x_m, y_m), (to_x_m, to_y_m), duration_s, yaw_rad, turn_rad, way = self._legs[index]
        share = 1.0 - (self._ends_s[index] - since_s) / duration_s
        return Placed(
            x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m), yaw_rad + share * turn_rad, way
        )

    def swept(self) -> Iterator[Rectangle]:
        """Yield rectangles that cover its footprint during one round: exact on straight lines, every 15° in turns."""
        for end_s, leg in zip(self._ends_s, self._legs, strict=True):
            begin_s = end_s - leg.duration_s
            if leg.way:
                x_m, y_m = (0.5 * (a + b) for a, b in zip(leg.from_m, leg.to_m, strict=True))
                half_m = 0.5 * math.dist(leg.from_m, leg.to_m)
                rear_m, front_m, half_width_m, _ = BODIES[self.kind]
                middle = Placed(x_m, y_m, leg.yaw_rad, leg.way)
                yield _rectangle(middle, rear_m - half_m, front_m + half_m, half_width_m)
            else:
                pieces = 1 + int(abs(leg.turn_rad) / _TURN_STEP_RAD)
                for piece in range(1, pieces):
                    yield self.footprint(self.placed(begin_s + leg.duration_s * piece / pieces))

    def footprint(self, placed: Placed) -> Rectangle:
        """Return its footprint at a pose."""
        return _rectangle(placed, *BODIES[self.kind][:3])

    def may_be_hindered(self, placed: Placed, x_m: float, y_m: float, radius_m: float) -> bool:
        """Return whether an object within this circle may be in its way; a fast check without false negatives."""
        if self.yields_m is None or placed.way == 0:
            return False
        dx_m, dy_m, reach_m = x_m - placed.x_m, y_m - placed.y_m, self._reach_m + radius_m
        return dx_m * dx_m + dy_m * dy_m < reach_m * reach_m

    def looked_at(self, placed: Placed) -> Rectangle:
        """Return the area from its centre to `yields_m` ahead; an object in this area is in its way."""
        rear_m, front_m, half_width_m, _ = BODIES[self.kind]
        yields_m = self.yields_m or 0.0
        if placed.way > 0:
            return _rectangle(placed, 0.0, front_m + yields_m, half_width_m)
        return _rectangle(placed, rear_m - yields_m, 0.0, half_width_m)


def _rectangle(placed: Placed, rear_m: float, front_m: float, half_width_m: float) -> Rectangle:
    middle_m = 0.5 * (rear_m + front_m)
    return Rectangle(
        placed.x_m + middle_m * math.cos(placed.yaw_rad),
        placed.y_m + middle_m * math.sin(placed.yaw_rad),
        placed.yaw_rad,
        0.5 * (front_m - rear_m),
        half_width_m,
    )
