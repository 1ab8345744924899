"""The speed barrier's geometry and formula."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law.clearance import (
    DEEP_M,
    Barrier,
    Block,
    Circle,
    ConvexPolygon,
    Hull,
    Kind,
    Surroundings,
    moved,
    permitted_closing_speed,
    permitted_scale,
    survey,
)

CORNERS = ((0.3, -0.2), (0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2))
RECTANGLE = ConvexPolygon(CORNERS)
BARRIER = Barrier(stop_distance_m=0.3, deceleration_m_s2=1.5, reaction_s=0.1, hidden_creep_m_s=0.0)
HULLS = (Circle(0.25), RECTANGLE)

coordinates = st.floats(-3.0, 3.0)
velocities = st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))


def one(x_m: float, y_m: float) -> np.ndarray:
    return np.array([[x_m, y_m]])


def seen(hull: Hull, points: np.ndarray) -> Surroundings:
    """Points that the newest scan shows."""
    return survey(hull, points, Kind.SEEN)


def hidden(hull: Hull, points: np.ndarray) -> Surroundings:
    """Places that no scan rules out."""
    return survey(hull, points, Kind.HIDDEN)


def outline(hull: Hull) -> np.ndarray:
    """Points (n, 2) around the hull, a micrometre outside it, at most 2 cm apart."""
    if isinstance(hull, Circle):
        angles = np.arange(0.0, 2 * math.pi, 0.05)
        return (hull.radius_m + 1e-6) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    along = np.linspace(0.0, 1.0, 31)[:, None]
    front = np.array([0.3 + 1e-6, -0.2]) + along * (0.0, 0.4)
    left = np.array([0.3, 0.2 + 1e-6]) - along * (0.6, 0.0)
    return np.concatenate((front, left, -front, -left))


def any_block(kind: Kind, per_linear: float = 1.0, per_angular: float = 0.0) -> Block:
    return Block(per_linear, per_angular, kind, x_m=1.0, y_m=0.0)


def test_clearance_of_a_circle_is_counted_from_its_rim() -> None:
    assert Circle(0.25).clearance(one(0.6, -0.8))[0] == pytest.approx(0.75)
    assert Circle(0.25).clearance(one(0.0, 0.0))[0] == -0.25


@pytest.mark.parametrize(
    ("point", "clearance_m", "normal"),
    [
        ((1.0, 0.0), 0.7, (1.0, 0.0)),
        ((0.0, 1.0), 0.8, (0.0, 1.0)),
        ((-0.5, 0.1), 0.2, (-1.0, 0.0)),
        ((0.6, 0.6), 0.5, (0.6, 0.8)),
        ((0.25, 0.0), -0.05, (1.0, 0.0)),
        ((0.3, 0.0), 0.0, (1.0, 0.0)),
    ],
)
def test_clearance_of_a_rectangle(
    point: tuple[float, float], clearance_m: float, normal: tuple[float, float]
) -> None:
    clearances, normals = ConvexPolygon(CORNERS).nearest(one(*point))
    assert clearances[0] == pytest.approx(clearance_m)
    assert normals[0] == pytest.approx(normal)


@pytest.mark.parametrize(
    "corners",
    [
        ((0.0, 0.0), (1.0, 0.0)),
        ((0.0, 0.0), (0.0, 1.0), (1.0, 0.0)),  # clockwise
        ((0.0, 0.0), (1.0, 0.0), (0.2, 0.2), (0.0, 1.0)),  # a dent
        ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)),  # a corner on a side
        ((0.0, 0.0), (1.0, 0.0), (math.nan, 1.0)),
        ((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)),  # a corner twice
        ((0.0, 0.0), (0.5, -3e-10), (1.0, 0.0), (0.0, 1.0)),  # as good as flat
        ((0.0, 1.0), (-0.59, -0.81), (0.95, 0.31), (-0.95, 0.31), (0.59, -0.81)),  # a star winds twice
    ],
)
def test_a_hull_that_is_not_convex_is_refused(corners: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ValueError, match=r"convex|finite"):
        ConvexPolygon(corners)


@given(coordinates, coordinates, velocities)
def test_closing_speed_is_the_rate_at_which_the_clearance_falls(
    x_m: float, y_m: float, velocity: tuple[float, float]
) -> None:
    """Compared with the change of distance after a small motion."""
    linear, angular = velocity
    dt_s = 1e-6
    for hull in HULLS:
        before = seen(hull, one(x_m, y_m))
        if before.nearest()[0] < 1e-3:
            continue
        closing = before.per_linear[0] * linear + before.per_angular[0] * angular
        moved_x, moved_y = x_m - linear * dt_s, y_m
        turn = -angular * dt_s
        shifted = one(
            moved_x * math.cos(turn) - moved_y * math.sin(turn),
            moved_x * math.sin(turn) + moved_y * math.cos(turn),
        )
        after = seen(hull, shifted)
        assert (before.nearest()[0] - after.nearest()[0]) / dt_s == pytest.approx(closing, abs=1e-3)


def test_the_permitted_speed_is_zero_up_to_the_stop_distance_and_above_it_beyond() -> None:
    edge = np.array([-1.0, 0.0, 0.3, math.nextafter(0.3, 0.0), 0.3001])
    speeds = permitted_closing_speed(edge, BARRIER)
    assert list(speeds[:4]) == [0.0, 0.0, 0.0, 0.0]
    assert speeds[4] > 0.0


@given(st.floats(0.3, 20.0))
def test_reacting_and_braking_from_the_permitted_speed_ends_at_the_stop_distance(clearance_m: float) -> None:
    (speed,) = permitted_closing_speed(np.array([clearance_m]), BARRIER)
    travelled = speed * BARRIER.reaction_s + speed**2 / (2 * BARRIER.deceleration_m_s2)
    assert clearance_m - travelled == pytest.approx(0.3, abs=1e-9)


@given(st.lists(st.tuples(coordinates, coordinates), max_size=40), velocities)
def test_after_scaling_nothing_is_approached_faster_than_permitted(
    points: list[tuple[float, float]], velocity: tuple[float, float]
) -> None:
    for hull in HULLS:
        around = seen(hull, np.array(points, dtype=np.float64).reshape(-1, 2))
        scale, _ = permitted_scale(around, *velocity, BARRIER)
        assert 0.0 <= scale <= 1.0
        closing = scale * (around.per_linear * velocity[0] + around.per_angular * velocity[1])
        permitted = permitted_closing_speed(around.clearance_m, BARRIER)
        assert (closing <= np.maximum(permitted, 0.01) + 1e-9).all()


def test_turning_on_the_spot_stays_free_for_a_round_robot_and_not_for_a_corner() -> None:
    close = one(0.35, 0.25)
    assert permitted_scale(seen(Circle(0.4), close), 0.0, 1.0, BARRIER) == (1.0, None)
    scale, block = permitted_scale(seen(RECTANGLE, close), 0.0, 1.0, BARRIER)
    assert scale == 1.0 or block is not None
    swept = one(0.2, 0.3)  # beside the path of the front left corner
    assert permitted_scale(seen(RECTANGLE, swept), 0.0, 1.0, BARRIER)[0] == 0.0


def test_no_points_permit_everything() -> None:
    around = seen(Circle(0.25), np.empty((0, 2)))
    assert permitted_scale(around, 1.0, 0.0, BARRIER) == (1.0, None)
    assert around.points.shape == (0, 2)
    assert len(around.clearance_m) == len(around.per_linear) == len(around.per_angular) == 0


@pytest.mark.parametrize("hull", HULLS, ids=["circle", "rectangle"])
def test_with_hidden_places_all_around_nothing_moves_outward(hull: Hull) -> None:
    blind = hidden(hull, outline(hull))
    scale, block = permitted_scale(blind, 0.5, 0.0, BARRIER)
    assert scale == 0.0
    assert block is not None
    assert block.kind is Kind.HIDDEN
    creeping = BARRIER._replace(hidden_creep_m_s=0.1)
    assert permitted_scale(blind, 0.5, 0.0, creeping)[0] == pytest.approx(0.2, abs=1e-3)


def test_with_a_creep_into_hidden_places_an_arc_is_slowed_to_it_and_not_stopped() -> None:
    """The way ahead of an arc permits the creep as well, counted at the fastest point of the hull."""
    creeping = BARRIER._replace(hidden_creep_m_s=0.3)
    beside = hidden(Circle(0.25), one(0.05, 0.56))
    assert permitted_scale(beside, 0.8, 0.0, BARRIER) == (1.0, None), "it lies beside a straight way"
    slow, block = permitted_scale(beside, 0.8, 2.0, BARRIER)
    assert block is not None
    assert block.kind is Kind.HIDDEN
    crept, _ = permitted_scale(beside, 0.8, 2.0, creeping)
    assert slow < 0.2 < crept == pytest.approx(0.3 / (0.8 + 2.0 * 0.25))
    inside = hidden(Circle(0.25), one(0.15, 0.5))
    assert permitted_scale(inside, 0.16, 0.48, BARRIER)[0] == 0.0
    assert permitted_scale(inside, 0.16, 0.48, creeping) == (1.0, None), "no faster than the creep"


def test_a_round_robot_may_turn_on_the_spot_among_hidden_places_and_a_corner_may_not() -> None:
    circle = Circle(0.25)
    assert permitted_scale(hidden(circle, outline(circle)), 0.0, 1.0, BARRIER) == (1.0, None)
    assert permitted_scale(hidden(RECTANGLE, outline(RECTANGLE)), 0.0, 1.0, BARRIER)[0] == 0.0


@given(
    st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=5),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-1.0, 1.0)),
)
def test_points_seen_from_the_moved_robot_are_where_they_were(
    points: list[tuple[float, float]], displacement: tuple[float, float, float]
) -> None:
    x_m, y_m, yaw_rad = displacement
    before = np.array(points)
    after = moved(before, displacement)
    turn = np.array([[math.cos(yaw_rad), -math.sin(yaw_rad)], [math.sin(yaw_rad), math.cos(yaw_rad)]])
    assert after @ turn.T + (x_m, y_m) == pytest.approx(before, abs=1e-9)


def test_points_come_nearer_by_what_the_robot_drives_toward_them() -> None:
    assert moved(one(1.0, 0.2), (0.5, 0.0, 0.0)).tolist() == [[0.5, 0.2]]
    assert moved(one(1.0, 0.0), (0.0, 0.0, math.pi / 2))[0] == pytest.approx([0.0, -1.0])


def test_a_block_knows_what_approaches_it() -> None:
    ahead = any_block(Kind.SEEN)
    assert ahead.is_approached_by(math.nextafter(0.001, 1.0), 0.0)
    assert not ahead.is_approached_by(0.001, 5.0)
    assert any_block(Kind.SEEN, 0.0, 0.5).is_approached_by(0.0, 1.0)
    assert not any_block(Kind.SEEN, 0.0, 0.5).is_approached_by(0.0, -1.0)
    assert not ahead.is_approached_by(-1.0, 0.0)


@pytest.mark.parametrize("count", [3, 4, 5, 12])
def test_regular_polygons_of_any_size_are_hulls_with_outward_normals(count: int) -> None:
    """Also with corners in whole metres, as a configuration may give them."""
    angles = np.arange(count) * 2 * np.pi / count
    hull = ConvexPolygon(tuple((3.0 * math.cos(a) + 1.0, 2.0 * math.sin(a) - 0.5) for a in angles))
    start = np.array(hull.corners)
    side = np.roll(start, -1, axis=0) - start
    outward = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.hypot(*side.T)[:, None]
    middle = start + 0.4 * side
    assert hull.clearance(middle) == pytest.approx(0.0, abs=1e-12)
    distances, normals = hull.nearest(middle + 0.01 * outward)
    assert distances == pytest.approx(0.01)
    assert normals == pytest.approx(outward)
    centre = np.array([1.0, -0.5])
    assert hull.clearance(centre + 0.99 * (middle - centre)).max() < 0.0
    assert hull.radius_m == pytest.approx(max(math.hypot(x, y) for x, y in hull.corners))


def test_a_triangle_in_whole_metres_is_a_hull() -> None:
    clearance, normal = ConvexPolygon(((0, 0), (1, 0), (0, 1))).nearest(one(0.25, -0.5))
    assert clearance[0] == 0.5
    assert tuple(normal[0]) == (0.0, -1.0)


@pytest.mark.parametrize(
    ("corners", "sentence"),
    [
        (((0.0, 0.0), (1.0, 0.0)), "a polygon needs at least three finite corners (x, y)"),
        ((1.0, 2.0, 3.0), "a polygon needs at least three finite corners (x, y)"),
        (((0.0, 0.0), (1.0, math.inf), (0.0, 1.0)), "a polygon needs at least three finite corners (x, y)"),
        (((0.0, 0.0), (0.0, 1.0), (1.0, 0.0)), "the polygon must be convex, its corners counter-clockwise"),
        (
            ((0.0, 1.0), (-0.59, -0.81), (0.95, 0.31), (-0.95, 0.31), (0.59, -0.81)),
            "the polygon must be convex, its corners counter-clockwise",
        ),
    ],
)
def test_each_refusal_of_a_hull_is_a_sentence(
    corners: tuple[tuple[float, float], ...], sentence: str
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        ConvexPolygon(corners)


def test_a_small_convex_hull_is_not_taken_for_flat() -> None:
    tiny = ConvexPolygon(tuple((x / 10, y / 10) for x, y in CORNERS))
    assert tiny.clearance(one(1.0, 0.0))[0] == pytest.approx(0.97)


def test_closing_no_faster_than_the_tolerance_is_not_closing() -> None:
    near = seen(Circle(0.25), one(0.548, 0.0))
    assert permitted_scale(near, 0.01, 0.0, BARRIER) == (1.0, None)
    scale, block = permitted_scale(near, math.nextafter(0.01, 1.0), 0.0, BARRIER)
    assert scale == 0.0
    assert block == Block(1.0, 0.0, Kind.SEEN, 0.548, 0.0)


def test_deep_inside_the_stop_distance_hardly_anything_is_slow_enough() -> None:
    """Found by a random drive: 0.0099 m/s crept from 31 cm to 11 cm."""
    edge = Circle(0.25).radius_m + BARRIER.stop_distance_m - DEEP_M
    for x_m, tolerance_m_s in ((edge + 1e-9, 0.01), (edge - 1e-9, 0.001)):
        near = seen(Circle(0.25), one(x_m, 0.0))
        assert permitted_scale(near, tolerance_m_s, 0.0, BARRIER) == (1.0, None)
        assert permitted_scale(near, math.nextafter(tolerance_m_s, 1.0), 0.0, BARRIER)[0] == 0.0


@pytest.mark.parametrize("creep_m_s", [0.0, 0.01, 0.2])
def test_closing_on_a_hidden_place_no_faster_than_the_creep_or_the_tolerance_is_not_closing(
    creep_m_s: float,
) -> None:
    """However deep inside the stop distance: a blind lidar always has a hidden place at the hull."""
    barrier = BARRIER._replace(hidden_creep_m_s=creep_m_s)
    near = hidden(Circle(0.25), one(0.25, 0.0))
    slow_m_s = max(0.01, creep_m_s)
    assert permitted_scale(near, slow_m_s, 0.0, barrier) == (1.0, None)
    scale, block = permitted_scale(near, 2.0 * slow_m_s, 0.0, barrier)
    assert scale == pytest.approx(creep_m_s / (2.0 * slow_m_s))
    assert block == Block(1.0, 0.0, Kind.HIDDEN, 0.25, 0.0)


def test_a_remembered_point_limits_as_a_seen_one_does_and_says_what_it_is() -> None:
    for point in (one(0.548, 0.0), one(0.7, 0.1), one(0.2, 0.6)):
        for twist in ((0.5, 0.0), (0.9, 1.8)):
            as_seen, block = permitted_scale(seen(Circle(0.25), point), *twist, BARRIER)
            remembered = survey(Circle(0.25), point, Kind.REMEMBERED)
            scale, other = permitted_scale(remembered, *twist, BARRIER)
            assert scale == as_seen
            assert (block is None) == (other is None)
            assert block is None or other == block._replace(kind=Kind.REMEMBERED)


def test_exactly_what_is_permitted_is_no_limit() -> None:
    far = seen(Circle(0.25), one(1.0, 0.0))
    (permitted,) = permitted_closing_speed(far.clearance_m, BARRIER)
    assert permitted_scale(far, float(permitted), 0.0, BARRIER) == (1.0, None)
    assert permitted_scale(far, 1.01 * float(permitted), 0.0, BARRIER)[0] == pytest.approx(1 / 1.01)
    creeping = BARRIER._replace(hidden_creep_m_s=0.25)
    blind = hidden(Circle(0.25), one(0.25, 0.0))
    assert permitted_scale(blind, 0.25, 0.0, creeping) == (1.0, None)
    assert permitted_scale(blind, 0.5, 0.0, creeping)[0] == 0.5


def test_of_where_it_was_and_where_it_is_by_now_the_tighter_limit_counts() -> None:
    hull = Circle(0.25)
    far, near = seen(hull, one(1.0, 0.0)), seen(hull, one(0.7, 0.0))
    alone, block = permitted_scale(near, 1.0, 0.0, BARRIER)
    assert permitted_scale(far, 1.0, 0.0, BARRIER)[0] > alone > 0.0
    assert permitted_scale(far, 1.0, 0.0, BARRIER, near) == (alone, block)
    assert permitted_scale(near, 1.0, 0.0, BARRIER, far) == (alone, block)


def test_the_way_ahead_of_an_arc_begins_where_the_robot_is_by_now() -> None:
    hull = Circle(0.25)
    beside, passed = seen(hull, one(0.2, 0.6)), seen(hull, one(-0.3, 0.6))
    assert permitted_scale(beside, 0.9, 1.8, BARRIER)[0] < 1.0
    assert permitted_scale(beside, 0.9, 1.8, BARRIER, passed) == (1.0, None)


def test_a_turn_among_hidden_places_closes_on_the_side_that_it_turns_to() -> None:
    around = outline(RECTANGLE)
    left_front = (around[:, 1] > 0.2) & (around[:, 0] > 0.0)
    blind = hidden(RECTANGLE, around[left_front])
    scale, block = permitted_scale(blind, 0.0, 1.0, BARRIER)
    assert scale == 0.0
    assert block is not None
    assert block.is_approached_by(0.0, 1.0)
    assert not block.is_approached_by(0.0, -1.0)
    assert permitted_scale(blind, 0.0, -0.04, BARRIER) == (1.0, None)


def test_the_nearest_point_is_named_by_its_clearance_and_its_bearing() -> None:
    around = seen(RECTANGLE, np.array([[2.0, 0.0], [0.0, 0.5], [-3.0, 0.0]]))
    clearance_m, bearing_rad = around.nearest()
    assert clearance_m == pytest.approx(0.3)
    assert bearing_rad == pytest.approx(math.pi / 2)


def test_points_inside_and_outside_of_a_polygon_are_distinguished_in_one_call() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.29, 0.0], [0.6, 0.6]])
    clearances, normals = ConvexPolygon(CORNERS).nearest(points)
    assert clearances == pytest.approx([-0.2, 0.7, -0.01, 0.5])
    assert normals[1:] == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.0], [0.6, 0.8]]))


@pytest.mark.parametrize("hull", HULLS, ids=["circle", "rectangle"])
def test_a_pillar_beside_the_nose_limits_an_arc_toward_it_before_it_closes(hull: Hull) -> None:
    """Found by random drives: the straight line and the present moment are free, but half a second later the hull touches."""
    beside = seen(hull, one(0.2, 0.6))
    assert permitted_scale(beside, 0.9, 0.0, BARRIER) == (1.0, None)
    scale, block = permitted_scale(beside, 0.9, 1.8, BARRIER)
    assert 0.6 < scale < 0.8
    assert block is not None
    assert block.kind is Kind.SEEN
    assert block.is_approached_by(0.9, 1.8)
    assert not block.is_approached_by(-0.9, -1.8)
    mirrored, _ = permitted_scale(seen(hull, one(0.2, -0.6)), 0.9, -1.8, BARRIER)
    assert mirrored == pytest.approx(scale)
    assert permitted_scale(seen(hull, one(-0.2, 0.6)), -0.9, -1.8, BARRIER)[0] == pytest.approx(scale)
    assert permitted_scale(beside, 0.9, -1.8, BARRIER) == (1.0, None)


def test_a_corner_that_sweeps_past_something_is_blocked_by_what_it_closes_on() -> None:
    """Found by hypothesis: now, and when the corner has come near, it moves away; in between it closes.

    A block that the motion itself does not approach would let the stop go with the very command that it stopped.
    """
    hull = ConvexPolygon(((1.0, 0.0), (-0.5, 0.866), (-0.5, -0.866)))
    scale, block = permitted_scale(seen(hull, one(0.0, 1.0)), 0.0, 2.0, Barrier(0.3, 1.5, 1.0, 0.0))
    assert scale == pytest.approx(0.447, abs=0.001)
    assert block is not None
    assert block.per_angular == pytest.approx(0.844, abs=0.001)
    assert block.is_approached_by(0.0, 2.0)
    assert not block.is_approached_by(0.0, -2.0)


@pytest.mark.parametrize(("linear_m_s", "limits"), [(0.00192, False), (0.00193, True)])
def test_what_an_arc_hardly_closes_on_limits_it_only_beyond_what_a_graze_and_slow_closing_add_up_to(
    linear_m_s: float, *, limits: bool
) -> None:
    """Found by hypothesis: closed on at less than 1 mm/s for more than 1 s, it blocked, and was not approached."""
    hull = Circle(1.0)
    beside = one(1.3045 * math.cos(0.46365), 1.3045 * math.sin(0.46365))
    scale, block = permitted_scale(survey(hull, beside), linear_m_s, 1.0, Barrier(0.3, 1.5, 1.0, 0.0))
    assert (scale < 1.0) is limits
    assert block is None or block.is_approached_by(linear_m_s, 1.0)


@given(
    st.tuples(st.floats(0.1, 1.0), st.floats(-2.0, 2.0)),
    st.floats(0.2, 2.0),
    st.floats(-1.5, 1.5),
    st.floats(0.05, 0.3),
)
def test_reacting_and_braking_along_the_arc_never_enters_the_stop_distance(
    velocity: tuple[float, float], distance_m: float, bearing_rad: float, reaction_s: float
) -> None:
    """The exact path of the hull, in fine steps, from the permitted speed to rest."""
    barrier = BARRIER._replace(reaction_s=reaction_s)
    point = (0.25 + distance_m) * math.cos(bearing_rad), (0.25 + distance_m) * math.sin(bearing_rad)
    hull = Circle(0.25)
    around = seen(hull, one(*point))
    if around.nearest()[0] < 0.32:
        return
    scale, _ = permitted_scale(around, *velocity, barrier)
    linear, angular = velocity
    braked = max(abs(linear), abs(angular) * hull.radius_m) / barrier.deceleration_m_s2
    progress_s = scale * reaction_s + scale**2 * braked / 2.0
    turn = angular * np.linspace(0.0, progress_s, 200)
    way = linear * np.linspace(0.0, progress_s, 200)
    x_m, y_m = way * np.sinc(turn / np.pi), way * (turn / 2) * np.sinc(turn / (2 * np.pi)) ** 2
    gaps = np.hypot(point[0] - x_m, point[1] - y_m) - 0.25
    assert gaps.min() > barrier.stop_distance_m - 0.002


@pytest.mark.parametrize("clearance_m", [0.32, 0.4, 0.5, 0.6])
@pytest.mark.parametrize("linear_m_s", [1.0, -1.0])
def test_for_a_wall_at_a_slant_the_base_brakes_along_its_way(linear_m_s: float, clearance_m: float) -> None:
    """The closing speed falls with 0.71·a only, so that the closing speed of now permits 1.4 times the kinetic energy."""
    diamond = ConvexPolygon(((0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)))
    foot = math.copysign(0.15 + clearance_m * math.sqrt(0.5), linear_m_s)
    along = np.linspace(-0.5, 0.5, 21)
    wall = np.column_stack((foot + along, abs(foot) - math.copysign(1.0, linear_m_s) * along))
    scale, _ = permitted_scale(seen(diamond, wall), linear_m_s, 0.0, BARRIER)
    way_m = scale * BARRIER.reaction_s + scale**2 / (2.0 * BARRIER.deceleration_m_s2)
    left_m = diamond.clearance(wall - (way_m * linear_m_s, 0.0)).min()
    assert BARRIER.stop_distance_m - 0.002 < left_m < BARRIER.stop_distance_m + 0.02


LONG = ((2.0, -0.4), (2.0, 0.4), (-2.0, 0.4), (-2.0, -0.4))


@pytest.mark.parametrize(
    ("hull", "point", "twist", "reaction_s", "scale", "rates"),
    [
        (Circle(0.25), (0.2, 0.6), (0.9, 1.8), 0.1, 0.71222, (0.4107, 0.0)),
        (Circle(0.25), (0.5, 0.28), (0.5, 2.0), 0.1, 0.21707, (0.89972, 0.0)),
        (Circle(0.25), (0.2, -0.52), (0.8, -2.0), 0.1, 0.0, (0.36228, 0.0)),
        (RECTANGLE, (0.2, 0.6), (0.9, 1.8), 0.1, 0.72966, (0.0, 0.22358)),
        (RECTANGLE, (0.56, 0.35), (0.3, 1.5), 0.2, 0.0037, (0.86619, -0.02332)),
        (RECTANGLE, (-0.32, -0.54), (-0.3, 2.0), 0.1, 0.3036, (-0.05872, 0.28774)),
        (ConvexPolygon(LONG), (1.8, 1.2), (0.3, 0.7), 0.1, 0.78573, (0.0, 1.94892)),
        # Entered before the first of the checked poses.
        (ConvexPolygon(LONG), (0.24, 0.8), (0.9, 1.7), 0.1, 0.36166, (0.0, 0.31923)),
        (ConvexPolygon(LONG), (-0.23, -0.72), (-0.6, -1.8), 0.4, 0.2555, (0.0, -0.28981)),
        (Circle(0.25), (1.0, 1.0), (0.7, 0.9), 1.5, 0.80302, (0.99997, 0.0)),
        (Circle(0.25), (0.9, 0.35), (1.0, 1.0), 0.3, 0.75696, (0.99942, 0.0)),
        (Circle(0.25), (0.99033, 0.0), (1.0, 0.001), 0.1, 0.99608, (1.0, 0.0)),
    ],
)
def test_what_an_arc_is_permitted_is_known_to_the_fourth_digit(
    hull: Hull,
    point: tuple[float, float],
    twist: tuple[float, float],
    reaction_s: float,
    scale: float,
    rates: tuple[float, float],
) -> None:
    """Figures of this code, each within 2 % of the exact way: a change of any of them needs a reason."""
    barrier = BARRIER._replace(reaction_s=reaction_s)
    permitted, block = permitted_scale(seen(hull, one(*point)), *twist, barrier)
    assert permitted == pytest.approx(scale, abs=2e-4)
    assert block is not None
    assert (block.per_linear, block.per_angular) == pytest.approx(rates, abs=2e-4)
    assert (block.kind, block.x_m, block.y_m) == (Kind.SEEN, *point)


def test_the_least_turn_that_a_float_can_say_is_limited_as_a_slight_one_is() -> None:
    ahead = seen(Circle(0.25), one(0.7, 0.0))
    slight, _ = permitted_scale(ahead, 1.0, 1e-9, BARRIER)
    assert permitted_scale(ahead, 1.0, 5e-324, BARRIER)[0] == pytest.approx(slight)


def test_what_limits_is_reported_only_where_it_leaves_less_than_is_worth_moving_for() -> None:
    beside = seen(Circle(0.25), one(0.2, 0.6))
    scale, block = permitted_scale(beside, 0.9, 1.8, BARRIER)
    assert block is not None
    assert permitted_scale(beside, 0.9, 1.8, BARRIER, worth=scale) == (scale, None)
    assert permitted_scale(beside, 0.9, 1.8, BARRIER, worth=math.nextafter(scale, 1.0)) == (scale, block)


def test_what_is_at_the_very_centre_of_a_round_hull_is_closed_on_by_driving_and_not_by_turning() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    clearance, per_linear, per_angular = Circle(0.25).approach(points)
    assert clearance.tolist() == [-0.25, 0.75]
    assert per_linear.tolist() == [1.0, 1.0]
    assert per_angular.tolist() == [0.0, 0.0]
    assert Circle(0.25).nearest(points)[1].tolist() == [[1.0, 0.0], [1.0, 0.0]]


def test_a_round_hull_closes_on_a_point_along_the_normal_of_its_nearest_point() -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 2))
    clearance, per_linear, _ = Circle(0.25).approach(points)
    distances, normals = Circle(0.25).nearest(points)
    assert clearance.tolist() == distances.tolist()
    assert per_linear.tolist() == normals[:, 0].tolist()


@pytest.mark.parametrize(
    ("point", "twist", "reaction_s"),
    [((-0.77, -0.64), (-0.8, 0.9), 0.3), ((0.69, 0.17), (0.4, 0.4), 0.2), ((0.23, 0.72), (0.6, 1.8), 0.3)],
)
def test_what_an_arc_comes_near_only_after_it_has_come_to_rest_limits_nothing(
    point: tuple[float, float], twist: tuple[float, float], reaction_s: float
) -> None:
    barrier = BARRIER._replace(reaction_s=reaction_s)
    assert permitted_scale(seen(Circle(0.25), one(*point)), *twist, barrier) == (1.0, None)


def test_exactly_at_the_depth_the_wider_tolerance_still_holds() -> None:
    depth_m = BARRIER.stop_distance_m - DEEP_M
    near = seen(Circle(0.25), one(0.25 + depth_m, 0.0))._replace(clearance_m=np.array([depth_m]))
    assert permitted_scale(near, 0.005, 0.0, BARRIER) == (1.0, None)
    deeper_m = math.nextafter(depth_m, 0.0)
    near = near._replace(clearance_m=np.array([deeper_m]))
    assert permitted_scale(near, 0.005, 0.0, BARRIER)[0] == 0.0


# --- where rays meet the hull

OUTLINES: dict[str, Hull] = {
    "round": Circle(0.25),
    "box": ConvexPolygon(((0.4, -0.2), (0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2))),
    "triangle": ConvexPolygon(((0.5, 0.0), (-0.2, 0.3), (-0.2, -0.3))),
}


@pytest.mark.parametrize("name", OUTLINES)
@given(x_m=st.floats(-1.0, 1.0), y_m=st.floats(-1.0, 1.0), angle_rad=st.floats(-4.0, 4.0))
def test_a_ray_is_inside_the_hull_exactly_between_where_it_enters_and_leaves(
    name: str, x_m: float, y_m: float, angle_rad: float
) -> None:
    hull, direction = OUTLINES[name], np.array([[math.cos(angle_rad)], [math.sin(angle_rad)]])
    enters_m, leaves_m = (ends.item() for ends in hull.crossing(x_m, y_m, direction))
    along_m = np.linspace(0.0, 3.0, 301)
    inside = hull.clearance(np.array([x_m, y_m]) + along_m[:, None] * direction.T) < -1e-9
    assert not inside[(along_m < enters_m - 1e-6) | (along_m > leaves_m + 1e-6)].any()
    assert (hull.clearance(np.array([x_m, y_m]) + along_m[:, None] * direction.T) < 1e-9)[
        (along_m > enters_m + 1e-6) & (along_m < leaves_m - 1e-6)
    ].all()
    if enters_m == math.inf:
        assert leaves_m == 0.0


@pytest.mark.parametrize(
    ("x_m", "y_m", "direction", "enters_m", "leaves_m"),
    [
        pytest.param(0.0, 0.0, (1.0, 0.0), 0.0, 0.4, id="from inside"),
        pytest.param(-1.0, 0.1, (1.0, 0.0), 0.6, 1.4, id="through it"),
        pytest.param(-1.0, 0.1, (-1.0, 0.0), math.inf, 0.0, id="away from it"),
        pytest.param(-1.0, 0.3, (1.0, 0.0), math.inf, 0.0, id="past it"),
        pytest.param(0.0, 1.0, (0.0, -1.0), 0.8, 1.2, id="across it"),
        pytest.param(-1.0, 0.2, (1.0, 0.0), 0.6, 1.4, id="along its side"),
        pytest.param(0.4, 0.0, (1.0, 0.0), math.inf, 0.0, id="from its edge outwards"),
        pytest.param(0.4, 0.0, (-1.0, 0.0), 0.0, 0.8, id="from its edge inwards"),
    ],
)
def test_where_a_ray_enters_and_leaves_a_box(
    x_m: float, y_m: float, direction: tuple[float, float], enters_m: float, leaves_m: float
) -> None:
    crossing = OUTLINES["box"].crossing(x_m, y_m, np.array(direction)[:, None])
    assert crossing.enters_m.item() == pytest.approx(enters_m)
    assert crossing.leaves_m.item() == pytest.approx(leaves_m)


def test_where_a_ray_enters_and_leaves_a_round_hull() -> None:
    rays = np.array(((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))).T
    enters_m, leaves_m = Circle(0.25).crossing(-1.0, 0.15, rays)
    assert enters_m.tolist() == pytest.approx([0.8, math.inf, math.inf])
    assert leaves_m.tolist() == pytest.approx([1.2, 0.0, 0.0])
