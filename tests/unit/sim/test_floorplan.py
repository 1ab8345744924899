"""The floor plan's distances: exact against hand-made worlds, and against MuJoCo's own."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim import mj
from sim.config import Build, Hull
from sim.floorplan import NOTHING, Circle, FloorPlan, Nearest, Outline, Rectangle, Standing, survey, way_out_m
from sim.plant import Plant


def _plan(*outlines: Outline) -> FloorPlan:
    return FloorPlan([Standing(f"thing {number}", outline) for number, outline in enumerate(outlines)])


def _point(x_m: float, y_m: float) -> Circle:
    return Circle(x_m, y_m, 0.0)


BOX = Rectangle(2.0, 0.0, 0.0, 1.0, 0.5)


@pytest.mark.parametrize(
    ("x_m", "y_m", "distance_m"), [(0.0, 0.0, 1.0), (-2.0, 4.5, 5.0), (2.0, 0.0, -0.5), (2.9, 0.0, -0.1)]
)
def test_a_rectangle_is_as_far_as_its_nearest_side_or_corner_and_as_deep(
    x_m: float, y_m: float, distance_m: float
) -> None:
    assert _plan(BOX).nearest(_point(x_m, y_m)).distance_m == pytest.approx(distance_m)


def test_a_turned_rectangle_is_turned() -> None:
    turned = Rectangle(0.0, 0.0, math.pi / 4, 1.0, 1.0)
    assert _plan(turned).nearest(_point(3.0, 0.0)).distance_m == pytest.approx(3.0 - math.sqrt(2.0))


def test_the_nearest_has_a_name_and_an_empty_floor_has_none() -> None:
    assert _plan(BOX, Circle(0.0, 2.0, 0.5)).nearest(Circle(0.0, 0.0, 0.25)) == Nearest(0.75, "thing 0")
    assert _plan(BOX, Circle(0.0, 1.0, 0.5)).nearest(Circle(0.0, 0.0, 0.25)) == Nearest(0.25, "thing 1")
    assert _plan().nearest(BOX) == NOTHING
    assert _plan(BOX, Circle(2.5, 0.9, 0.5)).overlapping(_point(2.5, 0.45), 0.01) == ["thing 0", "thing 1"]


@pytest.mark.parametrize(
    ("other", "distance_m"),
    [
        (Rectangle(5.0, 0.0, 0.0, 0.5, 3.0), 1.5),  # side to side
        (Rectangle(4.0, 2.5, 0.0, 0.7, 0.4), math.hypot(0.3, 1.6)),  # corner to corner
        (Rectangle(2.0, 2.0, math.pi / 4, 1.0, 1.0), 1.5 - math.sqrt(2.0)),  # corner to side
        (Rectangle(2.0, 0.0, math.pi / 2, 3.0, 0.1), -1.1),  # a cross, no corner within the other
        (Rectangle(2.0, 0.8, 0.0, 1.0, 0.5), -0.2),
        (Circle(4.0, 0.0, 0.4), 0.6),
        (Circle(3.3, 0.9, 0.6), -0.1),
    ],
)
def test_two_outlines_are_as_far_apart_as_they_are_both_ways(other: Outline, distance_m: float) -> None:
    assert _plan(other).nearest(BOX).distance_m == pytest.approx(distance_m)
    assert _plan(BOX).nearest(other).distance_m == pytest.approx(distance_m)


_PLACES = st.floats(-3.0, 3.0)
_SIZES = st.floats(0.05, 1.5)
_RECTANGLES = st.builds(Rectangle, _PLACES, _PLACES, st.floats(-math.pi, math.pi), _SIZES, _SIZES)


def _rim(rectangle: Rectangle) -> np.ndarray:
    """Points all around it, shape (n, 2)."""
    corners = [*rectangle.corners_m(), rectangle.corners_m()[0]]
    shares = np.linspace(0.0, 1.0, 50)[:, None]
    return np.concatenate(
        [np.array(a) + shares * (np.array(b) - np.array(a)) for a, b in itertools.pairwise(corners)]
    )


@given(_RECTANGLES, _RECTANGLES)
def test_the_distance_of_rectangles_is_that_of_their_nearest_points(a: Rectangle, b: Rectangle) -> None:
    distance_m = _plan(b).nearest(a).distance_m
    assert distance_m == pytest.approx(_plan(a).nearest(b).distance_m)
    rim_a, rim_b = _rim(a), _rim(b)
    sampled_m = float(np.min(np.linalg.norm(rim_a[:, None] - rim_b[None], axis=2)))
    if distance_m > 0.0:
        assert distance_m - 1e-9 <= sampled_m <= distance_m + 0.07
    else:
        # They overlap: a corner of one is in the other, or their rims cross.
        inside = min(_plan(a).nearest(_point(*p)).distance_m for p in (*b.corners_m(), (b.x_m, b.y_m)))
        inside = min(
            inside, *(_plan(b).nearest(_point(*p)).distance_m for p in (*a.corners_m(), (a.x_m, a.y_m)))
        )
        assert inside <= 1e-9 or sampled_m < 0.07


def test_only_upright_boxes_cylinders_and_spheres_have_an_outline() -> None:
    model = mj.mujoco.MjModel.from_xml_string("""<mujoco><compiler angle="degree"/><worldbody>
      <geom name="box" type="box" size="1 2 1" pos="1 2 3" euler="0 0 30"/>
      <geom name="drum" type="cylinder" size="0.5 1" pos="0 2 0"/>
      <geom name="ball" type="sphere" size="0.5" euler="10 0 0"/>
      <geom name="leaning" type="box" size="1 1 1" euler="10 0 0"/>
      <geom type="ellipsoid" size="1 1 2"/>
    </worldbody></mujoco>""")
    data = mj.make_data(model)
    mj.forward(model, data)
    standing, others = survey(model, data, range(model.ngeom))
    assert [thing.name for thing in standing] == ["box", "drum", "ball"]
    assert standing[0].outline == pytest.approx((1.0, 2.0, math.radians(30.0), 1.0, 2.0))
    assert standing[1].outline == (0.0, 2.0, 0.5)
    assert standing[2].outline == (0.0, 0.0, 0.5)
    assert [mj.geom_label(model, geom) for geom in others] == ["leaning", "geom 4"]


@pytest.mark.parametrize("hull", list(Hull))
def test_the_clearance_agrees_with_mujoco_s_own_distance(hull: Hull) -> None:
    plant = Plant(options=Build(hull=hull, moving=True))
    plant.place_pillar(-3.0, 0.6)
    hull_geom = mj.id_of(plant.model, "geom", "hull")
    solids = [g for g in range(plant.model.ngeom) if plant.model.geom_group[g] == 1]
    for target in ((0.5, 0.2), (0.5, -0.6), (-0.3, 1.0), (0.6, -1.0), (0.8, 0.3)):
        plant.step(target, 300)
        clearance_m = plant.clearance_m()
        mj.forward(plant.model, plant.data)
        distances_m = [mj.geom_distance(plant.model, plant.data, hull_geom, g, 20.0, None) for g in solids]
        assert clearance_m == pytest.approx(float(np.min(distances_m)), abs=1e-4)


@given(
    hull=st.sampled_from([Circle(9.0, 9.0, 0.25), Rectangle(9.0, 9.0, 1.0, 0.3, 0.2)]),
    x_m=st.floats(-0.6, 0.6),
    y_m=st.floats(-0.6, 0.6),
    angle_rad=st.floats(-4.0, 4.0),
)
def test_a_ray_has_left_the_hull_where_the_last_point_of_it_lies(
    hull: Outline, x_m: float, y_m: float, angle_rad: float
) -> None:
    out_m = float(way_out_m(hull, x_m, y_m, np.array([angle_rad]))[0])
    along_m = np.arange(0.0, 2.0, 1e-3)
    points = np.column_stack((x_m + along_m * math.cos(angle_rad), y_m + along_m * math.sin(angle_rad)))
    if isinstance(hull, Circle):
        inside = np.hypot(*points.T) < hull.radius_m
    else:
        inside = (np.abs(points) < (hull.half_x_m, hull.half_y_m)).all(axis=1)
    if inside.sum() > 1:  # a graze may lie between two samples
        assert out_m == pytest.approx(along_m[inside][-1], abs=2e-3)
    elif out_m > 0.0:
        end = (x_m + out_m * math.cos(angle_rad), y_m + out_m * math.sin(angle_rad))
        edge = Circle(0.0, 0.0, 0.25) if isinstance(hull, Circle) else Rectangle(0.0, 0.0, 0.0, 0.3, 0.2)
        point = Circle(*end, 1e-9)
        assert FloorPlan([Standing("hull", edge)]).nearest(point).distance_m == pytest.approx(0.0, abs=1e-4)


def test_from_a_corner_of_the_hull_three_quarters_of_a_turn_are_outside_at_once() -> None:
    angles_rad = np.deg2rad([45.0, -90.0, 180.0, 135.0, 0.0, 225.0])
    hull = Rectangle(0.0, 0.0, 0.0, 0.3, 0.2)
    outside = way_out_m(hull, 0.3, 0.2, angles_rad)
    assert outside[[0, 3, 4]].tolist() == [0.0, 0.0, 0.0]
    assert outside[5] == pytest.approx(0.4 * math.sqrt(2.0)), "straight through the hull"


@pytest.mark.parametrize(("x_m", "out_m"), [(0.3, 0.0), (-0.3, 0.6), (0.0, 0.3), (-1.0, 1.3), (1.0, 0.0)])
def test_a_ray_along_an_edge_leaves_the_hull_at_its_end(x_m: float, out_m: float) -> None:
    """At 0 rad the sine is exactly 0: the ray never crosses the edges beside it."""
    hull = Rectangle(0.0, 0.0, 0.0, 0.3, 0.2)
    assert way_out_m(hull, x_m, 0.2, np.array([0.0]))[0] == pytest.approx(out_m)
    assert way_out_m(hull, x_m, 0.21, np.array([0.0]))[0] == 0.0
