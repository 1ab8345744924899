"""Operators that drive at objects, and at the same object again after every stop."""

import math
from typing import Protocol

import numpy as np

from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from tests.scenes.world import Measure, World

FASTEST_M_S = 1.0
FASTEST_RAD_S = 2.0
SETTLE_S = 0.3
"""Duration of neutral commands at the start, in which the law receives its first scans."""
GIVES_UP_S = 0.4
"""Time for which an impatient operator still commands a motion after it has stopped the robot. A patient one completes it."""


class Operator(Protocol):
    """A source of commands over time."""

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        """Return the command at one tick; `stopped` says that the status shows a stop."""
        ...


class Adversary:
    """Drives at objects, past them on arcs, reverses while moving, and turns, for 0.3 to 2.5 s each.

    It knows all objects, even hidden ones.
    """

    def __init__(self, rng: np.random.Generator, world: World, measure: Measure) -> None:
        self._rng, self._world, self._measure = rng, world, measure
        self._until_s = SETTLE_S
        self._kind = "neutral"
        self._speed_m_s = self._turn_rad_s = self._aside_m = 0.0
        self._target = 0
        self._ahead: float | None = None
        self._patient = False
        # Some command neutral for one tick only: with a noisy lidar, each new scan then leads to a new decision.
        self._rest_s = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.05, 0.3))
        self._resting_until_s = 0.0

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        if stopped and not self._patient:
            self._until_s = min(self._until_s, now_s + GIVES_UP_S)
        if now_s >= self._until_s:
            self._choose(now_s, pose, twist)
        if stopped:
            self._resting_until_s = now_s + self._rest_s
        if stopped or now_s < self._resting_until_s or self._kind == "neutral":
            return STANDSTILL
        if self._kind == "random":
            return Velocity(self._speed_m_s, self._turn_rad_s)
        return self._steer(pose)

    def _choose(self, now_s: float, pose: Pose, twist: Velocity) -> None:
        rng = self._rng
        self._until_s = now_s + float(rng.uniform(0.3, 2.5))
        self._speed_m_s = FASTEST_M_S if rng.random() < 0.7 else float(rng.uniform(0.1, FASTEST_M_S))
        kind = rng.choice(["charge", "chase", "graze", "reverse", "random"], p=[0.3, 0.2, 0.2, 0.15, 0.15])
        self._kind, self._ahead, self._patient = str(kind), None, bool(rng.random() < 0.3)
        if kind == "reverse":
            self._kind = "random"
            self._turn_rad_s = float(rng.choice([-twist.angular_rad_s, twist.angular_rad_s, 0.0]))
            self._speed_m_s = math.copysign(self._speed_m_s, -twist.linear_m_s)
            self._until_s = now_s + float(rng.uniform(0.2, 1.0))
        elif kind == "random":
            self._speed_m_s *= float(rng.choice([1.0, -1.0, 0.0]))
            self._turn_rad_s = float(
                rng.choice([0.0, rng.uniform(-FASTEST_RAD_S, FASTEST_RAD_S), FASTEST_RAD_S, -FASTEST_RAD_S])
            )
        else:
            clearances = self._measure.clearances_m(self._world, *pose)
            nearest = np.argsort(clearances, kind="stable")[:4]
            self._target = int(rng.choice(nearest))
            self._aside_m = (
                float(rng.choice([-1.0, 1.0]) * rng.uniform(0.35, 0.75)) if kind == "graze" else 0.0
            )

    def _steer(self, pose: Pose) -> Velocity:
        """Return a command toward the target, ahead or astern, chosen by the bearing when this motion began."""
        world, number = self._world, self._target
        start, end = world.starts[number].tolist(), world.ends[number].tolist()
        x_m, y_m = _nearest_on_segment(pose.x_m, pose.y_m, start, end)
        away_m = max(math.hypot(x_m - pose.x_m, y_m - pose.y_m), 1e-6)
        bearing = math.atan2(y_m - pose.y_m, x_m - pose.x_m) - pose.yaw_rad
        bearing += math.atan2(self._aside_m, away_m)
        bearing = math.remainder(bearing, 2 * math.pi)
        if self._ahead is None:
            self._ahead = 1.0 if abs(bearing) < math.pi / 2 else -1.0
        error = bearing if self._ahead > 0.0 else math.remainder(bearing - math.pi, 2 * math.pi)
        turn = max(-FASTEST_RAD_S, min(FASTEST_RAD_S, 4.0 * error))
        if self._kind == "charge":
            if abs(error) > 0.15:
                return Velocity(0.0, turn)
            turn = 0.0
        return Velocity(self._ahead * self._speed_m_s, turn)


class Scripted:
    """Commands one constant twist, and neutral during each stop."""

    def __init__(self, wanted: Velocity, *, from_s: float = SETTLE_S) -> None:
        self._wanted, self._from_s = wanted, from_s

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        return STANDSTILL if stopped or now_s < self._from_s else self._wanted


class Chaser:
    """Drives at one point, ahead or astern, and again after every stop."""

    def __init__(self, place: tuple[float, float], speed_m_s: float, *, spins: bool) -> None:
        self._place, self._speed_m_s, self._spins = place, speed_m_s, spins

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        if stopped or now_s < SETTLE_S:
            return STANDSTILL
        x_m, y_m = self._place
        bearing = math.remainder(math.atan2(y_m - pose.y_m, x_m - pose.x_m) - pose.yaw_rad, 2 * math.pi)
        ahead = 1.0 if abs(bearing) < math.pi / 2 else -1.0
        error = bearing if ahead > 0.0 else math.remainder(bearing - math.pi, 2 * math.pi)
        turn = max(-FASTEST_RAD_S, min(FASTEST_RAD_S, 4.0 * error))
        if self._spins and abs(error) > 0.1:
            return Velocity(0.0, turn)
        return Velocity(ahead * self._speed_m_s, turn if abs(error) > 0.02 else 0.0)


class Stubborn:
    """Commands one constant twist after an initial neutral, even during stops."""

    def __init__(self, wanted: Velocity) -> None:
        self._wanted = wanted

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        return STANDSTILL if now_s < SETTLE_S else self._wanted


class Reverser:
    """Drives at full speed ahead and astern, straight or on arcs, and reverses while the base still moves."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._wanted = Velocity(FASTEST_M_S, 0.0)
        self._until_s = SETTLE_S + 0.8

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        if now_s >= self._until_s:
            rng = self._rng
            self._until_s = now_s + float(rng.uniform(0.2, 1.2))
            turn = float(rng.choice([0.0, rng.uniform(-FASTEST_RAD_S, FASTEST_RAD_S)]))
            self._wanted = Velocity(math.copysign(FASTEST_M_S, -self._wanted.linear_m_s), turn)
        return STANDSTILL if stopped or now_s < SETTLE_S else self._wanted


def _nearest_on_segment(x_m: float, y_m: float, start: list[float], end: list[float]) -> tuple[float, float]:
    side_x, side_y = end[0] - start[0], end[1] - start[1]
    square = side_x * side_x + side_y * side_y
    if square == 0.0:
        return start[0], start[1]
    along = ((x_m - start[0]) * side_x + (y_m - start[1]) * side_y) / square
    along = max(0.0, min(1.0, along))
    return start[0] + along * side_x, start[1] + along * side_y
