"""Hidden places begin on the hull itself: a place on a side closes along that side's normal, independent of rounding."""

import math

import numpy as np
import pytest

from supervisor.law.clearance import ConvexPolygon

RECTANGLE = ConvexPolygon(((0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3)))


@pytest.mark.parametrize("away_m", [0.0, 1e-16, 1e-15, 1e-13, 1e-10])
def test_what_touches_a_side_of_the_hull_is_not_closed_on_by_driving_along_that_side(away_m: float) -> None:
    x_m = np.linspace(-0.39, 0.39, 1001)
    for y_m in (0.3 + away_m, -0.3 - away_m):
        _, per_linear, _ = RECTANGLE.approach(np.stack([x_m, np.full_like(x_m, y_m)], axis=1))
        assert np.abs(per_linear).max() < 1e-6


def test_a_normal_is_a_unit_vector_outward_however_near_the_point_is() -> None:
    corner = np.array([[math.nextafter(0.4, 1.0), math.nextafter(0.3, 1.0)]])
    clearance_m, normals = RECTANGLE.nearest(corner)
    assert abs(clearance_m[0]) < 1e-9
    assert np.hypot(*normals[0]) == pytest.approx(1.0)
    assert normals[0].min() >= 0.0
