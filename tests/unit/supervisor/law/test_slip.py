"""How much farther than odometry shows the robot moved while it stopped."""

import cmath
import math

import numpy as np
import pytest

from supervisor.law import sight as sights
from supervisor.law import slip
from supervisor.law.agreement import beams_at, ranges_at, returns_m, tolerances_m
from supervisor.law.base import Base, brake, measured_stop
from supervisor.law.base_braking import Braking, Ended, Stop
from supervisor.law.decision import Limit
from supervisor.law.model import Odometry
from supervisor.law.reckoning import Odometer, Pose, Velocity
from supervisor.law.scan import Geometry, Mount, View
from supervisor.law.sight import LidarState, Sight
from supervisor.law.slip import (
    LEAST_SLIP_M,
    LEAST_SURFACE_M,
    MOST_S,
    MOST_TURN_RAD,
    NO_MEASUREMENT,
    REST_S,
    SAME_M,
    STANDARD_ERRORS,
    ReferenceScan,
    SlipMeasurement,
    _offsets,  # pyright: ignore[reportPrivateUsage]
    _weighted_median,  # pyright: ignore[reportPrivateUsage]
    measure_slip,
    slip_between,
)
from tests.unit.supervisor.law.law_harness import CONFIG, NEUTRAL, TICK_S, Law, laser_scan, odometry, ring
from tests.unit.supervisor.law.test_agreement import AT_A_CORNER, HERE, START, after, look
from tests.unit.supervisor.law.views import BEAM_RAD, GEOMETRY, view_of

# --- two scans


def shown(before: View, view: View, mount: Mount = HERE) -> tuple[float, float]:
    return slip_between(ReferenceScan.of(before), view, mount)


@pytest.mark.parametrize("mount", [HERE, AT_A_CORNER, Mount(-0.2, 0.1, 2.5)])
@pytest.mark.parametrize("way_m", [0.3, -0.3])
@pytest.mark.parametrize("slip_m", [0.0, 0.1, 0.35, -0.1])
def test_two_scans_show_how_much_farther_than_odometry_the_robot_moved(
    mount: Mount, way_m: float, slip_m: float
) -> None:
    true = after(START, way_m + math.copysign(1.0, way_m) * slip_m, 0.0, 0.0)
    view = look(true, mount, odometer=after(START, way_m, 0.0, 0.0))
    shown_m, error_m = shown(look(START, mount), view, mount)
    assert shown_m == pytest.approx(slip_m, abs=0.015)
    assert 0.0 <= error_m < 0.005


def test_motion_across_the_robot_counts_as_odometry_shows_it() -> None:
    view = look(after(START, 0.4, 0.3, 0.0), odometer=after(START, 0.3, 0.3, 0.0))
    assert shown(look(START), view)[0] == pytest.approx(0.1, abs=0.015)


def test_the_standard_error_covers_noise() -> None:
    errors = list[float]()
    for seed in range(30):
        noise = 0.03 * np.random.default_rng(seed).standard_normal((2, 360))
        there, odometer = after(START, 0.5, 0.0, 0.0), after(START, 0.3, 0.0, 0.0)
        shown_m, error_m = shown(
            look(START, noise=noise[0]), look(there, noise=noise[1], odometer=odometer), HERE
        )
        errors.append((shown_m - 0.2) / error_m)
        assert 0.002 < error_m < 0.02
    assert max(map(abs, errors)) < STANDARD_ERRORS + 1.0
    assert 0.5 < float(np.std(errors)) < 1.5


def test_a_clockwise_lidar_shows_the_same() -> None:
    def clockwise(view: View) -> View:
        geometry = Geometry(360, GEOMETRY.angle_min + 359 * BEAM_RAD, -BEAM_RAD)
        return view._replace(geometry=geometry, free_m=view.free_m[::-1], hit=view.hit[::-1])

    before, view = look(START), look(after(START, 0.4, 0.0, 0.0), odometer=after(START, 0.3, 0.0, 0.0))
    assert shown(clockwise(before), clockwise(view), HERE) == pytest.approx(
        shown(before, view, HERE), abs=2e-3
    )


def in_front(distances_m: np.ndarray, *, moved_m: float = 0.0, turned_rad: float = 0.0) -> View:
    """A view of walls across the travel at these distances from the start, one for each of the beams around zero; no others."""
    ranges = np.full(360, math.inf)
    first = 180 - len(distances_m) // 2
    angles = BEAM_RAD * (np.arange(first, first + len(distances_m)) - 180)
    ranges[first : first + len(distances_m)] = (distances_m - moved_m) / np.cos(angles)
    return view_of(ranges)._replace(pose=Pose(0.0, 0.0, turned_rad))


def test_a_turn_is_not_judged() -> None:
    wall = np.full(90, 2.0)
    for turned_rad, is_judged in ((MOST_TURN_RAD, True), (math.nextafter(MOST_TURN_RAD, 1.0), False)):
        for sign in (1.0, -1.0):
            shown_m, error_m = shown(in_front(wall), in_front(wall, turned_rad=sign * turned_rad), HERE)
            assert math.isnan(shown_m) is not is_judged
            assert math.isnan(error_m) is not is_judged


def test_a_surface_no_wider_than_three_people_is_not_judged() -> None:
    """The three beams at each end have no slope."""
    judged = list[bool]()
    for beams in range(40, 80, 2):
        angles = BEAM_RAD * (np.arange(3, beams - 3) - beams // 2)
        surface_m = BEAM_RAD * float((2.0 / np.cos(angles)).sum())
        wall = np.full(beams, 2.0)
        shown_m, _ = shown(in_front(wall), in_front(wall, moved_m=0.02), HERE)
        if abs(surface_m - LEAST_SURFACE_M) > 0.1:
            judged.append(not math.isnan(shown_m))
            assert judged[-1] is (surface_m > LEAST_SURFACE_M)
    assert set(judged) == {True, False}


@pytest.mark.parametrize(("moving", "is_judged"), [(0.2, True), (0.4, False)])
@pytest.mark.parametrize("slip_m", [0.0, 0.3])
def test_most_of_the_surface_must_agree(moving: float, slip_m: float, *, is_judged: bool) -> None:
    """A part comes 0.5 m nearer than the robot's motion explains."""
    before, now = np.full(120, 3.0), np.full(120, 3.0)
    now[: round(moving * 120)] -= 0.5
    shown_m, _ = shown(in_front(before), in_front(now, moved_m=slip_m), HERE)
    assert shown_m == pytest.approx(slip_m if is_judged else math.nan, abs=0.02, nan_ok=True)


def test_a_wall_counts_more_than_people_who_are_near() -> None:
    """They cover more beams than the wall, but less of its length."""
    before, now = np.full(90, 6.0), np.full(90, 6.0)
    before[20:65], now[20:65] = 1.2, 0.8
    assert shown(in_front(before), in_front(now))[0] == pytest.approx(0.0, abs=0.01)


def test_returns_agree_within_the_tolerance_at_their_range() -> None:
    """At 6 m it is 0.18 m."""
    wall = np.full(60, 6.0)
    off_m = np.tile([-0.1, -0.05, 0.0, 0.05, 0.1], 12)
    assert shown(in_front(wall), in_front(wall + off_m))[0] == pytest.approx(0.0, abs=0.01)


def test_the_first_comparison_is_with_the_motion_that_odometry_shows() -> None:
    """The wall would leave the view if the robot were 1 m farther back."""
    wall = np.full(90, 2.0)
    back = in_front(wall, moved_m=-0.1)._replace(pose=Pose(-0.1, 0.0, 0.0))
    assert shown(in_front(wall), back)[0] == pytest.approx(0.0, abs=0.01)


def test_before_a_wall_the_formula_is_exact_the_first_time(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = np.full(90, 2.0)
    monkeypatch.setattr(slip, "ITERATIONS", 1)
    shown_m, error_m = shown(in_front(wall), in_front(wall, moved_m=0.3))
    assert shown_m == pytest.approx(0.3, abs=0.005)
    assert error_m < 0.001


ORIGIN = Pose(0.0, 0.0, 0.0)


@pytest.mark.parametrize(("beam_degrees", "beside"), [(1, 2), (2, 1), (6, 1)])
def test_each_point_before_a_wall_shows_the_slip_unless_the_slope_beside_it_is_unknown(
    beam_degrees: int, beside: int
) -> None:
    """The slope is measured over 2 degrees to both sides, at least over one beam."""
    increment = math.radians(beam_degrees)
    angles = increment * np.arange(-7, 8)
    reference = ReferenceScan(Geometry(15, -7 * increment, increment), 0.0, ORIGIN, 2.0 / np.cos(angles))
    between = increment * (np.arange(-7, 7) + 0.5)
    points = 1.9 * (1.0 + 1j * np.tan(between))
    off_m, surface_m = _offsets(reference, points, 1 + 0j)
    seen = slice(beside, len(points) - beside)
    assert surface_m == pytest.approx(np.abs(points)[seen] * increment)
    assert off_m == pytest.approx(0.1, abs=0.01 if beam_degrees == 6 else 0.002)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("place", [-2, 3])
def test_a_point_at_an_edge_shows_nothing(place: int, sign: float) -> None:
    """Its surface bends by more than twice the tolerance, which is 0.1 m at 2 m."""
    for bend_m, is_shown in ((0.19, True), (0.21, False)):
        ranges_m = np.full(360, 2.0)
        ranges_m[180 + place] += sign * bend_m
        reference = ReferenceScan(GEOMETRY, 0.0, ORIGIN, ranges_m)
        off_m, _ = _offsets(reference, np.array([cmath.rect(1.9, BEAM_RAD / 2)]), 1 + 0j)
        assert len(off_m) == is_shown


def test_the_weighted_median_has_half_of_the_weight_on_each_side() -> None:
    assert _weighted_median(np.array([1.0, 0.0]), np.array([3.0, 1.0])) == 1.0
    assert _weighted_median(np.array([1.0, 0.0, 2.0]), np.array([1.0, 3.0, 1.0])) == 0.0


def test_walls_along_the_travel_show_nothing() -> None:
    angles = BEAM_RAD * (np.arange(360) - 180)
    sides = 1.2 / np.abs(np.sin(angles) + 1e-12)
    corridor = view_of(np.where(sides < 12.0, sides, math.inf))
    assert math.isnan(shown(corridor, corridor)[0])


def test_a_view_without_returns_shows_nothing() -> None:
    nothing = view_of(np.full(360, math.inf))
    assert math.isnan(shown(nothing, look(START))[0])
    assert math.isnan(shown(look(START), nothing)[0])


def test_a_beam_is_counted_from_the_first_one_in_the_direction_of_the_scan() -> None:
    points = np.array([cmath.rect(2.0, angle * math.pi) for angle in (0.125, 0.5, -0.125)])
    assert beams_at(Geometry(8, 0.0, math.pi / 4), points) == pytest.approx([0.5, 2.0, 7.5])
    assert beams_at(Geometry(8, 0.0, -math.pi / 4), points) == pytest.approx([7.5, 6.0, 0.5])
    assert beams_at(Geometry(8, math.pi / 2, math.pi / 4), points) == pytest.approx([6.5, 0.0, 5.5])


def test_the_ends_of_a_view_have_no_neighbour_and_a_full_turn_has_no_end() -> None:
    ranges = 1.0 + np.arange(8)
    ranges[3] = math.inf
    beams = np.array([-1, 0, 3, 7, 8])
    turn = view_of(ranges, Geometry(8, 0.0, math.pi / 4))
    assert ranges_at(turn.geometry, returns_m(turn), beams) == pytest.approx(
        [8.0, 1.0, math.nan, 8.0, 1.0], nan_ok=True
    )
    half = view_of(ranges, Geometry(8, 0.0, math.pi / 8))
    assert ranges_at(half.geometry, returns_m(half), beams) == pytest.approx(
        [math.nan, 1.0, math.nan, 8.0, math.nan], nan_ok=True
    )


def test_a_return_agrees_within_three_times_the_noise_and_a_share_of_its_range() -> None:
    assert tolerances_m(np.array([0.0, 5.0])) == pytest.approx([0.06, 0.16])


# --- a stop

VIEW = view_of(np.full(360, 2.0))
EARLY = VIEW._replace(taken_s=-1.0)


def watched(
    shown: list[tuple[float, float, float]],
    monkeypatch: pytest.MonkeyPatch,
    *,
    speed_m_s: float = 0.0,
    measurement: SlipMeasurement = NO_MEASUREMENT,
) -> SlipMeasurement:
    """Process views of a stop that began at 0 s, the view before it at -0.25 s: pairs of time, slip and error."""
    results: dict[float, tuple[float, float]] = {}

    def result(reference: ReferenceScan, view: View, mount: Mount) -> tuple[float, float]:
        assert reference.taken_s <= -0.25, "the last view before the stop"
        assert mount is HERE
        return results[view.taken_s]

    monkeypatch.setattr(slip, "slip_between", result)
    before = VIEW._replace(taken_s=-0.25)
    for taken_s, slip_m, error_m in shown:
        results[taken_s] = slip_m, error_m
        view = VIEW._replace(taken_s=taken_s)
        measurement = measure_slip(measurement, before, view, HERE, Stop(0.0, speed_m_s), stands=True)
        before = view
    return measurement


def test_no_stop_is_watched_unless_it_is_measured_and_has_a_view_before() -> None:
    measurement = SlipMeasurement(1.0, ReferenceScan.of(VIEW))
    assert measure_slip(measurement, VIEW, VIEW, HERE, None, stands=True) is NO_MEASUREMENT
    assert measure_slip(measurement, None, VIEW, HERE, Stop(2.0, 1.0), stands=True) is NO_MEASUREMENT


def test_the_last_view_before_a_stop_is_kept_until_the_base_stands() -> None:
    now = VIEW._replace(taken_s=0.125)
    first = measure_slip(NO_MEASUREMENT, VIEW, now, HERE, Stop(0.0, 2.0), stands=False)
    assert first.reference is not None
    assert first == SlipMeasurement(0.0, first.reference, tolerance_m=0.25)
    assert first.reference.taken_s == VIEW.taken_s
    later = now._replace(taken_s=1.0)
    assert measure_slip(first, now, later, HERE, Stop(0.0, 0.0), stands=False) is first
    again = measure_slip(first, now, later, HERE, Stop(0.75, 0.0), stands=False)
    assert again.reference is not None
    assert again == SlipMeasurement(0.75, again.reference)
    assert again.reference.taken_s == now.taken_s


def test_two_views_at_rest_must_show_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    one = watched([(0.5, 0.25, 0.0)], monkeypatch)
    assert (one.compared_s, one.compared_m, one.slip_m) == (0.5, 0.25, None)
    one = one._replace(compared_s=0.0)
    assert watched([(math.nextafter(REST_S, 0.0), 0.25, 0.0)], monkeypatch, measurement=one) is one
    assert watched([(REST_S, 0.25, 0.0)], monkeypatch, measurement=one).slip_m == 0.25


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_robot_that_still_slides_is_measured_later(sign: float, monkeypatch: pytest.MonkeyPatch) -> None:
    for apart_m, is_same in ((SAME_M, True), (math.nextafter(SAME_M, 1.0), False)):
        measurement = SlipMeasurement(0.0, ReferenceScan.of(EARLY), compared_s=0.5, compared_m=0.0)
        found = watched([(1.0, sign * apart_m, 0.0)], monkeypatch, measurement=measurement)
        assert (found.slip_m is not None) is is_same
        assert found.compared_s == (0.5 if is_same else 1.0)
    assert watched([(0.5, 0.25, 0.0), (1.0, 0.5, 0.0), (1.5, 0.5, 0.0)], monkeypatch).slip_m == 0.5


def test_a_result_is_final(monkeypatch: pytest.MonkeyPatch) -> None:
    found = watched([(0.5, 0.25, 0.0), (1.0, 0.25, 0.0), (1.5, 0.5, 0.0), (2.0, 0.5, 0.0)], monkeypatch)
    assert found.slip_m == 0.25


def test_what_never_comes_to_rest_is_not_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    last_s = EARLY.taken_s + MOST_S
    measurement = SlipMeasurement(0.0, ReferenceScan.of(EARLY), compared_s=0.5, compared_m=0.25)
    assert watched([(last_s, 0.25, 0.0)], monkeypatch, measurement=measurement).slip_m == 0.25
    late = watched([(math.nextafter(last_s, 9.0), 0.25, 0.0)], monkeypatch, measurement=measurement)
    assert late.slip_m is not None
    assert math.isnan(late.slip_m)


def test_a_view_that_shows_nothing_ends_the_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    found = watched([(0.5, math.nan, math.nan), (1.0, 0.25, 0.0)], monkeypatch)
    assert found.slip_m is not None
    assert math.isnan(found.slip_m)


@pytest.mark.parametrize(("speed_m_s", "error_m"), [(0.0, 0.0), (1.0, 0.0), (0.0, 0.125)])
def test_what_the_period_of_the_lidar_and_noise_explain_is_no_slip(
    speed_m_s: float, error_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    explained_m = speed_m_s * (0.5 + 0.25) + LEAST_SLIP_M + STANDARD_ERRORS * error_m
    for slip_m, shown_m in ((explained_m, 0.0), (math.nextafter(explained_m, 1.0), None)):
        found = watched([(0.5, slip_m, error_m), (1.0, slip_m, error_m)], monkeypatch, speed_m_s=speed_m_s)
        assert found.slip_m == (slip_m if shown_m is None else shown_m)


# --- several lidars

ENDED = Base(stopped_s=1.0, braking=Braking(ended=Ended(2.0, 0.25, is_measured=True)))


def shown_by(*slips: float | None, stopped_s: float = 1.0) -> Sight:
    return Sight(tuple(LidarState(slip=SlipMeasurement(stopped_s, slip_m=slip_m)) for slip_m in slips))


def test_every_lidar_must_have_concluded_and_the_least_slip_counts() -> None:
    assert sights.slip_m(shown_by(0.25, None), ENDED) is None
    assert sights.slip_m(shown_by(0.5, 0.25), ENDED) == 0.25
    assert sights.slip_m(shown_by(0.25, math.nan), ENDED) == 0.25
    unknown_m = sights.slip_m(shown_by(math.nan, math.nan), ENDED)
    assert unknown_m is not None
    assert math.isnan(unknown_m)


def test_the_slip_of_another_stop_does_not_count() -> None:
    assert sights.slip_m(shown_by(0.25, stopped_s=0.5), ENDED) is None
    assert sights.slip_m(shown_by(0.25), replace_braking(ENDED, Braking())) is None


def replace_braking(base: Base, braking: Braking) -> Base:
    return base._replace(braking=braking)


def test_a_stop_is_measured_from_its_beginning_until_its_result() -> None:
    assert measured_stop(ENDED) == Stop(1.0, 2.0)
    assert measured_stop(replace_braking(ENDED, Braking(mean_m_s=0.5, stopping=True))) == Stop(1.0, 0.5)
    assert measured_stop(replace_braking(ENDED, Braking(mean_m_s=0.5))) is None
    assert measured_stop(Base(braking=Braking(mean_m_s=0.5, stopping=True))) is None


# --- in the law

STOPPING = Base(
    odometry=Odometry(NEUTRAL, 1.0),
    stopped_s=1.0,
    braking=Braking(mean_m_s=0.5, stopping=True),
)


@pytest.mark.parametrize(("speed_m_s", "stands"), [(0.0, True), (1.0, False)])
def test_each_scan_of_a_stop_is_compared_with_the_one_before(
    speed_m_s: float, monkeypatch: pytest.MonkeyPatch, *, stands: bool
) -> None:
    calls: list[tuple[object, ...]] = []
    results = [SlipMeasurement(1.0, slip_m=0.25), SlipMeasurement(1.0, slip_m=0.5)]

    def measure(*arguments: object, **named: object) -> SlipMeasurement:
        calls.append((*arguments, named))
        return results[len(calls) - 1]

    monkeypatch.setattr(sights, "measure_slip", measure)
    base = STOPPING._replace(odometer=Odometer(velocity=Velocity(speed_m_s, 0.0)))
    sight, views = Sight((LidarState(),)), list[View]()
    for number, result in enumerate(results):
        sight = sights.see(sight, CONFIG, laser_scan(ring(2.0 + 0.01 * number), 1.0 + 0.05 * number), base)
        (lidar,) = sight.lidars
        assert lidar.slip is result
        assert lidar.scan is not None
        assert lidar.scan.view is not None
        views.append(lidar.scan.view)
    mount, stop, named = CONFIG.lidars[0].mount, Stop(1.0, 0.5), {"stands": stands}
    assert calls[0] == (NO_MEASUREMENT, None, views[0], mount, stop, named)
    measurement, before, view, *others = calls[1]
    assert measurement is results[0]
    assert before is views[0]
    assert view is views[1]
    assert others == [mount, stop, named]


def test_without_odometry_no_slip_is_measured() -> None:
    sight = Sight((LidarState(),))
    for number in range(2):
        scan = laser_scan(ring(2.0 + 0.01 * number), 1.0 + 0.05 * number)
        sight = sights.see(sight, CONFIG, scan, STOPPING._replace(odometry=None))
    assert sight.lidars[0].slip is NO_MEASUREMENT


def test_the_base_counts_the_slip_of_its_stop_once_it_is_known() -> None:
    sample = Odometry(NEUTRAL, 2.0)
    waiting, config = brake(ENDED, CONFIG, sample, None)
    assert waiting.braking.ended is ENDED.braking.ended
    assert config is CONFIG
    slipped, config = brake(ENDED, CONFIG, sample, 0.75)
    assert slipped.braking.ended is None
    assert slipped.braking.shown_slip_m == (0.75,)
    assert config.shown_m_s2 == slipped.braking.shown_m_s2[0] == 2.0
    none, config = brake(ENDED, CONFIG, sample, math.nan)
    assert none.braking == waiting.braking._replace(ended=None)
    assert config is CONFIG


def test_the_law_counts_the_slip_that_the_scans_show_and_the_status_names_it() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), odometry=odometry(0.0, law.now_s + TICK_S))
    (lidar,), base = law.state.sight.lidars, law.state.base
    assert base.stopped_s is not None
    lidar = lidar._replace(slip=SlipMeasurement(base.stopped_s, slip_m=1.75))
    braking = base.braking._replace(ended=Ended(2.0, 0.25, is_measured=False))
    law.state = law.state._replace(
        sight=law.state.sight._replace(lidars=(lidar,)), base=base._replace(braking=braking)
    )
    law.tick(("teleop", NEUTRAL), odometry=odometry(0.0, law.now_s + TICK_S))
    assert law.state.base.braking.shown_slip_m == (1.75,)
    assert law.state.config.shown_m_s2 == 1.0
    assert law.decision.limit is Limit.BASE_WEAK
    assert law.decision.detail == (
        "the base brakes with 1.00 m/s² instead of 1.50, and slid up to 1.75 m farther than odometry shows in 1 of 1 stops"
    )


def test_after_a_suspend_nothing_is_concluded_of_the_present_stop() -> None:
    """Meanwhile the robot may have been pushed."""
    slip = SlipMeasurement(1.0, ReferenceScan.of(VIEW))
    sight = sights.suspended(Sight((LidarState(slip=slip),)), CONFIG)
    base = ENDED._replace(odometry=Odometry(NEUTRAL, 2.0))
    for number in range(3):
        unknown_m = sights.slip_m(sight, base)
        assert unknown_m is not None
        assert math.isnan(unknown_m)
        sight = sights.see(sight, CONFIG, laser_scan(ring(2.0 + 0.01 * number), 2.0 + 0.5 * number), base)
