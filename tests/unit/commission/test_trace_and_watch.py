"""What is heard during the first drive, and what counts as a surprise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from commission.plan import Base, Drive
from commission.trace import LOST_S, Odom, Scan, Trace
from commission.wall import Wall
from commission.watch import NEARER_M, NEAREST_M, START_S, WRONG_WAY_M, Watch
from supervisor.law.reckoning import Pose as LawPose
from supervisor.law.scan import LaserScan, Mount
from teleop.path.course import Pose
from tests.unit.commission.truth import Lidar

START = Pose(1.0, 2.0, math.pi / 2)
WALL = Wall(3.0, 0.0, 4.0)
BASE = Base(0.5, 0.3, 0.6)


def scan(lidar: Lidar, pose: LawPose, at_s: float) -> LaserScan:
    ranges = lidar.scan(pose, np.random.default_rng(0)).astype(np.float32)
    angles = lidar.angles_rad
    return LaserScan(ranges, float(angles[0]), float(angles[1] - angles[0]), 0.1, 12.0, at_s)


# --- the trace


def test_the_wall_is_followed_through_a_turn_also_of_a_mirrored_lidar() -> None:
    for lidar in (Lidar(), Lidar(is_mirrored=True)):
        trace, turn = Trace(Mount()), -1.0 if not lidar.is_mirrored else 1.0
        yaw_rad = at_s = 0.0
        for step in range(40):
            yaw_rad, at_s = 0.015 * step, 0.05 * step
            trace.odometry.append(Odom(at_s, Pose(0.0, 0.0, yaw_rad), 0.0, 0.3, at_s))
            trace.add_scan(scan(lidar, LawPose(1.0, 0.0, yaw_rad), at_s))
        wall = trace.wall(at_s)
        assert wall is not None
        assert wall.bearing_rad == pytest.approx(turn * yaw_rad, abs=0.01)


def test_a_wall_that_is_not_seen_is_lost_after_its_time_and_another_is_found_on_request() -> None:
    trace = Trace(Mount())
    trace.add_scan(scan(Lidar(), LawPose(1.0, 0.0, 0.0), 0.0))
    trace.add_scan(scan(Lidar(), LawPose(2.0, 0.0, 0.0), 0.1))  # a jump of 1 m
    assert trace.wall(LOST_S) is not None
    assert trace.wall(math.nextafter(LOST_S, 2.0)) is None
    trace.forget_wall()
    trace.add_scan(scan(Lidar(), LawPose(2.0, 0.0, 0.0), 0.2))
    found = trace.wall(0.2)
    assert found is not None
    assert found.distance_m == pytest.approx(2.0, abs=0.01)


@settings(deadline=None)
@given(
    ranges=st.lists(st.floats(width=32), min_size=1, max_size=60),
    angle_min=st.floats(width=32),
    increment=st.floats(width=32),
    limits=st.tuples(st.floats(width=32), st.floats(width=32)),
)
def test_no_scan_is_an_error(
    ranges: list[float], angle_min: float, increment: float, limits: tuple[float, float]
) -> None:
    trace = Trace(Mount())
    with np.errstate(all="ignore"):
        for at_s in (0.0, 0.1):
            trace.add_scan(LaserScan(np.array(ranges, np.float32), angle_min, increment, *limits, at_s))
    assert len(trace.scans) == 2


def test_a_scan_of_very_many_beams_is_read_too() -> None:
    trace = Trace(Mount())
    trace.add_scan(scan(Lidar(beams=20_000), LawPose(1.0, 0.0, 0.0), 0.0))
    wall = trace.wall(0.0)
    assert wall is not None
    assert wall.distance_m == pytest.approx(3.0, abs=0.002)


def test_the_way_ahead_is_along_the_heading_at_the_start() -> None:
    trace = Trace(Mount())
    trace.odometry.append(Odom(1.0, Pose(1.0, 2.5, 0.0), 0.2, 0.0, 1.0))
    assert trace.toward(START).tolist() == [[1.0, pytest.approx(0.5), 0.2]]


def test_a_turn_of_more_than_half_a_circle_has_no_jump() -> None:
    trace = Trace(Mount())
    assert trace.turning(START).shape == (0, 3)
    assert trace.bearings().shape == (0, 2)
    for step in range(5):
        yaw_rad = math.remainder(START.yaw_rad + step, math.tau)
        trace.odometry.append(Odom(float(step), Pose(0.0, 0.0, yaw_rad), 0.0, 1.0, float(step)))
        wall = Wall(3.0, math.remainder(0.3 - step, math.tau), 4.0)
        trace.scans.append(Scan(float(step), np.empty(0), wall))
    trace.scans.append(Scan(5.0, np.empty(0), None))
    assert trace.turning(START).tolist() == [[step, pytest.approx(step), 1.0] for step in range(5)]
    assert trace.bearings().tolist() == [[step, pytest.approx(0.3 - step)] for step in range(5)]


# --- surprises


def odom(ahead_m: float = 0.0, turned_rad: float = 0.0) -> Odom:
    return Odom(0.0, Pose(START.x_m, START.y_m + ahead_m, START.yaw_rad + turned_rad), 0.0, 0.0, 0.0)


def nearer(by_m: float) -> Wall:
    return WALL._replace(distance_m=WALL.distance_m - by_m)


def watch(drive: Drive, gap_m: float = 2.75, *, is_first: bool = False) -> Watch:
    return Watch(drive, BASE, START, WALL, gap_m, 0.0, is_first=is_first)


AHEAD, BACK, LEFT = Drive(0.4), Drive(-0.4), Drive(turn_rad=0.6, speed=0.3)


@pytest.mark.parametrize("drive", [AHEAD, BACK, LEFT])
def test_a_drive_as_planned_has_no_surprise_and_is_done_at_its_end(drive: Drive) -> None:
    one, turned = watch(drive), WALL._replace(bearing_rad=-0.3)
    half_way = odom(drive.way_m / 2, drive.turn_rad / 2)
    wall = turned if drive.turn_rad else nearer(drive.way_m / 2)
    assert one.surprise(START_S + 0.1, half_way, wall, 2.75 - max(0.0, drive.way_m) / 2) is None
    assert not one.is_done(half_way, wall)
    assert one.is_done(odom(1.001 * drive.way_m, 1.001 * drive.turn_rad), wall)


def test_a_drive_that_comes_nearer_than_planned_is_a_surprise() -> None:
    planned_m = AHEAD.way_m + BASE.stop_m(AHEAD.speed) + NEARER_M
    one = watch(AHEAD)
    assert one.too_near(2.75 - planned_m + 1e-9) is None
    assert one.too_near(2.75 - planned_m - 1e-9) is not None
    assert "closer to the wall" in (one.surprise(1.0, odom(0.3), nearer(0.3), 2.0) or "")
    assert watch(AHEAD, gap_m=0.5).too_near(math.nextafter(NEAREST_M, 0.0)) is not None


@pytest.mark.parametrize(
    ("drive", "ahead_m", "nearer_m", "words"),
    [
        (AHEAD, -WRONG_WAY_M - 0.01, 0.1, "odometry shows a motion in the other direction"),
        (AHEAD, 0.1, -WRONG_WAY_M - 0.01, "the wall shows a motion in the other direction"),
        (BACK, 0.1, -0.1, "odometry shows a motion in the other direction"),
        (BACK, -0.1, 0.09, "the wall shows a motion in the other direction"),
        (AHEAD, 0.0, 0.0, "the robot does not move"),
        (AHEAD, 0.0, 0.05, "the wall shows a motion, and odometry does not"),
        (AHEAD, 0.05, 0.0, "odometry shows a motion, and the wall does not"),
    ],
)
def test_a_motion_other_than_planned_is_a_surprise(
    drive: Drive, ahead_m: float, nearer_m: float, words: str
) -> None:
    assert words in (watch(drive).surprise(START_S + 0.1, odom(ahead_m), nearer(nearer_m), 2.7) or "")


def test_on_the_first_drive_no_direction_is_a_surprise_and_either_sensor_ends_it() -> None:
    one = watch(AHEAD, is_first=True)
    assert one.surprise(1.0, odom(-0.3), nearer(-0.3), 2.75) is None
    assert one.is_done(odom(-0.401), WALL)
    assert one.is_done(odom(), nearer(0.401))
    assert not one.is_done(odom(0.39), nearer(-0.39))


def test_a_drive_that_takes_too_long_is_a_surprise() -> None:
    latest_s = 2.0 * AHEAD.lasts_s + 3.0
    assert watch(AHEAD).surprise(latest_s, odom(0.1), nearer(0.1), 2.6) is None
    assert "longer than planned" in (
        watch(AHEAD).surprise(latest_s + 0.01, odom(0.1), nearer(0.1), 2.6) or ""
    )
