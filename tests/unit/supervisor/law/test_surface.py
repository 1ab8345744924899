"""The distance that counts for a beam: that of its surface, minus two standard errors."""

import math

import numpy as np
import pytest

from supervisor.law.reckoning import Pose
from supervisor.law.surface import (
    EXPLAINED,
    FEWEST,
    LEAST_NOISE_M,
    MEASUREMENTS,
    MOST_NOISE_M,
    MOST_SCANS,
    NOTHING,
    REST,
    Surfaces,
    surfaces,
)

BEAMS = 360
STEP_RAD = 2 * math.pi / BEAMS
HERE = Pose(0.0, 0.0, 0.0)
NOISE_M = 0.01
NOISY = Surfaces(NOISE_M, 1)
ALTERNATING = np.resize([1.0, -1.0], BEAMS)
SMALLEST_M = 0.4
"""Three beams, each a degree from the next, up to 7.6 m away."""


@pytest.fixture
def known_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """The noise stays as it is, whatever the scans show."""
    monkeypatch.setattr("supervisor.law.surface.FEWEST", 10 * BEAMS)


def read(
    ranges: np.ndarray,
    before: Surfaces = NOISY,
    pose: Pose = HERE,
    step_rad: float = STEP_RAD,
    near_m: float = 3.0,
    smallest_m: float = SMALLEST_M,
    *,
    is_round: bool = True,
) -> tuple[Surfaces, np.ndarray]:
    hit = np.isfinite(ranges)
    return surfaces(before, ranges, hit, step_rad, pose, near_m, smallest_m, is_round=is_round)


def wall(distance_m: float = 0.6, slant_rad: float = 0.4, beams: int = 41) -> np.ndarray:
    """Ranges of a straight wall, over beams that do not form a full turn."""
    angle = STEP_RAD * (np.arange(beams) - beams // 2)
    return distance_m / np.cos(angle - slant_rad)


def noisy(ranges: np.ndarray, seed: int = 0, noise_m: float = NOISE_M) -> np.ndarray:
    return ranges + noise_m * np.random.default_rng(seed).standard_normal(len(ranges))


# --- the distance that counts


def test_a_slanted_wall_without_a_deviation_counts_two_standard_errors_nearer() -> None:
    ranges = wall()
    _, counts_m = read(ranges, is_round=False)
    beams = np.full(41, 7.0)
    beams[[0, 1, 2, -1, -2, -3]] = 1.0, 3.0, 5.0, 1.0, 3.0, 5.0
    expected = ranges - np.where(beams > 1.0, 2.0 * NOISE_M / np.sqrt(beams), 0.0)
    assert counts_m == pytest.approx(expected, abs=1e-9)


def test_the_first_beam_of_a_full_turn_is_the_last_one_s_neighbour() -> None:
    _, counts_m = read(np.full(BEAMS, 0.1))
    assert counts_m == pytest.approx(0.1 - 2.0 * NOISE_M / math.sqrt(7.0), abs=1e-4)


@pytest.mark.usefixtures("known_noise")
def test_the_first_and_the_last_beam_of_less_than_a_turn_are_no_neighbours() -> None:
    ranges, state = np.full(41, 0.1), NOISY
    for scans in (1, 2):
        state, counts_m = read(ranges, state, is_round=False)
        assert (
            counts_m[0]
            == counts_m[-1]
            == pytest.approx(0.1 if scans == 1 else 0.1 - math.sqrt(2.0) * NOISE_M)
        )


def test_a_clockwise_scan_counts_as_a_counter_clockwise_one() -> None:
    ranges = noisy(wall())
    _, counts_m = read(ranges, is_round=False)
    _, clockwise_m = read(ranges[::-1], step_rad=-STEP_RAD, is_round=False)
    assert clockwise_m[::-1] == pytest.approx(counts_m)


def test_the_neighbours_of_a_denser_lidar_are_a_degree_apart() -> None:
    ranges = np.full(3 * BEAMS, 0.6)
    ranges[[98, 99, 101, 102]] = 0.58  # a third and two thirds of a degree beside beam 100
    _, counts_m = read(ranges, step_rad=STEP_RAD / 3)
    assert counts_m[100] == pytest.approx(0.6 - 2.0 * NOISE_M / math.sqrt(7.0), abs=1e-3)
    ranges[97] = ranges[103] = 0.58
    _, counts_m = read(ranges, step_rad=STEP_RAD / 3)
    assert counts_m[100] == pytest.approx((0.6 + 2 * 0.58) / 3, abs=1e-3)


def test_one_reading_of_a_wall_that_is_too_near_counts_with_its_surface() -> None:
    ranges = np.full(BEAMS, 0.6)
    ranges[100] -= 3.0 * NOISE_M
    _, counts_m = read(ranges)
    assert counts_m[100] == pytest.approx(
        0.6 - 3.0 * NOISE_M / 7.0 - 2.0 * NOISE_M / math.sqrt(7.0), abs=1e-3
    )
    assert counts_m[103] == pytest.approx(
        0.6 - 3.0 * NOISE_M / 7.0 - 2.0 * NOISE_M / math.sqrt(7.0), abs=1e-3
    )


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_reading_that_noise_does_not_explain_counts_as_it_is(side: float) -> None:
    off_m = EXPLAINED * NOISE_M
    ranges = np.full(BEAMS, 5.0)
    for share, is_kept in ((1.02, True), (0.98, False)):
        ranges[100] = 5.0 + side * share * off_m
        _, counts_m = read(ranges)
        assert bool(counts_m[100] == ranges[100]) is is_kept


def test_a_surface_ends_at_the_first_pair_that_does_not_agree() -> None:
    ranges = np.full(BEAMS, 2.0)
    ranges[:98] = 1.0
    ranges[103:] = 1.0  # five beams of 2 m, between what is nearer
    _, counts_m = read(ranges)
    assert counts_m[98] == counts_m[102] == 2.0
    assert counts_m[99] == pytest.approx(2.0 - 2.0 * NOISE_M / math.sqrt(3.0), abs=1e-3)
    assert counts_m[100] == pytest.approx(2.0 - 2.0 * NOISE_M / math.sqrt(5.0), abs=2e-3)
    ranges[98] = ranges[102] = 1.0
    ranges[97] = ranges[103] = 2.0  # beyond a pair that does not agree, one that does
    _, counts_m = read(ranges)
    assert counts_m[100] == pytest.approx(2.0 - 2.0 * NOISE_M / math.sqrt(3.0), abs=1e-3)


def test_a_post_of_four_beams_stays_before_a_wall_that_noise_could_explain() -> None:
    ranges = np.full(BEAMS, 0.6)
    ranges[100:104] = 0.6 - 4.0 * NOISE_M
    _, counts_m = read(ranges)
    assert counts_m[101:103] == pytest.approx(0.6 - 4.0 * NOISE_M, abs=1e-3)


@pytest.mark.parametrize(("noise_m", "excess_m"), [(0.01, 0.0), (0.011, 0.0), (0.012, 0.001), (0.03, 0.019)])
def test_of_a_post_and_of_a_beam_alone_the_noise_beyond_11_mm_counts(noise_m: float, excess_m: float) -> None:
    ranges = np.full(BEAMS, 0.6)
    ranges[100:103] = 0.6 - 4.0 * noise_m
    _, counts_m = read(ranges, NOISY._replace(noise_m=noise_m))
    assert counts_m[101] == pytest.approx(0.6 - 4.0 * noise_m - 2.0 * excess_m / math.sqrt(3.0), abs=3e-4)
    ranges[[99, 103]] = math.inf
    _, counts_m = read(ranges, NOISY._replace(noise_m=noise_m))
    assert counts_m[100] == pytest.approx(ranges[100] - 2.0 * excess_m), "an edge has no pair"


def test_where_the_smallest_obstacle_spans_fewer_than_three_beams_no_neighbour_counts() -> None:
    for step_rad, stride in ((STEP_RAD, 1), (STEP_RAD / 3, 3), (-STEP_RAD, 1)):
        most_m = 0.04 / (3 * stride * abs(step_rad))
        for distance_m, is_alone in ((0.999 * most_m, False), (1.001 * most_m, True)):
            ranges = np.full(BEAMS, distance_m)
            _, counts_m = read(ranges, step_rad=step_rad, smallest_m=0.04)
            assert bool(counts_m[100] == distance_m) is is_alone


def test_a_beam_without_a_return_is_nobody_s_neighbour() -> None:
    ranges = np.full(BEAMS, 0.6)
    ranges[101] = math.inf
    _, counts_m = read(ranges)
    assert counts_m[100] == counts_m[102] == 0.6
    assert counts_m[103] == pytest.approx(0.6 - 2.0 * NOISE_M / math.sqrt(3.0), abs=1e-3)


# --- a robot at rest


@pytest.mark.usefixtures("known_noise")
def test_the_mean_of_a_resting_robot_s_readings_counts_and_not_the_newest() -> None:
    state, ranges = NOISY, np.full(BEAMS, math.inf)
    for number, reading in enumerate((0.60, 0.62, 0.59, 0.63)):
        ranges[100] = reading  # a beam alone
        state, counts_m = read(ranges, state)
        mean_m = np.mean((0.60, 0.62, 0.59, 0.63)[: number + 1])
        error_m = 0.0 if number == 0 else 2.0 * NOISE_M / math.sqrt(number + 1.0)
        assert counts_m[100] == pytest.approx(mean_m - error_m)


@pytest.mark.usefixtures("known_noise")
def test_at_rest_the_error_of_a_surface_shrinks_with_the_scans() -> None:
    state, ranges = NOISY, wall()
    for number in range(1, 5):
        state, counts_m = read(ranges, state, is_round=False)
        assert counts_m[20] == pytest.approx(ranges[20] - 2.0 * NOISE_M / math.sqrt(7.0 * number))
    state = NOISY
    for number in range(1, 5):
        state, counts_m = read(np.full(BEAMS, 0.1), state)
        assert counts_m[0] == pytest.approx(0.1 - 2.0 * NOISE_M / math.sqrt(7.0 * number), abs=1e-4)


@pytest.mark.usefixtures("known_noise")
def test_at_rest_a_surface_ends_where_the_noise_of_the_mean_does_not_explain_a_pair() -> None:
    state, ranges = NOISY, np.full(BEAMS, 0.6)
    ranges[100] -= 0.8 * EXPLAINED * NOISE_M
    for number in (1, 2):
        state, counts_m = read(ranges, state)
        alone_m = ranges[100] - 2.0 * NOISE_M / math.sqrt(number)
        assert bool(counts_m[100] == pytest.approx(alone_m)) is (number == 2)


@pytest.mark.usefixtures("known_noise")
def test_a_reading_that_noise_does_not_explain_begins_a_new_mean() -> None:
    for share, scans in ((0.99, 2.0), (1.01, 1.0), (-0.99, 2.0), (-1.01, 1.0)):
        ranges = np.full(BEAMS, math.inf)
        ranges[100] = 0.6
        state, _ = read(ranges)
        ranges[100] += share * EXPLAINED * NOISE_M
        state, _ = read(ranges, state)
        assert state.seen[100] == scans
        assert state.mean_m[100] == pytest.approx(0.6 + share * EXPLAINED * NOISE_M / scans)


@pytest.mark.usefixtures("known_noise")
def test_a_difference_of_exactly_what_noise_explains_is_explained() -> None:
    nothing = np.zeros(BEAMS)
    state = NOISY._replace(mean_m=nothing, seen=nothing + 1.0)
    assert read(nothing + EXPLAINED * NOISE_M, state)[0].seen[0] == 2.0
    assert read(nothing + math.nextafter(EXPLAINED * NOISE_M, 1.0), state)[0].seen[0] == 1.0
    assert pytest.approx(4.0 * math.sqrt(1.5)) == EXPLAINED


@pytest.mark.usefixtures("known_noise")
def test_a_beam_that_returns_again_begins_a_new_mean() -> None:
    ranges = np.full(BEAMS, 0.6)
    state, _ = read(ranges)
    state, _ = read(np.where(np.arange(BEAMS) == 100, math.inf, ranges), state)
    assert math.isnan(state.mean_m[100])
    state, _ = read(ranges, state)
    assert (state.seen[100], state.seen[200], state.mean_m[100]) == (1.0, 3.0, 0.6)


@pytest.mark.usefixtures("known_noise")
def test_the_mean_forgets_old_readings() -> None:
    state, ranges = NOISY, np.full(BEAMS, 0.6)
    for _ in range(60):
        state, _ = read(ranges, state)
    assert state.seen.tolist() == [MOST_SCANS] * BEAMS
    state, _ = read(ranges + 0.01, state)
    assert state.mean_m == pytest.approx(0.6 + 0.01 / MOST_SCANS)


@pytest.mark.usefixtures("known_noise")
@pytest.mark.parametrize("axis", range(3))
def test_a_robot_that_moves_begins_new_means(axis: int) -> None:
    ranges = np.full(BEAMS, 0.6)
    first, _ = read(ranges)
    slow = first
    for moved in (0.6 * REST, math.nextafter(REST, 0.0), -math.nextafter(REST, 0.0)):
        way = [0.0, 0.0, 0.0]
        way[axis] = moved
        slow, _ = read(ranges, slow, Pose(*way))
        assert slow.pose == HERE, "many small motions add up"
    assert slow.seen[0] == 4.0
    way[axis] = REST
    state, counts_m = read(ranges + 0.02, slow, Pose(*way))
    assert (state.seen[0], state.pose, state.mean_m[0]) == (1.0, Pose(*way), 0.62)
    assert counts_m[0] == pytest.approx(0.62 - 2.0 * NOISE_M / math.sqrt(7.0), abs=1e-3)


@pytest.mark.usefixtures("known_noise")
def test_means_of_other_directions_are_not_used() -> None:
    state, _ = read(np.full(BEAMS, 0.6))
    state, _ = read(np.full(BEAMS, 0.6), state._replace(mean_m=NOTHING))
    assert state.seen[0] == 1.0


# --- the noise


def at_rest(
    means: np.ndarray, noise_m: float | np.ndarray, scans: int, seed: int = 0, **more: object
) -> Surfaces:
    """What scans of a robot at rest have shown, from the first one on."""
    rng, state = np.random.default_rng(seed), Surfaces()
    for _ in range(scans):
        state, _ = read(means + noise_m * rng.standard_normal(len(means)), state, **more)  # type: ignore[arg-type]
    return state


def test_until_the_robot_has_rested_all_readings_count_as_they_are() -> None:
    ranges, state = noisy(np.full(BEAMS, 1.0)), Surfaces()
    for number in range(5):
        state, counts_m = read(noisy(ranges, number), state, Pose(0.01 * number, 0.0, 0.0))
        assert (state.noise_m, state.measurements, state.pose.x_m) == (0.0, 0, 0.01 * number)
        assert counts_m == pytest.approx(noisy(ranges, number))


def test_readings_of_a_lidar_with_little_noise_count_as_they_are() -> None:
    ranges = noisy(np.full(BEAMS, 0.6))
    still = Surfaces(pose=Pose(1.0, 0.0, 0.0))
    quiet = still._replace(noise_m=math.nextafter(LEAST_NOISE_M, 0.0))
    assert read(ranges, quiet)[1] is ranges
    assert read(ranges, still._replace(noise_m=LEAST_NOISE_M))[1] is not ranges


@pytest.mark.parametrize("noise_m", [0.003, 0.01, 0.025])
def test_the_noise_is_measured_to_a_tenth(noise_m: float) -> None:
    angle = STEP_RAD * (np.arange(BEAMS) + 0.5)
    room = np.minimum(2.0 / np.abs(np.cos(angle)), 2.2 / np.abs(np.sin(angle)))
    for scans in (2, 30, 200):
        state = at_rest(room, noise_m, scans)
        assert state.noise_m == pytest.approx(noise_m, rel=0.1)
        assert state.measurements == scans - 1


def test_the_mean_of_25_measurements_counts() -> None:
    ranges = np.full(BEAMS, 1.0)
    for before, measurements, share in ((0.0, 0, 1.0), (0.0, 1, 1 / 2), (0.01, 2, 1 / 3), (0.0, 400, 1 / 25)):
        state = Surfaces(before, measurements, HERE, ranges, np.ones(BEAMS))
        state, _ = read(ranges + 0.005 * ALTERNATING, state)
        once_m = 0.01 / math.sqrt(2.0) / (0.6745 * math.sqrt(1.5))
        assert state.noise_m == pytest.approx(before + (once_m - before) * share)
        assert state.measurements == measurements + 1
    assert MEASUREMENTS == 25


def test_the_newest_reading_differs_from_the_mean_of_n_by_the_error_of_both() -> None:
    ranges = np.full(BEAMS, 1.0)
    state = Surfaces(0.0, 0, HERE, ranges, np.full(BEAMS, 4.0))
    state, _ = read(ranges + 0.005 * ALTERNATING, state)
    assert state.noise_m == pytest.approx(0.01 / math.sqrt(1.25) / (0.6745 * math.sqrt(1.5)))


def test_half_of_the_beams_decide() -> None:
    ranges = np.full(43, 1.0)  # 41 beams have two neighbours
    state = Surfaces(0.0, 0, HERE, ranges, np.ones(43))
    for edges, noise_m in ((20, 0.0), (21, MOST_NOISE_M)):
        moving = ranges.copy()
        moving[:edges] += 0.5 * ALTERNATING[:edges]  # and the first quiet beam has one as its neighbour
        assert read(moving, state, is_round=False)[0].noise_m == noise_m


@pytest.mark.parametrize("change_m", [0.05, -0.5])
def test_a_smooth_change_is_no_noise(change_m: float) -> None:
    """The robot moves, and odometry does not show it."""
    ranges, state = np.full(BEAMS, 2.0), Surfaces()
    counts_m = ranges
    for number in range(5):
        state, counts_m = read(ranges + number * change_m * np.linspace(0.5, 1.0, BEAMS), state)
    assert state.noise_m < 1e-9
    assert (counts_m == ranges + 4 * change_m * np.linspace(0.5, 1.0, BEAMS)).all()


def test_the_neighbours_for_the_noise_are_a_degree_apart() -> None:
    ranges = np.full(3 * BEAMS, 1.0)
    state = Surfaces(0.0, 0, HERE, ranges, np.ones(3 * BEAMS))
    blocks = 0.005 * np.repeat(ALTERNATING, 3)
    assert read(ranges + blocks, state, step_rad=STEP_RAD / 3)[0].noise_m > 0.005


def test_what_stands_still_is_no_noise_however_jagged() -> None:
    fence = np.where(np.arange(BEAMS) % 4 < 2, 0.9, 1.0)
    assert at_rest(fence, 0.0, 10).noise_m == 0.0
    assert at_rest(fence, 0.005, 30).noise_m == pytest.approx(0.005, rel=0.1)


def test_more_noise_than_any_lidar_has_is_not_believed() -> None:
    assert at_rest(np.full(BEAMS, 2.0), 0.5, 2).noise_m == MOST_NOISE_M


def test_the_noise_of_near_returns_counts_if_they_suffice() -> None:
    ranges = np.full(BEAMS, 5.0)
    ranges[: FEWEST + 1] = 1.0  # the first beam has no neighbour
    noise_m = np.where(ranges == 5.0, 0.02, 0.0)
    assert at_rest(ranges, noise_m, 10).noise_m < 0.002
    assert at_rest(ranges, noise_m, 10, near_m=1.0).noise_m > 0.01, "no return is nearer than 1 m"
    ranges[FEWEST] = 5.0
    assert at_rest(ranges, noise_m, 10).noise_m > 0.01, "19 are not enough"


def test_the_noise_of_a_few_beams_is_not_measured() -> None:
    state = Surfaces(0.007, 4, HERE, np.full(BEAMS, 1.0), np.ones(BEAMS))
    ranges = np.full(BEAMS, math.inf)
    ranges[: FEWEST + 1] = 1.0
    assert read(ranges, state)[0][:2] == (0.007, 4)
    ranges[FEWEST + 1] = 1.0
    assert read(ranges, state)[0][:2] == (pytest.approx(0.0056), 5)
