"""Closed loop of a base whose wheels slip, and of people who walk in front of it while it stops."""

import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from supervisor.law import safety
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.state import State
from tests.scenes import run as scene_run
from tests.scenes.base import MixtureBase
from tests.scenes.operators import SETTLE_S
from tests.scenes.scene import TRUSTED_M_S2, Scene
from tests.scenes.sensing import Ranges
from tests.scenes.simple import LIDAR, plain_scene

DRIVE_S = 1.6
STOP_S = 2.9
"""Duration of a drive and of the stop after it; a robot that rests for longer than 3 s ends its run."""

LOCKED_M_S2 = 1000.0
FULL = Velocity(1.0, 0.0)


class SlidingBase:
    """The wheels obey with the deceleration of the configuration, or lock; the hull brakes `factor` times weaker."""

    def __init__(self, factor: float, *, locks: bool = False) -> None:
        self._hull = MixtureBase(1.0, TRUSTED_M_S2 / factor, 0.25)
        self._wheels = MixtureBase(1.0, LOCKED_M_S2 if locks else TRUSTED_M_S2, 0.25)
        self.twist = STANDSTILL

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        self._wheels.step(target, dt_s)
        self.twist = self._hull.step(target, dt_s)
        return self.twist

    def report(self, now_s: float, twist: Velocity) -> Velocity:
        """Odometry shows the wheels."""
        return self._wheels.twist


class Stops:
    """Stops from full speed in free space, ahead and back in turn; then drives straight ahead until the law stops it."""

    def __init__(self, stops: int, wanted: Velocity) -> None:
        self._stops, self._wanted = stops, wanted
        self.pose = Pose(0.0, 0.0, 0.0)

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        self.pose = pose
        number, since_s = divmod(now_s - SETTLE_S, DRIVE_S + STOP_S)
        if number >= self._stops:
            return STANDSTILL if stopped else self._wanted
        if number < 0 or since_s >= DRIVE_S:
            return STANDSTILL
        sign = -1.0 if number % 2 else 1.0
        return Velocity(sign * self._wanted.linear_m_s, self._wanted.angular_rad_s)


@contextmanager
def last_state() -> Generator[list[State]]:
    """Keep the last state of a run."""
    kept: list[State] = []
    step = safety.step

    def keep(*arguments: object) -> object:
        result = step(*arguments)  # pyright: ignore[reportArgumentType]
        kept[:] = [result[0]]
        return result

    with patch.object(scene_run, "step", keep):
        yield kept


Walk = Callable[[float, Pose], list[tuple[float, float]]]
"""Maps time and the pose of the robot to the places of people [m]."""

PERSON_M = 0.25
"""Radius of a person."""


def with_people(ranges: Ranges, pose: Pose, people: list[tuple[float, float]]) -> Ranges:
    """Return a scan of `LIDAR` with people in it."""
    angles = pose.yaw_rad + LIDAR.angle_min + LIDAR.angle_increment * np.arange(LIDAR.beams)
    for x_m, y_m in people:
        away_m, bearing = (
            math.hypot(x_m - pose.x_m, y_m - pose.y_m),
            math.atan2(y_m - pose.y_m, x_m - pose.x_m),
        )
        along = away_m * np.cos(angles - bearing)
        square = PERSON_M**2 - (away_m**2 - along**2)
        hit = np.where((square > 0.0) & (along > 0.0), along - np.sqrt(np.maximum(square, 0.0)), math.inf)
        ranges = np.minimum(ranges, hit).astype(np.float32)
    return ranges


def drive(
    *,
    stops: int,
    factor: float = 1.0,
    locks: bool = False,
    noise_m: float = 0.002,
    wanted: Velocity = FULL,
    scene: Scene | None = None,
    walk: Walk | None = None,
    seed: int = 0,
) -> tuple[float, State]:
    """Stop some times, then drive at the wall; return the least clearance [m] and the last state."""
    lidar = replace(LIDAR, noise_m=noise_m)
    duration_s = SETTLE_S + stops * (DRIVE_S + STOP_S) + (0.0 if walk else 8.0)
    scene = scene or plain_scene(room_m=4.0, seed=seed)
    base, operator = SlidingBase(factor, locks=locks), Stops(stops, wanted)

    def spoil(taken_s: float, number: int, ranges: Ranges) -> Ranges:
        return ranges if walk is None else with_people(ranges, operator.pose, walk(taken_s, operator.pose))

    with last_state() as kept:
        outcome = scene_run.run(
            replace(scene, lidars=(lidar,), duration_s=duration_s),
            operator=operator,
            base=base,
            report=base.report,
            spoil=spoil,
        )
    return outcome.closest_m, kept[0]
