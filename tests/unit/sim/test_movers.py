"""The ways of people and forklifts: where they are when, and what they look at."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.floorplan import FloorPlan, Rectangle, Standing
from sim.movers import BODIES, Mover, MoverKind, Way

THERE_AND_BACK = Way(((0.0, 0.0), (4.0, 0.0)), speed_m_s=2.0, dwell_s=1.0)
TRIANGLE = Way(((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)), speed_m_s=1.0, loop=True)


def _person(way: Way = THERE_AND_BACK, yields_m: float | None = 0.45) -> Mover:
    return Mover("ann", MoverKind.PERSON, way, yields_m)


@pytest.mark.parametrize(
    ("walked_s", "placed"),
    [
        (0.0, (0.0, 0.0, 0.0, 1)),
        (1.5, (3.0, 0.0, 0.0, 1)),
        (2.0, (4.0, 0.0, 0.0, 0)),  # arrived: it stands, and turns meanwhile
        (2.5, (4.0, 0.0, -math.pi / 2, 0)),
        (3.0, (4.0, 0.0, math.pi, 1)),
        (4.0, (2.0, 0.0, math.pi, 1)),
        (5.0, (0.0, 0.0, math.pi, 0)),
        (6.0, (0.0, 0.0, 0.0, 1)),  # and again
        (13.5, (3.0, 0.0, 0.0, 1)),
    ],
)
def test_a_person_goes_there_stands_turns_round_and_comes_back(
    walked_s: float, placed: tuple[float, float, float, int]
) -> None:
    mover = _person()
    assert mover.period_s == pytest.approx(6.0)
    x_m, y_m, yaw_rad, way = mover.placed(walked_s)
    assert (x_m, y_m) == pytest.approx(placed[:2])
    assert math.remainder(yaw_rad - placed[2], math.tau) == pytest.approx(0.0, abs=1e-9) or walked_s == 2.5
    assert way == placed[3]


def test_a_forklift_backs_up_with_its_forks_where_they_were() -> None:
    way = Way(((0.0, 0.0), (4.0, 0.0)), speed_m_s=2.0, dwell_s=1.0, backs_up=True)
    forklift = Mover("truck", MoverKind.FORKLIFT, way, 0.8)
    assert forklift.placed(2.5) == (4.0, 0.0, 0.0, 0)
    assert forklift.placed(4.0) == pytest.approx((2.0, 0.0, 0.0, -1))


def test_a_loop_goes_on_from_the_last_waypoint_to_the_first_and_turns_at_once_without_a_pause() -> None:
    mover = _person(TRIANGLE)
    assert mover.period_s == pytest.approx(3.0 + 4.0 + 5.0)
    assert mover.placed(7.0 + 2.5)[:2] == pytest.approx((1.5, 2.0))
    assert mover.placed(2.999).yaw_rad == 0.0
    assert mover.placed(3.001).yaw_rad == pytest.approx(math.pi / 2)


@given(st.floats(0.0, 1e6), st.floats(0.0, 0.1))
def test_nobody_is_faster_than_their_speed(walked_s: float, dt_s: float) -> None:
    for way in (THERE_AND_BACK, TRIANGLE):
        mover = _person(way)
        before, after = mover.placed(walked_s), mover.placed(walked_s + dt_s)
        assert math.dist(before[:2], after[:2]) <= way.speed_m_s * dt_s + 1e-8


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"waypoints_m": ((0.0, 0.0), (0.01, 0.0))}, "at the same place"),
        ({"waypoints_m": ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)), "loop": True}, "at the same place"),
    ],
)
def test_a_way_that_makes_no_sense_is_refused(values: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Way(**{"waypoints_m": ((0.0, 0.0), (1.0, 0.0)), "speed_m_s": 1.0, **values})  # pyright: ignore[reportArgumentType]


def _overlaps(mover: Mover, walked_s: float, x_m: float, y_m: float) -> bool:
    placed = mover.placed(walked_s)
    robot = Rectangle(x_m, y_m, 0.0, 0.1, 0.1)
    return FloorPlan([Standing("robot", robot)]).nearest(mover.looked_at(placed)).distance_m < 0.0


def test_it_looks_from_its_middle_to_so_far_ahead_of_its_front_in_its_own_width() -> None:
    person = _person()  # at 1 s at x = 2, with 0.25 m to its front and 0.45 m beyond
    edge_m = 2.0 + 0.25 + 0.45 + 0.1
    assert _overlaps(person, 1.0, edge_m - 0.001, 0.0)
    assert not _overlaps(person, 1.0, edge_m + 0.001, 0.0)
    assert _overlaps(person, 1.0, 2.3, 0.349)
    assert not _overlaps(person, 1.0, 2.3, 0.351)
    assert not _overlaps(person, 1.0, 1.8, 0.0)
    assert _overlaps(person, 4.0, 2.0 - 0.25 - 0.45 - 0.099, 0.0), "on its way back it looks the other way"


def test_a_forklift_that_backs_up_looks_behind() -> None:
    way = Way(((0.0, 0.0), (4.0, 0.0)), speed_m_s=2.0, backs_up=True)
    forklift = Mover("truck", MoverKind.FORKLIFT, way, 0.8)
    rear_m = 2.0 + BODIES[MoverKind.FORKLIFT].rear_m
    assert _overlaps(forklift, 3.0, rear_m - 0.8 - 0.099, 0.0)
    assert not _overlaps(forklift, 3.0, rear_m - 0.8 - 0.101, 0.0)
    assert not _overlaps(forklift, 3.0, 2.0 + 1.0, 0.0)


@given(st.floats(0.0, 6.0), st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))
def test_the_quick_look_never_misses_what_is_in_the_way(walked_s: float, x_m: float, y_m: float) -> None:
    mover = _person()
    placed = mover.placed(walked_s)
    if placed.way and _overlaps(mover, walked_s, x_m, y_m):
        assert mover.may_be_hindered(placed, x_m, y_m, 0.1 * math.sqrt(2.0))


def test_who_stands_or_never_yields_is_hindered_by_nothing() -> None:
    assert _person().may_be_hindered(_person().placed(1.0), 2.3, 0.0, 0.1)
    assert not _person().may_be_hindered(_person().placed(2.5), 4.3, 0.0, 0.1)
    stubborn = _person(yields_m=None)
    assert not stubborn.may_be_hindered(stubborn.placed(1.0), 2.3, 0.0, 0.1)


@pytest.mark.parametrize("way", [THERE_AND_BACK, TRIANGLE])
def test_all_the_floor_that_is_taken_in_a_round_is_swept(way: Way) -> None:
    mover = _person(way)
    plan = FloorPlan([Standing(str(number), part) for number, part in enumerate(mover.swept())])
    for share in range(100):
        placed = mover.placed(share / 100 * mover.period_s)
        if placed.way:
            for x_m, y_m in mover.footprint(placed).corners_m():
                point = Rectangle(x_m, y_m, 0.0, 1e-6, 1e-6)
                assert plan.nearest(point).distance_m < 1e-5
    straight = next(iter(mover.swept()))
    assert straight.half_x_m == pytest.approx(0.5 * math.dist(*way.waypoints_m[:2]) + 0.25)
