"""The drives that measure the robot, their order, and the free area that each needs.

A drive begins only if even a late and weak base would stop `MARGIN_M` before the wall. The first drives are slow. A faster stop is
tried only after the slower one ended within its planned distance.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

MARGIN_M = 0.5
"""Free area that must remain ahead after the longest stop."""
SLOW_M_S = 0.1
SLOW_RAD_S = 0.3
RETURN_M_S = 0.2
AHEAD_M = 0.4
OBLIQUE_M = 0.3
TURN_RAD = 0.6
"""The law judges the mount at each 0.4 rad, and stops after two judgements: the person is asked before the second."""
STOP_SPEEDS_M_S = (0.2, 0.3, 0.4, 0.5)
STOPS_AT_EACH = 2
FACING_RAD = math.radians(30.0)
"""Largest angle between the robot's heading and the wall."""
BACK_STOP_M = 0.04
"""Estimated stopping distance of a drive back."""
LEAST_BACK_M = 0.1
STEADY_S = 1.0
"""How long the robot drives at the full speed before it stops."""


class Base(NamedTuple):
    """What is assumed of the base."""

    acceleration_m_s2: float
    deceleration_m_s2: float
    reaction_s: float
    """Dead time and transport."""

    def stop_m(self, speed_m_s: float) -> float:
        """Return the stopping distance from a speed: v·T + v²/2a."""
        return speed_m_s * self.reaction_s + speed_m_s**2 / (2.0 * self.deceleration_m_s2)

    def run_up_m(self, speed_m_s: float, steady_s: float = STEADY_S) -> float:
        """Return the distance in which the base reaches a speed and then keeps it for `steady_s`."""
        return speed_m_s**2 / (2.0 * self.acceleration_m_s2) + speed_m_s * steady_s


POOR_DECELERATION_M_S2 = 0.3
POOR_REACTION_S = 0.6
"""Assumed for a base of which nothing is known: dead time and scan period together."""


class Drive(NamedTuple):
    """One motion from rest to rest."""

    way_m: float = 0.0
    """Distance ahead until zero is commanded; negative for a drive back."""
    turn_rad: float = 0.0
    """Turn on the spot, counter-clockwise; a drive has either a distance or a turn."""
    speed: float = SLOW_M_S
    """In m/s, or in rad/s for a turn; positive."""

    def back(self, there_m: float) -> "Drive":
        """Return a drive back as one that ends where the drive before began, which drove `there_m` with its stop."""
        return self._replace(way_m=-max(LEAST_BACK_M, there_m - BACK_STOP_M)) if self.way_m < 0.0 else self

    @property
    def lasts_s(self) -> float:
        return (abs(self.way_m) + abs(self.turn_rad)) / self.speed

    def needs_m(self, base: Base) -> float:
        """Return the free distance that the drive needs: its own, the longest stop, and the margin."""
        if self.way_m == 0.0:
            return MARGIN_M
        return abs(self.way_m) + base.stop_m(self.speed) + MARGIN_M

    def __str__(self) -> str:
        if self.turn_rad:
            side = "left" if self.turn_rad > 0.0 else "right"
            return f"turn {math.degrees(abs(self.turn_rad)):.0f}° {side} at {self.speed:g} rad/s"
        where = "ahead" if self.way_m > 0.0 else "back"
        return f"drive {abs(self.way_m):.2f} m {where} at {self.speed:g} m/s"


class Step(NamedTuple):
    """Drives that a person confirms together."""

    name: str
    purpose: str
    drives: tuple[Drive, ...]
    heading_rad: float = 0.0
    """Heading of the robot when the step begins, counter-clockwise from the direction of the wall."""
    is_needed: bool = True
    """Whether the next steps need its result."""

    def needs_m(self, base: Base, *, behind: bool = False) -> float:
        """Return the free distance that the step needs toward the wall, or behind the robot."""
        sign = -1.0 if behind else 1.0
        at_m = most_m = 0.0
        for drive in self.drives:
            if sign * drive.way_m >= 0.0:
                most_m = max(most_m, sign * at_m + drive.needs_m(base))
            at_m += drive.way_m  # a turn shortens the distance toward the wall, and never lengthens it
        return most_m


ESTOP_WAY_M = 1.0
ESTOP = Step(
    "e-stop",
    "whether it stops the robot. Press the e-stop of Lifeline while the robot drives. It stays stopped after that",
    (Drive(ESTOP_WAY_M),),
    is_needed=False,
)
AHEAD = Step("ahead", "the forward signs of base, odometry and lidar", (Drive(AHEAD_M),))
LEFT = Step(
    "left", "the turn signs of base, odometry and lidar", (Drive(turn_rad=TURN_RAD, speed=SLOW_RAD_S),)
)
HEADINGS = Step(
    "headings",
    "the yaw of the lidar and the scale of odometry",
    (
        Drive(OBLIQUE_M),
        Drive(-OBLIQUE_M),
        Drive(turn_rad=-2.0 * TURN_RAD, speed=SLOW_RAD_S),
        Drive(OBLIQUE_M),
        Drive(-OBLIQUE_M),
        Drive(turn_rad=TURN_RAD, speed=SLOW_RAD_S),
    ),
    TURN_RAD,
)


def stops(speed_m_s: float, base: Base) -> Step:
    """Return the step with the stops from one speed, each followed by the drive back."""
    way_m = base.run_up_m(speed_m_s)
    there, back = Drive(way_m, speed=speed_m_s), Drive(-way_m, speed=RETURN_M_S)
    return Step(
        f"stops from {speed_m_s:g} m/s",
        "how late and how hard the base brakes, and the latency of the lidar",
        (there, back) * STOPS_AT_EACH,
        is_needed=False,
    )


def speeds(fastest_m_s: float) -> Iterator[float]:
    """Yield the speeds of the stops, the slowest first."""
    return (speed for speed in STOP_SPEEDS_M_S if speed <= fastest_m_s)


def problem(step: Step, base: Base, ahead_m: float, wall_rad: float) -> str | None:
    """Return why a step cannot begin where the robot stands; None if it can.

    Args:
        step: the step.
        base: what is assumed of the base.
        ahead_m: the free distance from the hull to the wall.
        wall_rad: the direction of the wall, counter-clockwise from straight ahead.
    """
    off_rad = math.remainder(wall_rad + step.heading_rad, math.tau)
    if abs(off_rad) > FACING_RAD:
        side = "left" if off_rad > 0.0 else "right"
        return f"the robot must turn {math.degrees(abs(off_rad)):.0f}° {side} first"
    needs_m = step.needs_m(base)
    if needs_m > ahead_m:
        return f"it needs {needs_m:.2f} m ahead of the hull, and the wall is {ahead_m:.2f} m away"
    return None
