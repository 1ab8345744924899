"""What a laser scan proves."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.lidar import PROFILES, LidarProfile
from supervisor.law.reckoning import Pose
from supervisor.law.scan import LaserScan, Lidar, Moment, Mount, ScanReading, read_scan
from supervisor.law.seen_space import hidden_places
from supervisor.law.surface import Surfaces

BEAMS = 360
BEAM_RAD = 2 * math.pi / BEAMS
PERIOD_S = 0.05
TIMEOUT_S = 0.24

HULL = Circle(0.25)
LIDAR = Lidar("lidar", Mount(), LidarProfile(), TIMEOUT_S)
HERE = Pose(0.0, 0.0, 0.0)
NEVER_RETURNED = "no return since the start; set works_in_the_open = true if that is normal here"
BLANK = "nearly all returns disappeared from one scan to the next"


def read(
    ranges: np.ndarray,
    previous: ScanReading | None = None,
    *,
    lidar: Lidar = LIDAR,
    hull: Hull = HULL,
    taken_s: float = 0.0,
    pose: Pose = HERE,
    travelled_m: float = 0.0,
    proven_m: float | None = None,
    in_the_open: bool = False,
    stopped: bool = True,
    fields: dict[str, float] | None = None,
    repeated: np.ndarray | None = None,
) -> ScanReading:
    scan = LaserScan(ranges, -math.pi, BEAM_RAD, 0.05, 12.0, taken_s)
    return read_scan(
        previous,
        replace(scan, **(fields or {})),  # type: ignore[arg-type]
        Moment(taken_s, PERIOD_S, pose, travelled_m, travelled_m if proven_m is None else proven_m, stopped),
        lidar,
        hull,
        3.0,
        0.04,
        in_the_open=in_the_open,
        repeated=repeated,
    )


def free_m(reading: ScanReading) -> np.ndarray:
    """How far each ray is free [m]."""
    assert reading.view is not None
    return reading.view.free_m


def holes(reading: ScanReading) -> list[int]:
    """The beams that prove nothing."""
    return np.flatnonzero(free_m(reading) == 0.0).tolist()


def full(distance_m: float = 2.0) -> np.ndarray:
    return np.full(BEAMS, distance_m, dtype=np.float32)


def test_a_ring_of_readings_is_a_ring_of_points() -> None:
    reading = read(full())
    assert reading.problem is None
    assert reading.nearest_m == pytest.approx(1.75)
    assert len(reading.around.clearance_m) == BEAMS
    assert reading.return_share == 1.0
    assert free_m(reading) == pytest.approx(2.0)
    assert reading.view is not None
    assert reading.view.is_whole


def test_a_lidar_mounted_ahead_and_turned_sees_the_same_room() -> None:
    ranges = full(math.inf)
    ranges[BEAMS // 2] = 1.0  # along the lidar's own x axis
    reading = read(ranges, lidar=replace(LIDAR, mount=Mount(0.1, 0.0, math.pi / 2)))
    assert reading.nearest_bearing_rad == pytest.approx(math.atan2(1.0, 0.1))
    assert reading.nearest_m == pytest.approx(math.hypot(0.1, 1.0) - 0.25)
    assert reading.around.points[0] == pytest.approx([0.1, 1.0])


def test_a_clockwise_scan_is_read_clockwise() -> None:
    ranges = full(3.0)
    ranges[90] = 1.0
    reading = read(ranges, fields={"angle_min": math.pi, "angle_increment": -BEAM_RAD})
    assert reading.nearest_bearing_rad == pytest.approx(math.pi / 2)


def test_infinite_and_far_readings_are_free_up_to_range_max_and_no_returns() -> None:
    ranges = full(math.inf)
    ranges[::2] = 12.5
    ranges[7] = 5.0
    reading = read(ranges)
    assert reading.problem is None
    assert reading.return_share == 1 / BEAMS
    assert len(reading.around.points) == 0, "farther than the reach of 3 m from the hull"
    assert reading.nearest_m == pytest.approx(4.75)
    assert np.delete(free_m(reading), 7).tolist() == [12.0] * (BEAMS - 1)


def test_without_any_return_there_is_nothing_nearest() -> None:
    reading = read(full(math.inf), in_the_open=True)
    assert reading.problem is None
    assert reading.nearest_m == math.inf
    assert math.isnan(reading.nearest_bearing_rad)


@pytest.mark.parametrize("value", [-math.inf, -1.0, 0.0, 0.049])
def test_readings_below_range_min_are_too_close(value: float) -> None:
    ranges = full()
    ranges[7] = value
    reading = read(ranges)
    assert reading.problem is None
    assert reading.nearest_m == pytest.approx(0.0, abs=1e-9)


def test_one_beam_that_is_not_explained_is_a_hole_from_the_first_scan_on() -> None:
    ranges = full()
    ranges[187] = math.nan
    reading = read(ranges)
    assert reading.problem is None
    assert holes(reading) == [187]
    assert reading.view is not None
    assert not reading.view.is_whole


def test_a_masked_sector_is_a_hole_and_its_readings_are_the_robot_s_own() -> None:
    ranges = full()
    ranges[:31] = 0.1
    ranges[330:] = 0.1
    masked = Mount(masked_rad=((math.radians(149.5), math.radians(-149.5)),))
    reading = read(ranges, lidar=replace(LIDAR, mount=masked))
    assert reading.problem is None
    assert reading.nearest_m == pytest.approx(1.75)
    assert holes(reading) == [*range(31), *range(330, 360)]
    assert len(reading.around.points) == BEAMS - 61


def test_a_scan_that_is_all_nan_proves_nothing_at_all() -> None:
    reading = read(full(math.nan))
    assert reading.problem == "no reading that the profile explains"
    assert math.isnan(reading.nearest_m)
    assert len(holes(reading)) == BEAMS


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"angle_min": math.nan}, "geometry that is not finite"),
        ({"angle_increment": 0.0}, "360 beams of 0 rad span more than a full turn, or no angle"),
        ({"angle_increment": -9.9e-7}, "360 beams of -9.9e-07 rad span more than a full turn, or no angle"),
        ({"angle_increment": math.inf}, "geometry that is not finite"),
        ({"angle_increment": 0.02}, "360 beams of 0.02 rad span more than a full turn, or no angle"),
        ({"range_min": 12.0}, "range_min 12 m and range_max 12 m contradict each other"),
        ({"range_min": -0.1}, "range_min -0.1 m and range_max 12 m contradict each other"),
        ({"range_max": math.nan}, "geometry that is not finite"),
        ({"range_max": 0.01}, "range_min 0.05 m and range_max 0.01 m contradict each other"),
    ],
)
def test_geometry_that_contradicts_itself_is_no_scan(changes: dict[str, float], sentence: str) -> None:
    reading = read(full(), fields=changes)
    assert reading.problem == sentence
    assert len(reading.around.points) == 0
    assert reading.view is None
    assert reading.return_share == 0.0
    assert math.isnan(reading.nearest_m)


@pytest.mark.parametrize("beams", [0, 89, 90])
def test_a_scan_has_as_many_beams_as_are_configured_or_is_none(beams: int) -> None:
    reading = read(np.full(beams, 2.0, dtype=np.float32))
    join = ": if the driver sends a turn in segments, join them" if beams else ""
    assert reading.problem == (None if beams == 90 else f"{beams} beams, fewer than 90{join}")


def segment(first_deg: float, previous: ScanReading | None, beams: int = 91) -> ScanReading:
    fields = {"angle_min": math.radians(first_deg)}
    return read(np.full(beams, 2.0, dtype=np.float32), previous, fields=fields)


def test_segments_of_a_turn_are_no_scans() -> None:
    """A fan of 90 degrees may shift by 45: lidars with an uneven rotation begin anywhere."""
    before = segment(170.0, None)
    for first_deg in (125.01, 170.0, 214.99 - 360.0):
        assert segment(first_deg, before).problem is None
    for first_deg in (124.99, 215.01 - 360.0, 0.0):
        problem = segment(first_deg, before).problem
        assert problem is not None
        assert "join them" in problem
    assert segment(170.0, segment(0.0, before)).problem is None


def test_a_fan_of_half_a_turn_is_no_segment() -> None:
    assert segment(100.0, segment(0.0, None, 180), 180).problem is not None
    assert segment(100.0, segment(0.0, None, 182), 182).problem is None


def test_a_scan_says_how_many_beams_it_lacks() -> None:
    whole = read(full())
    assert whole.missing_beams == 0
    short = read(full()[:343], whole)
    assert (short.problem, short.missing_beams) == (None, 17)
    assert read(full()[:343], short).missing_beams == 0
    assert read(full(), short).missing_beams == 0


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"angle_max": math.radians(197)}, "18 beams are missing"),
        ({"angle_max": math.radians(162)}, "17 beams are too many"),
        (
            {"angle_min": math.pi, "angle_increment": -BEAM_RAD, "angle_max": math.radians(-197)},
            "18 beams are missing",
        ),
        ({"angle_increment": -BEAM_RAD, "angle_max": math.pi}, "the sign of angle_increment is wrong"),
        ({"angle_min": math.pi, "angle_max": -math.pi}, "the sign of angle_increment is wrong"),
    ],
)
def test_a_last_angle_that_does_not_fit_is_explained(fields: dict[str, float], why: str) -> None:
    problem = read(full(), fields=fields).problem
    assert problem is not None
    assert problem.endswith(f": {why}")


def test_a_scan_that_is_none_leaves_what_the_one_before_proved() -> None:
    before = read(full())
    reading = read(full(), before, fields={"angle_min": math.nan})
    assert reading.view is before.view
    assert reading.return_share == 1.0
    assert reading.repeats == 0


def test_361_beams_over_a_whole_turn_are_a_scan() -> None:
    assert read(np.full(361, 2.0, dtype=np.float32)).problem is None


# --- scans that prove nothing


def test_a_frozen_scan_is_noticed_once_the_robot_has_moved() -> None:
    scan = read(full())
    problems: list[str | None] = []
    for n in range(1, 6):
        scan = read(full(), scan, travelled_m=n * 0.0101)
        problems.append(scan.problem)
    assert problems[:2] == [None, None]
    assert problems[2] == "the same scan 4 times while the robot moves: frozen, or simulated without noise"
    assert math.isnan(scan.nearest_m)
    assert read(full(2.001), scan, travelled_m=1.0).problem is None


@pytest.mark.parametrize(("travelled_m", "frozen"), [(0.02, False), (math.nextafter(0.02, 1.0), True)])
def test_a_repeated_scan_is_frozen_just_beyond_two_centimetres(travelled_m: float, *, frozen: bool) -> None:
    scan = read(full())
    for _ in range(3):
        scan = read(full(), scan, travelled_m=travelled_m)
    assert (scan.problem is not None) is frozen


@pytest.mark.parametrize(("travelled_m", "is_new"), [(0.005, True), (math.nextafter(0.005, 1.0), False)])
def test_a_scan_that_repeats_the_one_before_while_the_robot_moves_shows_nothing_new(
    travelled_m: float, *, is_new: bool
) -> None:
    first = read(full())
    again = read(full(), first, taken_s=0.05, travelled_m=travelled_m)
    assert again.problem is None
    assert again.repeats == 1
    assert (again.taken_s == 0.05) is is_new
    assert (again.view is first.view) is not is_new


def test_a_commanded_way_that_no_odometry_shows_freezes_no_lidar() -> None:
    """A base with a dead time stands still while it is commanded to move."""
    scan = read(full())
    for n in range(1, 100):
        scan = read(full(), scan, taken_s=0.05 * n, travelled_m=0.05 * n, proven_m=0.005)
        assert (scan.problem, scan.taken_s) == (None, 0.05 * n)


def test_of_scans_between_two_others_only_the_proven_way_counts() -> None:
    invalid = read(full(), read(full(), proven_m=1.0), proven_m=2.0, fields={"range_min": 13.0})
    assert invalid.travelled_m == 2.0
    assert read(full(3.0), invalid, proven_m=2.5).travelled_m == 2.5


def test_a_robot_at_rest_may_see_the_same_for_ever() -> None:
    scan = read(full())
    for _ in range(1000):
        scan = read(full(), scan)
    assert scan.problem is None


def test_an_open_field_may_look_the_same_while_the_robot_moves() -> None:
    scan = read(full(math.inf), in_the_open=True)
    for n in range(100):
        scan = read(full(math.inf), scan, travelled_m=n * 0.1, in_the_open=True)
    assert scan.problem is None


def test_an_open_field_whose_beams_read_the_maximum_range_looks_the_same_too() -> None:
    scan = read(full(12.0), in_the_open=True)
    for n in range(100):
        scan = read(full(12.0), scan, travelled_m=n * 0.1, in_the_open=True)
    assert scan.problem is None
    assert read(full(12.0)).problem == NEVER_RETURNED


def test_a_blank_scan_counts_as_missing_for_half_a_timeout() -> None:
    scan, missing_s = read(full(), taken_s=0.0), LIDAR.timeout_s / 2
    assert read(full(math.inf), scan, taken_s=missing_s) is scan
    late = read(full(math.inf), scan, taken_s=math.nextafter(missing_s, 1.0))
    assert late.problem == BLANK
    assert read(full(math.inf), late, taken_s=missing_s + 0.05).problem == BLANK


def test_a_scan_that_goes_blank_at_once_proves_nothing_until_something_returns() -> None:
    scan = read(full(), taken_s=0.0)
    for n in range(50):
        scan = read(full(math.inf), scan, taken_s=1.0 + 0.05 * n)
        assert scan.problem == BLANK
    stray, back = full(math.inf), full(math.inf)
    stray[:35] = 3.0
    back[:36] = 3.0
    assert read(stray, scan).problem == BLANK
    assert read(back, scan).problem is None


def test_a_room_left_by_and_by_may_end_in_an_open_field() -> None:
    ranges, scan = full(), read(full())
    for n in range(0, BEAMS, 20):
        ranges = ranges.copy()
        ranges[n : n + 20] = math.inf
        scan = read(ranges, scan)
        assert scan.problem is None
    assert scan.return_share == 0.0
    assert read(ranges, scan).problem is None, "something has returned before"


def test_a_scan_that_proves_nothing_does_not_excuse_the_blank_one_after_it() -> None:
    scan = read(full(math.nan), read(full()), taken_s=1.0)
    assert read(full(math.inf), scan, taken_s=1.05).problem == BLANK


def test_one_blank_scan_between_two_others_is_no_problem() -> None:
    """99 and 86 returns, and none between them, as on a recording."""
    before, after = full(math.inf), full(math.inf)
    before[:99], after[:86] = 3.0, 3.1
    scan = read(full(math.inf), read(before, taken_s=0.0), taken_s=0.05)
    assert read(after, scan, taken_s=0.1).problem is None


@pytest.mark.parametrize("name", list(PROFILES))
def test_a_lidar_on_which_nothing_has_ever_returned_proves_nothing_unless_it_works_in_the_open(
    name: str,
) -> None:
    """A Neato with a stopped motor sends 0.0 on all beams: no return, or no measurement."""
    lidar = replace(LIDAR, profile=replace(PROFILES[name], trusts_silence_at_start=True))
    scan = read(full(math.inf), lidar=lidar)
    assert scan.problem == NEVER_RETURNED
    assert read(full(math.inf), scan, lidar=lidar).problem == NEVER_RETURNED
    one = full(math.inf)
    one[0] = 2.0
    assert read(one, scan, lidar=lidar).problem is None
    assert read(full(math.inf), lidar=lidar, in_the_open=True).problem is None


# --- what is too close


def test_what_is_too_close_stands_at_the_hull_in_the_direction_of_its_beam() -> None:
    """Found by a random scan: inside a rectangle it was taken for something at the nearest side."""
    hull = ConvexPolygon(((0.3, -0.2), (0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2)))
    for reading_m in (-math.inf, 0.0, 0.03):
        ranges = full(3.0)
        ranges[170:191] = reading_m
        reading = read(ranges, hull=hull)
        assert reading.problem is None
        assert reading.nearest_m == pytest.approx(0.0, abs=1e-9)
        assert reading.nearest_bearing_rad == pytest.approx(0.0, abs=0.2)
        touching = reading.around.clearance_m < 1e-6
        assert reading.around.per_linear[touching] == pytest.approx(1.0)
        turned = replace(LIDAR, mount=Mount(0.1, 0.05, 0.3))
        around = read(full(reading_m), hull=hull, lidar=turned).around
        assert around.clearance_m == pytest.approx(0.0, abs=1e-9)
        assert around.per_linear.min() == pytest.approx(-1.0)
        assert around.per_linear.max() == pytest.approx(1.0)


def test_a_reading_of_zero_at_a_lidar_outside_of_the_hull_is_known_to_be_there() -> None:
    """Found by hypothesis: a fan that says so all over looked like one that knows nothing, and the law broke."""
    fan = np.full(181, -math.inf, dtype=np.float32)
    ahead = replace(LIDAR, mount=Mount(x_m=0.5))
    reading = read(fan, lidar=ahead, fields={"angle_min": -math.pi / 2, "range_min": 0.0})
    assert reading.problem is None
    assert (free_m(reading) > 0.0).all()
    assert reading.nearest_m == pytest.approx(0.25)
    assert reading.view is not None
    assert len(hidden_places(reading.view, ahead.mount, HULL, 0.04, 1.0)) > 0


def test_a_lidar_outside_of_the_hull_sees_it_as_it_sees_anything() -> None:
    ranges = full(math.inf)
    ranges[180] = 0.5
    reading = read(ranges, lidar=replace(LIDAR, mount=Mount(x_m=0.4)))
    assert reading.nearest_m == pytest.approx(0.65)


@pytest.mark.parametrize(
    ("angle_max_deg", "fits"),
    [(179, True), (180, True), (177.01, True), (90, False), (176.9, False), (182, False)],
)
def test_a_last_angle_that_does_not_fit_is_a_contradiction(angle_max_deg: float, *, fits: bool) -> None:
    problem = read(full(), fields={"angle_max": math.radians(angle_max_deg)}).problem
    assert (problem is None) is fits
    assert problem is None or "not at" in problem


# --- a reading that is not explained


def dropout(*beams: int) -> np.ndarray:
    ranges = full()
    ranges[list(beams)] = math.nan
    return ranges


def test_a_dropout_is_filled_for_one_timeout_by_what_was_known_and_then_is_a_hole() -> None:
    before = read(full())
    last = read(dropout(40), before, taken_s=TIMEOUT_S)
    assert holes(last) == []
    assert free_m(last)[40] == 2.0
    assert last.view is not None
    assert last.view.explained_s[40] == 0.0
    assert not last.view.hit[40], "known to be free so far is no return"
    over = read(dropout(40), last, taken_s=math.nextafter(TIMEOUT_S, 1.0))
    assert holes(over) == [40]
    assert holes(read(dropout(40, 41), over, taken_s=TIMEOUT_S + 0.05)) == [40]
    assert holes(read(full(), over, taken_s=TIMEOUT_S + 0.05)) == []


def test_a_filled_direction_turns_with_the_robot() -> None:
    ranges = full()
    ranges[50] = 1.0
    before = read(ranges)
    left = read(dropout(40, 50), before, pose=Pose(0.0, 0.0, 10 * BEAM_RAD), taken_s=0.05)
    assert free_m(left)[40] == 1.0
    assert free_m(left)[50] == 2.0
    again = read(dropout(30, 40), left, pose=Pose(0.0, 0.0, 20 * BEAM_RAD), taken_s=0.1)
    assert free_m(again)[30] == 1.0


def test_slow_turning_is_not_lost_in_the_rounding_to_whole_beams() -> None:
    ranges = full()
    ranges[50] = 1.0
    scan, gone = read(ranges), full()
    gone[44:52] = math.nan
    for n in range(1, 13):
        scan = read(gone, scan, pose=Pose(0.0, 0.0, 0.4 * n * BEAM_RAD), taken_s=0.01 * n)
    assert np.flatnonzero(free_m(scan) == 1.0).tolist() == [45]


def test_a_filled_ray_is_free_for_less_by_the_way_that_the_robot_has_gone() -> None:
    before = read(full(0.5))
    ranges = full(0.5)
    ranges[40] = math.nan
    after = read(ranges, before, pose=Pose(0.3, 0.4 - 0.3, 0.0), taken_s=0.05)
    assert free_m(after)[40] == pytest.approx(0.5 - math.hypot(0.3, 0.1))
    assert free_m(read(ranges, before, pose=Pose(0.6, 0.0, 0.0), taken_s=0.05))[40] == 0.0


def test_a_fan_knows_nothing_of_what_turns_into_its_view() -> None:
    fan = np.full(181, 2.0, dtype=np.float32)
    fan_of = {"angle_min": -math.pi / 2}
    before = read(fan, fields=fan_of)
    gone = fan.copy()
    gone[[0, 5, 176, 180]] = math.nan
    left = read(gone, before, pose=Pose(0.0, 0.0, 10 * BEAM_RAD), taken_s=0.05, fields=fan_of)
    assert holes(left) == [176, 180], "it turned to the left"
    right = read(gone, before, pose=Pose(0.0, 0.0, -10 * BEAM_RAD), taken_s=0.05, fields=fan_of)
    assert holes(right) == [0, 5]


def test_a_lidar_whose_beams_vary_keeps_what_was_known_of_each_direction() -> None:
    """Beam 40 of 300 looks where beam 48 of 360 did."""
    known = full()
    known[48] = 1.5
    varied = np.full(300, 2.0, dtype=np.float32)
    varied[40] = math.nan
    fields = {"angle_increment": 2 * math.pi / 300}
    scan = read(varied, read(known), taken_s=0.05, fields=fields)
    assert free_m(scan)[40] == 1.5
    assert holes(read(varied, scan, taken_s=0.05 + TIMEOUT_S, fields=fields)) == [40]


def test_a_wider_fan_knows_nothing_of_what_it_sees_first() -> None:
    fan = {"angle_min": -1.0, "angle_increment": 0.01}
    narrow = read(np.full(150, 2.0, dtype=np.float32), fields=fan)
    wide = np.full(200, 2.0, dtype=np.float32)
    wide[[149, 150, 151]] = math.nan
    assert holes(read(wide, narrow, taken_s=0.05, fields=fan)) == [150, 151]


def test_a_beam_that_varies_is_believed_to_be_free_as_long_as_its_direction_had_a_return() -> None:
    lidar = replace(LIDAR, profile=SILENT)
    silent = np.full(300, 2.0, dtype=np.float32)
    silent[40] = math.inf
    fields = {"angle_increment": 2 * math.pi / 300}
    for after_s, hidden in ((15.0, []), (15.1, [40])):
        scan = read(
            silent, read(full(), lidar=lidar), lidar=lidar, taken_s=after_s, travelled_m=9.0, fields=fields
        )
        assert holes(scan) == hidden


# --- silence


SILENT = LidarProfile(silence_limit_s=15.0, silence_limit_m=5.0)


@pytest.mark.parametrize(
    ("after_s", "way_m", "trusted"),
    [
        (15.0, 9.0, True),
        (15.1, 5.0, True),
        (15.1, 5.1, False),
    ],
)
def test_no_return_is_believed_of_a_beam_while_either_limit_of_silence_holds(
    after_s: float, way_m: float, *, trusted: bool
) -> None:
    lidar = replace(LIDAR, profile=SILENT)
    ranges = full()
    ranges[40] = math.inf
    scan = read(ranges, read(full(), lidar=lidar), lidar=lidar, taken_s=after_s, travelled_m=way_m)
    assert holes(scan) == ([] if trusted else [40])
    back = read(full(), scan, lidar=lidar, taken_s=after_s + 0.05, travelled_m=way_m)
    assert holes(read(ranges, back, lidar=lidar, taken_s=after_s + 0.1, travelled_m=way_m)) == []


@pytest.mark.parametrize("at_start", [True, False])
def test_at_start_no_return_is_believed_only_of_sensors_that_say_it_reliably(*, at_start: bool) -> None:
    profile = replace(SILENT, trusts_silence_at_start=at_start)
    lidar = replace(LIDAR, profile=profile)
    ranges = full()
    ranges[40] = math.inf
    assert holes(read(ranges, lidar=lidar)) == ([] if at_start else [40])


# --- surfaces instead of single readings (surface.py)

NOISY = Surfaces(0.01, 1)


def test_what_is_around_is_at_the_distances_that_count_and_free_space_at_the_readings() -> None:
    first = read(full(0.6))
    reading = read(full(0.6), first._replace(surfaces=NOISY), travelled_m=0.0, taken_s=PERIOD_S)
    nearer_m = 0.02 / math.sqrt(7.0)
    assert reading.around.clearance_m == pytest.approx(np.full(BEAMS, 0.35 - nearer_m), abs=1e-3)
    assert reading.nearest_m == pytest.approx(0.35 - nearer_m, abs=1e-3)
    assert free_m(reading) == pytest.approx(0.6)


def test_the_ends_of_half_a_turn_are_no_neighbours() -> None:
    first = read(full(0.6)[:180], fields={"angle_min": 0.0})
    reading = read(
        full(0.6)[:180], first._replace(surfaces=NOISY), taken_s=PERIOD_S, fields={"angle_min": 0.0}
    )
    assert reading.around.clearance_m[[0, -1]] == pytest.approx([0.35, 0.35])
    assert reading.around.clearance_m[90] == pytest.approx(0.35 - 0.02 / math.sqrt(7.0), abs=1e-3)


def test_a_scan_of_other_directions_or_under_a_command_begins_new_means() -> None:
    first = read(full(0.6))
    second = read(full(0.61), first._replace(surfaces=NOISY), taken_s=PERIOD_S)
    same = read(full(0.62), second, taken_s=2 * PERIOD_S)
    assert same.surfaces.seen.tolist() == [2.0] * BEAMS
    turned = read(full(0.62), second, taken_s=2 * PERIOD_S, fields={"angle_min": 0.0})
    assert turned.surfaces.seen.tolist() == [1.0] * BEAMS
    driving = read(full(0.62), second, taken_s=2 * PERIOD_S, stopped=False)
    assert driving.surfaces.seen.tolist() == [1.0] * BEAMS, "odometry may be stuck at zero"


@pytest.mark.parametrize(
    ("fields", "is_same"),
    [
        ({"angle_increment": BEAM_RAD * (1.0 + 1e-7)}, True),
        ({"angle_min": -math.pi + 0.49 * BEAM_RAD}, True),
        ({"angle_min": -math.pi + 0.51 * BEAM_RAD}, False),
        ({"angle_increment": BEAM_RAD * (1.0 - 0.51 / BEAMS)}, False),
    ],
)
def test_beams_within_half_a_beam_of_the_last_scan_continue_its_means(
    fields: dict[str, float], *, is_same: bool
) -> None:
    first = read(full(0.6))
    second = read(full(0.6), first._replace(surfaces=NOISY), taken_s=PERIOD_S)
    third = read(full(0.6), second, taken_s=2 * PERIOD_S, fields=fields)
    assert third.surfaces.seen.tolist() == [2.0 if is_same else 1.0] * BEAMS
    fewer = read(full(0.6)[:-1], second, taken_s=2 * PERIOD_S)
    assert fewer.surfaces.seen.tolist() == [1.0] * (BEAMS - 1)


def test_no_standard_error_places_a_return_inside_the_hull() -> None:
    first = read(full(0.2501))
    reading = read(full(0.2501), first._replace(surfaces=NOISY), taken_s=PERIOD_S)
    assert reading.around.clearance_m == pytest.approx(np.zeros(BEAMS), abs=1e-9)


def test_an_invalid_scan_keeps_the_measured_noise() -> None:
    first = read(full(0.6))._replace(surfaces=NOISY)
    assert read(full(0.6)[:10], first).surfaces is NOISY
    assert read(full(0.6)[:10]).surfaces == Surfaces()
