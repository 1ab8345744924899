"""What the base shows of its brakes at each stop."""

import math

import numpy as np
import pytest

from supervisor.config import SupervisorSection
from supervisor.law import base_braking
from supervisor.law.base_braking import (
    GREATEST_M_S2,
    KEPT,
    LATE_S,
    LEAST_M_S2,
    LEAST_SPEED_M_S,
    LONGEST_DEAD_S,
    LONGEST_GAP_S,
    NO_LINE,
    REACHED_SHARE,
    SAMPLING_S,
    UNMEASURED,
    Braking,
    Ended,
    bound_dead_s,
    bound_m_s2,
    slipped,
)

STANDING_M_S = 0.05


def measure(
    braking: Braking,
    speed_m_s: float,
    at_s: float,
    *,
    is_driven: bool,
    stopped_s: float = 0.0,
    commanded_m_s: float = 1.0,
) -> Braking:
    """Process a sample of a base that is driven, or to which zero has been commanded since `stopped_s`."""
    return base_braking.measure(
        braking,
        speed_m_s,
        at_s,
        commanded_m_s=commanded_m_s if is_driven else 0.0,
        stopped_s=None if is_driven else stopped_s,
        standing_m_s=STANDING_M_S,
    )


def stop(
    braking: Braking = UNMEASURED,
    *,
    deceleration_m_s2: float,
    speed_m_s: float = 1.0,
    dead_s: float = 0.0,
    period_s: float = 0.02,
    noise_m_s: float = 0.0,
    seed: int = 0,
) -> Braking:
    """Drive at a speed for a second, then command zero until the base has stood for 0.1 s."""
    rng = np.random.default_rng(seed)
    start_s = max(braking.last_s, 0.0)
    ends_s = 1.0 + dead_s + speed_m_s / deceleration_m_s2 + 0.1
    for number in range(1, round(ends_s / period_s) + 1):
        now_s = number * period_s
        true_m_s = min(speed_m_s, speed_m_s - deceleration_m_s2 * (now_s - 1.0 - dead_s))
        shown_m_s = abs(max(0.0, true_m_s) + float(rng.normal(0.0, noise_m_s)))
        braking = measure(
            braking,
            shown_m_s,
            start_s + now_s,
            is_driven=now_s < 1.0,
            stopped_s=start_s + 1.0,
            commanded_m_s=speed_m_s,
        )
    return braking


@pytest.mark.parametrize("is_driven", [True, False])
def test_the_newest_sample_is_kept_while_the_base_drives_and_while_it_stops(*, is_driven: bool) -> None:
    braking = measure(UNMEASURED, 0.7, 1.0, is_driven=is_driven, stopped_s=0.5, commanded_m_s=0.8)
    assert (braking.last_m_s, braking.last_s) == (0.7, 1.0)


def test_a_base_exactly_as_fast_as_the_noise_stands_still() -> None:
    braking = measure(UNMEASURED, 1.0, 0.0, is_driven=True)
    for number in range(1, 51):
        braking = measure(braking, 1.0, number * 0.02, is_driven=True)
    braking = measure(braking, 0.8, 1.02, is_driven=False, stopped_s=1.0)
    braking = measure(braking, 0.2, 1.06, is_driven=False, stopped_s=1.0)
    assert measure(braking, math.nextafter(STANDING_M_S, 1.0), 1.08, is_driven=False, stopped_s=1.0).stopping
    assert not measure(braking, STANDING_M_S, 1.08, is_driven=False, stopped_s=1.0).stopping


def test_without_a_stop_nothing_is_known() -> None:
    assert bound_m_s2(UNMEASURED) == math.inf


@pytest.mark.parametrize("speed_m_s", [0.41, 0.6, 1.0])
@pytest.mark.parametrize("deceleration_m_s2", [0.5, 1.1, 1.5, 2.0])
@pytest.mark.parametrize("dead_s", [0.0, 0.03, 0.2])
@pytest.mark.parametrize("period_s", [0.01, 0.02, 0.05])
def test_a_stop_shows_the_deceleration_whatever_the_dead_time(
    speed_m_s: float, deceleration_m_s2: float, dead_s: float, period_s: float
) -> None:
    shown = stop(deceleration_m_s2=deceleration_m_s2, speed_m_s=speed_m_s, dead_s=dead_s, period_s=period_s)
    assert bound_m_s2(shown) == pytest.approx(deceleration_m_s2, rel=1e-6)


@pytest.mark.parametrize("dead_s", [0.0, 0.1])
def test_noise_changes_the_bound_by_no_more_than_a_fifth(dead_s: float) -> None:
    braking = UNMEASURED
    for seed in range(KEPT):
        braking = stop(
            braking, deceleration_m_s2=1.5, speed_m_s=0.6, dead_s=dead_s, noise_m_s=0.02, seed=seed
        )
    assert len(braking.shown_m_s2) == KEPT
    assert 0.8 * 1.5 < bound_m_s2(braking) < 1.05 * 1.5


def test_a_stop_downhill_is_remembered_for_several_stops_uphill() -> None:
    braking = stop(stop(deceleration_m_s2=0.7), deceleration_m_s2=0.7)
    for _ in range(KEPT - 2):
        braking = stop(braking, deceleration_m_s2=2.3)
        assert bound_m_s2(braking) == pytest.approx(0.7)
    assert bound_m_s2(stop(braking, deceleration_m_s2=2.3)) == pytest.approx(2.3)


def test_the_first_stop_counts_and_a_single_outlier_is_forgotten_at_the_next() -> None:
    braking = stop(deceleration_m_s2=0.5)
    assert bound_m_s2(braking) == pytest.approx(0.5)
    assert bound_m_s2(stop(braking, deceleration_m_s2=2.0)) == pytest.approx(2.0)


def test_a_slow_base_is_not_measured() -> None:
    slow_m_s = math.nextafter(LEAST_SPEED_M_S, 0.0)
    assert stop(deceleration_m_s2=0.5, speed_m_s=0.9 * slow_m_s).shown_m_s2 == ()


def test_a_base_that_follows_a_falling_command_is_not_weak() -> None:
    """The barrier reduces the speed with 0.9 m/s² on average; the base could brake with 2 m/s²."""
    braking, speed_m_s, now_s = UNMEASURED, 1.0, 0.0
    while speed_m_s > 0.02:
        now_s += 0.02
        speed_m_s = speed_m_s if now_s < 1.0 else speed_m_s - 0.9 * 0.02
        braking = measure(braking, speed_m_s, now_s, is_driven=True)
    braking = measure(braking, 0.0, now_s + 0.02, is_driven=False)
    assert braking.shown_m_s2 == ()


def test_a_stop_that_begins_while_the_command_falls_is_not_measured() -> None:
    """For its dead time, the base still follows the falling command with 0.9 m/s²; then it brakes with 2 m/s²."""
    braking, speed_m_s, now_s = UNMEASURED, 1.0, 0.0
    while speed_m_s > 0.0:
        now_s += 0.02
        falls_m_s2 = 0.0 if now_s < 1.0 else 0.9 if now_s < 1.7 else 2.0
        speed_m_s = max(0.0, speed_m_s - falls_m_s2 * 0.02)
        braking = measure(braking, speed_m_s, now_s, is_driven=now_s < 1.6)
    assert braking.shown_m_s2 == ()
    assert bound_m_s2(stop(braking, deceleration_m_s2=1.2)) == pytest.approx(1.2)


@pytest.mark.parametrize(("speed_m_s", "is_steady"), [(0.879, True), (0.877, False)])
def test_a_stop_begins_at_a_steady_speed(speed_m_s: float, *, is_steady: bool) -> None:
    """At 0.878 m/s, the newest sample is 0.9 of the mean that contains it with a weight of 0.2: 0.8 + 0.2 · 0.878."""
    braking = UNMEASURED._replace(mean_m_s=1.0, last_s=0.0)
    braking = measure(braking, speed_m_s, 0.02, is_driven=True)
    assert braking.stopping is is_steady


def test_a_base_that_rolled_on_counts_as_the_weakest_that_can_be_configured() -> None:
    assert bound_m_s2(stop(deceleration_m_s2=0.02)) == LEAST_M_S2
    assert bound_m_s2(stop(deceleration_m_s2=1.01 * LEAST_M_S2)) == pytest.approx(1.01 * LEAST_M_S2)


def test_a_stop_that_a_new_command_ends_is_not_measured() -> None:
    braking = UNMEASURED
    for number in range(1, 200):
        now_s = 0.02 * number
        speed_m_s = max(0.6, 1.0 - max(0.0, now_s - 1.0) * 0.5)
        braking = measure(braking, speed_m_s, now_s, is_driven=now_s < 1.0 or now_s > 1.8)
    assert braking.shown_m_s2 == ()
    assert bound_m_s2(stop(braking, deceleration_m_s2=1.2)) == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("gap_s", "is_measured"), [(0.999 * LONGEST_GAP_S, True), (1.001 * LONGEST_GAP_S, False)]
)
def test_a_stop_with_a_gap_in_odometry_is_not_measured(gap_s: float, *, is_measured: bool) -> None:
    braking, now_s = UNMEASURED, 0.0
    for speed_m_s in [1.0] * 50:
        now_s += 0.02
        braking = measure(braking, speed_m_s, now_s, is_driven=True)
    for speed_m_s in (0.8, 0.6, 0.4, 0.2, 0.0):
        now_s += gap_s if speed_m_s == 0.4 else 0.1
        braking = measure(braking, speed_m_s, now_s, is_driven=False)
    assert (len(braking.shown_m_s2) == 1) is is_measured


def test_a_sample_that_is_not_newer_changes_nothing() -> None:
    braking = measure(UNMEASURED, 1.0, 1.0, is_driven=True)
    assert measure(braking, 0.0, 1.0, is_driven=False) is braking


def test_odometry_that_shows_an_impossible_stop_is_no_measurement() -> None:
    assert stop(deceleration_m_s2=1.01 * GREATEST_M_S2).shown_m_s2 == ()
    assert len(stop(deceleration_m_s2=0.99 * GREATEST_M_S2).shown_m_s2) == 1


def test_odometry_that_jumps_to_zero_is_no_measurement() -> None:
    braking = measure(UNMEASURED._replace(mean_m_s=1.0, last_s=0.98), 1.0, 1.0, is_driven=True)
    assert measure(braking, 0.0, 1.02, is_driven=False).shown_m_s2 == ()


def test_only_the_last_stops_are_kept() -> None:
    braking = UNMEASURED
    for number in range(2 * KEPT):
        braking = stop(braking, deceleration_m_s2=1.0 + 0.01 * number, period_s=0.05)
    assert len(braking.shown_m_s2) == KEPT
    assert bound_m_s2(braking) == pytest.approx(1.0 + 0.01 * (KEPT + 1))


def samples(
    braking: Braking, speeds_m_s: list[float], *, start_s: float = 0.0, gap_s: float = 0.05
) -> Braking:
    """Zero is commanded, and odometry shows these speeds."""
    for number, speed_m_s in enumerate(speeds_m_s, start=1):
        at_s = start_s + number * gap_s
        braking = measure(braking, speed_m_s, at_s, is_driven=False)
    return braking


def driven(speed_m_s: float) -> Braking:
    """The base drove at this speed until the time 0."""
    before = Braking(mean_m_s=speed_m_s, last_m_s=speed_m_s, last_s=-0.05)
    return measure(before, speed_m_s, 0.0, is_driven=True)


@pytest.mark.parametrize(
    ("mean_m_s", "stopping"), [(LEAST_SPEED_M_S, True), (math.nextafter(LEAST_SPEED_M_S, 0.0), False)]
)
def test_a_stop_from_the_least_speed_is_measured(mean_m_s: float, *, stopping: bool) -> None:
    before = Braking(mean_m_s=mean_m_s, last_m_s=mean_m_s, last_s=0.0)
    assert measure(before, mean_m_s, 0.02, is_driven=True).stopping is stopping


def test_a_gap_of_the_longest_time_is_measured() -> None:
    braking = driven(1.0)
    for gap_s, stopping in ((LONGEST_GAP_S, True), (math.nextafter(LONGEST_GAP_S, 1.0), False)):
        after = measure(braking, 0.8, gap_s, is_driven=False)
        assert after.stopping is stopping


def test_a_stop_begins_again_if_the_base_is_fast_again() -> None:
    braking = samples(driven(1.0), [0.8, 0.7, 0.95, 0.8, 0.6, 0.4, 0.0])
    # From 0.8 to 0.4 m/s within two samples of 0.05 s.
    assert braking.shown_m_s2 == pytest.approx([(0.8**2 - 0.4**2) / 2 / 0.06])


def test_a_stop_without_a_loss_of_speed_has_no_result() -> None:
    assert samples(driven(1.0), [0.8, 0.8, 0.0]).shown_m_s2 == ()


@pytest.mark.parametrize("is_measured", [True, False])
def test_the_next_drive_begins_without_a_mean_speed(*, is_measured: bool) -> None:
    """After a stop, and after a gap in odometry."""
    braking, start_s = samples(driven(1.0), [0.8, 0.6, 0.0]), 0.15
    if not is_measured:
        braking, start_s = samples(driven(1.0), [0.8], gap_s=10.0), 10.0
    assert len(braking.shown_m_s2) == is_measured
    for number in range(1, 10):
        at_s = start_s + 0.02 * number
        braking = measure(braking, 0.5, at_s, is_driven=True)
    assert braking.mean_m_s == pytest.approx(0.5 * (1 - 0.8**9))
    assert braking.stopping


# --- the dead time


@pytest.mark.parametrize("speed_m_s", [0.41, 0.6, 1.0])
@pytest.mark.parametrize("deceleration_m_s2", [0.5, 1.5, 2.0])
@pytest.mark.parametrize("dead_s", [0.1, 0.15, 0.2, 0.4])
@pytest.mark.parametrize("period_s", [0.01, 0.02, 0.05])
def test_a_stop_shows_the_dead_time_whatever_the_deceleration(
    speed_m_s: float, deceleration_m_s2: float, dead_s: float, period_s: float
) -> None:
    shown = stop(deceleration_m_s2=deceleration_m_s2, speed_m_s=speed_m_s, dead_s=dead_s, period_s=period_s)
    assert shown.shown_dead_s == pytest.approx((dead_s,), abs=0.003)


@pytest.mark.parametrize("period_s", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("noise_m_s", [0.0, 0.02])
def test_a_base_that_follows_at_once_has_no_dead_time(period_s: float, noise_m_s: float) -> None:
    braking = UNMEASURED
    for seed in range(50):
        braking = stop(
            braking,
            deceleration_m_s2=(1.0, 1.5, 2.0)[seed % 3],
            speed_m_s=0.5 + 0.01 * seed,
            period_s=period_s,
            noise_m_s=noise_m_s,
            seed=seed,
        )
        assert bound_dead_s(braking) == 0.0
    assert len(braking.shown_dead_s) == KEPT


def test_noise_like_that_of_a_standing_base_rarely_shows_a_dead_time() -> None:
    bounds_s: list[float] = []
    braking = UNMEASURED
    for seed in range(100):
        braking = stop(braking, deceleration_m_s2=1.5, speed_m_s=0.7, noise_m_s=STANDING_M_S, seed=seed)
        bounds_s.append(bound_dead_s(braking))
    assert np.count_nonzero(bounds_s) <= 10
    assert max(bounds_s) < 0.06


def test_noise_changes_the_dead_time_by_no_more_than_the_tolerance() -> None:
    braking = UNMEASURED
    for seed in range(KEPT):
        braking = stop(braking, deceleration_m_s2=1.5, speed_m_s=0.6, dead_s=0.15, noise_m_s=0.02, seed=seed)
    assert len(braking.shown_dead_s) == KEPT
    assert 0.15 - LATE_S < bound_dead_s(braking) < 0.15 + LATE_S


@pytest.mark.parametrize(("dead_s", "shown"), [(0.039, False), (0.041, True)])
def test_half_a_gap_a_tick_and_transport_are_no_dead_time(dead_s: float, *, shown: bool) -> None:
    assert pytest.approx(0.04) == SAMPLING_S + 0.02 / 2
    dead = stop(deceleration_m_s2=1.5, dead_s=dead_s).shown_dead_s
    assert dead == (pytest.approx(dead_s, abs=5e-4) if shown else 0.0,)


def test_the_second_largest_dead_time_counts_and_a_single_one_as_it_is() -> None:
    assert bound_dead_s(UNMEASURED) == 0.0
    assert bound_dead_s(Braking(shown_dead_s=(0.2,))) == 0.2
    assert bound_dead_s(Braking(shown_dead_s=(0.2, 0.0))) == 0.0
    assert bound_dead_s(Braking(shown_dead_s=(0.1, 0.3, 0.2, 0.0))) == 0.2


def test_only_the_last_dead_times_are_kept() -> None:
    braking = stop(stop(deceleration_m_s2=2.0, dead_s=0.2), deceleration_m_s2=2.0, dead_s=0.2)
    for _ in range(KEPT - 2):
        braking = stop(braking, deceleration_m_s2=2.0)
        assert bound_dead_s(braking) == pytest.approx(0.2, abs=0.003)
    assert bound_dead_s(stop(braking, deceleration_m_s2=2.0)) == 0.0


def test_a_base_that_was_pushed_on_counts_as_the_latest_that_can_be_configured() -> None:
    assert stop(deceleration_m_s2=1.5, dead_s=1.2).shown_dead_s == (LONGEST_DEAD_S,)
    assert SupervisorSection(base_dead_time_s=LONGEST_DEAD_S)
    with pytest.raises(ValueError, match="base_dead_time_s"):
        SupervisorSection(base_dead_time_s=math.nextafter(LONGEST_DEAD_S, 1.0))
    assert stop(deceleration_m_s2=1.5, dead_s=0.49).shown_dead_s == pytest.approx((0.49,), abs=0.003)


@pytest.mark.parametrize("share", [REACHED_SHARE, -REACHED_SHARE])
def test_only_a_base_that_has_reached_its_command_shows_its_dead_time(share: float) -> None:
    """Another one may still accelerate during its dead time."""
    before = Braking(mean_m_s=1.0, last_m_s=1.0, last_s=0.0)
    for beyond, reached in ((0.999, True), (1.001, False)):
        commanded_m_s = 1.0 / (1.0 + beyond * share)
        after = measure(before, 1.0, 0.02, is_driven=True, commanded_m_s=commanded_m_s)
        assert after.reached is reached


def test_a_difference_of_exactly_a_twentieth_counts_as_reached() -> None:
    """Numbers without rounding errors."""
    before = Braking(mean_m_s=21.0, last_m_s=21.0, last_s=0.0)
    assert measure(before, 21.0, 0.02, is_driven=True, commanded_m_s=20.0).reached
    assert not measure(before, 21.0, 0.02, is_driven=True, commanded_m_s=19.99).reached


def test_a_stop_takes_nothing_from_the_stop_before() -> None:
    """Odometry of the second one jumps from a fast sample to zero, so it shows no distance, no line and no gap."""
    braking = samples(driven(1.0), [1.0, 1.0, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0], gap_s=0.1)
    assert len(braking.shown_m_s2) == 1
    assert braking.shown_dead_s[0] > 0.2
    for number in range(1, 50):
        speed_m_s = 1.2 if number == 49 else 1.0
        braking = measure(braking, speed_m_s, 0.8 + 0.02 * number, is_driven=True)
    again = measure(braking, 0.0, 1.8, is_driven=False, stopped_s=1.79)
    assert again.shown_m_s2 == braking.shown_m_s2
    assert again.shown_dead_s == (*braking.shown_dead_s, 0.0)
    assert again.gap_s == pytest.approx(0.02)


def test_after_a_long_pause_the_mean_speed_is_that_of_the_newest_sample() -> None:
    assert measure(UNMEASURED, 0.6, 5.0, is_driven=True).mean_m_s == 0.6
    before = Braking(mean_m_s=1.0, last_m_s=1.0, last_s=0.0)
    assert measure(before, 0.5, 0.08, is_driven=True).mean_m_s == pytest.approx(0.75)
    assert measure(before, 0.5, 0.02, is_driven=True).mean_m_s == pytest.approx(0.9)


def test_a_base_that_still_accelerates_shows_its_deceleration_but_no_dead_time() -> None:
    braking, speed_m_s = UNMEASURED, 0.0
    for number in range(1, 120):
        now_s = 0.02 * number
        speed_m_s = max(0.0, speed_m_s + 0.02 * (1.0 if now_s < 0.9 else -1.5))
        braking = measure(braking, speed_m_s, now_s, is_driven=now_s < 0.8, stopped_s=0.8)
    assert bound_m_s2(braking) == pytest.approx(1.5)
    assert braking.shown_dead_s == ()


def test_a_base_whose_stop_is_shorter_than_two_samples_shows_its_dead_time() -> None:
    """Odometry shows the distance; what braking takes of it is less than a sample."""
    braking = samples(driven(1.0), [1.0, 1.0, 1.0, 0.5, 0.0])
    assert braking.shown_m_s2 == ()
    assert braking.shown_dead_s == pytest.approx((0.1875,))
    assert samples(driven(1.0), [0.0]).shown_dead_s == (0.0,)


def test_a_base_that_does_not_slow_down_on_average_shows_no_dead_time() -> None:
    assert samples(driven(1.0), [0.5, 0.8, 0.0]).shown_dead_s == ()


def test_the_longest_gap_of_a_stop_is_part_of_its_tolerance() -> None:
    braking = driven(1.0)
    for at_s, speed_m_s in ((0.1, 1.0), (0.12, 1.0), (0.14, 0.8), (0.24, 0.4), (0.28, 0.2), (0.3, 0.0)):
        braking = measure(braking, speed_m_s, at_s, is_driven=False)
    assert braking.gap_s == pytest.approx(0.1)
    assert braking.shown_dead_s[0] > 0.1 / 2 + SAMPLING_S


@pytest.mark.parametrize("stopped_s", [0.0, 0.03])
def test_the_distance_is_counted_from_the_command(stopped_s: float) -> None:
    braking = driven(1.0)
    for number in range(1, 20):
        at_s = 0.05 * number
        speed_m_s = min(1.0, max(0.0, 1.0 - 2.0 * (at_s - 0.2)))
        braking = measure(braking, speed_m_s, at_s, is_driven=False, stopped_s=stopped_s)
    assert braking.shown_dead_s == pytest.approx((0.2 - stopped_s,), abs=1e-6)


def test_a_sample_that_arrives_just_before_the_command_counts_no_distance() -> None:
    early = measure(driven(1.0), 0.8, 0.05, is_driven=False, stopped_s=0.06)
    assert early.whole_m == 0.0
    assert early.line.t == 0.0


@pytest.mark.parametrize(("apart_s", "is_one"), [(0.0, True), (1e-9, True), (1e-4, False)])
@pytest.mark.parametrize("at_s", [0.0, 9.9])
def test_a_line_through_samples_of_one_time_has_no_slope(
    at_s: float, apart_s: float, *, is_one: bool
) -> None:
    line = NO_LINE.add(at_s, 1.0).add(at_s + apart_s, 0.9)
    assert math.isinf(line.brakes_m_s2()) is is_one


@pytest.mark.parametrize("deceleration_m_s2", [0.5, 2.0])
def test_a_line_through_samples_has_their_deceleration(deceleration_m_s2: float) -> None:
    line = NO_LINE
    assert line.brakes_m_s2() == math.inf
    for number in range(6):
        line = line.add(0.1 * number, 1.0 - deceleration_m_s2 * 0.1 * number)
        if number == 0:
            assert line.brakes_m_s2() == math.inf
        else:
            assert line.brakes_m_s2() == pytest.approx(deceleration_m_s2)


# --- slip


def test_a_stop_that_has_ended_waits_for_the_scans_until_the_next_command() -> None:
    braking = stop(deceleration_m_s2=2.0, dead_s=0.2)
    assert braking.ended is not None
    assert braking.ended.speed_m_s == pytest.approx(1.0)
    assert braking.ended.braked_m == pytest.approx(0.25, abs=0.005)
    assert braking.ended.is_measured
    assert measure(braking, 0.0, braking.last_s + 0.02, is_driven=False).ended is braking.ended
    assert measure(braking, 0.0, braking.last_s + 0.02, is_driven=True).ended is None


def test_a_stop_without_a_dead_time_counts_whole() -> None:
    before = Braking(mean_m_s=1.0, last_m_s=1.0, last_s=-0.05)
    driven_slowly = measure(before, 1.0, 0.0, is_driven=True, commanded_m_s=2.0)
    braking = samples(driven_slowly, [0.8, 0.6, 0.4, 0.2, 0.0])
    assert braking.stopping is False
    assert braking.shown_dead_s == ()
    assert braking.ended is not None
    assert braking.ended.braked_m == pytest.approx(braking.whole_m) == pytest.approx(0.12, abs=0.02)


def test_wheels_that_lock_show_no_deceleration_but_a_stop() -> None:
    at_once = samples(driven(1.0), [0.0])
    assert at_once.ended == Ended(1.0, 0.0, is_measured=False)
    too_hard = samples(driven(1.0), [0.5, 0.4, 0.0], gap_s=0.001)
    assert too_hard.shown_m_s2 == ()
    assert too_hard.ended is not None
    assert not too_hard.ended.is_measured
    assert too_hard.ended.braked_m > 0.0


def test_a_dead_time_longer_than_the_stop_leaves_no_braking_distance() -> None:
    braking = samples(driven(1.0), [0.8, 0.6, 0.4, 0.2, 0.0])._replace(ended=None)
    assert braking.shown_dead_s == (0.0,)
    ended = stop(deceleration_m_s2=8.0, dead_s=0.4).ended
    assert ended is not None
    assert 0.0 <= ended.braked_m < 0.08


def test_slip_replaces_what_odometry_has_shown_of_this_stop() -> None:
    braking = stop(stop(deceleration_m_s2=1.6), deceleration_m_s2=2.0)
    after = slipped(braking, 0.25)
    assert after.shown_m_s2 == pytest.approx((1.6, 1.0), rel=0.01)
    assert (after.shown_slip_m, after.ended) == ((0.25,), None)
    assert slipped(after, 0.25) == after


def test_slip_is_a_result_of_wheels_that_locked() -> None:
    braking = Braking(shown_m_s2=(1.6,), ended=Ended(1.0, 0.0, is_measured=False))
    assert slipped(braking, 0.5).shown_m_s2 == (1.6, 1.0)
    faster = braking._replace(ended=Ended(2.0, 0.5, is_measured=False))
    assert slipped(faster, 0.5).shown_m_s2 == (1.6, 2.0)
    assert slipped(braking, 50.0).shown_m_s2 == (1.6, LEAST_M_S2)


def test_a_stop_without_slip_keeps_its_deceleration() -> None:
    braking = Braking(shown_m_s2=(1.6,), ended=Ended(1.0, 0.25, is_measured=True), shown_slip_m=(0.5,))
    assert slipped(braking, 0.0) == Braking(shown_m_s2=(1.6,), shown_slip_m=(0.5, 0.0))
    assert slipped(braking, math.nan) == Braking(shown_m_s2=(1.6,), shown_slip_m=(0.5,))


def test_only_the_last_slips_are_kept() -> None:
    full = tuple(float(number) for number in range(KEPT))
    for is_measured in (True, False):
        braking = Braking(shown_m_s2=full, ended=Ended(1.0, 0.0, is_measured=is_measured), shown_slip_m=full)
        after = slipped(braking, 0.25)
        assert after.shown_slip_m == (*full[1:], 0.25)
        assert after.shown_m_s2 == ((*full[:-1], 2.0) if is_measured else (*full[1:], 2.0))


def test_the_slip_of_earlier_stops_is_kept_while_the_base_drives() -> None:
    assert measure(Braking(shown_slip_m=(0.25,)), 1.0, 1.0, is_driven=True).shown_slip_m == (0.25,)
