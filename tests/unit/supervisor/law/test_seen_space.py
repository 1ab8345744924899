"""Where something may hide: what the beams do not rule out, and what other views do."""

import math
from unittest.mock import patch

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervisor.law import seen_space
from supervisor.law.clearance import (
    Barrier,
    Circle,
    ConvexPolygon,
    Floats,
    Hull,
    Kind,
    permitted_scale,
    survey,
)
from supervisor.law.own_way import OwnWay
from supervisor.law.reckoning import Pose
from supervisor.law.scan import Geometry, Mount, Rays, View, rays_of
from supervisor.law.seen_space import (
    SEEN_MARGIN_M,
    Evidence,
    Lookout,
    hidden_places,
    hiding_distance_m,
    lookout,
)
from tests.unit.supervisor.law.views import BEAM_RAD, BEAMS, gap_to_rays_m, view_of

SMALLEST_M = 0.04
HULL = Circle(0.25)
RECTANGLE = ConvexPolygon(((0.3, -0.2), (0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2)))
AHEAD = BEAMS // 2
HERE = Pose(0.0, 0.0, 0.0)
UNKNOWN, NO_RETURN = math.nan, math.inf


def room(distance_m: float = 3.0) -> Floats:
    return np.full(BEAMS, distance_m)


def with_hole(beams: int, around: int = AHEAD, distance_m: float = 3.0) -> Floats:
    """A room with so many beams that prove nothing around one of them."""
    readings = room(distance_m)
    readings[around - beams // 2 : around - beams // 2 + beams] = UNKNOWN
    return readings


def hidden(
    view: View,
    *others: Evidence,
    hull: Hull = HULL,
    mount: Mount | None = None,
    reach_m: float = 1.5,
) -> Floats:
    """The hidden places on the rays alone; those along the edges of holes are tested below."""
    with patch.object(seen_space, "ALONG_EDGE_M", np.empty(0)):
        return hidden_places(view, mount or Mount(), hull, SMALLEST_M, reach_m, lambda: others)


def away_m(places: Floats) -> Floats:
    """From the base frame's origin."""
    return np.hypot(places[:, 0], places[:, 1])


def bearing_deg(places: Floats) -> Floats:
    return np.degrees(np.arctan2(places[:, 1], places[:, 0]))


# --- one lidar


@pytest.mark.parametrize("gap_deg", [0.25, 1.0, 4.0, 30.0, 120.0, 179.9])
def test_from_the_hiding_distance_on_a_disc_fits_between_two_rays_and_not_before(gap_deg: float) -> None:
    half_rad = math.radians(gap_deg) / 2
    (nearest_m,) = hiding_distance_m(np.array([2 * half_rad]), SMALLEST_M).tolist()
    centre_m = nearest_m + SMALLEST_M / 2
    assert centre_m * math.sin(half_rad) == pytest.approx(SMALLEST_M / 2), "it touches both"


def test_in_half_a_turn_and_more_something_hides_from_the_lidar_on() -> None:
    assert hiding_distance_m(np.array([math.pi, 4.0, 2 * math.pi]), SMALLEST_M).tolist() == [0.0] * 3


def test_a_view_without_a_hole_whose_beams_are_close_enough_hides_nothing_within_reach() -> None:
    fits_m = float(hiding_distance_m(np.array(BEAM_RAD), SMALLEST_M))
    reach_m = fits_m - HULL.radius_m
    assert len(hidden(view_of(room()), reach_m=math.nextafter(reach_m, 0.0))) == 0
    beyond = hidden(view_of(room()), reach_m=reach_m + 1e-9)
    assert len(beyond) == BEAMS
    assert away_m(beyond) == pytest.approx(fits_m)
    assert np.sort(bearing_deg(beyond)) == pytest.approx(np.arange(-179.5, 180.0))


def test_between_two_beams_that_return_from_nearer_nothing_hides() -> None:
    fits_m = float(hiding_distance_m(np.array(BEAM_RAD), SMALLEST_M))
    assert len(hidden(view_of(room(fits_m)), reach_m=3.0)) == 0
    one_farther = room(fits_m)
    one_farther[AHEAD] = 3.0
    assert bearing_deg(hidden(view_of(one_farther), reach_m=3.0)) == pytest.approx([-0.5, 0.5])


def test_a_coarse_lidar_hides_things_near_it_in_the_middle_between_its_beams() -> None:
    coarse = view_of(np.full(90, 3.0), Geometry(90, -math.pi, math.radians(4.0)))
    places = hidden(coarse)
    assert len(places) == 90
    assert away_m(places) == pytest.approx(0.553, abs=1e-3)
    assert np.sort(bearing_deg(places)) == pytest.approx(np.arange(-178.0, 180.0, 4.0))
    wide = hidden(coarse, hull=Circle(0.7))
    assert away_m(wide) == pytest.approx(0.7), "nothing can be inside the hull"


def test_the_gap_between_the_last_beam_and_the_first_counts_with_its_own_width() -> None:
    """Drivers that leave half a beam out still go all around; the first law looked for that gap too far out."""
    beams = 240
    increment = 2 * math.pi / (beams + 0.49)
    view = view_of(np.full(beams, 3.0), Geometry(beams, -math.pi, increment))
    rest_rad = 2 * math.pi - (beams - 1) * increment
    fits_m = float(hiding_distance_m(np.array(rest_rad), SMALLEST_M))
    seam_deg = 180.0 - math.degrees(rest_rad) / 2
    places = hidden(view)
    nearest = away_m(places).argmin()
    assert away_m(places)[nearest] == pytest.approx(fits_m)
    assert bearing_deg(places)[nearest] % 360.0 == pytest.approx(seam_deg)
    dirty = room()
    dirty[:6], dirty[-5:] = UNKNOWN, UNKNOWN
    helped = hidden(view_of(dirty), lookout(view, Mount(), HERE, HERE))
    in_seam = np.abs(bearing_deg(helped) % 360.0 - seam_deg) < math.degrees(rest_rad) / 2 - 1e-6
    assert in_seam.any()
    assert away_m(helped[in_seam]).max() < fits_m
    assert away_m(helped[~in_seam]).min() > fits_m


def test_in_a_hole_something_hides_from_where_it_fits_between_its_edges() -> None:
    small = Circle(0.1)
    places = hidden(view_of(with_hole(11)), hull=small)
    assert np.sort(bearing_deg(places)) == pytest.approx(np.arange(-5.0, 6.0))
    fits_m = float(hiding_distance_m(np.array(12 * BEAM_RAD), SMALLEST_M))
    assert away_m(places) == pytest.approx(fits_m)
    assert away_m(hidden(view_of(with_hole(11)))) == pytest.approx(HULL.radius_m), "no nearer than the hull"


def test_a_hole_across_the_first_beam_is_one_hole() -> None:
    readings = room()
    readings[:6], readings[-5:] = UNKNOWN, UNKNOWN
    places = hidden(view_of(readings), hull=Circle(0.1))
    assert len(places) == 11
    assert away_m(places) == pytest.approx(
        float(hiding_distance_m(np.array(12 * BEAM_RAD), SMALLEST_M)), abs=1e-9
    )


def test_nothing_hides_in_a_hole_whose_both_edges_return_from_nearer() -> None:
    one_beam_m = float(hiding_distance_m(np.array(2 * BEAM_RAD), SMALLEST_M))
    assert len(hidden(view_of(with_hole(1, distance_m=one_beam_m)))) == 0
    deeper = with_hole(1, distance_m=one_beam_m)
    deeper[AHEAD + 1] = one_beam_m + 0.01
    assert away_m(hidden(view_of(deeper))) == pytest.approx(one_beam_m)
    assert len(hidden(view_of(with_hole(1)), reach_m=one_beam_m - HULL.radius_m - 1e-6)) == 0


def test_outside_of_a_fan_s_view_something_hides_at_the_hull_in_steps_of_two_degrees() -> None:
    for sign in (1, -1):
        fan = view_of(np.full(181, 3.0), Geometry(181, -sign * math.pi / 2, sign * BEAM_RAD))
        places = hidden(fan)
        assert away_m(places) == pytest.approx(HULL.radius_m)
        bearings = np.sort(bearing_deg(places) % 360.0)
        assert (bearings[0], bearings[-1]) == pytest.approx((92.0, 268.0))
        assert np.diff(bearings).max() <= 2.0 + 1e-9


@pytest.mark.parametrize(("range_max_m", "hides"), [(0.6, True), (1.74, True), (1.75, False)])
def test_beyond_its_range_a_beam_without_a_return_proves_nothing(range_max_m: float, *, hides: bool) -> None:
    readings = room(NO_RETURN)
    readings[:AHEAD] = 0.5
    places = hidden(view_of(readings, range_max_m=range_max_m))
    assert len(places) == (BEAMS - AHEAD if hides else 0)
    # A disc that touches the ends of two neighbouring rays reaches between them, beyond the line of their ends.
    bulge_m = SMALLEST_M / 2 - math.sqrt((SMALLEST_M / 2) ** 2 - (range_max_m * BEAM_RAD / 2) ** 2)
    assert away_m(places) == pytest.approx(range_max_m - bulge_m, abs=1e-9)
    assert (bearing_deg(places) > -1e-6).all(), "where something returns it is seen"


@pytest.mark.parametrize("lidar_x_m", [0.0, 0.4])
def test_a_range_that_ends_inside_the_hull_proves_nothing_beyond_the_hull_s_outline(lidar_x_m: float) -> None:
    readings = room(NO_RETURN)
    readings[AHEAD] = 0.2
    places = hidden(view_of(readings, range_max_m=0.2), mount=Mount(x_m=lidar_x_m))
    assert len(places) == BEAMS - 1
    assert HULL.clearance(places).min() == pytest.approx(0.0, abs=1e-9)


# --- where the lidar is mounted


def test_in_a_hole_of_a_lidar_off_the_centre_something_hides_at_the_hull_s_own_outline() -> None:
    places = hidden(view_of(with_hole(41)), hull=RECTANGLE, mount=Mount(0.2, 0.1, 0.5))
    assert RECTANGLE.clearance(places) == pytest.approx(0.0, abs=1e-6)
    assert len(places) == 41


def test_a_lidar_on_the_hull_s_edge_sees_nothing_of_what_is_behind_the_hull() -> None:
    fan = view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD))
    places = hidden(fan, mount=Mount(x_m=0.25))
    assert len(places) == 89
    assert HULL.clearance(places) == pytest.approx(0.0, abs=1e-6)


def test_behind_a_lidar_ahead_of_the_hull_something_may_stand_before_and_behind_the_hull() -> None:
    fan = view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD))
    places = hidden(fan, mount=Mount(x_m=0.6), reach_m=1.0)
    clearance_m = HULL.clearance(places)
    before = away_m(places - (0.6, 0.0)) < 1e-9
    assert before.any()
    assert clearance_m[before] == pytest.approx(0.35)
    assert clearance_m[~before] == pytest.approx(0.0, abs=1e-6)
    assert places[~before, 0].max() < 0.25


def test_between_a_lidar_and_a_hull_too_near_for_the_smallest_thing_nothing_stands() -> None:
    readings = room()
    readings[:21], readings[-20:] = UNKNOWN, UNKNOWN
    fits_m = float(hiding_distance_m(np.array(42 * BEAM_RAD), SMALLEST_M))
    assert fits_m < SMALLEST_M
    for gap_m, stands in ((SMALLEST_M - 1e-6, False), (SMALLEST_M + 1e-6, True)):
        places = hidden(view_of(readings), mount=Mount(x_m=0.25 + gap_m), reach_m=1.0)
        straight_back = np.abs(places[:, 1]) < 1e-6
        expected_m = [-0.25, *([0.25 + gap_m - fits_m] if stands else [])]
        assert np.sort(places[straight_back, 0]) == pytest.approx(expected_m, abs=1e-6)


# --- what other views have seen


def other(readings: Floats, x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0) -> Lookout:
    return lookout(view_of(readings), Mount(x_m, y_m, yaw_rad), HERE, HERE)


def test_a_hole_that_another_lidar_sees_free_hides_nothing() -> None:
    dirty = view_of(with_hole(11))
    assert len(hidden(dirty)) == 11
    assert len(hidden(dirty, other(room(), y_m=0.05, yaw_rad=2.0))) == 0
    everywhere = hidden_places(dirty, Mount(), HULL, SMALLEST_M, 1.5, lambda: [other(room())])
    assert len(everywhere) == 0, "what is hidden beyond the reach limits nothing"


def test_a_hole_is_followed_outward_to_the_last_point_that_another_lidar_sees_free() -> None:
    places = hidden(view_of(with_hole(11)), other(room(1.0), x_m=-0.2))
    assert len(places) == 11
    assert (away_m(places) > 0.6).all()
    assert (away_m(places) < 0.8 - 0.02).all(), "nearer than the other one's returns"


def test_a_hole_is_followed_to_within_a_quarter_of_the_last_step() -> None:
    """Steps end 0.48 and 0.6 m behind the hull: the returns of the other one are between them."""
    places = away_m(hidden(view_of(with_hole(11)), other(room(1.0), x_m=-0.2)))
    ahead_m = places.max()
    assert ahead_m == pytest.approx(0.25 + 0.48 + 0.03, abs=1e-6)
    assert ahead_m < 0.8 - SEEN_MARGIN_M < ahead_m + 0.03


def test_a_place_that_nothing_proves_free_stays_where_it_is() -> None:
    """Also if points behind it are seen free."""
    far = lookout(view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD)), Mount(0.4), HERE, HERE)
    assert away_m(hidden(view_of(with_hole(11)), far)) == pytest.approx(0.25)


def test_the_hull_s_own_way_is_free_beyond_a_gap_of_the_other_views() -> None:
    """The other lidar sees the space beyond the hull's own way, and the way begins at the hull."""
    far = lookout(view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD)), Mount(0.4), HERE, HERE)
    way = OwnWay(HULL, np.array(((0.1, 0.0, 0.0), (0.2, 0.0, 0.0))))
    assert len(hidden(view_of(with_hole(31)), far, way)) == 0
    assert away_m(hidden(view_of(with_hole(31)), way)) == pytest.approx(0.44, abs=0.02)


def test_another_lidar_with_the_same_hole_changes_nothing() -> None:
    dirty = view_of(with_hole(11))
    assert hidden(dirty, other(with_hole(31))).tolist() == hidden(dirty).tolist()


def test_a_point_between_two_beams_of_another_lidar_is_free_only_where_nothing_fits_between_them() -> None:
    geometry = Geometry(90, -math.pi, math.radians(4.0))
    coarse = lookout(view_of(np.full(90, 3.0), geometry), Mount(), HERE, HERE)
    places = hidden(view_of(with_hole(11)), coarse)
    assert len(places) == 11
    assert away_m(places).max() < 0.553


def test_beside_another_lidar_s_view_nothing_is_seen_free() -> None:
    fan = view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD))
    behind = view_of(with_hole(11, around=20))
    assert len(hidden(behind, lookout(fan, Mount(), HERE, HERE))) == 11
    assert len(hidden(behind, lookout(fan, Mount(yaw_rad=math.pi), HERE, HERE))) == 0


def test_a_view_of_a_moment_ago_is_looked_at_from_where_the_robot_was() -> None:
    clear, dirty = view_of(room()), view_of(with_hole(11))
    passed = lookout(clear, Mount(0.1, 0.0, 0.2), Pose(1.0, 2.2, 0.5), Pose(1.0, 2.0, 0.5 + math.pi / 2))
    assert (passed.x_m, passed.y_m) == pytest.approx(
        (0.2 * math.cos(0.5), -0.2 * math.sin(0.5) - 0.1), abs=1e-9
    )
    assert passed.yaw_rad == pytest.approx(0.2 - math.pi / 2)
    assert len(hidden(dirty, passed)) == 0
    far = lookout(clear, Mount(), Pose(-9.0, 0.0, 0.0), HERE)
    assert hidden(dirty, far).tolist() == hidden(dirty).tolist()


def test_other_views_are_asked_for_only_where_something_hides() -> None:
    def refuse() -> tuple[Lookout, ...]:
        raise AssertionError("nothing hides")

    assert len(hidden_places(view_of(room()), Mount(), HULL, SMALLEST_M, 1.5, refuse)) == 0


# --- any lidar on any hull


@st.composite
def scenes(draw: st.DrawFn) -> tuple[View, Mount, Hull]:
    """A lidar of any resolution and field of view, with holes, on a hull; rays through the hull are masked."""
    hull: Hull = draw(st.sampled_from([HULL, RECTANGLE, Circle(0.1)]))
    mount = Mount(draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5)), draw(st.floats(-3.0, 3.0)))
    beams = draw(st.sampled_from([24, 60, 90, 180, 360]))
    spread = draw(st.sampled_from([1.0, 0.999, 0.98, 0.75, 0.5, 0.2]))
    increment = draw(st.sampled_from([1, -1])) * spread * 2 * math.pi / beams
    geometry = Geometry(beams, draw(st.floats(-math.pi, math.pi)), increment)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    readings = np.repeat(rng.uniform(0.3, 3.0, 12), -(-beams // 12))[:beams]
    readings[rng.random(beams) < draw(st.sampled_from([0.0, 0.3]))] = NO_RETURN
    readings[rng.random(beams) < draw(st.sampled_from([0.0, 0.02, 0.2]))] = UNKNOWN
    start, width = rng.integers(0, beams), draw(st.sampled_from([0.0, 0.05, 0.3]))
    readings[start : start + round(width * beams)] = UNKNOWN
    rays = rays_of(geometry, mount, hull)
    readings = np.maximum(readings, rays.hull_m)  # nothing can be inside the hull
    inside = float(hull.clearance(np.array([[mount.x_m, mount.y_m]]))[0]) < 0.0
    steps = np.arange(0.0, 1.6, 0.01)
    way = rays.direction.T[:, None, :] * steps[:, None] + (mount.x_m, mount.y_m)
    through = (hull.clearance(way.reshape(-1, 2)).reshape(beams, -1) < 0.0).any(axis=1)
    if not inside:
        readings[through] = UNKNOWN
    readings[0] = 1.0 if np.isnan(readings).all() else readings[0]
    return view_of(readings, geometry, draw(st.sampled_from([0.6, 12.0]))), mount, hull


@settings(max_examples=60)
@given(scene=scenes(), seed=st.integers(0, 2**32))
def test_no_disc_that_touches_no_free_ray_is_nearer_to_the_hull_than_what_is_hidden_or_returns(
    scene: tuple[View, Mount, Hull], seed: int
) -> None:
    """Discs of the smallest diameter at random places; half their diameter is what a place may be off sideways."""
    view, mount, hull = scene
    places = hidden_places(view, mount, hull, SMALLEST_M, 2.0)
    rays = rays_of(view.geometry, mount, hull)
    returns = rays.points(np.flatnonzero(view.hit), view.free_m)
    known_m = hull.clearance(np.concatenate((places, returns))).min(initial=2.0)
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1.2, 1.2, (1500, 2))
    disc_m = hull.clearance(centres) - SMALLEST_M / 2
    nearer = centres[(disc_m >= 0.0) & (disc_m < known_m - SMALLEST_M / 2)]
    touched = gap_to_rays_m(nearer, rays.origin_m[:, 0], rays.direction, view.free_m) < SMALLEST_M / 2
    assert touched.all(), nearer[~touched]


# --- along the edges of holes


def along_edges(view: View, hull: Hull = HULL, mount: Mount | None = None) -> Floats:
    """The hidden places without those that are the nearest on a ray."""
    places = hidden_places(view, mount or Mount(), hull, SMALLEST_M, 1.5)
    on_rays = {tuple(place) for place in hidden(view, hull=hull, mount=mount).tolist()}
    return np.array([place for place in places.tolist() if tuple(place) not in on_rays])


def gap_in_view_m(view: View, points: Floats, mount: Mount | None = None) -> Floats:
    rays = rays_of(view.geometry, mount or Mount(), HULL)
    return gap_to_rays_m(points, rays.origin_m[:, 0], rays.direction, view.free_m)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("beams", [11, 150, 200])
def test_hidden_places_along_edges_of_a_hole_are_of_discs_that_touch_them(beams: int, sign: int) -> None:
    view = view_of(with_hole(beams), Geometry(BEAMS, -sign * math.pi, sign * BEAM_RAD))
    places = along_edges(view)
    assert (places[:, 1] > 0.0).any()
    assert (places[:, 1] < 0.0).any()
    discs = (
        places * (1.0 + SMALLEST_M / 2 / away_m(places))[:, None]
    )  # beyond the point nearest to a round hull
    whole = HULL.clearance(places) > 1e-9  # a disc that overlaps the hull is cut off there
    assert gap_in_view_m(view, discs[whole]) == pytest.approx(SMALLEST_M / 2, abs=1e-9)
    # At most 10 cm apart, out to where no point limits a motion: 1.75 m.
    for side in (1.0, -1.0):
        out_m = np.sort(away_m(discs[whole & (side * places[:, 1] > 0.0)]))
        assert np.diff(out_m).max() < 0.11
        assert out_m[-1] > 1.65


def test_the_first_disc_along_each_edge_touches_both_edges_of_the_hole() -> None:
    small = Circle(0.1)
    places = along_edges(view_of(with_hole(11)), small)
    fits_m = float(hiding_distance_m(np.array(12 * BEAM_RAD), SMALLEST_M))
    nearest = np.sort(away_m(places))[:2]
    assert nearest == pytest.approx([fits_m, fits_m])
    first = places[away_m(places) < fits_m + 1e-6]
    assert first[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_no_hidden_place_along_an_edge_lies_inside_the_hull() -> None:
    fan = view_of(np.full(181, 3.0), Geometry(181, -math.pi / 2, BEAM_RAD))
    places = along_edges(fan, RECTANGLE, Mount(-0.1, 0.05))
    assert len(places)
    assert RECTANGLE.clearance(places).min() >= -1e-9


def test_a_hidden_place_behind_a_corner_limits_backing_where_the_nearest_on_its_ray_does_not() -> None:
    """A robot with one lidar of 210° once backed straight past an object just outside its view."""
    box = ConvexPolygon(((0.21, -0.226), (0.21, 0.226), (-0.21, 0.226), (-0.21, -0.226)))
    mount = Mount(0.186, 0.029, 1.846)
    view = view_of(np.full(641, 3.0), Geometry(641, -1.8355, 0.005736))
    barrier = Barrier(0.3, 1.5, 0.1, 0.0)
    on_rays = survey(box, hidden(view, hull=box, mount=mount), Kind.HIDDEN)
    everywhere = survey(box, hidden_places(view, mount, box, SMALLEST_M, 1.5), Kind.HIDDEN)
    assert permitted_scale(on_rays, -0.5, 0.0, barrier) == (1.0, None)
    scale, block = permitted_scale(everywhere, -0.5, 0.0, barrier)
    assert scale < 0.5
    assert block is not None
    assert (block.x_m, block.y_m) < (-0.21, 0.0)


def test_the_edges_of_a_hole_are_followed_past_the_end_of_a_long_hull() -> None:
    """They ended 2.6 m from the lidar: a hull of 3 m passed something behind it at 10 cm."""
    long = ConvexPolygon(((0.2, -0.3), (0.2, 0.3), (-3.8, 0.3), (-3.8, -0.3)))
    view = view_of(np.full(181, 9.0), Geometry(181, -math.pi / 2, BEAM_RAD))
    mount = Mount(0.1, 0.0, -0.05)
    places = hidden_places(view, mount, long, SMALLEST_M, 1.5)
    assert away_m(places - (mount.x_m, mount.y_m)).max() > long.radius_m + 1.5


def shaded(
    centres: Floats, rays: Rays, view: View, near: npt.NDArray[np.bool_], smallest_m: float
) -> npt.NDArray[np.bool_]:
    """Which discs (n,) stand behind a return inside the stop distance.

    When the robot moves straight on beside such a return, it passes them at a larger distance than the return.
    """
    shades = np.flatnonzero(view.hit)[near]
    away, direction = centres - rays.origin_m[:, 0], rays.direction[:, shades]
    beside_m = np.abs(away[:, :1] * direction[1] - away[:, 1:] * direction[0])
    behind = (beside_m < smallest_m) & (away @ direction > view.free_m[shades])
    return np.asarray(behind.any(axis=1), dtype=np.bool_)


@settings(max_examples=40)
@given(scene=scenes(), seed=st.integers(0, 2**32))
def test_no_disc_that_touches_no_free_ray_is_approached_faster_than_the_hidden_places_permit(
    scene: tuple[View, Mount, Hull], seed: int
) -> None:
    view, mount, hull = scene
    smallest_m, barrier = 0.1, Barrier(0.3, 1.5, 0.15, 0.0)
    rays = rays_of(view.geometry, mount, hull)
    returns = rays.points(np.flatnonzero(view.hit), view.free_m)
    hides = survey(hull, hidden_places(view, mount, hull, smallest_m, 2.0), Kind.HIDDEN)
    known = (hides, survey(hull, returns))
    centres = np.random.default_rng(seed).uniform(-1.6, 1.6, (1500, 2))
    away, normals = hull.nearest(centres)
    free = away > smallest_m / 2
    free &= gap_to_rays_m(centres, rays.origin_m[:, 0], rays.direction, view.free_m) >= smallest_m / 2
    free &= ~shaded(centres, rays, view, hull.clearance(returns) < barrier.stop_distance_m, smallest_m)
    discs = survey(hull, (centres - smallest_m / 2 * normals)[free])
    for twist in ((1.0, 0.0), (-1.0, 0.0), (0.8, 0.8), (-0.8, 0.8), (0.0, 1.5)):
        permitted = min(permitted_scale(around, *twist, barrier)[0] for around in known)
        asked, block = permitted_scale(discs, *twist, barrier, worth=1.0)
        # Places are 4 cm and 2° apart.
        assert permitted <= asked + 0.02, (twist, block)
