"""Hull, rings and free space as shapes, with values that a drawing on paper gives."""

import math

import numpy as np
import pytest

from lifeline.view.shapes import fan, free_space, outline
from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.lidar import PROFILES
from supervisor.law.reckoning import Pose
from supervisor.law.scan import LaserScan, Lidar, Moment, Mount, View, read_scan

ROUND = Circle(0.25)
SQUARE = ConvexPolygon(((0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)))


@pytest.mark.parametrize("hull", [ROUND, SQUARE])
@pytest.mark.parametrize("away_m", [0.3, 0.5])
def test_each_point_of_a_ring_is_at_its_distance_from_the_hull(hull: Hull, away_m: float) -> None:
    ring = outline(hull, away_m)
    assert hull.clearance(ring) == pytest.approx(np.full(len(ring), away_m))
    assert ring[0] == pytest.approx(ring[-1])


def test_the_outline_of_a_polygon_consists_of_its_corners() -> None:
    corners = {(round(x, 9), round(y, 9)) for x, y in outline(SQUARE).tolist()}
    assert corners == set(SQUARE.corners)


def test_a_ring_runs_around_the_hull_once() -> None:
    for hull in (ROUND, SQUARE):
        angle = np.unwrap(np.arctan2(*outline(hull, 0.3).T[::-1]))
        assert angle[-1] - angle[0] == pytest.approx(math.tau)


def test_the_triangles_of_a_closed_line_have_its_area() -> None:
    corners, triangles = fan(outline(SQUARE))
    assert area_m2(corners, triangles) == pytest.approx(0.16)


def area_m2(
    corners: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]",
    triangles: "np.ndarray[tuple[int, ...], np.dtype[np.int64]]",
) -> float:
    a, b, c = (corners[triangles[:, side]] for side in range(3))
    cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return float(np.abs(cross).sum() / 2)


def view_of(ranges: list[float], span_rad: float) -> View:
    """The view of a lidar whose first beam points straight behind."""
    increment = span_rad / len(ranges)
    scan = LaserScan(np.array(ranges, dtype=np.float32), -math.pi, increment, 0.05, 5.0, arrival_s=0.0)
    lidar = Lidar("lidar", Mount(), PROFILES["rep117"], 0.24, min_beams=4)
    moment = Moment(0.0, 0.05, Pose(0.0, 0.0, 0.0), 0.0, 0.0)
    view = read_scan(None, scan, moment, lidar, ROUND, 3.0, 0.04, in_the_open=True).view
    assert view is not None
    return view


def test_beams_of_one_metre_all_around_prove_a_polygon_free() -> None:
    corners, triangles = free_space(view_of([1.0] * 8, math.tau), Mount(), ROUND)
    assert len(triangles) == 8
    assert area_m2(corners, triangles) == pytest.approx(8 * math.sin(math.tau / 8) / 2, rel=1e-6)


def test_a_beam_that_proves_nothing_makes_a_hole_of_two_triangles() -> None:
    _, triangles = free_space(
        view_of([1.0, 1.0, math.nan, 1.0, 1.0, 1.0, 1.0, 1.0], math.tau), Mount(), ROUND
    )
    assert len(triangles) == 6
    assert 3 not in triangles[:, 1:]


def test_the_ends_of_half_a_turn_are_not_joined() -> None:
    _, triangles = free_space(view_of([1.0] * 8, math.pi), Mount(), ROUND)
    assert len(triangles) == 7


def test_free_space_begins_at_the_lidar() -> None:
    corners, _ = free_space(view_of([1.0] * 8, math.tau), Mount(x_m=0.1, y_m=-0.05), ROUND)
    assert corners[0] == pytest.approx((0.1, -0.05))
    assert corners[1] == pytest.approx((0.1 - 1.0, -0.05))
