"""The overlay's geometry, against the floor plan's own distances; no GL is needed for it."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim import mj
from sim.floorplan import Circle, FloorPlan, Outline, Rectangle, Standing
from sim.lidar_config import LidarConfig
from sim.overlay import (
    COLOURS,
    MAX_POINTS,
    SEGMENTS,
    Mode,
    Overlay,
    Shown,
    gaps_m,
    geoms_needed,
    offset_outline,
)

sizes_m = st.floats(0.05, 2.0)
hulls: st.SearchStrategy[Outline] = st.one_of(
    st.builds(Circle, st.just(3.0), st.just(1.0), sizes_m),
    st.builds(Rectangle, st.just(3.0), st.just(1.0), st.just(0.4), sizes_m, sizes_m),
)


def at_origin(hull: Outline) -> Outline:
    if isinstance(hull, Circle):
        return Circle(0.0, 0.0, hull.radius_m)
    return Rectangle(0.0, 0.0, 0.0, hull.half_x_m, hull.half_y_m)


def scene(room: int = 2000) -> Any:  # noqa: ANN401 - MuJoCo has no types
    model = mj.mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    return mj.mujoco.MjvScene(model, maxgeom=room)


@given(hulls, st.floats(0.01, 1.0))
def test_every_point_of_a_ring_is_just_so_far_from_the_hull(hull: Outline, distance_m: float) -> None:
    ring_m = offset_outline(hull, distance_m)
    assert ring_m.shape == (SEGMENTS, 2)
    plan = FloorPlan([Standing("hull", at_origin(hull))])
    for x_m, y_m in ring_m:
        assert plan.nearest(Circle(float(x_m), float(y_m), 1e-9)).distance_m == pytest.approx(
            distance_m, abs=1e-6
        )
    np.testing.assert_allclose(gaps_m(hull, ring_m), distance_m, atol=1e-9)
    # Once around, counter-clockwise: each piece turns to the left.
    ahead_m = np.roll(ring_m, -1, axis=0)
    turns = ring_m[:, 0] * ahead_m[:, 1] - ring_m[:, 1] * ahead_m[:, 0]
    assert (turns > 0).all()


def test_the_overlay_comes_after_what_is_in_the_scene_and_casts_no_shadow() -> None:
    subject = scene()
    subject.ngeom = 7
    lidar = LidarConfig(beams=4)
    overlay = Overlay(subject, Circle(0.0, 0.0, 0.25), (lidar,))
    ranges = np.array((math.inf, 2.0, -math.inf, math.nan), np.float32)
    overlay.update(1.0, -1.0, math.pi / 2, Shown(Mode.LIMITED, ranges=(ranges,)))
    assert subject.ngeom == 7 + 3 * SEGMENTS + 1
    geoms = [subject.geoms[number] for number in range(7, subject.ngeom)]
    assert not any(geom.castshadow for geom in geoms)
    # Beam 1 looks to the right, at a robot that faces along y: along x.
    assert geoms[-1].pos.tolist() == pytest.approx([3.0, -1.0, lidar.height_m])


def test_the_rings_follow_the_robot_and_take_the_colour_of_the_mode() -> None:
    subject = scene()
    hull = Rectangle(9.0, 9.0, 1.0, 0.3, 0.2)
    overlay = Overlay(subject, hull, (LidarConfig(),))
    for x_m, y_m, yaw_rad, mode in ((1.0, 2.0, 0.5, Mode.DRIVING), (-3.0, 0.0, -2.0, Mode.STOPPED)):
        overlay.update(x_m, y_m, yaw_rad, Shown(mode))
        assert subject.ngeom == 3 * SEGMENTS
        plan = FloorPlan([Standing("hull", Rectangle(x_m, y_m, yaw_rad, 0.3, 0.2))])
        hue = np.array(COLOURS[mode]) / max(COLOURS[mode])
        for number, distance_m in ((SEGMENTS, 0.3), (2 * SEGMENTS, 0.5)):
            for geom in (subject.geoms[number + piece] for piece in range(SEGMENTS)):
                middle = Circle(float(geom.pos[0]), float(geom.pos[1]), 1e-9)
                assert plan.nearest(middle).distance_m == pytest.approx(distance_m, abs=0.003)
                np.testing.assert_allclose(geom.rgba[:3] / geom.rgba[:3].max(), hue, atol=1e-5)
                assert geom.rgba[3] == 1.0


def test_points_that_are_near_the_hull_are_amber_and_those_at_the_stop_distance_red() -> None:
    subject = scene()
    overlay = Overlay(subject, Circle(0.0, 0.0, 0.25), (LidarConfig(beams=3),))
    overlay.update(0.0, 0.0, 0.0, Shown(ranges=(np.array((0.55, 0.7, 2.0), np.float32),)))
    touching, near, far = (subject.geoms[3 * SEGMENTS + number].rgba.tolist() for number in range(3))
    assert touching[0] > 0.9
    assert touching[1] < 0.2
    assert near[0] > 0.9 > near[1] > 0.5
    assert far[2] > 0.9
    assert far[0] < 0.3


@pytest.mark.parametrize("beams", [1, MAX_POINTS, MAX_POINTS + 1, 65_536])
def test_a_lidar_of_very_many_beams_is_drawn_by_no_more_points_than_there_is_room_for(beams: int) -> None:
    lidar = LidarConfig(beams=beams)
    subject = scene(geoms_needed((lidar,)))
    overlay = Overlay(subject, Circle(0.0, 0.0, 0.25), (lidar,))
    overlay.update(0.0, 0.0, 0.0, Shown(ranges=(np.ones(beams, np.float32),)))
    assert min(beams, MAX_POINTS // 2) <= subject.ngeom - 3 * SEGMENTS <= MAX_POINTS


def test_a_ring_that_would_be_made_of_nothing_is_drawn_before_the_first_scan_as_well() -> None:
    subject = scene()
    Overlay(subject, Circle(0.0, 0.0, 0.25), (LidarConfig(),)).update(0.0, 0.0, 0.0, Shown())
    assert subject.ngeom == 3 * SEGMENTS


def test_the_points_of_two_lidars_lie_where_their_mounts_say() -> None:
    front = LidarConfig(beams=2, span_rad=math.pi, x_m=0.3, y_m=0.2, yaw_rad=0.5 * math.pi)
    rear = LidarConfig(beams=1, span_rad=1.0, x_m=-0.3, y_m=-0.2, yaw_rad=math.pi)
    subject = scene(geoms_needed((front, rear)))
    overlay = Overlay(subject, Rectangle(0.0, 0.0, 0.0, 0.3, 0.2), (front, rear))
    ranges = (np.array((1.0, math.nan), np.float32), np.array((2.0,), np.float32))
    overlay.update(1.0, 0.0, 0.5 * math.pi, Shown(ranges=ranges))
    assert subject.ngeom == 3 * SEGMENTS + 2
    places = [subject.geoms[3 * SEGMENTS + number].pos.tolist() for number in range(2)]
    # The front one's first beam looks along the robot's x axis, which is the world's y axis now.
    assert places[0] == pytest.approx([1.0 - 0.2, 0.3 + 1.0, front.height_m])
    assert places[1] == pytest.approx([1.0 + 0.2, -0.3 - 2.0, rear.height_m])


def test_before_a_lidar_s_first_scan_none_of_its_points_is_drawn() -> None:
    subject = scene()
    overlay = Overlay(subject, Circle(0.0, 0.0, 0.25), (LidarConfig(beams=2), LidarConfig(beams=2)))
    overlay.update(0.0, 0.0, 0.0, Shown(ranges=(np.empty(0, np.float32), np.ones(2, np.float32))))
    assert subject.ngeom == 3 * SEGMENTS + 2
