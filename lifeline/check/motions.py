"""Finds the motions that a configuration's lidars permit, by running the safety law.

The robot is in open space: every beam returns `WALL_M`, or almost its maximum range if that is shorter. The e-stop stations
are left out, because their leases say nothing about the lidars.
"""

import math
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from supervisor.config import SupervisorSection
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan

WALL_M = 5.0
DRIVE_S = 2.0
"""How long the robot drives ahead before it stops and the motion `after_driving` is commanded."""
SETTLE_S = 1.0
"""How long the robot is at rest before the first motion: enough scans for the law to trust them."""
NOISE_M = 1e-4
"""Difference between successive scans: identical scans would count as frozen."""
NEUTRAL = Velocity(0.0, 0.0)


class View(NamedTuple):
    """The beam geometry and scan period of one lidar."""

    angle_min: float
    angle_increment: float
    beams: int
    range_max_m: float
    period_s: float
    assumed: tuple[str, ...] = ()
    """The names of the values that were assumed because no setting gives them."""


class Motion(NamedTuple):
    """A motion that an operator may command, as fractions of the maximum speeds."""

    name: str
    linear: float
    angular: float


MOTIONS = (
    Motion("ahead", 1.0, 0.0),
    Motion("arc left", 1.0, 0.5),
    Motion("arc right", 1.0, -0.5),
    Motion("back", -1.0, 0.0),
    Motion("turn left", 0.0, 1.0),
    Motion("turn right", 0.0, -1.0),
)


class Permitted(NamedTuple):
    """The law's decisions on one motion."""

    motion: Motion
    at_rest: Decision
    after_driving: Decision


def permitted_motions(config: SupervisorSection, views: tuple[View, ...]) -> Iterator[Permitted]:
    """Yield the law's decisions on each motion, commanded at rest, and just after driving ahead and stopping.

    Args:
        config: the robot's configuration.
        views: the views of its lidars, in the order of `config.all_lidars()`.
    """
    at_rest = _Robot(config, views)
    after_driving = at_rest.copy()
    after_driving.drive(Velocity(config.max_linear_m_s, 0.0), DRIVE_S)
    braking_s = config.max_linear_m_s / config.deceleration_m_s2
    after_driving.drive(NEUTRAL, braking_s + SETTLE_S / 2)
    for motion in MOTIONS:
        asked = Velocity(motion.linear * config.max_linear_m_s, motion.angular * config.max_angular_rad_s)
        yield Permitted(motion, at_rest.copy().ask(asked), after_driving.copy().ask(asked))


class _Lidar:
    """One lidar in open space, which returns each scan when it is due."""

    def __init__(self, index: int, view: View, start_s: float) -> None:
        self._index, self._view, self._due_s, self._count = index, view, start_s, 0

    def scan(self, now_s: float) -> LaserScan | None:
        view = self._view
        if now_s < self._due_s:
            return None
        self._due_s = max(self._due_s + view.period_s, now_s)
        self._count += 1
        distance_m = min(WALL_M, 0.99 * view.range_max_m) - NOISE_M * (self._count % 2)
        return LaserScan(
            ranges=np.full(view.beams, distance_m, dtype=np.float32),
            angle_min=view.angle_min,
            angle_increment=view.angle_increment,
            range_min=0.0,
            range_max=view.range_max_m,
            arrival_s=now_s,
            lidar=self._index,
        )


class _Robot:
    """Runs the law at its tick rate, with scans at their rate and a base that follows commands immediately."""

    def __init__(self, config: SupervisorSection, views: tuple[View, ...]) -> None:
        law = replace(config.law(), estop_stations=())
        self._source = config.sources[0].name
        self._tick_s = 1.0 / config.tick_hz
        self._now_s = 1000.0
        self._state = initial_state(law)
        self.lidars = [_Lidar(index, view, self._now_s) for index, view in enumerate(views)]
        self._moving = NEUTRAL
        self._has_odometry = config.odometry
        self.drive(NEUTRAL, SETTLE_S)

    def copy(self) -> "_Robot":
        """Return a robot in the same state; the law's states and scans are immutable, so both may share them."""
        twin = copy(self)
        twin.lidars = [copy(lidar) for lidar in self.lidars]
        return twin

    def drive(self, velocity: Velocity, seconds: float) -> None:
        for _ in range(math.ceil(seconds / self._tick_s)):
            self.ask(velocity)

    def ask(self, velocity: Velocity) -> Decision:
        """Return the decision of the law at the next tick if this velocity is commanded."""
        self._now_s += self._tick_s
        command = Command(self._source, velocity, self._now_s)
        odometry = Odometry(self._moving, self._now_s) if self._has_odometry else None
        scans = tuple(scan for lidar in self.lidars if (scan := lidar.scan(self._now_s)) is not None)
        inputs = Inputs(commands=(command,), scans=scans, odometry=odometry)
        self._state, decision = step(self._state, self._now_s, inputs)
        self._moving = decision.output
        return decision
