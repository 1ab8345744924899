"""The parts of a View."""

import math

import numpy as np
import pytest

from teleop.pilot import NEUTRAL, Velocity
from teleop.view import Odom, Scan, Segment, Tone, View, columns_of, plain
from tests.unit.teleop.views import source, status
from wire.messages import LaserScan, header, odometry


def test_plain_leaves_printable_ascii_alone_and_everything_else_one_column_wide() -> None:
    assert plain("wall-1 [~]") == "wall-1 [~]"
    assert plain("\x1b[2J\n漢\u202e\x7f\x9b") == "?[2J?????"


def test_a_line_is_as_wide_as_its_segments() -> None:
    assert columns_of((Segment("ab"), Segment("", Tone.DIM), Segment("c"))) == 3


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -3.0])
def test_odometry_is_read_in_the_plane(yaw_rad: float) -> None:
    odom = Odom.of(odometry((1.0, -2.0, yaw_rad), (0.5, -0.25)))
    assert (odom.x_m, odom.y_m, odom.linear_m_s, odom.angular_rad_s) == (1.0, -2.0, 0.5, -0.25)
    assert odom.yaw_rad == pytest.approx(yaw_rad)


def test_a_scan_keeps_its_geometry_and_its_limits() -> None:
    ranges = np.array([1.0, math.nan], dtype=np.float32)
    scan = Scan.of(
        LaserScan(header("lidar"), -3.0, 3.0, 0.5, 0.0, 0.05, 0.1, 12.0, ranges, np.empty(0, np.float32))
    )
    assert scan.ranges_m is ranges
    assert (scan.angle_min_rad, scan.angle_increment_rad) == (-3.0, 0.5)
    assert (scan.range_min_m, scan.range_max_m) == (0.1, 12.0)


def test_the_own_source_is_found_by_its_name() -> None:
    own = source("teleop")
    assert View("teleop", "", status=status(sources=[source("joy"), own])).own is own
    assert View("path", "", status=status(sources=[own])).own is None
    assert View("teleop", "").own is None


def test_neutral_is_nothing_asked_for_now_and_at_the_end_of_the_ramp() -> None:
    moving = Velocity(0.0, 0.1)
    assert View("teleop", "").is_neutral
    assert not View("teleop", "", wanted=moving, sent=NEUTRAL).is_neutral
    assert not View("teleop", "", wanted=NEUTRAL, sent=moving).is_neutral
