"""Generates a random scene from a seed; a seed always gives the same scene."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from supervisor.law.clearance import Circle, ConvexPolygon
from tests.scenes.world import Floats, Measure, Shape, World

TRUSTED_M_S2 = 1.5
"""The deceleration that the law assumes. No base brakes with less."""

BOUND_M = 0.285
"""Minimum clearance that the hull must keep by its own motion: the stop distance minus 1.5 cm."""

NEAR_LOSS_M = 0.015
"""Maximum loss of clearance of a robot that starts nearer than the stop distance."""

SMALLEST_M = 0.041
"""Diameter of the smallest objects: just above the law's default `smallest_obstacle_m`."""

START_M = 0.35
"""Minimum clearance at the start, except in scenes that start near an object."""

ROUND_CORNERS = 12

TIMEOUT_PERIODS = 2.25
SHORTEST_TIMEOUT_S = 0.24
LATEST_PERIODS = 1.1
"""Part of the scan timeout that remains when the latest possible scan arrives [scan periods], so that the next one is in time."""

Profile = Literal["rep117", "rplidar", "neato_xv"]


@dataclass(frozen=True)
class Lidar:
    """One lidar of the robot, and its faults."""

    x_m: float
    y_m: float
    yaw_rad: float
    beams: int
    angle_min: float
    angle_increment: float
    range_max: float
    rate_hz: float
    phase_s: float
    """Time of its first scan."""
    profile: Profile = "rep117"
    noise_m: float = 0.0
    """Standard deviation of the range noise, clipped at three sigma."""
    holes_rad: tuple[tuple[float, float], ...] = ()
    """Dirt: sectors (from, to) in the lidar frame."""
    silent_holes: bool = False
    """Whether dirt reads as the profile's "no return", indistinguishable from free space, instead of NaN."""
    beam_dropout: float = 0.0
    """Fraction of the beams missing in each scan."""
    silent_dropout: bool = False
    """Whether they read as "no return" instead of NaN."""
    object_dropout: float = 0.0
    """For each object, the fraction of scans in which it is missing: its beams read as "no return"."""
    stray: float = 0.0
    """Fraction of scans with one beam that reads too short."""
    range_min: float = 0.02
    """Minimum range; shorter distances read as -Inf."""
    late_s: float = 0.0
    """Transport delay of each scan, visible in its stamp, after the first scans arrived without delay."""
    latency_s: float = 0.0
    """Time from the measurement to its message, which no stamp shows."""


@dataclass(frozen=True)
class BaseNumbers:
    """The model of a base and its ramps."""

    kind: Literal["mixture", "axis"]
    acceleration_m_s2: float
    braking_m_s2: float
    dead_s: float = 0.0
    """Time after which it obeys, in addition to one tick; rounded to ticks."""


@dataclass(frozen=True)
class Configured:
    """Configured numbers of the base and the lidars. The defaults are those of the law."""

    braking_m_s2: float = TRUSTED_M_S2
    dead_s: float = 0.0
    latency_s: float = 0.0
    timeout_s: float = 0.15
    """Time after which the base stops without a command."""


@dataclass(frozen=True)
class Scene:
    """All inputs of one run."""

    seed: int
    hull: Shape
    shape: str
    lidars: tuple[Lidar, ...]
    base: BaseNumbers
    odometry_scale: float | None
    """Scale of the reported velocity; None for no odometry."""
    world: World
    yaw_rad: float
    """The robot starts at the origin, with this heading."""
    start_m: float
    """Clearance at the start."""
    duration_s: float
    configured: Configured = Configured()

    @property
    def bound_m(self) -> float:
        """The clearance that the hull must keep."""
        return min(BOUND_M, self.start_m - NEAR_LOSS_M)

    @property
    def tags(self) -> tuple[str, ...]:
        """Properties of the scene, for the summary."""
        first = self.lidars[0]
        tags = {
            f"hull {self.shape}": True,
            f"base {self.base.kind}": True,
            "two lidars": len(self.lidars) == 2,
            "partial view": len(self.lidars) == 1 and first.angle_increment * first.beams < 6.2,
            "coarse (< 180 beams)": first.beams < 180,
            "fine (> 720 beams)": first.beams > 720,
            "slow (< 8 Hz)": first.rate_hz < 8.0,
            "short range (< 2 m)": first.range_max < 2.0,
            "dirt": any(lidar.holes_rad for lidar in self.lidars),
            "silent dirt": any(lidar.holes_rad and lidar.silent_holes for lidar in self.lidars),
            "beam dropouts": any(lidar.beam_dropout for lidar in self.lidars),
            "object dropouts": any(lidar.object_dropout for lidar in self.lidars),
            "stray readings": any(lidar.stray for lidar in self.lidars),
            "noise": any(lidar.noise_m for lidar in self.lidars),
            "late scans": any(lidar.late_s for lidar in self.lidars),
            "sees nothing near (> 5 cm)": first.range_min > 0.05,
            "odometry scaled": self.odometry_scale not in (None, 1.0),
            "no odometry": self.odometry_scale is None,
            "near start": self.start_m < START_M,
        }
        clean = first.beams >= 360 and not any(
            (lidar.holes_rad or lidar.beam_dropout or lidar.object_dropout or lidar.noise_m)
            for lidar in self.lidars
        )
        return (*(tag for tag, holds in tags.items() if holds), *(("clean lidar",) if clean else ()))


def random_scene(seed: int, *, noise_m: float = 0.005, silent_dirt: bool = False) -> Scene:
    """Return the scene of a seed.

    Args:
        seed: seed of all random numbers.
        noise_m: the largest standard deviation of the range noise [m].
        silent_dirt: whether dirt may read as "no return".
    """
    rng = np.random.default_rng([seed, 0])
    hull, shape = _random_hull(rng)
    lidars = _random_lidars(rng, hull, noise_m=noise_m, silent_dirt=silent_dirt)
    lidars = _late_or_short_sighted(np.random.default_rng([seed, 4]), lidars)
    base = BaseNumbers(
        "mixture" if rng.random() < 0.5 else "axis",
        float(rng.uniform(0.5, 2.0)),
        TRUSTED_M_S2 if rng.random() < 0.4 else float(rng.uniform(TRUSTED_M_S2, 2.5)),
    )
    scale = (1.0, float(rng.uniform(0.97, 1.03)), None)[int(rng.choice(3, p=(0.5, 0.3, 0.2)))]
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    keep_m = START_M if rng.random() < 0.8 else 0.1
    world, start_m = _random_world(rng, hull, yaw_rad, keep_m)
    duration_s = float(rng.uniform(8.0, 12.0))
    return Scene(seed, hull, shape, lidars, base, scale, world, yaw_rad, start_m, duration_s)


def rectangle(front_m: float, back_m: float, half_width_m: float) -> ConvexPolygon:
    """Return a hull from -back_m to front_m, and half_width_m to each side."""
    return ConvexPolygon(
        (
            (front_m, -half_width_m),
            (front_m, half_width_m),
            (-back_m, half_width_m),
            (-back_m, -half_width_m),
        )
    )


def _random_hull(rng: np.random.Generator) -> tuple[Shape, str]:
    kind = rng.choice(["round", "round off-centre", "rectangle", "long", "rectangle off-centre"])
    if kind == "round":
        return Circle(float(rng.uniform(0.1, 0.4))), "round"
    if kind == "round off-centre":
        radius_m, ahead_m = rng.uniform(0.15, 0.4), rng.uniform(-0.12, 0.12)
        angle = 2 * math.pi / ROUND_CORNERS * np.arange(ROUND_CORNERS)
        corners = np.stack((ahead_m + radius_m * np.cos(angle), radius_m * np.sin(angle)), axis=1)
        return ConvexPolygon(tuple((float(x), float(y)) for x, y in corners)), kind
    if kind == "rectangle":
        half_m = float(rng.uniform(0.15, 0.4))
        return rectangle(half_m, half_m, float(rng.uniform(0.12, 0.3))), kind
    if kind == "long":
        half_m = float(rng.uniform(0.35, 0.45))
        return rectangle(half_m, half_m, float(rng.uniform(0.15, 0.22))), kind
    length_m, behind = float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.1, 0.4))
    # The origin is at the drive axle, in the hull's front or rear part.
    front_m, back_m = (1.0 - behind) * length_m, behind * length_m
    if rng.random() < 0.3:
        front_m, back_m = back_m, front_m
    return rectangle(front_m, back_m, float(rng.uniform(0.12, 0.3))), str(kind)


def _random_lidars(
    rng: np.random.Generator, hull: Shape, *, noise_m: float, silent_dirt: bool
) -> tuple[Lidar, ...]:
    if isinstance(hull, Circle):
        front_m = back_m = half_m = hull.radius_m / math.sqrt(2.0)
    else:
        corners = np.array(hull.corners)
        front_m, back_m, half_m = (
            float(corners[:, 0].max()),
            -float(corners[:, 0].min()),
            float(corners[:, 1].max()),
        )
        if len(corners) > 4:  # inside a round hull
            middle_m, radius_m = (front_m - back_m) / 2, half_m / math.sqrt(2.0)
            front_m, back_m, half_m = middle_m + radius_m, radius_m - middle_m, radius_m
    faults = _Faults(rng, noise_m=noise_m, silent_dirt=silent_dirt)
    if rng.random() < 0.25:  # at two opposite corners, facing outward
        beams = int(rng.integers(180, 1081))
        span = math.radians(270.0)
        rate_hz, range_max = _random_rate_hz(rng), _random_range_m(rng)
        return tuple(
            faults.lidar(x_m, y_m, yaw_rad, beams, span, range_max, rate_hz)
            for x_m, y_m, yaw_rad in (
                (front_m, half_m, math.pi / 4),
                (-back_m, -half_m, math.pi / 4 - math.pi),
            )
        )
    span = 2 * math.pi if rng.random() < 0.7 else math.radians(float(rng.uniform(180.0, 360.0)))
    place = rng.choice(["origin", "front", "anywhere"], p=[0.4, 0.25, 0.35])
    x_m = y_m = yaw_rad = 0.0
    if place == "front":
        x_m = front_m
    elif place == "anywhere":
        x_m, y_m = float(rng.uniform(-back_m, front_m)), float(rng.uniform(-half_m, half_m))
        yaw_rad = float(rng.uniform(-math.pi, math.pi))
    # Prefer coarse lidars: they are harder for the law and faster to simulate.
    beams = round(90 * (2048 / 90) ** rng.random() ** 1.5)
    return (faults.lidar(x_m, y_m, yaw_rad, beams, span, _random_range_m(rng), _random_rate_hz(rng)),)


def _random_rate_hz(rng: np.random.Generator) -> float:
    return float(rng.choice([5.0, 5.5, 7.0, 10.0, 12.0, 15.0, 20.0, 25.0, 40.0]))


def _random_range_m(rng: np.random.Generator) -> float:
    if rng.random() < 0.2:
        return float(rng.uniform(0.6, 2.0))
    return float(rng.choice([3.5, 5.6, 8.0, 12.0, 30.0]))


def timeout_s(rate_hz: float) -> float:
    """Return the age at which the law rejects a scan of a lidar with this rate."""
    return max(SHORTEST_TIMEOUT_S, TIMEOUT_PERIODS / rate_hz)


def _late_or_short_sighted(rng: np.random.Generator, lidars: tuple[Lidar, ...]) -> tuple[Lidar, ...]:
    """Sometimes delay the scans of all lidars, and sometimes give all of them a larger `range_min`."""
    rate_hz = lidars[0].rate_hz
    latest_s = timeout_s(rate_hz) - LATEST_PERIODS / rate_hz
    late_s = float(rng.uniform(0.0, latest_s)) if rng.random() < 0.2 else 0.0
    range_min = float(rng.uniform(0.05, 0.3)) if rng.random() < 0.2 else lidars[0].range_min
    return tuple(replace(lidar, late_s=late_s, range_min=range_min) for lidar in lidars)


class _Faults:
    """The faults that all lidars of one robot share: the profile, the kinds of fault, the noise."""

    def __init__(self, rng: np.random.Generator, *, noise_m: float, silent_dirt: bool) -> None:
        self._rng = rng
        profiles: tuple[Profile, ...] = ("rep117", "rplidar", "neato_xv")
        self._profile: Profile = profiles[int(rng.choice(3, p=(0.6, 0.2, 0.2)))]
        self._noise_m = float(rng.uniform(0.0, noise_m)) * bool(rng.random() < 0.6)
        self._dirty = bool(rng.random() < 0.4)
        # In a profile where NaN means "no return", dirt is always silent.
        self._silent = bool(rng.random() < 0.3) or self._profile == "neato_xv"
        if self._silent and not silent_dirt:
            self._dirty = self._dirty and self._profile != "neato_xv"
            self._silent = False
        self._beam_dropout = float(rng.uniform(0.0, 0.1)) * bool(rng.random() < 0.4)
        self._silent_dropout = bool(rng.random() < 0.3) or self._profile == "neato_xv"
        self._object_dropout = float(rng.uniform(0.0, 0.1)) * bool(rng.random() < 0.3)
        self._stray = float(rng.uniform(0.0, 0.02)) * bool(rng.random() < 0.2)

    def lidar(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float,
        beams: int,
        span: float,
        range_max: float,
        rate_hz: float,
    ) -> Lidar:
        rng = self._rng
        full = span > 2 * math.pi - 1e-9
        holes: list[tuple[float, float]] = []
        for _ in range(int(rng.integers(1, 4)) if self._dirty else 0):
            # Most dirt covers the directions of travel.
            middle = float(rng.choice([-yaw_rad, math.pi - yaw_rad, rng.uniform(-math.pi, math.pi)]))
            middle += float(rng.uniform(-0.15, 0.15))
            half = math.radians(float(rng.uniform(0.5, 10.0)))
            holes.append((middle - half, middle + half))
        return Lidar(
            x_m,
            y_m,
            yaw_rad,
            beams,
            angle_min=-span / 2,
            angle_increment=span / (beams if full else beams - 1),
            range_max=range_max,
            rate_hz=rate_hz,
            phase_s=float(rng.uniform(0.0, 1.0 / rate_hz)),
            profile=self._profile,
            noise_m=self._noise_m,
            holes_rad=tuple(holes),
            silent_holes=self._silent,
            beam_dropout=self._beam_dropout,
            silent_dropout=self._silent_dropout,
            object_dropout=self._object_dropout,
            stray=self._stray,
        )


def _random_world(
    rng: np.random.Generator, hull: Shape, yaw_rad: float, keep_m: float
) -> tuple[World, float]:
    """Return objects around the origin, none nearer to the hull than `keep_m`, and the clearance at the start."""
    measure = Measure(hull)
    while True:
        discs = int(rng.integers(3, 15))
        walls = int(rng.integers(0, 4))
        radius_m = np.where(rng.random(discs) < 0.5, SMALLEST_M / 2, rng.uniform(SMALLEST_M / 2, 0.25, discs))
        centres = _around(rng, discs)
        starts = _around(rng, walls)
        ends = starts + rng.uniform(-1.5, 1.5, (walls, 2))
        room_starts, room_ends = _random_room(rng)
        world = World(
            np.concatenate((room_starts, centres, starts)),
            np.concatenate((room_ends, centres, ends)),
            np.concatenate(
                (np.full(len(room_starts), 0.05), radius_m, rng.uniform(SMALLEST_M / 2, 0.06, walls))
            ),
        )
        clearances = measure.clearances_m(world, 0.0, 0.0, yaw_rad)
        far = clearances >= keep_m
        if far[: len(room_starts)].all() and np.count_nonzero(far) >= len(room_starts) + 3:
            world = World(world.starts[far], world.ends[far], world.radii[far])
            return world, float(measure.clearances_m(world, 0.0, 0.0, yaw_rad).min())


def _around(rng: np.random.Generator, count: int) -> Floats:
    """Return points (count, 2) around the origin, denser near it."""
    distance, angle = rng.uniform(0.3, 3.5, count), rng.uniform(-math.pi, math.pi, count)
    return np.stack((distance * np.cos(angle), distance * np.sin(angle)), axis=1)


def _random_room(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return the ends of four walls around the origin, near or far, or of none."""
    kind = rng.choice(["closed", "far", "open"], p=[0.5, 0.25, 0.25])
    if kind == "open":
        return np.empty((0, 2)), np.empty((0, 2))
    nearest, farthest = (1.2, 4.5) if kind == "closed" else (6.0, 25.0)
    right, top, left, bottom = rng.uniform(nearest, farthest, 4) * (1, 1, -1, -1)
    corners = np.array(((right, bottom), (right, top), (left, top), (left, bottom)))
    turn = float(rng.uniform(0.0, math.pi / 2))
    corners = corners @ np.array(((math.cos(turn), math.sin(turn)), (-math.sin(turn), math.cos(turn))))
    return corners, np.roll(corners, -1, axis=0)
