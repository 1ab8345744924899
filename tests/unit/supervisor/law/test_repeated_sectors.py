"""Sectors of a scan that repeat the previous scan, bit for bit, while the robot moves."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.agreement import BLOCK_RAD, LEAST_CHANGE_M, NOISY_SHARE, REST, RESTS, Agreement, repeat
from supervisor.law.base import Base
from supervisor.law.model import Inputs, Odometry
from supervisor.law.near_memory import Remembered, remember
from supervisor.law.reckoning import Pose, Velocity
from supervisor.law.scan import LaserScan, Mount, ScanReading
from supervisor.law.sight import LidarState, Sight, see
from tests.scenes.operators import Scripted
from tests.scenes.run import Outcome, run
from tests.scenes.scene import BOUND_M
from tests.scenes.sensing import Ranges
from tests.scenes.simple import LIDAR, plain_scene
from tests.unit.supervisor.law.law_harness import BEAMS, CONFIG, NEUTRAL, Law, laser_scan
from tests.unit.supervisor.law.test_scan import read

HERE = Pose(0.0, 0.0, 0.0)
AHEAD = Pose(0.05, 0.0, 0.0)
NOISY = Agreement(rests=RESTS)
TEN_DEGREES = 10


def noisy(seed: int, beams: int = BEAMS) -> Ranges:
    return np.random.default_rng(seed).uniform(2.0, 5.0, beams).astype(np.float32)


def seen(ranges: Ranges, pose: Pose = HERE) -> ScanReading:
    return read(ranges, pose=pose)


def repeating(
    width: int,
    *,
    first: int = 100,
    agreement: Agreement = NOISY,
    pose: Pose | None = AHEAD,
    at_m: float | None = None,
) -> list[int]:
    """The beams that count as repeated if so many, from the first one on, have the same readings again."""
    old, new = noisy(1), noisy(2)
    if at_m is not None:
        old[first : first + width] = at_m
    new[first : first + width] = old[first : first + width]
    repeated = repeat(agreement, seen(old), laser_scan(new, 1.0), pose).repeated
    return [] if repeated is None else np.flatnonzero(repeated).tolist()


def test_a_block_of_ten_degrees_repeats_and_a_narrower_one_may_be_chance() -> None:
    assert math.degrees(BLOCK_RAD) == pytest.approx(TEN_DEGREES)
    assert repeating(TEN_DEGREES) == list(range(100, 110))
    assert repeating(TEN_DEGREES - 1) == []


@pytest.mark.parametrize("first", [0, BEAMS - 20])
def test_a_block_at_an_end_of_the_scan_repeats(first: int) -> None:
    assert repeating(20, first=first) == list(range(first, first + 20))


@pytest.mark.parametrize(("beams", "is_round"), [(BEAMS, True), (BEAMS - 1, False)])
def test_a_block_passes_over_the_ends_of_a_full_turn_only(beams: int, *, is_round: bool) -> None:
    """The seam of a lidar that is turned by 180 degrees is straight ahead."""
    old, new = noisy(1, beams), noisy(2, beams)
    new[:9], new[-9:] = old[:9], old[-9:]
    agreement = repeat(NOISY, seen(old), laser_scan(new, 1.0), AHEAD)
    later = noisy(3, beams)
    later[:7], later[-7:] = old[:7], old[-7:]
    again = repeat(agreement, seen(new), laser_scan(later, 1.0), HERE)
    for found, ends in ((agreement, 9), (again, 7)):
        if is_round:
            assert found.repeated is not None
            wanted = {*range(ends), *range(beams - ends, beams)}
            assert set(np.flatnonzero(found.repeated).tolist()) == wanted
        else:
            assert found.repeated is None


def test_of_a_coarse_lidar_at_least_six_beams_repeat() -> None:
    for beams, expected in ((6, 6), (5, 0)):
        old, new = noisy(1, 90), noisy(2, 90)
        new[:beams] = old[:beams]
        before = seen(old)
        assert before.view is not None
        coarse = before.view.geometry._replace(increment=-math.radians(4.0))
        before = before._replace(view=before.view._replace(geometry=coarse))
        repeated = repeat(NOISY, before, laser_scan(new, 1.0), AHEAD).repeated
        assert (0 if repeated is None else np.count_nonzero(repeated)) == expected


@pytest.mark.parametrize("at_m", [math.nan, math.inf, -math.inf, 0.0, 0.05, 9.6, 12.0])
def test_codes_and_readings_at_the_ends_of_the_range_may_repeat(at_m: float) -> None:
    """From 0.05 m to 12 m: a constant is often a code, or the robot itself."""
    assert repeating(30, at_m=at_m) == []


@pytest.mark.parametrize("at_m", [0.06, 9.5])
def test_other_readings_may_not(at_m: float) -> None:
    assert len(repeating(30, at_m=at_m)) == 30


@pytest.mark.parametrize(
    ("pose", "moves"),
    [
        (HERE, False),
        (Pose(math.nextafter(REST, 0.0), 0.0, 0.0), False),
        (Pose(-REST, 0.0, 0.0), True),
        (Pose(0.0, REST, 0.0), True),
        (Pose(0.0, 0.0, -REST), True),
        (None, False),
    ],
)
def test_only_a_moving_robot_by_odometry_shows_that_a_block_repeats(
    pose: Pose | None, *, moves: bool
) -> None:
    assert bool(repeating(30, pose=pose)) is moves


def test_a_lidar_that_has_shown_no_noise_at_rest_may_repeat() -> None:
    assert repeating(30, agreement=Agreement(rests=RESTS - 1)) == []


def test_a_lidar_shows_its_noise_in_several_scans_at_rest() -> None:
    agreement, before = Agreement(), seen(noisy(0))
    for count in range(1, RESTS + 3):
        scan = noisy(count)
        agreement = repeat(agreement, before, laser_scan(scan, 1.0), HERE)
        before = seen(scan)
        assert agreement.rests == min(count, RESTS)
    # A moving robot shows nothing new about it.
    assert repeat(agreement, before, laser_scan(noisy(50), 1.0), AHEAD).rests == RESTS


@pytest.mark.parametrize(("sample", "rests"), [(Odometry(NEUTRAL, 1.0), RESTS), (None, 0)])
def test_without_odometry_no_lidar_shows_its_noise(sample: Odometry | None, rests: int) -> None:
    sight = Sight((LidarState(),))
    for number in range(RESTS + 1):
        sight = see(sight, CONFIG, laser_scan(noisy(number), 1.0 + 0.05 * number), Base(odometry=sample))
    assert sight.lidars[0].agreement.rests == rests


@pytest.mark.parametrize("blocks", [0, 20])
@pytest.mark.parametrize("pose", [HERE, AHEAD])
def test_a_lidar_that_repeats_more_than_a_share_of_its_single_readings_has_no_noise(
    pose: Pose, blocks: int
) -> None:
    """Beside the wide blocks, which may be repeated segments at rest, too."""
    for extra, is_noisy in ((0, True), (1, False)):
        old, new = noisy(1), noisy(2)
        single = np.arange(round(NOISY_SHARE * (BEAMS - blocks)) + extra) * 2 + 30
        new[single] = old[single]
        new[:blocks] = old[:blocks]
        found = repeat(NOISY, seen(old), laser_scan(new, 1.0), pose)
        if pose == HERE:
            assert found.rests == (RESTS if is_noisy else 0)
        elif blocks:
            assert (found.repeated is not None) is is_noisy


@pytest.mark.parametrize(("change_m", "rests"), [(0.99 * LEAST_CHANGE_M, 0), (1.01 * LEAST_CHANGE_M, RESTS)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_simulated_robot_that_trembles_at_rest_shows_no_noise(
    change_m: float, rests: int, sign: float
) -> None:
    old = np.full(BEAMS, 0.5, dtype=np.float32)
    new = old + np.float32(sign * change_m)
    assert repeat(NOISY, seen(old), laser_scan(new, 1.0), HERE).rests == rests


def test_of_a_moving_robot_only_readings_that_are_the_same_bit_for_bit_repeat() -> None:
    old, new = noisy(1), noisy(2)
    new[30:60] = old[30:60]
    assert repeat(NOISY, seen(old), laser_scan(new, 1.0), AHEAD).repeated is not None
    new[30:60] += np.float32(LEAST_CHANGE_M / 2.0)
    assert repeat(NOISY, seen(old), laser_scan(new, 1.0), AHEAD).repeated is None


@pytest.mark.parametrize(("apart", "rests"), [(BEAMS // 4, 0), (BEAMS // 4 + 1, RESTS)])
def test_a_few_noisy_readings_beside_wide_blocks_show_no_noise(apart: int, rests: int) -> None:
    old, new = noisy(1), noisy(2)
    new[apart:] = old[apart:]
    assert repeat(NOISY, seen(old), laser_scan(new, 1.0), HERE).rests == rests


def test_beams_without_a_return_do_not_count_as_noise() -> None:
    old, new = noisy(1), noisy(2)
    old[100:], new[100:] = math.inf, math.inf
    new[:40:2] = old[:40:2]  # 20 of 100 returns
    assert repeat(NOISY, seen(old), laser_scan(new, 1.0), HERE).rests == 0


def test_a_block_repeats_until_its_readings_change_also_at_rest() -> None:
    old, new = noisy(1), noisy(2)
    new[100:140] = old[100:140]
    agreement = repeat(NOISY, seen(old), laser_scan(new, 1.0), AHEAD)
    later = noisy(3)
    later[100:120] = new[100:120]
    agreement = repeat(agreement, seen(new, AHEAD), laser_scan(later, 1.1), AHEAD)
    assert agreement.repeated is not None
    assert np.flatnonzero(agreement.repeated).tolist() == list(range(100, 120))
    last = noisy(4)
    last[100:105] = later[100:105]  # no wide block any more
    assert repeat(agreement, seen(later, AHEAD), laser_scan(last, 1.2), AHEAD).repeated is None


def test_a_scan_that_repeats_as_a_whole_changes_nothing_here() -> None:
    some = np.zeros(BEAMS, dtype=np.bool_)
    some[:20] = True
    old = noisy(1)
    old[200] = math.nan
    agreement = NOISY._replace(repeated=some)
    for pose in (HERE, AHEAD):
        assert repeat(agreement, seen(old), laser_scan(old.copy(), 1.0), pose) is agreement


def test_scans_of_other_sizes_and_scans_without_an_earlier_one_repeat_nothing() -> None:
    agreement = NOISY._replace(repeated=np.ones(BEAMS, dtype=np.bool_))
    scan = laser_scan(noisy(2), 1.0)
    for before in (None, seen(noisy(1, 361)), seen(noisy(1))._replace(view=None)):
        assert repeat(agreement, before, scan, AHEAD).repeated is None
    assert repeat(agreement, seen(noisy(1)), scan, AHEAD).repeated is None
    assert repeat(agreement, seen(noisy(1)), scan, None).repeated is None


def test_the_returns_of_a_repeated_block_count_but_prove_nothing_free() -> None:
    """For one timeout, the earlier scan stands in for its directions; after that, they are a hole."""
    block = np.zeros(BEAMS, dtype=np.bool_)
    block[170:190] = True
    ranges = np.full(BEAMS, 2.0, dtype=np.float32)
    first = read(ranges, taken_s=1.0)
    soon = read(ranges + np.float32(0.001) * ~block, first, taken_s=1.1, repeated=block)
    late = read(ranges + np.float32(0.002) * ~block, soon, taken_s=1.3, repeated=block)
    for reading in (soon, late):
        assert reading.problem is None
        assert reading.view is not None
        assert len(reading.around.points) == BEAMS
        assert not reading.view.hit[block].any()
        assert reading.view.hit[~block].all()
        assert (reading.view.explained_s[block] == 1.0).all()
    assert soon.view is not None
    assert late.view is not None
    assert (soon.view.free_m[block] == 2.0).all()
    assert (late.view.free_m[block] == 0.0).all()
    assert (late.view.free_m[~block] > 2.0).all()
    # It erases no memory: neither as a return behind a point, nor as one at its place.
    points = np.array([[1.0, 0.0]])
    kept = remember(Remembered(points, np.zeros(1)), late.view, Mount())
    assert kept.points.tolist() == points.tolist()
    assert kept.misses.tolist() == [0.0]


def approach(
    half_rad: float, speed_m_s: float, *, noise_m: float = 0.002, since_s: float = 2.5, until_s: float = 99.0
) -> Outcome:
    """Drive at a pillar; from some time on, the sector ahead repeats its last readings."""
    kept: list[Ranges] = []
    angle = LIDAR.angle_min + LIDAR.angle_increment * np.arange(BEAMS)

    def stick(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        if not since_s < at_s < until_s:
            kept[:] = [ranges]
        return np.where(np.abs(angle) < half_rad, kept[0], ranges)

    scene = plain_scene((3.0, 0.0, 0.05), lidars=(replace(LIDAR, noise_m=noise_m),), duration_s=12.0)
    return run(scene, operator=Scripted(Velocity(speed_m_s, 0.0)), spoil=stick, stuck_s=math.inf)


@pytest.mark.parametrize("noise_m", [0.0005, 0.005])
@pytest.mark.parametrize(("half_rad", "speed_m_s"), [(0.2, 0.8), (0.5, 0.8), (1.57, 0.8), (0.5, 0.3)])
def test_a_pillar_behind_a_sector_that_repeats_is_not_hit(
    half_rad: float, speed_m_s: float, noise_m: float
) -> None:
    """The robot once reached the pillar at full speed: the sector showed it where it had been."""
    outcome = approach(half_rad, speed_m_s, noise_m=noise_m)
    assert outcome.closest_m >= BOUND_M
    assert "SCAN_BLIND" in outcome.stops


def test_a_sector_that_repeats_for_two_scans_stops_nothing() -> None:
    """A merger may publish faster than its sources."""
    outcome = approach(0.5, 0.5, until_s=2.61)
    assert "SCAN_BLIND" not in outcome.stops
    assert outcome.travelled_m > 2.0


def test_a_law_that_was_never_told_of_motion_judges_no_sector() -> None:
    law = Law(scanning=False)
    kept = noisy(1)
    for number in range(30):
        ranges = noisy(number + 2)
        ranges[100:150] = kept[100:150]
        law.now_s += 0.02
        odometry = None if number < 20 else Odometry(NEUTRAL, law.now_s)
        law.step(Inputs(scans=(laser_scan(ranges, law.now_s),), odometry=odometry))
        assert law.state.sight.lidars[0].agreement.repeated is None


def test_a_scan_whose_numbers_contradict_each_other_is_refused_as_before() -> None:
    law = Law()
    for increment in (0.0, math.nan, math.inf):
        law.now_s += 0.02
        scan = replace(laser_scan(noisy(1), law.now_s), angle_increment=increment)
        assert isinstance(scan, LaserScan)
        law.step(Inputs(scans=(scan,), odometry=Odometry(NEUTRAL, law.now_s)))
        assert law.decision.scan_problem
