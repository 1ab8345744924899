"""What a laser scan proves, and what it does not."""

import math

import numpy as np
import pytest

from supervisor.clearance import Circle, Surroundings
from supervisor.scan import read_scan

BEAMS = 360


def read(ranges: np.ndarray, **changes: object) -> tuple[Surroundings, str | None]:
    values: dict[str, object] = {
        "angle_min": -math.pi,
        "angle_increment": 2 * math.pi / BEAMS,
        "range_min": 0.05,
        "range_max": 12.0,
        "lidar_pose": (0.0, 0.0, 0.0),
        "hull": Circle(0.25),
        "min_beams": 90,
        "min_valid_share": 0.5,
    }
    return read_scan(ranges, **(values | changes))  # type: ignore[arg-type]


def full(distance_m: float = 2.0) -> np.ndarray:
    return np.full(BEAMS, distance_m, dtype=np.float32)


def test_a_ring_of_readings_is_a_ring_of_points() -> None:
    around, problem = read(full())
    assert problem is None
    assert around.nearest_m == pytest.approx(1.75)
    assert len(around.clearance_m) == BEAMS


def test_a_lidar_mounted_ahead_and_turned_sees_the_same_room() -> None:
    ranges = np.full(BEAMS, math.inf, dtype=np.float32)
    ranges[BEAMS // 2] = 1.0  # along the lidar's own x axis
    around, _ = read(ranges, lidar_pose=(0.1, 0.0, math.pi / 2))
    assert around.nearest_bearing_rad == pytest.approx(math.atan2(1.0, 0.1))
    assert around.nearest_m == pytest.approx(math.hypot(0.1, 1.0) - 0.25)


def test_a_clockwise_scan_is_read_clockwise() -> None:
    ranges = full(3.0)
    ranges[90] = 1.0
    around, _ = read(ranges, angle_min=math.pi, angle_increment=-2 * math.pi / BEAMS)
    assert around.nearest_bearing_rad == pytest.approx(math.pi / 2)


def test_infinite_and_far_readings_are_free() -> None:
    ranges = full(math.inf)
    ranges[::2] = 12.5
    around, problem = read(ranges)
    assert problem is None
    assert len(around.clearance_m) == 0


@pytest.mark.parametrize("reading", [-math.inf, -1.0, 0.0, 0.049])
def test_readings_below_range_min_are_too_close(reading: float) -> None:
    ranges = full()
    ranges[7] = reading
    around, problem = read(ranges)
    assert problem is None
    assert around.nearest_m <= 0.0


def test_half_of_a_sector_may_be_nan_and_not_one_beam_more() -> None:
    ranges = full()
    ranges[:15] = math.nan
    assert read(ranges)[1] is None
    ranges[15] = math.nan
    problem = read(ranges)[1]
    assert problem is not None
    assert "sector 1 of 12" in problem


@pytest.mark.parametrize(
    "changes",
    [
        {"angle_min": math.nan},
        {"angle_increment": 0.0},
        {"angle_increment": math.inf},
        {"angle_increment": 0.02},
        {"range_min": 12.0},
        {"range_min": -0.1},
        {"range_max": math.nan},
        {"range_max": 0.01},
        {"min_beams": 361},
    ],
)
def test_geometry_that_contradicts_itself_is_no_scan(changes: dict[str, object]) -> None:
    around, problem = read(full(), **changes)
    assert problem is not None
    assert len(around.clearance_m) == 0


def test_361_beams_over_a_whole_turn_are_a_scan() -> None:
    assert read(np.full(361, 2.0, dtype=np.float32))[1] is None
