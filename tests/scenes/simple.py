"""Builds scenes with few objects by hand."""

import math

import numpy as np

from supervisor.law.clearance import Circle
from tests.scenes.scene import TRUSTED_M_S2, BaseNumbers, Lidar, Scene
from tests.scenes.world import Measure, Shape, World

Disc = tuple[float, float, float]
"""x [m], y [m], radius [m]."""

LIDAR = Lidar(
    x_m=0.0,
    y_m=0.0,
    yaw_rad=0.0,
    beams=360,
    angle_min=-math.pi,
    angle_increment=2 * math.pi / 360,
    range_max=12.0,
    rate_hz=20.0,
    phase_s=0.01,
)

BASE = BaseNumbers("mixture", acceleration_m_s2=1.0, braking_m_s2=TRUSTED_M_S2)

WALL_RADIUS_M = 0.05


def plain_scene(
    *discs: Disc,
    hull: Shape | None = None,
    lidars: tuple[Lidar, ...] = (LIDAR,),
    base: BaseNumbers = BASE,
    room_m: float | None = 4.0,
    duration_s: float = 6.0,
    seed: int = 0,
) -> Scene:
    """Build a scene with discs around a robot at the origin that faces along x.

    Args:
        discs: the objects.
        hull: hull of the robot; that of the default robot if None.
        lidars: one or several.
        base: parameters of the base.
        room_m: distance of each of four walls from the origin; None for no walls.
        duration_s: duration of the run.
        seed: seed of all random numbers.
    """
    hull = hull or Circle(0.25)
    centres = np.array([disc[:2] for disc in discs], dtype=np.float64).reshape(-1, 2)
    radii = np.array([disc[2] for disc in discs], dtype=np.float64)
    walls = np.empty((0, 2))
    if room_m is not None:
        walls = room_m * np.array(((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)))
    world = World(
        np.concatenate((centres, walls)),
        np.concatenate((centres, np.roll(walls, -1, axis=0))),
        np.concatenate((radii, np.full(len(walls), WALL_RADIUS_M))),
    )
    start_m = float(Measure(hull).clearances_m(world, 0.0, 0.0, 0.0).min())
    return Scene(seed, hull, "plain", lidars, base, 1.0, world, 0.0, start_m, duration_s)
