"""What becomes of the ranges of a lidar with faults."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.sensor_faults import (
    NEAR_M,
    NO_FAULTS,
    STRAY_M,
    FaultyLidar,
    LidarFaults,
    Ranges,
    nearest_object,
    parse_faults,
)

ANGLES_RAD = np.deg2rad(np.arange(-180.0, 180.0))
RANGES = np.full(360, 2.0, dtype=np.float32)


def faulty(seed: int = 0, angles_rad: np.ndarray = ANGLES_RAD) -> FaultyLidar:
    return FaultyLidar(angles_rad, np.full(len(angles_rad), 0.25), 0.1, seed)


def spoil(faults: LidarFaults, ranges: Ranges, angles_rad: np.ndarray) -> Ranges:
    return faulty(angles_rad=angles_rad).spoil(faults, ranges)


def test_no_faults_change_nothing() -> None:
    np.testing.assert_array_equal(spoil(NO_FAULTS, RANGES, ANGLES_RAD), RANGES)


def test_all_nan_leaves_no_reading() -> None:
    spoiled = spoil(parse_faults("all_nan; blocked 0 1"), RANGES, ANGLES_RAD)
    assert spoiled.dtype == np.float32
    assert np.isnan(spoiled).all()


def blocked_deg(text: str) -> list[int]:
    spoiled = spoil(parse_faults(text), RANGES, ANGLES_RAD)
    assert spoiled.dtype == np.float32
    assert np.all(np.isnan(spoiled) | (spoiled == 2.0))
    return [round(math.degrees(angle)) for angle in ANGLES_RAD[np.isnan(spoiled)]]


def test_a_blocked_sector_goes_counter_clockwise_and_its_edges_are_in_it() -> None:
    quarter_rad = math.pi / 2
    assert blocked_deg(f"blocked 0 {quarter_rad}") == list(range(91))
    assert blocked_deg(f"blocked {quarter_rad} 0") == [*range(-180, 1), *range(90, 180)]


def test_a_blocked_sector_may_lie_across_the_seam_behind() -> None:
    assert blocked_deg("blocked 3.1 -3.1") == [-180, -179, -178, 178, 179]


def test_a_sector_as_wide_as_a_turn_blocks_everything() -> None:
    assert len(blocked_deg("blocked -4 4")) == 360


def test_several_sectors_are_blocked_together() -> None:
    assert blocked_deg("blocked -0.01 0.01; blocked 1.56 1.58") == [0, 90]


def test_the_true_ranges_are_left_as_they_are() -> None:
    ranges = RANGES.copy()
    spoil(parse_faults("blocked -1 1"), ranges, ANGLES_RAD)
    spoil(parse_faults("all_nan"), ranges, ANGLES_RAD)
    np.testing.assert_array_equal(ranges, RANGES)


@pytest.mark.parametrize("code", [0.0, math.inf, -math.inf, 81.83])
def test_a_blocked_sector_reads_the_code_that_was_asked_for(code: float) -> None:
    spoiled = spoil(parse_faults(f"blocked 0 0.1 {code}"), RANGES, ANGLES_RAD)
    assert spoiled[180:186].tolist() == [np.float32(code)] * 6
    assert (np.delete(spoiled, slice(180, 186)) == 2.0).all()


def test_the_first_scan_after_a_freeze_stays_until_other_faults_are_in_force() -> None:
    lidar, frozen = faulty(), parse_faults("freeze; beams 0.5")
    first = lidar.spoil(frozen, RANGES)
    assert np.isnan(first).any()
    assert lidar.spoil(frozen, RANGES + 1.0) is first
    lidar.thaw()
    assert (lidar.spoil(NO_FAULTS, RANGES + 1.0) == 3.0).all()


def scene(*things: tuple[int, int, float]) -> Ranges:
    """Beams of 1°, 6 m of free space, and things from one beam to before another at a distance."""
    ranges = np.full(360, 6.0, dtype=np.float32)
    for start, end, distance_m in things:
        ranges[np.arange(start, end) % 360] = distance_m
    return ranges


def lost(text: str, ranges: Ranges, scans: int = 1, seed: int = 0) -> list[set[int]]:
    """The beams of each of some scans that read something else than without faults."""
    lidar, faults = faulty(seed), parse_faults(text)
    spoiled = [lidar.spoil(faults, ranges) for _ in range(scans)]
    return [
        set(np.flatnonzero((one != ranges) & ~(np.isnan(one) & np.isnan(ranges))).tolist()) for one in spoiled
    ]


def test_a_dropout_takes_the_whole_nearest_object_and_nothing_else() -> None:
    ranges = scene((170, 190, 1.0), (190, 200, 1.5), (40, 60, 1.2))
    assert lost("dropout 1", ranges) == [set(range(170, 190))]
    assert spoil(parse_faults("dropout 1"), ranges, ANGLES_RAD)[180] == math.inf
    assert spoil(parse_faults("dropout 1 0"), ranges, ANGLES_RAD)[180] == 0.0


def test_a_dropout_takes_an_object_across_the_seam_of_a_full_turn_whole() -> None:
    assert lost("dropout 1", scene((350, 372, 1.0))) == [set(range(350, 360)) | set(range(12))]


def test_a_fan_with_edges_has_no_object_across_them() -> None:
    angles_rad = np.deg2rad(np.arange(-135.0, 136.0))
    ranges = np.full(271, 6.0, dtype=np.float32)
    ranges[:10] = ranges[-20:] = 1.0
    ranges[:10] += 0.01
    met = nearest_object(ranges, angles_rad)
    assert np.flatnonzero(met).tolist() == list(range(251, 271))


def test_an_object_ends_where_depth_steps_and_a_slanted_one_does_not() -> None:
    slanted = scene()
    slanted[100:110] = np.arange(10) * 0.1 + 0.8
    slanted[110:115] = 1.9
    assert set(np.flatnonzero(nearest_object(slanted, ANGLES_RAD))) == set(range(100, 110))


def test_all_that_is_near_all_around_is_one_object() -> None:
    assert nearest_object(scene((0, 360, 1.0)), ANGLES_RAD).all()


def test_what_is_too_close_to_measure_is_the_nearest_and_what_reads_nothing_is_none() -> None:
    ranges = scene((10, 12, 0.5), (80, 83, -math.inf), (90, 95, math.nan))
    assert set(np.flatnonzero(nearest_object(ranges, ANGLES_RAD))) == {80, 81, 82}


def test_what_is_just_too_far_is_never_missing() -> None:
    just_nearer = float(np.nextafter(np.float32(NEAR_M), np.float32(0.0)))
    assert lost("dropout 1", scene((10, 20, NEAR_M))) == [set()]
    assert lost("dropout 1", scene((10, 20, just_nearer))) == [set(range(10, 20))]
    assert not nearest_object(np.full(360, np.nan, dtype=np.float32), ANGLES_RAD).any()


@given(start=st.integers(0, 359), width=st.integers(1, 360), full=st.booleans())
def test_wherever_a_single_object_stands_all_of_it_is_found(start: int, width: int, full: bool) -> None:  # noqa: FBT001
    angles_rad = ANGLES_RAD if full else 0.5 * ANGLES_RAD
    end = start + width if full else min(360, start + width)
    ranges = scene((start, end, 1.0))
    assert set(np.flatnonzero(nearest_object(ranges, angles_rad))) == {n % 360 for n in range(start, end)}


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_a_dropout_happens_in_its_share_of_the_scans(share: float) -> None:
    scans = lost(f"dropout {share}", scene((170, 190, 1.0)), scans=3000)
    assert set(map(len, scans)) == {0, 20}
    assert np.mean([bool(one) for one in scans]) == pytest.approx(share, rel=0.2)


def test_single_beams_are_missing_by_their_share_others_in_each_scan() -> None:
    scans = lost("beams 0.1 0", RANGES, scans=200)
    assert np.mean([len(one) for one in scans]) == pytest.approx(36, rel=0.05)
    assert len({frozenset(one) for one in scans}) == 200


def test_a_stray_reading_is_one_beam_within_its_distance_of_the_hull() -> None:
    lidar, faults = faulty(), parse_faults("stray 0.5")
    spoiled = [lidar.spoil(faults, RANGES) for _ in range(1000)]
    strays = [one[one != 2.0] for one in spoiled]
    assert set(map(len, strays)) == {0, 1}
    assert np.mean([len(one) for one in strays]) == pytest.approx(0.5, abs=0.05)
    found_m = np.concatenate(strays) - 0.25
    assert 0.0 <= found_m.min() < 0.01
    assert STRAY_M - 0.01 < found_m.max() <= STRAY_M
    assert len({int(np.flatnonzero(one != 2.0)[0]) for one in spoiled if (one != 2.0).any()}) > 200


def test_a_stray_reading_is_none_behind_what_is_really_there_and_none_too_near_to_measure() -> None:
    lidar, faults = FaultyLidar(ANGLES_RAD, np.zeros(360), 0.2), parse_faults("stray 1")
    near = np.full(360, 0.25, dtype=np.float32)
    for _ in range(200):
        spoiled = lidar.spoil(faults, near)
        assert np.float32(0.2) <= spoiled.min()
        assert spoiled.max() == 0.25


def test_a_stray_reading_comes_in_a_beam_that_saw_nothing_as_well() -> None:
    nothing = np.full(360, np.nan, dtype=np.float32)
    assert np.isfinite(spoil(parse_faults("stray 1"), nothing, ANGLES_RAD)).sum() == 1


@pytest.mark.parametrize(
    "text", ["dropout 0.3", "beams 0.1", "stray 0.5", "dropout 0.3; beams 0.1; stray 0.5"]
)
def test_the_same_seed_makes_the_same_faults(text: str) -> None:
    ranges = scene((170, 190, 1.0))
    assert lost(text, ranges, scans=50, seed=3) == lost(text, ranges, scans=50, seed=3)
    assert lost(text, ranges, scans=50, seed=3) != lost(text, ranges, scans=50, seed=4)


def test_what_is_beyond_the_reach_is_missed() -> None:
    ranges = scene((10, 20, 0.6), (20, 30, 0.61), (40, 41, math.nan))
    spoiled = spoil(parse_faults("reach 0.6"), ranges, ANGLES_RAD)
    assert set(np.flatnonzero(np.isfinite(spoiled)).tolist()) == set(range(10, 20))
    assert math.isnan(spoiled[40])
    assert np.isinf(np.delete(spoiled, [*range(10, 20), 40])).all()
