"""The floor plan's distances: exact against hand-made worlds, and against MuJoCo's own."""

import math

import numpy as np
import pytest

from sim import mj
from sim.floorplan import FloorPlan
from sim.plant import Plant


def _plan(geoms: str) -> FloorPlan:
    model = mj.load_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data = mj.make_data(model)
    mj.forward(model, data)
    return FloorPlan(model, data, list(range(model.ngeom)))


def test_a_box_is_as_far_as_its_nearest_side_or_corner() -> None:
    plan = _plan('<geom type="box" size="1 0.5 1" pos="2 0 1"/>')
    assert plan.distance_m(0.0, 0.0) == pytest.approx(1.0)
    assert plan.distance_m(-2.0, 4.5) == pytest.approx(5.0)
    assert plan.distance_m(2.0, 0.0) == 0.0


def test_a_turned_box_is_turned() -> None:
    plan = _plan('<geom type="box" size="1 1 1" euler="0 0 45"/>')
    assert plan.distance_m(3.0, 0.0) == pytest.approx(3.0 - math.sqrt(2.0))


def test_a_cylinder_is_a_circle_and_an_empty_floor_is_far_away() -> None:
    assert _plan('<geom type="cylinder" size="0.5 1" pos="0 2 0"/>').distance_m(0.0, 0.0) == pytest.approx(
        1.5
    )
    assert _plan("").distance_m(0.0, 0.0) == math.inf


@pytest.mark.parametrize(
    "geom", ['<geom type="box" size="1 1 1" euler="10 0 0"/>', '<geom type="ellipsoid" size="1 1 2"/>']
)
def test_a_solid_without_a_simple_outline_is_refused(geom: str) -> None:
    with pytest.raises(ValueError, match=r"Geom 0"):
        _plan(geom)


def test_the_clearance_agrees_with_mujoco_s_own_distance() -> None:
    plant = Plant()
    plant.place_pillar(-3.0, 0.4)
    hull = mj.geom_id(plant.model, "hull")
    solids = [g for g in range(plant.model.ngeom) if plant.model.geom_group[g] == 1]
    for target in ((0.5, 0.2), (0.5, -0.6), (-0.3, 1.0)):
        plant.step(target, 200)
        mj.forward(plant.model, plant.data)
        distances_m = [mj.geom_distance(plant.model, plant.data, hull, g, 20.0, None) for g in solids]
        assert plant.clearance_m() == pytest.approx(float(np.min(distances_m)), abs=1e-3)
