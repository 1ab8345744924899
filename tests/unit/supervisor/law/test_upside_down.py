"""A lidar that is mounted upside down: the angles of its scans run clockwise, as seen from above."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law.clearance import Circle
from supervisor.law.lidar import PROFILES
from supervisor.law.reckoning import Pose, Velocity
from supervisor.law.scan import Geometry, LaserScan, Lidar, Moment, Mount, ScanReading, rays_of, read_scan
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, Law, with_lidar

HULL = Circle(0.25)
STEP_RAD = math.radians(1.0)


def read(ranges: np.ndarray, mount: Mount, angle_min: float, increment: float) -> ScanReading:
    scan = LaserScan(ranges, angle_min, increment, 0.05, 12.0, 0.0)
    lidar = Lidar("lidar", mount, PROFILES["rep117"], 0.24)
    moment = Moment(0.0, 0.05, Pose(0.0, 0.0, 0.0), 0.0, 0.0)
    return read_scan(None, scan, moment, lidar, HULL, 3.0, 0.04, in_the_open=False)


def places(reading: ScanReading) -> list[list[float]]:
    return sorted(reading.around.points.round(9).tolist())


@given(st.floats(-3.0, 3.0), st.floats(-3.1, 0.0), st.sampled_from([1.0, -1.0]), st.integers(0, 5))
def test_a_lidar_upside_down_shows_what_it_shows_when_its_angles_are_negated(
    yaw_rad: float, angle_min: float, sign: float, seed: int
) -> None:
    ranges = np.random.default_rng(seed).uniform(0.5, 3.0, 180).astype(np.float32)
    mount = Mount(0.1, 0.05, yaw_rad)
    flipped = read(ranges, replace(mount, flip=True), angle_min, sign * STEP_RAD)
    upright = read(ranges, mount, -angle_min, -sign * STEP_RAD)
    assert places(flipped) == places(upright)
    assert flipped.view is not None
    assert flipped.view.geometry == Geometry(180, -angle_min, -sign * STEP_RAD)


def test_as_a_roll_of_half_a_turn_before_the_yaw() -> None:
    """Rpy = (pi, 0, 0.5), a return at the angle 0.3 of the scan: it is at the bearing 0.5 - 0.3."""
    ranges = np.full(90, np.inf, dtype=np.float32)
    ranges[30] = 2.0
    reading = read(ranges, Mount(yaw_rad=0.5, flip=True), 0.0, 0.01)
    assert reading.nearest_bearing_rad == pytest.approx(0.2)


def test_masked_sectors_are_angles_of_the_scan_as_it_is_sent() -> None:
    geometry = Geometry(181, math.pi / 2, -STEP_RAD)  # of a scan from -90 to 90 degrees, upside down
    mount = Mount(masked_rad=((math.radians(20.5), math.radians(40.5)),), flip=True)
    rays = rays_of(geometry, mount, HULL)
    masked_deg = np.degrees(np.arctan2(rays.direction[1], rays.direction[0]))[~rays.looking]
    assert sorted(masked_deg.round(6).tolist()) == [float(angle) for angle in range(-40, -20)]


@pytest.mark.parametrize(("flip", "side"), [(False, 1.0), (True, -1.0)])
def test_what_a_lidar_upside_down_shows_on_its_left_is_on_the_right(*, flip: bool, side: float) -> None:
    law = Law(with_lidar(CONFIG, mount=Mount(flip=flip)))
    law.ranges[215:235] = 0.58
    law.hold(0.2, ("teleop", NEUTRAL))
    assert 0.5 < law.decision.nearest_bearing_rad * side < 1.0
    law.drive()
    assert law.hold(0.1, ("teleop", FORWARD)).output.linear_m_s < 0.3
    law.drive(Velocity(-0.5, 0.0))
    assert law.decision.output == Velocity(-0.5, 0.0)
