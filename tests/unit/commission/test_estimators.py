"""The estimators of the first drive against simulated truth with noise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from commission import timing
from commission.estimate import Estimate, least_squares, of_repeats, student_95
from commission.findings import Findings, results
from commission.mounting import (
    Mistake,
    Motion,
    forward_mistakes,
    heading,
    is_moved,
    turn_mistakes,
    turn_scale,
)
from commission.stopping import LEAST_STOPS, Stop, brakes, by_the_law, steady_scale, steady_speeds, stop_of
from commission.trace import Driven, Odom, Scan, Trace
from commission.wall import Wall, follow, nearest_wall
from supervisor.config import SupervisorSection
from supervisor.law.reckoning import Pose
from supervisor.law.scan import Mount
from teleop.path import course
from tests.unit.commission.truth import WALL_M, Lidar, Run, run

SEEDS = st.integers(0, 10_000)


def wall_of(lidar: Lidar, pose: Pose, seed: int = 0) -> Wall:
    found = nearest_wall(lidar.angles_rad, lidar.scan(pose, np.random.default_rng(seed)))
    assert found is not None
    return found


# --- statistics


@pytest.mark.parametrize(
    ("freedom", "quantile"), [(1, 12.706), (2, 4.303), (3, 3.182), (5, 2.571), (30, 2.042)]
)
def test_students_quantile_is_that_of_the_tables(freedom: int, quantile: float) -> None:
    assert student_95(freedom) == pytest.approx(quantile, rel=0.01)


def test_one_measurement_determines_nothing() -> None:
    assert of_repeats([1.0]) == Estimate(1.0, math.inf, 1)
    assert not of_repeats([]).is_determined
    assert student_95(0) == math.inf


def test_equal_repetitions_have_no_uncertainty_and_the_mean_of_them() -> None:
    assert of_repeats([2.0, 2.0, 2.0]) == Estimate(2.0, 0.0, 3)


def test_the_interval_of_repetitions_contains_the_truth_in_about_95_of_100_cases() -> None:
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(1000):
        found = of_repeats(random.normal(3.0, 0.5, size=4).tolist())
        hits += found.low <= 3.0 <= found.high
    assert 925 <= hits <= 975


def test_the_far_end_of_an_interval_is_on_the_side_away_from_the_reference() -> None:
    assert Estimate(1.0, 0.25, 3).far_from(0.9) == 1.25
    assert Estimate(1.0, 0.25, 3).far_from(1.1) == 0.75


def test_rows_that_do_not_determine_a_parameter_leave_it_unknown() -> None:
    fit = least_squares(np.ones((5, 2)), np.arange(5.0))
    assert fit.estimate(1.0, np.array([1.0, 0.0])).u95 == math.inf


# --- the wall


@settings(deadline=None)
@given(
    yaw_rad=st.floats(-0.9, 0.9),
    x_m=st.floats(-2.0, 2.5),
    noise_m=st.floats(0.0, 0.02),
    seed=SEEDS,
)
def test_a_wall_is_found_more_exactly_than_one_reading(
    yaw_rad: float, x_m: float, noise_m: float, seed: int
) -> None:
    found = wall_of(Lidar(noise_m=noise_m), Pose(x_m, 0.3, yaw_rad), seed)
    assert found.distance_m == pytest.approx(WALL_M - x_m, abs=0.002 + noise_m / 2)
    assert found.bearing_rad == pytest.approx(-yaw_rad, abs=0.002 + noise_m / 2)


@settings(deadline=None)
@given(seed=SEEDS)
def test_things_before_a_wall_and_missing_returns_do_not_move_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    lidar = Lidar(noise_m=0.005)
    ranges = lidar.scan(Pose(1.0, 0.0, 0.1), random)
    ranges[random.random(360) < 0.2] = math.inf
    ranges[170:176] = 1.2  # a leg before the wall
    found = nearest_wall(lidar.angles_rad, ranges)
    assert found is not None
    assert found.distance_m == pytest.approx(3.0, abs=0.01)
    assert found.bearing_rad == pytest.approx(-0.1, abs=0.01)


def test_the_nearer_of_two_walls_is_taken() -> None:
    lidar = Lidar(noise_m=0.002)
    ranges = lidar.scan(Pose(0.0, 0.0, 0.0), np.random.default_rng(0))
    with np.errstate(divide="ignore"):
        left_m = 2.5 / np.sin(lidar.angles_rad)
    ranges = np.where((left_m > 0.0) & (left_m < ranges), left_m, ranges)
    found = nearest_wall(lidar.angles_rad, ranges)
    assert found is not None
    assert (found.distance_m, found.bearing_rad) == (
        pytest.approx(2.5, abs=0.01),
        pytest.approx(math.pi / 2, abs=0.01),
    )


def test_without_a_wall_there_is_none() -> None:
    random = np.random.default_rng(0)
    angles = Lidar().angles_rad
    assert nearest_wall(angles, np.full(360, math.inf)) is None
    assert nearest_wall(angles, np.full(360, math.nan)) is None
    assert nearest_wall(angles, random.uniform(1.0, 9.0, 360)) is None
    assert nearest_wall(angles[:3], np.ones(3)) is None


def test_a_box_shorter_than_a_wall_is_not_one() -> None:
    lidar = Lidar()
    ranges = lidar.scan(Pose(2.0, 0.0, 0.0), np.random.default_rng(0))
    ranges[np.abs(lidar.angles_rad) > 0.2] = math.inf  # 0.8 m
    assert nearest_wall(lidar.angles_rad, ranges) is None


def test_a_wall_is_followed_while_the_robot_turns_and_lost_after_a_jump() -> None:
    lidar, random = Lidar(), np.random.default_rng(0)
    before = wall_of(lidar, Pose(1.0, 0.0, 0.0))
    next_ranges = lidar.scan(Pose(1.02, 0.0, 0.05), random)
    found = follow(before, lidar.angles_rad, next_ranges, turned_rad=-0.05)
    assert found is not None
    assert found.distance_m == pytest.approx(2.98, abs=0.005)
    assert found.bearing_rad == pytest.approx(-0.05, abs=0.005)
    assert follow(before, lidar.angles_rad, lidar.scan(Pose(2.0, 0.0, 0.0), random)) is None
    assert follow(before, lidar.angles_rad, np.full(360, math.inf)) is None


# --- mount and odometry


def straights(lidar: Lidar, scale: float, seed: int) -> list[Motion]:
    found: list[Motion] = []
    for n, (yaw_rad, way_m) in enumerate(((0.0, 0.4), (0.8, 0.3), (0.8, -0.3), (-0.8, 0.3), (-0.8, -0.3))):
        before = Pose(0.5, 0.0, yaw_rad)
        after = Pose(0.5 + way_m * math.cos(yaw_rad), way_m * math.sin(yaw_rad), yaw_rad)
        found.append(
            Motion(
                way_m / scale,
                way_m / scale,
                wall_of(lidar, before, seed + 2 * n),
                wall_of(lidar, after, seed + 2 * n + 1),
            )
        )
    return found


@settings(deadline=None)
@given(
    yaw_rad=st.floats(-math.pi, math.pi),
    scale=st.floats(0.8, 1.25),
    x_m=st.floats(-0.3, 0.3),
    seed=SEEDS,
)
def test_straight_drives_show_which_way_a_lidar_looks_and_the_scale_of_odometry(
    yaw_rad: float, scale: float, x_m: float, seed: int
) -> None:
    found = heading(straights(Lidar(x_m=x_m, y_m=0.1, yaw_rad=yaw_rad, noise_m=0.005), scale, seed))
    assert abs(math.remainder(found.yaw_rad.value - yaw_rad, math.tau)) < 0.03
    assert found.scale.value == pytest.approx(scale, rel=0.03)
    assert found.yaw_rad.u95 < 0.1
    assert found.scale.u95 < 0.1 * scale


def test_the_interval_of_the_yaw_mostly_contains_the_truth() -> None:
    lidar = Lidar(yaw_rad=0.4, noise_m=0.01)
    hits = 0
    for seed in range(60):
        found = heading(straights(lidar, 1.05, 100 * seed))
        hits += found.yaw_rad.low <= 0.4 <= found.yaw_rad.high and found.scale.low <= 1.05 <= found.scale.high
    assert hits >= 50


def test_drives_at_one_heading_or_too_few_of_them_show_no_yaw() -> None:
    drives = straights(Lidar(), 1.1, 0)
    assert not heading(drives[:1] * 3).yaw_rad.is_determined
    assert not heading(drives[:2]).yaw_rad.is_determined
    assert not heading([]).scale.is_determined


def turned(lidar: Lidar, turn_rad: float, shown_rad: float) -> Motion:
    return Motion(
        shown_rad,
        shown_rad,
        wall_of(lidar, Pose(1.0, 0.0, 0.0), 1),
        wall_of(lidar, Pose(1.0, 0.0, turn_rad), 2),
    )


def test_turns_show_the_scale_of_turns_and_their_sign() -> None:
    found = turn_scale([turned(Lidar(), 0.8, 0.76), turned(Lidar(), -0.8, -0.77)])
    assert found.value == pytest.approx(0.8 / 0.765, abs=0.02)
    assert turn_scale([turned(Lidar(is_mirrored=True), 0.8, 0.8)]).value == pytest.approx(-1.0, abs=0.02)


@pytest.mark.parametrize(
    ("lidar", "true_rad", "shown_rad", "seen_left", "mistakes"),
    [
        (Lidar(), 0.8, 0.8, True, set[Mistake]()),
        (Lidar(is_mirrored=True), 0.8, 0.8, True, {Mistake.LIDAR_MIRRORED}),
        (Lidar(), 0.8, -0.8, True, {Mistake.ODOMETRY_TURNS_BACK}),
        (
            Lidar(is_mirrored=True),
            0.8,
            -0.8,
            True,
            {Mistake.LIDAR_MIRRORED, Mistake.ODOMETRY_TURNS_BACK},
        ),
        (Lidar(), -0.8, -0.8, False, {Mistake.BASE_TURNS_BACK}),
        (Lidar(), -0.8, 0.8, False, {Mistake.BASE_TURNS_BACK, Mistake.ODOMETRY_TURNS_BACK}),
    ],
)
def test_a_person_who_sees_the_turn_separates_the_mistakes(
    lidar: Lidar, true_rad: float, shown_rad: float, *, seen_left: bool, mistakes: set[Mistake]
) -> None:
    assert turn_mistakes(turned(lidar, true_rad, shown_rad), seen_left=seen_left) == mistakes


@pytest.mark.parametrize(
    ("nearer_m", "shown_m", "seen_ahead", "mistakes"),
    [
        (0.3, 0.3, True, set[Mistake]()),
        (-0.3, 0.3, True, {Mistake.LIDAR_TURNED}),
        (0.3, -0.3, True, {Mistake.ODOMETRY_BACKWARDS}),
        (-0.3, -0.3, False, {Mistake.BASE_BACKWARDS}),
        (-0.3, 0.3, False, {Mistake.BASE_BACKWARDS, Mistake.ODOMETRY_BACKWARDS}),
    ],
)
def test_a_person_who_sees_the_drive_separates_the_mistakes(
    nearer_m: float, shown_m: float, *, seen_ahead: bool, mistakes: set[Mistake]
) -> None:
    before = wall_of(Lidar(), Pose(1.0, 0.0, 0.0))
    drive = Motion(shown_m, shown_m, before, before._replace(distance_m=before.distance_m - nearer_m))
    assert forward_mistakes(drive, seen_ahead=seen_ahead) == mistakes


@pytest.mark.parametrize(
    ("by_speed", "is_wrong"), [(0.26, True), (0.28, False), (0.32, False), (0.34, True), (-0.3, True)]
)
def test_odometry_whose_velocity_is_not_that_of_its_poses_is_a_mistake(
    by_speed: float, *, is_wrong: bool
) -> None:
    before = wall_of(Lidar(), Pose(1.0, 0.0, 0.0))
    drive = Motion(0.3, by_speed, before, before._replace(distance_m=before.distance_m - 0.3))
    turn = Motion(0.3, by_speed, before, before._replace(bearing_rad=before.bearing_rad - 0.3))
    wanted = {Mistake.ODOMETRY_SPEED} if is_wrong else set[Mistake]()
    assert forward_mistakes(drive, seen_ahead=True) == wanted
    assert turn_mistakes(turn, seen_left=True) == wanted


@pytest.mark.parametrize(
    ("by_odometry", "is_wrong"), [(0.22, True), (0.23, False), (0.46, False), (0.47, True)]
)
def test_odometry_that_differs_by_more_than_a_third_from_the_wall_is_a_mistake(
    by_odometry: float, *, is_wrong: bool
) -> None:
    before = wall_of(Lidar(), Pose(1.0, 0.0, 0.0))
    drive = Motion(by_odometry, by_odometry, before, before._replace(distance_m=before.distance_m - 0.3))
    turn = Motion(by_odometry, by_odometry, before, before._replace(bearing_rad=before.bearing_rad - 0.3))
    assert forward_mistakes(drive, seen_ahead=True) == (
        {Mistake.ODOMETRY_DISTANCE} if is_wrong else set[Mistake]()
    )
    assert turn_mistakes(turn, seen_left=True) == ({Mistake.ODOMETRY_TURN} if is_wrong else set[Mistake]())


@pytest.mark.parametrize(
    ("nearer_m", "turned_rad", "is_wrong"),
    [(0.0, 0.0, False), (0.009, 0.029, False), (0.011, 0.0, True), (-0.011, 0.0, True), (0.0, -0.031, True)],
)
def test_a_wall_that_moves_at_rest_shows_that_the_base_drifts(
    nearer_m: float, turned_rad: float, *, is_wrong: bool
) -> None:
    before = wall_of(Lidar(), Pose(1.0, 0.0, 0.0))
    after = before._replace(
        distance_m=before.distance_m - nearer_m, bearing_rad=before.bearing_rad + turned_rad
    )
    assert is_moved(before, after) is is_wrong


# --- times and noise


@given(sigma_m=st.floats(0.0005, 0.05), seed=SEEDS)
def test_the_noise_of_a_lidar_is_found_beside_beams_that_jump_or_do_not_return(
    sigma_m: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    ranges = 3.0 + sigma_m * random.standard_normal((40, 200))
    ranges[:, :20] += random.integers(0, 2, (40, 20))  # edges
    ranges[::3, 20:30] = math.inf
    found = timing.noise(ranges)
    assert found.value == pytest.approx(sigma_m, rel=0.15)
    assert found.u95 < 0.1 * sigma_m


def test_too_few_scans_or_returns_show_no_noise() -> None:
    assert not timing.noise(np.ones((9, 100))).is_determined
    assert not timing.noise(np.full((20, 100), math.inf)).is_determined


@settings(deadline=None, max_examples=30)
@given(latency_s=st.floats(0.0, 0.3), scale=st.floats(0.9, 1.1), seed=SEEDS)
def test_the_latency_of_scans_is_found_from_a_start_and_a_stop(
    latency_s: float, scale: float, seed: int
) -> None:
    one = run(0.5, np.random.default_rng(seed), latency_s=latency_s, scale=scale)
    found = timing.latency(one.walls[:, 0], one.walls[:, 1], one.odometry[:, 0], one.odometry[:, 1])
    assert found == pytest.approx(latency_s, abs=0.01)


def test_odometry_that_arrives_in_bursts_does_not_shift_the_latency() -> None:
    one = run(0.5, np.random.default_rng(0), latency_s=0.06)
    at_s = one.odometry[:, 0].copy()
    at_s[1::2] = at_s[:-1:2][: len(at_s[1::2])] + 1e-5
    found = timing.latency(one.walls[:, 0], one.walls[:, 1], at_s, one.odometry[:, 1])
    assert found == pytest.approx(0.07, abs=0.005)  # half of the samples are 0.02 s early


def test_a_robot_at_rest_or_at_one_speed_shows_no_latency() -> None:
    at = np.arange(0.0, 2.0, 0.02)
    assert math.isnan(timing.latency(at, 3.0 - 0.3 * at, at, 0.3 * at))
    assert math.isnan(timing.latency(at[:5], at[:5], at, at**2))
    assert math.isnan(timing.latency(at, 3.0 + at**2, at, -((at - 2.0) ** 2)))  # later than any that is tried


# --- stops


def stops(
    seed: int, *, dead_s: float, braking_m_s2: float, scale: float = 1.0, latency_s: float = 0.0
) -> list[Stop]:
    random = np.random.default_rng(seed)
    found: list[Stop] = []
    for speed_m_s in (0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5, 0.5):
        one = run(
            speed_m_s, random, dead_s=dead_s, braking_m_s2=braking_m_s2, scale=scale, latency_s=latency_s
        )
        stop = stop_of(one.stopped_s, one.rest_s, one.odometry, one.walls, scale=scale, latency_s=latency_s)
        assert stop is not None
        found.append(stop)
    return found


@settings(deadline=None, max_examples=40)
@given(
    dead_s=st.floats(0.0, 0.3),
    braking_m_s2=st.floats(0.3, 2.0),
    scale=st.floats(0.9, 1.1),
    latency_s=st.floats(0.0, 0.1),
    seed=SEEDS,
)
def test_stops_show_the_dead_time_and_the_deceleration_of_the_base(
    dead_s: float, braking_m_s2: float, scale: float, latency_s: float, seed: int
) -> None:
    found = brakes(stops(seed, dead_s=dead_s, braking_m_s2=braking_m_s2, scale=scale, latency_s=latency_s))
    assert found.dead_time_s.value == pytest.approx(dead_s, abs=0.02)
    assert found.deceleration_m_s2.value == pytest.approx(braking_m_s2, rel=0.15)
    assert found.deceleration_m_s2.low < 1.05 * braking_m_s2
    assert found.slip.value == pytest.approx(0.0, abs=0.05)


def test_a_wrong_scale_of_odometrys_velocity_does_not_change_what_stops_show() -> None:
    one = run(0.5, np.random.default_rng(0), dead_s=0.1)
    wrong = one.odometry * (1.0, 1.0, 1.2)
    assert stop_of(one.stopped_s, one.rest_s, wrong, one.walls) == stop_of(
        one.stopped_s, one.rest_s, one.odometry, one.walls
    )


def test_the_lower_end_of_the_deceleration_is_nearly_always_safe() -> None:
    unsafe = sum(
        brakes(stops(seed, dead_s=0.1, braking_m_s2=1.0)).deceleration_m_s2.low > 1.0 for seed in range(100)
    )
    assert unsafe <= 8  # 2.5 expected


def test_the_interval_of_the_dead_time_mostly_contains_the_truth() -> None:
    """The error of a distance comes from the wall, and does not grow with the speed."""
    random, speeds, hits = np.random.default_rng(0), np.repeat((0.2, 0.3, 0.4, 0.5), 2), 0
    for _ in range(400):
        ways = 0.1 * speeds + speeds**2 / 2.0 + 0.001 * random.standard_normal(len(speeds))
        dead = brakes(list(map(Stop, speeds, ways, ways))).dead_time_s
        hits += dead.low <= 0.1 <= dead.high
    assert hits >= 372  # 380 expected


def test_uncertain_scale_and_latency_widen_what_stops_show() -> None:
    some = stops(0, dead_s=0.1, braking_m_s2=1.0)
    plain, wide = brakes(some), brakes(some, scale_u95=0.1, latency_u95_s=0.05)
    assert wide.dead_time_s == plain.dead_time_s.with_errors(0.05, 0.02)
    assert wide.deceleration_m_s2.u95 > 0.2 * wide.deceleration_m_s2.value
    assert wide.slip.u95 > 0.1


def slipping(seed: int, *, latency_s: float = 0.0) -> list[Run]:
    """Return stops of a base that brakes with 0.7 m/s² while its wheels brake with 2 m/s²."""
    random, found = np.random.default_rng(seed), list[Run]()
    for speed_m_s in (0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5, 0.5):
        true = run(speed_m_s, random, dead_s=0.0, braking_m_s2=0.7, latency_s=latency_s)
        wheels = run(speed_m_s, random, dead_s=0.0, braking_m_s2=2.0)
        wheels.odometry[:, 0] += (
            true.stopped_s - wheels.stopped_s
        )  # both drive the same distance until the stop
        wheels.odometry[:, 1] += speed_m_s * (true.stopped_s - wheels.stopped_s)
        end = wheels.odometry[-1:] * (0.0, 1.0, 0.0) + (true.rest_s, 0.0, 0.0)
        found.append(true._replace(odometry=np.vstack((wheels.odometry, end - (0.2, 0.0, 0.0), end))))
    return found


@pytest.mark.parametrize("latency_s", [0.0, 0.1])
def test_wheels_that_slip_in_the_stops_do_not_show_as_latency_or_as_a_wrong_speed(latency_s: float) -> None:
    some = slipping(0, latency_s=latency_s)
    each = [timing.latency(*one.walls.T, *one.odometry[:, :2].T) for one in some]
    speeds = (0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5, 0.5)
    assert of_repeats(each).low > latency_s  # the mean would be wrong
    late = timing.latency_of(speeds, each)
    assert late.low <= latency_s <= late.high
    before = (steady_speeds(one.stopped_s, one.odometry, one.walls, late.value) for one in some)
    scale = steady_scale([two for two in before if two is not None])
    assert scale.value == pytest.approx(1.0, abs=0.03)


def driven(one: Run, speed_m_s: float) -> Driven:
    """Return a stop as the command records it."""
    trace = Trace(Mount())
    for at_s, way_m, velocity_m_s in one.odometry.tolist():
        trace.odometry.append(Odom(at_s, course.Pose(way_m, 0.0, 0.0), velocity_m_s, 0.0, at_s))
    for at_s, distance_m in one.walls.tolist():
        trace.scans.append(Scan(at_s, np.empty(0), Wall(distance_m, 0.0, 4.0)))
    before, after = (Wall(distance_m, 0.0, 4.0) for distance_m in (one.walls[0, 1], one.walls[-1, 1]))
    return Driven(
        trace,
        course.Pose(0.0, 0.0, 0.0),
        speed_m_s,
        before,
        after,
        one.stopped_s,
        one.rest_s,
        is_stopped=False,
    )


def test_the_scale_of_odometry_does_not_contain_the_slip_of_the_stops() -> None:
    speeds = (0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5, 0.5)
    found = Findings(driven=[driven(one, speed) for one, speed in zip(slipping(0), speeds, strict=True)])
    for bearing_rad in (0.6, -0.6):  # slow drives, without slip
        nearer_m = 0.3 * math.cos(bearing_rad)
        walls = Wall(3.0, bearing_rad, 4.0), Wall(3.0 - nearer_m, bearing_rad, 4.0)
        found.straights.append(Motion(0.3, 0.3, *walls))
    found.straights += [one.motion(is_turn=False) for one in found.driven]
    assert heading(found.straights).scale.low > 1.05
    lidar = SupervisorSection().all_lidars()[0]
    (scale,) = (one for one in results(found, lidar) if one.path == ("odometry_scale",))
    assert scale.estimate.low < 1.0 < scale.estimate.high
    assert scale.estimate.u95 < 0.02
    assert scale.limit == scale.estimate.far_from(1.0)


def test_one_scan_before_a_stop_shows_no_speed() -> None:
    one = run(0.3, np.random.default_rng(0), scan_hz=2.0)
    assert steady_speeds(one.stopped_s, one.odometry, one.walls) is None
    assert not steady_scale([]).is_determined


def test_a_negative_latency_of_wheels_that_slip_does_not_exclude_zero() -> None:
    found = timing.latency_of([0.2, 0.3, 0.4, 0.5], [0.02, 0.05, 0.08, 0.11])
    assert found.value == pytest.approx(-0.04)
    assert found.high >= 0.0


def test_the_latency_of_drives_at_one_speed_is_their_mean() -> None:
    assert timing.latency_of([0.2, 0.2, 0.2], [0.1, 0.11, 0.12]) == of_repeats([0.1, 0.11, 0.12])


def test_a_robot_that_slides_farther_than_its_odometry_shows_slip() -> None:
    slid = [stop._replace(odometry_m=0.7 * stop.way_m) for stop in stops(0, dead_s=0.0, braking_m_s2=1.0)]
    assert brakes(slid).slip.value == pytest.approx(0.3, abs=0.01)


def test_too_few_stops_or_stops_at_one_speed_determine_nothing() -> None:
    some = stops(0, dead_s=0.1, braking_m_s2=1.0)
    assert not brakes(some[: LEAST_STOPS - 1]).deceleration_m_s2.is_determined
    assert not brakes([some[0]] * LEAST_STOPS).deceleration_m_s2.is_determined


def test_a_stop_that_did_not_begin_at_a_steady_speed_is_not_one() -> None:
    one = run(0.5, np.random.default_rng(0))
    assert stop_of(0.4, one.rest_s, one.odometry, one.walls) is None
    assert stop_of(one.stopped_s, 99.0, one.odometry, one.walls) is None


def test_a_stop_whose_samples_arrived_late_is_not_one() -> None:
    """A program that was not scheduled for 0.07 s takes what has arrived meanwhile at once, and the robot seems to have been slower."""
    one = run(0.5, np.random.default_rng(0), dead_s=0.1)
    assert stop_of(one.stopped_s, one.rest_s, one.odometry, one.walls) is not None
    late = one.odometry.copy()
    is_late = (late[:, 0] > one.stopped_s - 0.11) & (late[:, 0] < one.stopped_s - 0.04)
    late[is_late, 0] = one.stopped_s - 0.04
    assert np.count_nonzero(is_late) >= 3
    assert stop_of(one.stopped_s, one.rest_s, late, one.walls) is None


def test_the_law_measures_the_same_deceleration_in_a_fast_stop_and_nothing_in_a_slow_one() -> None:
    fast, slow = (run(v, np.random.default_rng(0), speed_sd_m_s=0.0) for v in (0.5, 0.2))
    assert by_the_law(fast.stopped_s, fast.odometry, 0.5, 0.01) == pytest.approx(1.2, rel=0.05)
    assert math.isnan(by_the_law(slow.stopped_s, slow.odometry, 0.2, 0.01))
