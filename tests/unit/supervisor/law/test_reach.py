"""The selection of the points that may limit a motion, compared with the barrier on all points."""

import math
from random import Random

import numpy as np
import pytest

from supervisor.law.clearance import (
    Barrier,
    Block,
    Circle,
    ConvexPolygon,
    Floats,
    Hull,
    Kind,
    moved,
    permitted_scale,
    survey,
)
from supervisor.law.reach import Place, in_reach, nearer_than, reach_m
from supervisor.law.reckoning import STANDSTILL, Odometer, Pose, Velocity
from tests.scenes.scene import rectangle

TRIANGLE = ConvexPolygon(((0.4, 0.0), (-0.3, 0.25), (-0.3, -0.25)))
HULLS: tuple[Hull, ...] = (Circle(0.25), rectangle(0.3, 0.3, 0.2), rectangle(0.4, 0.4, 0.2), TRIANGLE)
BARRIER = Barrier(0.3, 1.5, 0.1, 0.05)


def _points(random: Random) -> Floats:
    """Return points around the hull, some of them near."""
    count, widest_m = random.randint(1, 40), random.choice((0.7, 1.5, 4.0))
    return np.array([[random.uniform(-widest_m, widest_m) for _ in "xy"] for _ in range(count)])


def _barrier(random: Random) -> Barrier:
    reaction_s = random.uniform(0.0, 0.4)
    dead_s = random.uniform(0.0, reaction_s)
    return Barrier(random.uniform(0.1, 0.5), random.uniform(0.5, 3.0), reaction_s, 0.05, dead_s)


def _numbers(scale: float, block: Block | None) -> list[float]:
    return [scale, *(() if block is None else (block.per_linear, block.per_angular, block.x_m, block.y_m))]


@pytest.mark.parametrize("trials", [1000, pytest.param(3000, marks=pytest.mark.proof)])
@pytest.mark.parametrize("hull", HULLS, ids=["circle", "rectangle", "behind the axle", "triangle"])
def test_the_points_in_reach_permit_what_all_points_permit(hull: Hull, trials: int) -> None:
    """The scale and the blocking point are the same, also for a base that has moved since the scan, or that is faster.

    They may differ in the last digit: numpy rounds some operations otherwise at the end of an array.
    """
    random, left_out = Random(7), 0
    for _ in range(trials):
        barrier, kind = _barrier(random), random.choice(list(Kind))
        around = survey(hull, _points(random), kind)
        v, w = random.uniform(-1.0, 1.0), random.uniform(-2.0, 2.0) * random.choice((0.0, 1.0))
        way = Pose(random.uniform(-0.1, 0.1), random.uniform(-0.05, 0.05), random.uniform(-0.3, 0.3))
        odometer = Odometer(way if random.random() < 0.5 else Pose(0.0, 0.0, 0.0))
        place = Place(Pose(0.0, 0.0, 0.0), around)
        present = random.choice((0.0, random.uniform(0.0, 2.0)))
        fastest_m_s = max(1.0, present) * (abs(v) + abs(w) * hull.radius_m)
        known = in_reach(place, odometer, 1.0, barrier, fastest_m_s)
        here = None if odometer.pose == place.pose else survey(hull, moved(around.points, way), kind)
        every = permitted_scale(around, v, w, barrier, here, worth=0.5, present=present)
        if known is None:
            assert every == (1.0, None)
            left_out += 1
        else:
            selected = permitted_scale(known.around, v, w, barrier, known.here, worth=0.5, present=present)
            assert _numbers(*selected) == pytest.approx(_numbers(*every), abs=1e-12)
    assert 0 < left_out < trials


def test_the_reach_is_stop_distance_stray_reaction_and_braking_distance() -> None:
    assert reach_m(0.0, BARRIER) == pytest.approx(0.31)
    assert reach_m(1.5, BARRIER) == pytest.approx(0.31 + 1.5 * 0.1 + 1.5**2 / 3.0)


def test_only_points_nearer_than_the_distance_remain_in_their_order() -> None:
    around = survey(HULLS[0], np.array([[1.0, 0.0], [0.5, 0.0], [0.0, -2.0], [0.0, 0.75]]), Kind.HIDDEN)
    near = nearer_than(around, 0.75)
    assert near is not None
    assert (near.hull, near.kind) == (around.hull, Kind.HIDDEN)
    assert near.points.tolist() == [[0.5, 0.0], [0.0, 0.75]]
    assert near.clearance_m.tolist() == [0.25, 0.5]
    assert near.per_linear.tolist() == around.per_linear[[1, 3]].tolist()
    assert near.per_angular.tolist() == around.per_angular[[1, 3]].tolist()
    assert nearer_than(around, 0.25) is None


@pytest.mark.parametrize("hull", HULLS[:2], ids=["circle", "rectangle"])
@pytest.mark.parametrize(
    "way", [Pose(0.03, 0.04, 0.0), Pose(0.0, 0.0, 0.1), Pose(0.0, 0.0, -0.1), Pose(0.0, -0.02, 0.1)]
)
def test_the_reach_grows_by_the_distance_that_the_hull_has_moved(hull: Hull, way: Pose) -> None:
    limit_m = reach_m(0.5, BARRIER) + math.hypot(way.x_m, way.y_m) + abs(way.yaw_rad) * hull.radius_m

    def at(clearance_m: float, pose: Pose) -> bool:
        ahead_m = -float(hull.clearance(np.array([[10.0, 0.0]]))[0]) + 10.0 + clearance_m
        place = Place(Pose(0.0, 0.0, 0.0), survey(hull, np.array([[ahead_m, 0.0]])))
        known = in_reach(place, Odometer(pose, STANDSTILL, 1.0), 1.0, BARRIER, 0.5)
        assert known is None or known.barrier is BARRIER
        return known is not None

    assert at(limit_m - 1e-6, way)
    assert not at(limit_m + 1e-6, way)
    assert not at(limit_m - 1e-6, Pose(0.0, 0.0, 0.0))


def test_the_points_here_are_in_the_present_base_frame() -> None:
    points = np.array([[0.7, 0.1], [0.6, -0.2]])
    place = Place(Pose(0.0, 0.0, 0.0), survey(HULLS[1], points, Kind.REMEMBERED))
    still = in_reach(place, Odometer(), 0.0, BARRIER, 1.0)
    assert still is not None
    assert still.here is None
    # The last velocity is held until now.
    known = in_reach(place, Odometer(velocity=Velocity(0.5, 0.0)), 0.1, BARRIER, 1.0)
    assert known is not None
    assert known.here is not None
    assert known.here.kind is Kind.REMEMBERED
    assert known.here.points == pytest.approx(points - (0.05, 0.0))
