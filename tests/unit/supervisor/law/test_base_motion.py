"""Whether the base follows its commands, within its ramps."""

import math

import pytest

from supervisor.law.base_motion import (
    FOLLOWING,
    LEAST_SHARE,
    MOST_SHARE,
    PATIENCE_S,
    PROGRESS_SHARE,
    SLOW,
    Following,
    follow,
    moves,
    possible_twists,
)
from supervisor.law.reckoning import STANDSTILL, Velocity

SLOWEST = Velocity(0.5, 1.5)
TRUSTED = Velocity(1.5, 6.0)
DT_S = 0.02


def after(
    following: Following,
    commanded: Velocity,
    measured: Velocity | None,
    *,
    now_s: float = 0.0,
    dt_s: float = DT_S,
    dead_time_s: float = 0.0,
) -> Following:
    return follow(following, commanded, measured, now_s, dt_s, SLOWEST, TRUSTED, dead_time_s)


def settled(velocity: Velocity) -> Following:
    return Following(velocity, velocity, None, STANDSTILL, unresponsive=False)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_least_rises_with_the_slowest_acceleration_up_to_the_command(sign: float) -> None:
    commanded = Velocity(sign * 0.5, sign * 1.0)
    following = after(FOLLOWING, commanded, None, dt_s=0.2)
    assert following.least == pytest.approx((sign * 0.1, sign * 0.3))
    assert after(following, commanded, None, dt_s=10.0).least == commanded


def test_the_least_falls_with_the_command_at_once_and_starts_anew_in_the_other_direction() -> None:
    assert after(settled(Velocity(0.5, 1.0)), Velocity(0.1, 0.2), None).least == Velocity(0.1, 0.2)
    turned = after(settled(Velocity(0.5, 1.0)), Velocity(-0.5, -1.0), None, dt_s=0.2)
    assert turned.least == pytest.approx((-0.1, -0.3))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_most_rises_with_the_command_at_once_and_falls_with_the_trusted_deceleration(sign: float) -> None:
    fast, slow = Velocity(sign * 0.5, sign * 2.0), Velocity(sign * 0.1, sign * 0.4)
    assert after(FOLLOWING, fast, None).most == fast
    assert after(settled(fast), slow, None, dt_s=0.1).most == pytest.approx((sign * 0.35, sign * 1.4))
    assert after(settled(fast), slow, None, dt_s=10.0).most == slow


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_most_of_one_axis_falls_no_faster_than_the_other_axis_gets_to_its_command(sign: float) -> None:
    """Found by a random scene: a base that goes straight from twist to twist brakes less while it takes up a turn."""
    straight, arc = settled(Velocity(sign * 0.5, 0.0)), Velocity(sign * 0.2, sign * 1.5)
    # The turn takes 1 s at 1.5 rad/s², of which 0.1 s are over; the speed alone would fall in 0.2 s.
    assert after(straight, arc, None, dt_s=0.1).most == pytest.approx((sign * (0.5 - 0.3 / 9), sign * 1.5))
    turning, ahead = settled(Velocity(0.0, sign * 1.5)), Velocity(sign * 0.5, sign * 0.5)
    assert after(turning, ahead, None, dt_s=0.1).most == pytest.approx((sign * 0.5, sign * (1.5 - 1.0 / 9)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_most_brakes_through_zero_into_the_other_direction(sign: float) -> None:
    fast, back = Velocity(sign * 0.3, sign * 1.2), Velocity(-sign * 0.5, -sign * 2.0)
    assert after(settled(fast), back, None, dt_s=0.1).most == pytest.approx((sign * 0.15, sign * 0.6))
    assert after(settled(fast), back, None, dt_s=0.3).most == pytest.approx((-sign * 0.15, -sign * 0.6))


FAST = Velocity(0.5, 1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_base_lags_just_below_its_share_of_the_least(axis: int, sign: float) -> None:
    commanded = Velocity(*(sign * c if a == axis else 0.0 for a, c in enumerate(FAST)))
    share = LEAST_SHARE[axis] * commanded[axis]
    for value, lags in ((share, False), (math.nextafter(share, 0.0), True), (-commanded[axis], True)):
        measured = Velocity(*(value if a == axis else 0.0 for a in (0, 1)))
        assert (after(settled(commanded), commanded, measured).since_s is not None) is lags


@pytest.mark.parametrize(("share", "follows"), [(0.45, True), (0.25, False)])
def test_a_skid_steer_base_may_turn_less_than_half_as_fast_as_commanded(
    share: float, *, follows: bool
) -> None:
    """At 45 %, it was unresponsive five times in 8 s."""
    following, commanded = FOLLOWING, Velocity(0.3, 1.5)
    for tick in range(400):
        measured = Velocity(0.3, share * min(1.5, 0.06 * tick))
        following = after(following, commanded, measured, now_s=0.02 * tick, dt_s=0.02)
        assert not (follows and following.unresponsive)
    assert following.unresponsive is not follows


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_base_is_too_fast_just_beyond_its_share_of_the_most(axis: int, sign: float) -> None:
    limit = MOST_SHARE * FAST[axis] + SLOW[axis]
    for value, is_out in ((limit, False), (math.nextafter(limit, math.inf), True)):
        measured = Velocity(*(sign * value if a == axis else c for a, c in enumerate(FAST)))
        commanded = Velocity(*(sign * c if a == axis else c for a, c in enumerate(FAST)))
        assert (after(settled(commanded), commanded, measured).since_s is not None) is is_out


@pytest.mark.parametrize("axis", [0, 1])
def test_a_base_that_is_hardly_asked_to_move_may_stand(axis: int) -> None:
    for value, lags in ((SLOW[axis], False), (math.nextafter(SLOW[axis], 1.0), True)):
        commanded = Velocity(*(value if a == axis else 0.0 for a in (0, 1)))
        assert (after(settled(commanded), commanded, STANDSTILL).since_s is not None) is lags


def test_a_base_is_unresponsive_just_after_its_patience() -> None:
    lagging = after(settled(FAST), FAST, STANDSTILL, now_s=0.0)
    assert lagging.since_s == 0.0
    assert not after(lagging, FAST, STANDSTILL, now_s=PATIENCE_S).unresponsive
    late = after(lagging, FAST, STANDSTILL, now_s=math.nextafter(PATIENCE_S, 1.0))
    assert late.unresponsive
    assert late.since_s == 0.0


def test_a_base_that_follows_in_between_has_its_patience_anew() -> None:
    lagging = after(settled(FAST), FAST, STANDSTILL, now_s=0.0)
    follows = after(lagging, FAST, FAST, now_s=0.4)
    assert follows.since_s is None
    assert not after(follows, FAST, STANDSTILL, now_s=0.6).unresponsive


def test_a_base_may_lag_for_its_dead_time_in_addition() -> None:
    lagging = after(settled(FAST), FAST, STANDSTILL)
    patience_s = PATIENCE_S + 0.25
    assert not after(lagging, FAST, STANDSTILL, now_s=patience_s, dead_time_s=0.25).unresponsive
    late = after(lagging, FAST, STANDSTILL, now_s=math.nextafter(patience_s, 1.0), dead_time_s=0.25)
    assert late.unresponsive


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_base_that_comes_nearer_to_its_command_has_its_patience_anew(axis: int, sign: float) -> None:
    commanded = Velocity(*(sign * c if a == axis else 0.0 for a, c in enumerate(FAST)))
    lagging = after(settled(commanded), commanded, STANDSTILL, now_s=0.0)
    gain = PROGRESS_SHARE * SLOW[axis]
    for value, gains in ((0.9 * gain, False), (1.1 * gain, True), (-1.1 * gain, False)):
        measured = Velocity(*(sign * value if a == axis else 0.0 for a in (0, 1)))
        slow = after(lagging, commanded, measured, now_s=0.4)
        assert slow.since_s == (0.4 if gains else 0.0)
        assert slow.since == (measured if gains else STANDSTILL)
        assert after(slow, commanded, measured, now_s=0.6).unresponsive is not gains


@pytest.mark.parametrize(("turning_rad_s", "is_patient"), [(0.05, False), (math.nextafter(0.05, 1.0), True)])
def test_coming_nearer_on_one_axis_counts_from_just_beyond_its_share(
    turning_rad_s: float, *, is_patient: bool
) -> None:
    assert PROGRESS_SHARE * SLOW.angular_rad_s == 0.05
    commanded = Velocity(0.5, turning_rad_s)
    following = after(settled(commanded), commanded, STANDSTILL, now_s=0.0)
    following = after(following, commanded, Velocity(0.0, turning_rad_s), now_s=PATIENCE_S)
    assert following.since_s == (PATIENCE_S if is_patient else 0.0)


def test_a_base_that_rolled_the_other_way_comes_nearer_by_standing() -> None:
    commanded = Velocity(0.5, 0.0)
    following = after(settled(commanded), commanded, Velocity(-0.3, 0.0), now_s=0.0)
    assert after(following, commanded, STANDSTILL, now_s=PATIENCE_S).since_s == PATIENCE_S


@pytest.mark.parametrize("measured", [SLOW, Velocity(-0.1, -0.25)])
def test_it_stays_unresponsive_until_it_is_commanded_zero_and_stands(measured: Velocity) -> None:
    lost = Following(STANDSTILL, STANDSTILL, None, STANDSTILL, unresponsive=True)
    assert after(lost, FAST, FAST).unresponsive
    assert after(lost, STANDSTILL, Velocity(0.11, 0.0)).unresponsive
    assert after(lost, STANDSTILL, Velocity(0.0, 0.26)).unresponsive
    assert not after(lost, STANDSTILL, measured).unresponsive


def test_too_fast_at_a_zero_command_is_left_to_the_runaway() -> None:
    moving = after(FOLLOWING, STANDSTILL, FAST, now_s=0.0)
    assert not after(moving, STANDSTILL, FAST, now_s=10.0).unresponsive


def test_without_odometry_a_base_is_taken_to_follow() -> None:
    lost = Following(FAST, FAST, 0.0, STANDSTILL, unresponsive=True)
    following = after(lost, FAST, None, now_s=10.0)
    assert following == Following(FAST, FAST, None, STANDSTILL, unresponsive=False)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_velocity_moves_just_beyond_the_threshold_of_either_axis(axis: int, sign: float) -> None:
    for value, is_moving in ((SLOW[axis], False), (math.nextafter(SLOW[axis], 1.0), True)):
        velocity = Velocity(*(sign * value if a == axis else 0.0 for a in (0, 1)))
        assert moves(velocity, SLOW) is is_moving


BETWEEN = Following(Velocity(0.25, 0.5), Velocity(1.0, 2.0), None, STANDSTILL, unresponsive=False)
MOST, ONE_LAGS, OTHER_LAGS = Velocity(1.0, 2.0), Velocity(1.0, 0.5), Velocity(0.25, 2.0)


def test_a_base_may_have_what_odometry_says_and_the_most_of_its_ramps() -> None:
    assert possible_twists(BETWEEN, Velocity(0.5, 1.0)) == [MOST, Velocity(0.5, 1.0)]


def test_without_odometry_or_out_of_bounds_one_axis_may_have_its_most_and_the_other_its_least() -> None:
    assert possible_twists(BETWEEN, None) == [MOST, ONE_LAGS, OTHER_LAGS]
    lagging = BETWEEN._replace(since_s=0.0)
    assert possible_twists(lagging, STANDSTILL) == [MOST, STANDSTILL, ONE_LAGS, OTHER_LAGS]
