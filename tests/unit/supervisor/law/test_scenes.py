"""The exactness of the scenes that the search uses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.clearance import Circle, ConvexPolygon
from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.scenes.base import AxisBase, Base, MixtureBase
from tests.scenes.run import run
from tests.scenes.scene import BOUND_M, SMALLEST_M, TRUSTED_M_S2, random_scene, rectangle
from tests.scenes.sensing import NOBODY, Eye
from tests.scenes.simple import LIDAR, plain_scene
from tests.scenes.world import Floats, Measure, World


@pytest.mark.parametrize("seed", range(30))
def test_a_ray_ends_where_the_nearest_surface_is(seed: int) -> None:
    """Sphere tracing: from anywhere, the distance to the nearest surface is free in every direction."""
    scene = random_scene(seed)
    lidar = replace(scene.lidars[0], beams=90)
    eye = Eye(lidar, len(scene.world), [0])
    distance, which = eye.cast(scene.world, 0.0, 0.0, scene.yaw_rad)
    cos, sin = math.cos(scene.yaw_rad), math.sin(scene.yaw_rad)
    x_m, y_m = cos * lidar.x_m - sin * lidar.y_m, sin * lidar.x_m + cos * lidar.y_m
    for beam in range(0, 90, 3):
        angle = scene.yaw_rad + lidar.yaw_rad + lidar.angle_min + beam * lidar.angle_increment
        traced_m = _trace(scene.world, x_m, y_m, angle, lidar.range_max)
        if math.isinf(traced_m):
            assert distance[beam] > lidar.range_max
        else:
            assert distance[beam] == pytest.approx(traced_m, abs=1e-3)
            assert which[beam] != NOBODY


def _trace(world: World, x_m: float, y_m: float, angle: float, range_max: float) -> float:
    way_m = 0.0
    for _ in range(2000):
        free_m = float(
            world.nearest_to(x_m + way_m * math.cos(angle), y_m + way_m * math.sin(angle))[0].min()
        )
        if free_m < 1e-5:
            return way_m
        way_m += free_m
        if way_m > range_max:
            return math.inf
    return way_m


@pytest.mark.parametrize("seed", range(30))
def test_the_clearance_is_the_least_distance_between_the_outline_and_a_surface(seed: int) -> None:
    scene = random_scene(seed)
    rng = np.random.default_rng(seed)
    pose = (float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)), float(rng.uniform(-3, 3)))
    outline = _outline(scene.hull, pose)
    sampled_m = min(float(scene.world.nearest_to(x, y)[0].min()) for x, y in outline)
    measured_m = float(Measure(scene.hull).clearances_m(scene.world, *pose).min())
    if sampled_m > 0.02:
        assert measured_m == pytest.approx(sampled_m, abs=2e-3) or measured_m <= 0.0  # inside the hull
    else:
        assert measured_m < 0.03


def _outline(hull: Circle | ConvexPolygon, pose: tuple[float, float, float]) -> Floats:
    if isinstance(hull, Circle):
        angle = np.linspace(0.0, 2 * math.pi, 400)
        points = hull.radius_m * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    else:
        corners = np.array(hull.corners)
        along = np.linspace(0.0, 1.0, 200)[:, None, None]
        points = (corners + along * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
    x_m, y_m, yaw_rad = pose
    turn = np.array(((math.cos(yaw_rad), math.sin(yaw_rad)), (-math.sin(yaw_rad), math.cos(yaw_rad))))
    placed: Floats = points @ turn + (x_m, y_m)
    return placed


def test_a_wall_right_through_the_hull_is_a_contact() -> None:
    wall = World(np.array([[-3.0, 0.1]]), np.array([[3.0, 0.1]]), np.array([0.02]))
    assert Measure(rectangle(0.4, 0.4, 0.3)).clearances_m(wall, 0.0, 0.0, 0.0)[0] <= 0.0


def test_a_scene_and_its_run_are_the_same_for_the_same_seed() -> None:
    assert run(random_scene(6)) == run(random_scene(6))


def test_random_scenes_have_what_they_promise() -> None:
    scenes = [random_scene(seed) for seed in range(400)]
    tags = {tag for scene in scenes for tag in scene.tags}
    assert {"hull round", "hull round off-centre", "hull rectangle", "hull long"} < tags
    assert {"hull rectangle off-centre", "two lidars", "partial view", "dirt", "object dropouts"} < tags
    assert {"beam dropouts", "stray readings", "noise", "no odometry", "short range (< 2 m)"} < tags
    assert {"late scans", "sees nothing near (> 5 cm)"} < tags
    assert min(lidar.beams for scene in scenes for lidar in scene.lidars) >= 90
    assert max(lidar.beams for scene in scenes for lidar in scene.lidars) > 1900
    assert min(float(scene.world.radii.min()) for scene in scenes) >= SMALLEST_M / 2
    assert min(scene.base.braking_m_s2 for scene in scenes) == TRUSTED_M_S2
    for scene in scenes:
        assert scene.bound_m == min(BOUND_M, scene.start_m - 0.015)


@pytest.mark.parametrize("base", [MixtureBase(1.0, 1.5, 0.4), AxisBase(1.0, 1.5, 0.4)])
def test_a_base_stands_as_soon_as_it_is_trusted_to(base: Base) -> None:
    for _ in range(200):
        base.step(Velocity(1.0, -2.0), 0.02)
    assert base.twist == pytest.approx(Velocity(1.0, -2.0))
    ticks = 0
    while base.twist != STANDSTILL:
        base.step(STANDSTILL, 0.02)
        ticks += 1
    assert ticks == math.ceil(1.0 / 1.5 / 0.02)


def test_a_hole_reads_nan_and_a_silent_one_reads_as_no_return() -> None:
    scene = plain_scene(room_m=2.0)
    hole = replace(LIDAR, holes_rad=((-0.1, 0.1),))
    ranges = Eye(hole, len(scene.world), [0]).scan(scene.world, 0.0, 0.0, 0.0)
    assert np.count_nonzero(np.isnan(ranges)) == 11
    silent = replace(hole, silent_holes=True, profile="rplidar")
    ranges = Eye(silent, len(scene.world), [0]).scan(scene.world, 0.0, 0.0, 0.0)
    assert np.count_nonzero(ranges == 0.0) == 11


def test_a_dropped_object_reads_as_no_return_for_two_scans_at_most() -> None:
    scene = plain_scene((1.0, 0.0, 0.1), room_m=None)
    eye = Eye(replace(LIDAR, object_dropout=1.0), len(scene.world), [0])
    seen = [bool(np.isfinite(eye.scan(scene.world, 0.0, 0.0, 0.0)).any()) for _ in range(8)]
    assert seen == [False, True, False, False, True, False, False, True]
