"""The smallest object, wherever a scan cannot see it: a robot that drives at it never comes too near."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, note, settings
from hypothesis import strategies as st

from supervisor.config import SupervisorSection
from supervisor.law.clearance import Circle
from tests.scenes.operators import Chaser
from tests.scenes.run import run
from tests.scenes.scene import BOUND_M, TRUSTED_M_S2, BaseNumbers, Lidar, rectangle
from tests.scenes.sensing import NOBODY, Eye
from tests.scenes.simple import LIDAR, Disc, plain_scene
from tests.scenes.world import Measure, Shape

RADIUS_M = SupervisorSection().smallest_obstacle_m / 2 + 0.001
FREE_M = 0.35
"""Minimum distance of a hidden place from the hull at the start."""

pytestmark = [pytest.mark.proof, pytest.mark.timeout(600)]


@st.composite
def hulls(draw: st.DrawFn) -> Shape:
    if draw(st.booleans()):
        return Circle(draw(st.floats(0.1, 0.4)))
    length_m, behind = draw(st.floats(0.25, 0.8)), draw(st.floats(0.15, 0.85))
    return rectangle((1.0 - behind) * length_m, behind * length_m, draw(st.floats(0.1, 0.3)))


@st.composite
def lidars(draw: st.DrawFn, hull: Shape) -> Lidar:
    """One lidar in or at the edge of the hull, with up to three holes."""
    beams = draw(st.integers(90, 720))
    span = draw(st.sampled_from([2 * math.pi, 2 * math.pi, math.radians(270.0), math.radians(200.0)]))
    corners = _corners(hull)
    weights = draw(st.lists(st.floats(0.01, 1.0), min_size=len(corners), max_size=len(corners)))
    x_m, y_m = (np.array(weights) @ corners / sum(weights)).tolist()
    full = span == 2 * math.pi
    holes = draw(st.lists(st.tuples(st.floats(-math.pi, math.pi), st.floats(0.01, 0.17)), max_size=3))
    return replace(
        LIDAR,
        x_m=x_m,
        y_m=y_m,
        yaw_rad=draw(st.floats(-math.pi, math.pi)),
        beams=beams,
        angle_min=-span / 2,
        angle_increment=span / (beams if full else beams - 1),
        range_max=draw(st.sampled_from([0.8, 1.5, 12.0])),
        rate_hz=draw(st.sampled_from([5.0, 10.0, 20.0, 40.0])),
        holes_rad=tuple((middle - half, middle + half) for middle, half in holes),
    )


def _corners(hull: Shape) -> np.ndarray:
    if isinstance(hull, Circle):
        side_m = hull.radius_m / math.sqrt(2.0)
        return side_m * np.array(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)))
    return np.array(hull.corners)


def _hides(lidar: Lidar, hull: Shape, disc: Disc) -> bool:
    """Return whether the first scan misses it although it is away from the hull."""
    scene = plain_scene(disc, hull=hull, lidars=(lidar,), room_m=None)
    if scene.start_m < FREE_M:
        return False
    which = Eye(lidar, 1, [0]).cast(scene.world, 0.0, 0.0, 0.0).which
    angle = lidar.angle_min + lidar.angle_increment * np.arange(lidar.beams)
    for start, end in lidar.holes_rad:
        which[(angle - start) % (2 * math.pi) <= end - start] = NOBODY
    return bool((which == NOBODY).all())


def _hiding_places(lidar: Lidar, hull: Shape) -> list[Disc]:
    """Between beams, in holes, beside the view and beyond the range, nearest to the hull first."""
    angles = lidar.angle_min + lidar.angle_increment * (np.arange(lidar.beams) + 0.5)
    angles = np.concatenate((angles, np.linspace(-math.pi, math.pi, 120)))
    if len(angles) > 240:
        angles = angles[:: len(angles) // 240]
    places: list[tuple[float, Disc]] = []
    for distance_m in np.arange(0.4, min(lidar.range_max, 2.5) + 0.2, 0.08):
        for angle in lidar.yaw_rad + angles:
            disc = (
                lidar.x_m + float(distance_m * np.cos(angle)),
                lidar.y_m + float(distance_m * np.sin(angle)),
                RADIUS_M,
            )
            away_m = math.hypot(disc[0], disc[1]) - hull.radius_m
            if FREE_M - 0.3 < away_m < 2.0:
                places.append((away_m, disc))
    places.sort()
    return [disc for _, disc in places]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
@given(st.data())
def test_an_object_that_hides_from_a_scan_is_not_approached(data: st.DataObject) -> None:
    hull = data.draw(hulls(), label="hull")
    lidar = data.draw(lidars(hull), label="lidar")
    candidates = _hiding_places(lidar, hull)
    first = data.draw(st.floats(0.0, 1.0), label="where in the list")
    start = round(first * (len(candidates) - 1))
    near = candidates[start : start + 400 : 4]
    disc = next((disc for disc in near if _hides(lidar, hull, disc)), None)
    assume(disc is not None)  # else such a lidar sees everything there
    assert disc is not None
    note(f"hidden at {disc}")
    base = BaseNumbers(data.draw(st.sampled_from(["mixture", "axis"])), 1.0, TRUSTED_M_S2)
    room_m = data.draw(st.sampled_from([None, 4.0]), label="room")
    scene = plain_scene(disc, hull=hull, lidars=(lidar,), base=base, room_m=room_m, duration_s=5.0)
    speed_m_s = data.draw(st.sampled_from([1.0, 0.5, 0.2]), label="speed")
    operator = Chaser(disc[:2], speed_m_s, spins=data.draw(st.booleans(), label="turns on the spot first"))
    outcome = run(scene, operator=operator)
    assert outcome.closest_m >= BOUND_M


def test_the_hiding_places_of_a_scan_are_places_that_it_does_not_show() -> None:
    """Of an ordinary coarse lidar there are some: the test above is not empty."""
    hull, lidar = Circle(0.25), replace(LIDAR, beams=90, angle_increment=2 * math.pi / 90)
    hidden = [disc for disc in _hiding_places(lidar, hull)[::5] if _hides(lidar, hull, disc)]
    assert len(hidden) > 20
    for x_m, y_m, radius_m in hidden:
        assert math.hypot(x_m, y_m) > radius_m / math.sin(math.radians(2.0)) - 1e-9
        assert (
            Measure(hull).clearances_m(plain_scene((x_m, y_m, radius_m), room_m=None).world, 0.0, 0.0, 0.0)[0]
            >= FREE_M
        )
