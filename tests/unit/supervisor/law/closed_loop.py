"""The law and a base in plain kinematics, among random pillars and walls.

The base accelerates at 1 m/s² and brakes at 2 m/s² (turns count at a rim of 0.25 m), passes through intermediate twists,
and obeys one tick late. The lidar casts 360 rays at 20 Hz. Walls end in round
posts: no lidar sees an edge of no thickness. Distances are exact; only the law sees rays.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from supervisor.config import SupervisorSection
from supervisor.law.clearance import Circle, ConvexPolygon
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan, Mount
from supervisor.law.state import State
from tests.unit.supervisor.law.law_harness import TICK_S, with_lidar
from wire.reasons import StopReason

Floats = npt.NDArray[np.float64]

BEAMS = 360
ANGLES: Floats = -math.pi + 2 * math.pi / BEAMS * np.arange(BEAMS, dtype=np.float64)
ROOM_M = 3.5
POST_M = 0.03
RIM_M = 0.25


class Base:
    """The twist moves straight to the commanded one: in between, it is a mixture of the two."""

    def __init__(self) -> None:
        self.twist = STANDSTILL

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        linear = target.linear_m_s - self.twist.linear_m_s
        angular = target.angular_rad_s - self.twist.angular_rad_s
        change = math.hypot(linear, angular * RIM_M)
        fades = self.twist.linear_m_s * linear + self.twist.angular_rad_s * angular * RIM_M**2 < 0.0
        share = 1.0 if change == 0.0 else min(1.0, (2.0 if fades else 1.0) * dt_s / change)
        self.twist = Velocity(
            self.twist.linear_m_s + share * linear, self.twist.angular_rad_s + share * angular
        )
        return self.twist


@dataclass(frozen=True)
class World:
    """Pillars and walls; the room's own four walls are the first ones."""

    pillars: Floats
    """(p, 2) [m]"""
    radii: Floats
    """(p,) [m]"""
    starts: Floats
    """(w, 2) [m]: one end of each wall."""
    ends: Floats
    """(w, 2) [m]: the other."""

    def ranges(self, x_m: float, y_m: float, yaw_rad: float) -> npt.NDArray[np.float32]:
        """Ranges of a lidar at this pose: (BEAMS,) [m], infinite where nothing is."""
        rays = np.stack([np.cos(yaw_rad + ANGLES), np.sin(yaw_rad + ANGLES)], axis=1)
        here = np.array([x_m, y_m])
        to = self.pillars - here
        along = rays @ to.T  # (beams, p)
        reach = self.radii**2 - ((to**2).sum(axis=1) - along**2)
        hit = along - np.sqrt(np.maximum(reach, 0.0))
        pillars = np.where((reach >= 0.0) & (hit > 0.0), hit, math.inf).min(axis=1)
        side = self.ends - self.starts
        offset = self.starts - here
        across = rays[:, :1] * side[:, 1] - rays[:, 1:] * side[:, 0]  # (beams, w)
        safe = np.where(across == 0.0, 1.0, across)
        distance = (offset[:, 0] * side[:, 1] - offset[:, 1] * side[:, 0]) / safe
        share = (offset[:, 0] * rays[:, 1:] - offset[:, 1] * rays[:, :1]) / safe
        good = (across != 0.0) & (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
        walls = np.where(good, distance, math.inf).min(axis=1)
        return np.minimum(pillars, walls).astype(np.float32)

    def clearance_m(self, x_m: float, y_m: float, yaw_rad: float, hull: Circle | ConvexPolygon) -> float:
        """Distance from the hull to the nearest object; not positive if they overlap."""
        turn = np.array([[math.cos(yaw_rad), -math.sin(yaw_rad)], [math.sin(yaw_rad), math.cos(yaw_rad)]])
        here = np.array([x_m, y_m])
        pillars, starts, ends = ((part - here) @ turn for part in (self.pillars, self.starts, self.ends))
        if isinstance(hull, Circle):
            centre = np.zeros((1, 2))
            return float(
                min(
                    (np.hypot(pillars[:, 0], pillars[:, 1]) - self.radii).min() - hull.radius_m,
                    _to_segments(centre, starts, ends).min() - hull.radius_m,
                )
            )
        corners = np.array(hull.corners)
        half = corners.max(axis=0)
        along = np.linspace(0.0, 1.0, 20)[:, None, None]
        inside = _to_box((starts + along * (ends - starts)).reshape(-1, 2), half)
        return float(
            min(
                (_to_box(pillars, half) - self.radii).min(),
                inside.min(),  # the walls' ends, and walls that pass through the hull
                _to_segments(corners, starts, ends).min(),
            )
        )


def _to_box(points: Floats, half: Floats) -> Floats:
    """Distance from a box around the origin to points (n, 2); zero inside."""
    beyond = np.maximum(np.abs(points) - half, 0.0)
    distances: Floats = np.hypot(beyond[:, 0], beyond[:, 1])
    return distances


def _to_segments(points: Floats, starts: Floats, ends: Floats) -> Floats:
    """Distances (n, w) from points (n, 2) to segments (w, 2)."""
    side = ends - starts
    offset = points[:, None, :] - starts
    along = np.clip((offset * side).sum(axis=2) / (side**2).sum(axis=1), 0.0, 1.0)
    away = offset - along[:, :, None] * side
    distances: Floats = np.hypot(away[:, :, 0], away[:, :, 1])
    return distances


@dataclass(frozen=True)
class Outcome:
    """The result of one run."""

    seed: int
    hull: Circle | ConvexPolygon
    start_m: float
    closest_m: float
    way_m: float
    stops: int


def random_world(rng: np.random.Generator) -> World:
    room = ROOM_M * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64)
    pillars = rng.uniform(-ROOM_M, ROOM_M, (int(rng.integers(2, 12)), 2))
    radii = rng.uniform(POST_M, 0.25, len(pillars))
    walls = int(rng.integers(0, 4))
    starts = rng.uniform(-ROOM_M, ROOM_M, (walls, 2))
    ends = starts + rng.uniform(-1.5, 1.5, (walls, 2))
    return World(
        np.concatenate([pillars, starts, ends]),
        np.concatenate([radii, np.full(2 * walls, POST_M)]),
        np.concatenate([room, starts]),
        np.concatenate([np.roll(room, -1, axis=0), ends]),
    )


def _random_pose(rng: np.random.Generator) -> Pose:
    return Pose(float(rng.uniform(-2.5, 2.5)), float(rng.uniform(-2.5, 2.5)), float(rng.uniform(-3.0, 3.0)))


def advance(pose: Pose, twist: Velocity, dt_s: float) -> Pose:
    heading_rad = pose.yaw_rad + twist.angular_rad_s * dt_s / 2
    return Pose(
        pose.x_m + dt_s * twist.linear_m_s * math.cos(heading_rad),
        pose.y_m + dt_s * twist.linear_m_s * math.sin(heading_rad),
        pose.yaw_rad + dt_s * twist.angular_rad_s,
    )


Step = Callable[[Velocity, float], Velocity]
Watch = Callable[[State, Decision, Velocity, np.random.Generator], None]
"""Called after each step with the state, the decision, the base's twist and the random numbers of the run."""


def drive_about(
    seed: int,
    duration_s: float = 6.0,
    *,
    arcs: bool = True,
    changes: bool = True,
    base_step: Step | None = None,
    watch: Watch | None = None,
) -> Outcome:
    """One run: an operator requests random motions, and sends neutral whenever the robot stops.

    Args:
        seed: seed of all random choices.
        duration_s: duration of the run.
        arcs: whether motions include arcs; else they are straight, or turns on the spot.
        changes: whether motions follow each other directly; else with one second of neutral between them.
        base_step: the base, instead of the one in this file.
        watch: called after each step.
    """
    rng = np.random.default_rng(seed)
    hull: Circle | ConvexPolygon = Circle(float(rng.uniform(0.1, 0.35)))
    if rng.random() < 0.5:
        x, y = rng.uniform(0.15, 0.45), rng.uniform(0.15, 0.35)
        hull = ConvexPolygon(((x, -y), (x, y), (-x, y), (-x, -y)))
    mount = Mount(0.1 * float(rng.uniform(-1, 1)), 0.1 * float(rng.uniform(-1, 1)), float(rng.uniform(-3, 3)))
    config = with_lidar(replace(SupervisorSection().law(), hull=hull), mount=mount)
    world, pose = random_world(rng), _random_pose(rng)
    while world.clearance_m(*pose, hull) < 0.1:  # some begin inside the stop zone
        world, pose = random_world(rng), _random_pose(rng)
    start_m = closest_m = world.clearance_m(*pose, hull)
    with_odometry = bool(rng.random() < 0.5)
    obey, command, wanted, until_s = base_step or Base().step, STANDSTILL, STANDSTILL, 0.0
    now_s, quiet_s, next_scan_s, way_m, stops = 0.0, 0.0, float(rng.uniform(0.0, 0.05)), 0.0, 0
    state, decision = step(initial_state(config), now_s, Inputs())
    while now_s < duration_s:
        now_s += TICK_S
        # The base obeys the decision of the previous tick.
        twist = obey(command, TICK_S)
        pose = advance(pose, twist, TICK_S)
        way_m += abs(twist.linear_m_s) * TICK_S
        closest_m = min(closest_m, world.clearance_m(*pose, hull))
        if now_s > until_s:
            until_s = now_s + float(rng.uniform(0.3, 2.0))
            turn = float(rng.choice([0.0, rng.uniform(-2.0, 2.0)]))
            speed = float(rng.choice([1.0, -1.0, rng.uniform(-1.0, 1.0), 0.0]))
            wanted = Velocity(speed, turn if arcs or speed == 0.0 else 0.0)
            quiet_s = now_s + (0.0 if changes else 1.0)
            until_s = max(until_s, quiet_s + 0.3)
        scan = None
        if now_s >= next_scan_s:
            next_scan_s += 0.05
            cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
            ranges = world.ranges(
                pose.x_m + cos * mount.x_m - sin * mount.y_m,
                pose.y_m + sin * mount.x_m + cos * mount.y_m,
                pose.yaw_rad + mount.yaw_rad,
            )
            scan = LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.02, 12.0, now_s)
        asked = STANDSTILL if decision.reasons or now_s < quiet_s else wanted
        odometry = Odometry(twist, now_s) if with_odometry else None
        inputs = Inputs(
            (Command("teleop", asked, now_s),), scans=() if scan is None else (scan,), odometry=odometry
        )
        command = decision.output
        state, decision = step(state, now_s, inputs)
        stops += decision.reasons == (StopReason.OBSTACLE,)
        if watch is not None:
            watch(state, decision, twist, rng)
    return Outcome(seed, hull, start_m, closest_m, way_m, stops)
