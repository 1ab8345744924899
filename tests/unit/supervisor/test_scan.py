"""What a laser scan proves, and what it does not."""

import math

import numpy as np
import pytest

from supervisor.clearance import Circle, ConvexPolygon, Surroundings
from supervisor.lidar import PROFILES
from supervisor.scan import Mount, ScanReading, continue_reading, read_scan

BEAMS = 360


HULL = Circle(0.25)
OUTLINE = len(HULL.outline()[0])


def read(ranges: np.ndarray, **changes: object) -> tuple[Surroundings, str | None]:
    values: dict[str, object] = {
        "angle_min": -math.pi,
        "angle_increment": 2 * math.pi / BEAMS,
        "range_min": 0.05,
        "range_max": 12.0,
        "mount": Mount(),
        "profile": PROFILES["rep117"],
        "hull": HULL,
        "stop_distance_m": 0.3,
        "min_beams": 90,
        "min_valid_share": 0.5,
    }
    around, problem, _ = read_scan(ranges, **(values | changes))  # type: ignore[arg-type]
    return around, problem


def blind_share(around: Surroundings) -> float:
    return len(around.blind_per_linear) / OUTLINE


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
    around, _ = read(ranges, mount=Mount(0.1, 0.0, math.pi / 2))
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
    ranges[180:187] = math.nan
    assert blind_share(read(ranges)[0]) == 0.0
    ranges[187] = math.nan
    around, problem = read(ranges)
    assert problem is None
    assert blind_share(around) == pytest.approx(1 / 24, abs=0.01)


def test_a_fan_is_blind_where_it_does_not_look() -> None:
    fan = np.full(180, 2.0, dtype=np.float32)
    around, problem = read(fan, angle_min=-math.pi / 2)
    assert problem is None
    assert blind_share(around) == pytest.approx(0.5, abs=0.05)
    assert around.blind_per_linear.max() < 0.1, "it looks ahead"


def test_a_masked_sector_is_blind_and_its_readings_are_the_robot_s_own() -> None:
    ranges = full()
    ranges[:31] = 0.1
    ranges[330:] = 0.1
    masked = Mount(masked_rad=((math.radians(149.5), math.radians(-149.5)),))
    around, problem = read(ranges, mount=masked)
    assert problem is None
    assert around.nearest_m == pytest.approx(1.75)
    assert blind_share(around) == pytest.approx(60 / 360, abs=0.02)


def test_a_scan_that_is_all_nan_proves_nothing_at_all() -> None:
    around, problem = read(full(math.nan))
    assert problem is not None
    assert blind_share(around) == 1.0


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


def reading(ranges: np.ndarray, previous: ScanReading | None = None, travelled_m: float = 0.0) -> ScanReading:
    around, problem, share = read_scan(
        ranges,
        angle_min=-math.pi,
        angle_increment=2 * math.pi / BEAMS,
        range_min=0.05,
        range_max=12.0,
        mount=Mount(),
        profile=PROFILES["rep117"],
        hull=HULL,
        stop_distance_m=0.3,
        min_beams=90,
        min_valid_share=0.5,
    )
    new = ScanReading(0.0, 0.05, around, problem, ranges, 0, travelled_m, share)
    return continue_reading(previous, new)


def test_a_frozen_scan_is_noticed_once_the_robot_has_moved() -> None:
    scan = reading(full())
    problems: list[str | None] = []
    for n in range(1, 6):
        scan = reading(full(), scan, travelled_m=n * 0.0101)
        problems.append(scan.problem)
    assert problems[:2] == [None, None]
    assert problems[2] == "the same 4 times while the robot moves"
    assert reading(full(2.001), scan, 1.0).problem is None


def test_a_robot_at_rest_may_see_the_same_for_ever() -> None:
    scan = reading(full())
    for _ in range(1000):
        scan = reading(full(), scan)
    assert scan.problem is None


def test_an_open_field_may_look_the_same_while_the_robot_moves() -> None:
    scan = reading(full(math.inf))
    for n in range(100):
        scan = reading(full(math.inf), scan, travelled_m=n * 0.1)
    assert scan.problem is None


def test_a_scan_that_goes_blank_at_once_proves_nothing_until_something_returns() -> None:
    scan = reading(full())
    for _ in range(50):
        scan = reading(full(math.inf), scan)
        assert scan.problem == "blank from one scan to the next"
    stray, back = full(math.inf), full(math.inf)
    stray[:35] = 3.0
    back[:36] = 3.0
    assert reading(stray, scan).problem == "blank from one scan to the next"
    assert reading(back, scan).problem is None


def test_a_lidar_that_never_said_anything_but_its_codes_proves_nothing() -> None:
    """A Neato whose motor stands says 0.0 all around: nothing came back, or nothing was sent."""
    codes = full(0.0)
    for name, readings in (("neato_xv", codes), ("hokuyo_urg", full(math.nan)), ("rplidar", codes)):
        assert read(readings, profile=PROFILES[name])[1] == "nothing but codes for no return"
    open_field = full(0.0)
    open_field[0] = math.inf
    assert read(open_field, profile=PROFILES["rplidar"])[1] is None


def test_what_is_too_close_stands_at_the_hull_in_the_direction_of_its_beam() -> None:
    """Found by a random scan: inside a rectangle it was taken for something at the nearest side."""
    hull = ConvexPolygon(((0.3, -0.2), (0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2)))
    for reading_m in (-math.inf, 0.0, 0.03):
        ranges = full(3.0)
        ranges[170:191] = reading_m
        around, problem = read(ranges, hull=hull)
        assert problem is None
        assert around.nearest_m == pytest.approx(0.0, abs=1e-9)
        assert around.nearest_bearing_rad == pytest.approx(0.0, abs=0.2)
        touching = around.clearance_m < 1e-6
        assert around.per_linear[touching] == pytest.approx(1.0)
        all_around, _ = read(full(reading_m), hull=hull, mount=Mount(0.1, 0.05, 0.3))
        assert all_around.clearance_m == pytest.approx(0.0, abs=1e-9)
        assert all_around.per_linear.min() == pytest.approx(-1.0)
        assert all_around.per_linear.max() == pytest.approx(1.0)


def test_a_lidar_outside_of_the_hull_sees_it_as_it_sees_anything() -> None:
    ranges = full(math.inf)
    ranges[180] = 0.5
    around, _ = read(ranges, mount=Mount(x_m=0.4))
    assert around.nearest_m == pytest.approx(0.65)


@pytest.mark.parametrize(
    ("angle_max_deg", "fits"),
    [(179, True), (180, True), (177.01, True), (90, False), (176.9, False), (182, False)],
)
def test_a_last_angle_that_does_not_fit_is_a_contradiction(angle_max_deg: float, fits: bool) -> None:  # noqa: FBT001
    problem = read(full(), angle_max=math.radians(angle_max_deg))[1]
    assert (problem is None) is fits
    assert problem is None or "not at" in problem


def test_a_room_left_by_and_by_may_end_in_an_open_field() -> None:
    ranges, scan = full(), None
    for n in range(0, BEAMS, 20):
        ranges = ranges.copy()
        ranges[n : n + 20] = math.inf
        scan = reading(ranges, scan)
        assert scan.problem is None


def test_a_scan_that_proves_nothing_does_not_excuse_the_blank_one_after_it() -> None:
    scan = reading(full(math.inf), reading(full(math.nan), reading(full())))
    assert scan.problem == "blank from one scan to the next"
