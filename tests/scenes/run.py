"""Runs one scene in closed loop: the law at 50 Hz, a base with one tick of delay, scans between the ticks."""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from supervisor.law.decision import Decision
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.safety import initial_state, step
from tests.scenes import law
from tests.scenes.base import AxisBase, Base, MixtureBase
from tests.scenes.operators import Adversary, Operator
from tests.scenes.scene import Scene
from tests.scenes.sensing import Eye, Ranges
from tests.scenes.world import Measure

TICK_S = 0.02
FINE_M = 0.006
"""Maximum motion of any hull point between two measurements of the clearance, where a new minimum is possible."""
STUCK_S = 3.0

NEAR_M = 0.3
"""Distance that the hull moves before the objects within the search radius are selected again."""


@dataclass(frozen=True)
class Outcome:
    """The result of one run."""

    seed: int
    tags: tuple[str, ...]
    bound_m: float
    closest_m: float
    closest_s: float
    """Time of the smallest clearance."""
    travelled_m: float
    duration_s: float
    stopped_s: float
    """Total time with a stop reason."""
    stops: dict[str, int]
    """How often each stop reason began."""

    @property
    def violated(self) -> bool:
        return self.closest_m < self.bound_m

    @property
    def contact(self) -> bool:
        return self.closest_m <= 0.0


class Moment(NamedTuple):
    """One tick, as passed to `watch`."""

    now_s: float
    pose: Pose
    twist: Velocity
    """The true twist of the base."""
    asked: Velocity
    decision: Decision
    scans: list[tuple[int, float, Ranges]]


Watch = Callable[[Moment], None]
Spoil = Callable[[float, int, Ranges], Ranges | None]
"""A custom fault: maps (time, lidar, readings) to readings, or to None if the scan never arrives."""
Report = Callable[[float, Velocity], Velocity | None]
"""Custom odometry: maps (time, true velocity of the base) to a velocity, or to None for no message."""


def run(
    scene: Scene,
    *,
    operator: Operator | None = None,
    watch: Watch | None = None,
    spoil: Spoil | None = None,
    report: Report | None = None,
    base: Base | None = None,
    stuck_s: float = STUCK_S,
) -> Outcome:
    """Run one scene.

    Args:
        scene: the scene.
        operator: source of commands; None for the adversary of the scene's seed.
        watch: is called after each tick.
        spoil: changes or drops scans before they reach the law.
        report: replaces the scene's odometry.
        base: replaces the scene's base.
        stuck_s: ends the run when the robot has been at rest for this long, whatever was commanded.
    """
    measure = Measure(scene.hull)
    operator = operator or Adversary(np.random.default_rng([scene.seed, 1]), scene.world, measure)
    base = base or base_of(scene)
    eyes = [
        Eye(lidar, len(scene.world), [scene.seed, 2 + number]) for number, lidar in enumerate(scene.lidars)
    ]
    taken = [0] * len(eyes)
    on_their_way: list[tuple[int, float, Ranges]] = []
    pose, now_s = Pose(0.0, 0.0, scene.yaw_rad), 0.0
    # The base follows the decision of the previous tick, or an older one if it has a dead time.
    commands = deque([STANDSTILL] * (1 + dead_ticks(scene)))
    ledger = _Ledger(scene, measure)
    state, decision = step(
        initial_state(law.config_of(scene)), now_s, law.inputs(scene, now_s, STANDSTILL, [], None)
    )
    stops: Counter[str] = Counter()
    stopped_s = moved_s = 0.0
    reasons: tuple[str, ...] = law.stops(decision)
    for _ in range(round(scene.duration_s / TICK_S)):
        before, was = pose, base.twist
        twist = base.step(commands.popleft(), TICK_S)
        mean = Velocity(
            (was.linear_m_s + twist.linear_m_s) / 2, (was.angular_rad_s + twist.angular_rad_s) / 2
        )
        for number, eye in enumerate(eyes):
            taken_s = eye.lidar.phase_s + taken[number] / eye.lidar.rate_hz
            if taken_s <= now_s + TICK_S:
                taken[number] += 1
                ranges = eye.scan(scene.world, *advance(before, mean, taken_s - now_s))
                arrived = ranges if spoil is None else spoil(taken_s, number, ranges)
                if arrived is not None:
                    on_their_way.append((number, taken_s, arrived))
        pose = advance(before, mean, TICK_S)
        ledger.note(now_s, before, mean)
        now_s += TICK_S
        scans = [
            scan for scan in on_their_way if scan[1] + law.on_way_s(scene.lidars[scan[0]], scan[1]) <= now_s
        ]
        on_their_way = on_their_way[len(scans) :]
        asked = operator.asks(now_s, pose, twist, stopped=bool(reasons))
        odometry = _odometry(scene, twist) if report is None else report(now_s, twist)
        commands.append(decision.output)
        state, decision = step(state, now_s, law.inputs(scene, now_s, asked, scans, odometry))
        last, reasons = reasons, law.stops(decision)
        stops.update(set(reasons) - set(last))
        stopped_s += TICK_S if reasons else 0.0
        if watch is not None:
            watch(Moment(now_s, pose, twist, asked, decision, scans))
        if twist != STANDSTILL:
            moved_s = now_s
        elif now_s - moved_s > stuck_s:
            break
    return Outcome(
        scene.seed,
        scene.tags,
        scene.bound_m,
        ledger.closest_m,
        ledger.closest_s,
        ledger.travelled_m,
        now_s,
        stopped_s,
        dict(stops),
    )


def run_seed(number: int, *, scene_of: Callable[[int], Scene], only: str) -> Outcome | None:
    """Run the scene of a seed; return None if it lacks the tag `only`. A worker process imports it, so it is not in `__main__`."""
    scene = scene_of(number)
    return run(scene) if not only or only in scene.tags else None


class _Ledger:
    """The smallest clearance so far. A clearance shrinks by at most the hull's motion, so that few ticks need a measurement."""

    def __init__(self, scene: Scene, measure: Measure) -> None:
        self._world, self._measure = scene.world, measure
        self._reach_m = scene.hull.radius_m
        self.closest_m, self.closest_s, self.travelled_m = scene.start_m, 0.0, 0.0
        self._at_least_m = scene.start_m
        self._near, self._near_for_m = scene.world, 0.0

    def note(self, now_s: float, pose: Pose, twist: Velocity) -> None:
        """Record one tick from a pose, at a twist."""
        moved_m = TICK_S * (abs(twist.linear_m_s) + abs(twist.angular_rad_s) * self._reach_m)
        self.travelled_m += TICK_S * abs(twist.linear_m_s)
        self._at_least_m -= moved_m
        self._near_for_m -= moved_m
        if self._at_least_m >= self.closest_m or moved_m == 0.0:
            return
        if self._near_for_m < moved_m:
            self._near_for_m = moved_m + NEAR_M
            self._near = self._world.within(pose.x_m, pose.y_m, self._reach_m + self.closest_m + 2 * NEAR_M)
        if len(self._near) == 0:
            self._at_least_m = self.closest_m + NEAR_M
            return
        parts = math.ceil(moved_m / FINE_M)
        for part in range(1, parts + 1):
            later_s = TICK_S * part / parts
            here = advance(pose, twist, later_s)
            clearance_m = float(self._measure.clearances_m(self._near, *here).min())
            self._at_least_m = min(clearance_m, self.closest_m + NEAR_M)
            if clearance_m < self.closest_m:
                self.closest_m, self.closest_s = clearance_m, now_s + later_s


def advance(pose: Pose, twist: Velocity, dt_s: float) -> Pose:
    """Return the pose after a time at a constant twist, by the heading at the middle of the arc."""
    heading_rad = pose.yaw_rad + twist.angular_rad_s * dt_s / 2
    return Pose(
        pose.x_m + dt_s * twist.linear_m_s * math.cos(heading_rad),
        pose.y_m + dt_s * twist.linear_m_s * math.sin(heading_rad),
        pose.yaw_rad + dt_s * twist.angular_rad_s,
    )


def dead_ticks(scene: Scene) -> int:
    """Return the dead time of the base in ticks."""
    return round(scene.base.dead_s / TICK_S)


def base_of(scene: Scene) -> Base:
    """Return the base of a scene, at rest."""
    kind = MixtureBase if scene.base.kind == "mixture" else AxisBase
    return kind(scene.base.acceleration_m_s2, scene.base.braking_m_s2, scene.hull.radius_m)


def _odometry(scene: Scene, twist: Velocity) -> Velocity | None:
    scale = scene.odometry_scale
    return None if scale is None else Velocity(scale * twist.linear_m_s, scale * twist.angular_rad_s)
