"""The base in the law: lost odometry, a base that does not follow, and its present motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.config import SupervisorSection
from supervisor.law.base import weakness
from supervisor.law.base_braking import LATE_S, WEAK_SHARE, Braking
from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.clearance import Circle, ConvexPolygon
from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Inputs, LawConfig, Odometry
from supervisor.law.permission import PRESENT_SHARE
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import initial_state, step
from tests.unit.supervisor.law.law_harness import (
    BACK,
    CONFIG,
    FORWARD,
    NEUTRAL,
    SPIN,
    TICK_S,
    Law,
    laser_scan,
    odometry,
    ring,
)
from wire.freshness import Sent
from wire.reasons import Limit, StopReason


def tick(law: Law, command: Velocity, measured: Velocity) -> Decision:
    return law.tick(("teleop", command), odometry=Odometry(measured, law.now_s + TICK_S))


def driving(config: LawConfig = CONFIG) -> Law:
    """A base that follows its command at once."""
    law = Law(config=config)
    tick(law, NEUTRAL, STANDSTILL)
    for _ in range(10):
        tick(law, FORWARD, law.state.base.output)
    assert law.decision.mode is Mode.DRIVING
    return law


# --- ODOM_STALE


@pytest.mark.parametrize("is_over", [False, True])
def test_odometry_goes_stale_just_after_its_timeout(*, is_over: bool) -> None:
    """Heard at zero, so that no difference of times is rounded."""
    state, _ = step(initial_state(CONFIG), 0.0, Inputs(odometry=odometry(0.0, 0.0)))
    now_s = CONFIG.odom_timeout_s
    _, decision = step(state, math.nextafter(now_s, 1.0) if is_over else now_s, Inputs())
    assert (StopReason.ODOM_STALE in decision.causes) is is_over


def test_odometry_that_comes_back_moves_nothing_without_neutral() -> None:
    law = driving()
    assert law.hold(0.4, ("teleop", FORWARD)).reasons == (StopReason.ODOM_STALE,)
    for _ in range(20):
        assert tick(law, FORWARD, STANDSTILL).output == STANDSTILL
    assert law.decision.causes == ()
    tick(law, NEUTRAL, STANDSTILL)
    assert tick(law, FORWARD, STANDSTILL).output == FORWARD


def test_a_base_that_never_sent_odometry_is_taken_at_its_command() -> None:
    law = Law()
    law.drive()
    assert law.hold(1.0, ("teleop", FORWARD)).output == FORWARD
    assert law.state.base.odometer.pose.x_m == pytest.approx(0.5, abs=0.03)


def test_without_odometry_in_the_configuration_none_is_heard() -> None:
    law = Law(config=replace(CONFIG, odometry=False))
    law.tick(("teleop", NEUTRAL), odometry=odometry(0.0, law.now_s))
    law.tick(("teleop", FORWARD), odometry=odometry(3.0, law.now_s))
    assert law.state.base.odometry is None
    assert law.hold(2.0, ("teleop", FORWARD)).output == FORWARD


# --- BASE_UNRESPONSIVE


def stuck() -> Law:
    """The base's own e-stop is pressed: it stands, whatever is commanded."""
    law = driving()
    for _ in range(round((PATIENCE_S + 0.1) / TICK_S)):
        tick(law, FORWARD, STANDSTILL)
    return law


def test_a_base_that_does_not_follow_stops_after_its_patience() -> None:
    law = driving()
    began_s = law.now_s
    while tick(law, FORWARD, STANDSTILL).output == FORWARD:
        assert law.now_s - began_s < 1.0
    assert law.decision.reasons == (StopReason.BASE_UNRESPONSIVE,)
    assert law.now_s - began_s == pytest.approx(PATIENCE_S + 2 * TICK_S, abs=1.5 * TICK_S)


def test_release_of_the_base_s_own_e_stop_causes_no_lurch() -> None:
    law = stuck()
    assert law.decision.output == STANDSTILL
    for _ in range(100):
        assert tick(law, FORWARD, STANDSTILL).output == STANDSTILL
    assert law.decision.latched == (StopReason.BASE_UNRESPONSIVE,)
    assert tick(law, NEUTRAL, STANDSTILL).mode is Mode.READY
    assert tick(law, FORWARD, STANDSTILL).output == FORWARD


def test_an_unresponsive_base_that_rolls_is_a_cause_until_it_stands() -> None:
    law = stuck()
    tick(law, NEUTRAL, Velocity(0.2, 0.0))
    law = driving()
    for _ in range(40):
        tick(law, FORWARD, Velocity(-0.2, 0.0))
    assert StopReason.BASE_UNRESPONSIVE in law.decision.causes
    tick(law, NEUTRAL, Velocity(0.11, 0.0))
    assert StopReason.BASE_UNRESPONSIVE in law.decision.causes
    tick(law, NEUTRAL, STANDSTILL)
    assert StopReason.BASE_UNRESPONSIVE not in law.decision.causes


def test_a_base_that_is_as_slow_as_its_least_acceleration_follows() -> None:
    law = Law()
    tick(law, NEUTRAL, STANDSTILL)
    measured_m_s = 0.0
    for _ in range(200):
        assert tick(law, FORWARD, Velocity(measured_m_s, 0.0)).output == FORWARD
        measured_m_s = min(0.5, measured_m_s + CONFIG.base_acceleration_m_s2 * TICK_S)


# --- the present motion of the base


def met(has: Velocity, asked: Velocity, ranges_m: float, bearing: int) -> Decision:
    """The decision for a command given to a base that moves, with one thing at a bearing [beams from behind]."""
    law = Law()
    law.ranges[bearing - 3 : bearing + 4] = ranges_m
    tick(law, NEUTRAL, has)
    return tick(law, asked, has)


def test_a_speed_that_the_base_still_has_is_judged_with_the_turn_that_is_asked_for() -> None:
    """On its way from driving ahead to turning on the spot, a base drives an arc into what is ahead."""
    assert met(STANDSTILL, SPIN, 0.62, 180).output == SPIN
    limited = met(Velocity(0.8, 0.0), SPIN, 0.62, 180)
    assert limited.mode is Mode.LIMITED
    assert limited.output == STANDSTILL
    assert limited.reasons == (), "it latches nothing: the base only has to slow down"


def test_a_turn_that_the_base_still_has_is_judged_with_the_speed_that_is_asked_for() -> None:
    for bearing in range(190, 251, 10):
        straight = met(STANDSTILL, FORWARD, 0.6, bearing)
        turning = met(Velocity(0.0, 1.5), FORWARD, 0.6, bearing)
        assert turning.scale < straight.scale
        assert turning.reasons == ()


@pytest.mark.parametrize("has", [Velocity(0.049, 0.0), Velocity(0.0, 0.19)])
def test_what_is_left_of_a_velocity_within_noise_is_none(has: Velocity) -> None:
    assert met(has, SPIN if has.linear_m_s else FORWARD, 0.9, 180).scale == (
        1.0 if has.linear_m_s else pytest.approx(met(STANDSTILL, FORWARD, 0.9, 180).scale)
    )


def test_a_base_that_is_too_fast_on_its_present_arc_brakes_along_that_one_first() -> None:
    """A base that drives at an object and is commanded to swerve continues toward it while it turns."""
    law = Law(room_m=8.0)
    law.ranges[170:191] = 0.8
    swerve, has = Velocity(0.1, 1.0), Velocity(1.0, 0.0)
    tick(law, NEUTRAL, has)
    decision = tick(law, swerve, has)
    assert decision.output == STANDSTILL
    assert decision.reasons == ()
    assert decision.mode is Mode.LIMITED
    law = Law(room_m=8.0)
    tick(law, NEUTRAL, has)
    assert tick(law, swerve, has).output == swerve


def test_a_base_on_another_arc_that_approaches_nothing_is_not_slowed() -> None:
    """Something is within reach, but behind the base."""
    law = Law(room_m=8.0)
    law.ranges[:8] = 0.6
    swerve, has = Velocity(0.1, 1.0), Velocity(1.0, 0.0)
    tick(law, NEUTRAL, has)
    assert tick(law, swerve, has).output == swerve


def test_a_base_on_the_commanded_arc_slows_down_and_stops_only_where_it_must() -> None:
    asked = Velocity(1.0, 0.0)
    for range_m, is_held in ((0.8, True), (0.89, False)):  # it can stop in 0.33 m
        law = Law(room_m=8.0)
        law.ranges[170:191] = range_m
        tick(law, NEUTRAL, asked)
        decision = tick(law, asked, asked)
        assert (decision.output == STANDSTILL) is is_held
        assert decision.scale < PRESENT_SHARE
        assert decision.reasons == ()


def test_without_odometry_the_base_is_taken_to_brake_as_it_is_trusted_to() -> None:
    law = Law(room_m=8.0)
    law.drive(Velocity(1.0, 0.0))
    law.hold(0.5, ("teleop", Velocity(1.0, 0.0)))
    law.ranges[170:191] = 0.62
    assert law.tick(("teleop", SPIN)).output == STANDSTILL
    assert law.decision.reasons == ()
    waited_s = 0.0
    while law.tick(("teleop", SPIN)).output == STANDSTILL:
        waited_s += TICK_S
        assert waited_s < 1.0
    assert waited_s > 0.3
    law.hold(0.1, ("teleop", SPIN))
    assert law.decision.output == SPIN


# --- one stray reading, and what is remembered


def test_a_stray_reading_stops_while_it_is_there_and_latches_nothing() -> None:
    law = Law()
    law.drive()
    law.ranges[180] = 0.4
    decision = law.tick(("teleop", FORWARD))
    assert decision.output == STANDSTILL
    assert (decision.mode, decision.scale) == (Mode.LIMITED, 0.0)
    assert (decision.reasons, decision.causes) == ((), (StopReason.OBSTACLE,))
    law.ranges = ring()
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_reading_elsewhere_confirms_nothing() -> None:
    law = Law()
    law.drive()
    for beam in (180, 210, 150, 180, 210):
        law.ranges = ring()
        law.ranges[beam] = 0.5
        assert law.tick(("teleop", FORWARD)).output == STANDSTILL
        assert law.decision.reasons == ()
        law.ranges = ring()
        law.tick(("teleop", FORWARD))


def test_what_was_seen_limits_though_the_newest_scan_does_not_cover_it_and_latches_nothing() -> None:
    law = Law()
    law.drive()
    law.ranges[175:186] = 0.5
    law.tick(("teleop", FORWARD))
    law.ranges = ring()
    law.ranges[170:191] = math.nan
    decision = law.tick(("teleop", FORWARD))
    assert decision.output == STANDSTILL
    assert decision.causes == (StopReason.OBSTACLE,)
    assert decision.reasons == ()
    assert decision.nearest_m == pytest.approx(0.25, abs=0.01), "what is remembered is told"


def test_what_a_later_scan_disproves_is_forgotten() -> None:
    law = Law()
    law.drive()
    law.ranges[175:186] = 0.5
    law.tick(("teleop", BACK))
    law.ranges = ring()
    law.tick(("teleop", BACK))
    assert len(law.state.sight.memory.points) == 0
    assert law.state.sight.places == ()


def test_what_is_remembered_goes_out_of_reach_with_the_robot_s_way() -> None:
    law = Law(room_m=8.0)
    law.ranges[175:186] = 1.5
    tick(law, NEUTRAL, STANDSTILL)
    law.ranges[170:191] = math.nan
    tick(law, NEUTRAL, STANDSTILL)
    assert len(law.state.sight.memory.points) > 0
    for _ in range(100):
        assert tick(law, BACK, BACK).output == BACK
    assert len(law.state.sight.memory.points) == 0


def test_the_first_step_and_a_scan_at_once_find_their_way() -> None:
    law = Law(scanning=False)
    law.now_s += TICK_S
    law.step(Inputs(scans=(laser_scan(ring(), law.now_s), laser_scan(ring(2.9), law.now_s))))
    assert law.decision.scan_counts.accepted == 2


# --- a base that lags on one axis

BOX = ConvexPolygon(((0.4, -0.2), (0.4, 0.2), (-0.1, 0.2), (-0.1, -0.2)))
ARC = Velocity(-0.24, -2.0)


def backing_on_an_arc(measured: Velocity | None, pillar_m: float) -> Decision:
    """The turn takes the corner away from a pillar; backing alone closes on it."""
    law = Law(config=replace(CONFIG, hull=BOX))
    ranges = ring()
    ranges[180 + 135 : 180 + 138] = pillar_m
    law.tick(("teleop", NEUTRAL))
    for number in range(3):
        now_s = law.now_s + TICK_S
        law.tick(
            ("teleop", ARC),
            odometry=None if measured is None else Odometry(measured, now_s),
            scans=(laser_scan(ranges + np.float32(1e-4 * number), now_s),) if number else (),
        )
    return law.decision


def test_an_arc_is_stopped_if_a_base_that_takes_up_one_axis_first_would_close_on_something() -> None:
    """Found by a random scene."""
    decision = backing_on_an_arc(STANDSTILL, 0.495)
    assert decision.output == STANDSTILL
    assert decision.reasons == (StopReason.OBSTACLE,)
    assert backing_on_an_arc(None, 0.495).output == STANDSTILL
    assert backing_on_an_arc(ARC, 0.495).output == ARC


def test_an_arc_is_slowed_as_far_as_a_base_that_takes_up_one_axis_first_must_be() -> None:
    assert 0.2 < backing_on_an_arc(STANDSTILL, 0.51).scale < 0.6
    assert backing_on_an_arc(STANDSTILL, 0.51).reasons == ()


# --- earlier poses


def test_the_noise_of_odometry_at_rest_is_no_travel_but_a_push_is() -> None:
    law = Law()
    for _ in range(100):
        tick(law, NEUTRAL, Velocity(0.001, -0.001))
    way_m = law.state.base.way_m
    for _ in range(50):
        tick(law, NEUTRAL, Velocity(0.001, -0.001))
    assert law.state.base.way_m == way_m
    for _ in range(10):
        tick(law, NEUTRAL, Velocity(0.2, 0.0))
    assert law.state.base.way_m - way_m == pytest.approx(0.2 * 10 * TICK_S)


def test_a_scan_that_was_long_on_its_way_belongs_where_the_robot_was() -> None:
    """At 0.5 m/s with odometry at 50 Hz: the first scans are quick, the last one took 0.15 s."""
    state, now_s = initial_state(CONFIG), 1000.0
    for number in range(1, 61):
        now_s = 1000.0 + number * TICK_S
        late_s = 0.15 if number == 60 else 0.0
        sent = Sent(b"lidar", number, now_s - late_s)
        scans = (replace(laser_scan(ring(3.0 + 1e-3 * number), now_s), sent=sent),)
        inputs = Inputs(odometry=odometry(0.5, now_s), scans=() if 50 <= number < 60 else scans)
        state, _ = step(state, now_s, inputs)
    reading = state.sight.lidars[0].scan
    assert reading is not None
    assert reading.view is not None
    assert reading.taken_s == pytest.approx(now_s - 0.15)
    assert state.base.odometer.pose.x_m - reading.view.pose.x_m == pytest.approx(0.5 * 0.15, abs=1e-3)


# --- BASE_UNMEASURED

UNKNOWN = SupervisorSection().law(is_base_known=False)


def asked(law: Law, command: Velocity) -> Decision:
    """The decision for a command to a base that stands."""
    tick(law, NEUTRAL, STANDSTILL)
    return tick(law, command, STANDSTILL)


@pytest.mark.parametrize(
    "command", [Velocity(1.0, 0.0), Velocity(-1.0, 0.5), Velocity(math.nextafter(0.5, 1.0), 2.0)]
)
def test_a_base_of_which_nothing_is_known_drives_half_a_metre_per_second(command: Velocity) -> None:
    decision = asked(Law(config=UNKNOWN, room_m=6.0), command)
    assert (decision.mode, decision.limit, decision.reasons) == (Mode.LIMITED, Limit.BASE_UNMEASURED, ())
    assert abs(decision.output.linear_m_s) == pytest.approx(0.5)
    share = decision.output.linear_m_s / command.linear_m_s
    assert decision.output.angular_rad_s == pytest.approx(share * command.angular_rad_s), (
        "the arc keeps its shape"
    )
    assert decision.detail == "stop once from 0.4 m/s or more, or set deceleration_m_s2"


def test_a_base_of_which_nothing_is_known_turns_so_fast_that_its_rim_moves_as_fast() -> None:
    wide = replace(UNKNOWN, hull=Circle(0.5))
    decision = asked(Law(config=wide, room_m=6.0), Velocity(0.0, 2.0))
    assert decision.output == pytest.approx((0.0, 1.0))
    assert decision.limit is Limit.BASE_UNMEASURED


@pytest.mark.parametrize("command", [Velocity(0.5, 0.0), Velocity(0.5, 2.0), Velocity(0.0, -2.0)])
def test_an_unknown_base_obeys_a_slower_command(command: Velocity) -> None:
    decision = asked(Law(config=UNKNOWN, room_m=6.0), command)
    assert (decision.mode, decision.limit, decision.output) == (Mode.DRIVING, None, command)


def test_one_stop_ends_the_limit_of_an_unknown_base() -> None:
    law = Law(config=UNKNOWN, room_m=6.0)
    assert stops_with(law, 2.0, speed_m_s=0.41).limit is None
    decision = tick(law, Velocity(1.0, 0.0), STANDSTILL)
    assert (decision.mode, decision.limit, decision.output.linear_m_s) == (Mode.DRIVING, None, 1.0)


def test_of_two_limits_the_lower_one_is_named() -> None:
    law = Law(config=UNKNOWN, room_m=6.0)
    asked(law, Velocity(1.0, 0.0))
    limits = [law.tick(odometry=odometry(0.0, law.now_s + TICK_S)).limit for _ in range(8)]
    assert limits[0] is Limit.BASE_UNMEASURED
    assert limits[-1] is Limit.COMMAND_AGE
    assert law.decision.output.linear_m_s < 0.5


def test_an_obstacle_may_limit_an_unknown_base_further() -> None:
    law = Law(config=UNKNOWN)
    law.ranges = ring(ahead_m=0.65)
    decision = asked(law, Velocity(1.0, 0.0))
    assert (decision.mode, decision.limit) == (Mode.LIMITED, None)
    assert 0.0 < decision.output.linear_m_s < 0.5


def test_what_the_base_has_shown_before_counts_from_the_start() -> None:
    shown = Braking(shown_m_s2=(1.0,), shown_dead_s=(0.2,))
    for config in (CONFIG, UNKNOWN):
        state = initial_state(config, braking=shown)
        assert state.base.braking == shown
        assert (state.config.braking_m_s2, state.config.dead_time_s) == (1.0, 0.2)
    assert initial_state(CONFIG).config == CONFIG


# --- BASE_WEAK


def stops_with(
    law: Law, deceleration_m_s2: float, speed_m_s: float = 0.5, turn_rad_s: float = 0.0
) -> Decision:
    """Drive for a second, then request zero until the base stands, which brakes with this deceleration at its rim."""
    tick(law, NEUTRAL, STANDSTILL)
    full = Velocity(speed_m_s, turn_rad_s)
    for _ in range(50):
        tick(law, full, full)
    share, rim_m_s = 1.0, max(speed_m_s, turn_rad_s * law.config.hull.radius_m)
    while share > 0.0:
        tick(law, NEUTRAL, Velocity(share * speed_m_s, share * turn_rad_s))
        share -= deceleration_m_s2 * TICK_S / rim_m_s
    for _ in range(5):
        tick(law, NEUTRAL, STANDSTILL)
    return law.decision


@pytest.mark.parametrize(("speed_m_s", "turn_rad_s"), [(0.5, 0.0), (0.0, 2.0)])
def test_a_base_that_brakes_worse_than_configured_is_weak_from_its_first_stop(
    speed_m_s: float, turn_rad_s: float
) -> None:
    law = Law(room_m=6.0)
    decision = stops_with(law, 1.0, speed_m_s, turn_rad_s)
    assert (decision.mode, decision.limit, decision.causes) == (Mode.READY, Limit.BASE_WEAK, ())
    assert decision.detail == "the base brakes with 1.00 m/s² instead of 1.50"
    tick(law, FORWARD, STANDSTILL)
    assert (law.decision.mode, law.decision.limit) == (Mode.DRIVING, Limit.BASE_WEAK)


@pytest.mark.parametrize(("share", "limit"), [(0.901, None), (0.899, Limit.BASE_WEAK)])
def test_the_error_of_a_measurement_reduces_the_trusted_deceleration_and_is_not_reported(
    share: float, limit: Limit | None
) -> None:
    law = Law(room_m=6.0)
    tick(law, NEUTRAL, STANDSTILL)
    shown_m_s2 = share * CONFIG.deceleration_m_s2
    law.state = law.state._replace(base=law.state.base._replace(braking=Braking(shown_m_s2=(shown_m_s2,))))
    assert tick(law, NEUTRAL, STANDSTILL).limit is limit
    assert law.state.config.braking_m_s2 == shown_m_s2


def test_a_base_that_brakes_as_configured_or_better_is_not_weak() -> None:
    law = Law(room_m=6.0)
    for deceleration_m_s2 in (1.51, 2.0, 4.0):
        assert stops_with(law, deceleration_m_s2).limit is None
    assert law.state.config.braking_m_s2 == CONFIG.deceleration_m_s2


@pytest.mark.parametrize(("share", "limit"), [(0.999, None), (1.001, Limit.BASE_WEAK)])
@pytest.mark.parametrize("configured_s", [0.0, 0.1])
def test_the_error_of_a_measured_dead_time_counts_and_is_not_reported(
    share: float, limit: Limit | None, configured_s: float
) -> None:
    law = Law(config=replace(CONFIG, base_dead_time_s=configured_s), room_m=6.0)
    tick(law, NEUTRAL, STANDSTILL)
    shown_s = configured_s + share * LATE_S
    law.state = law.state._replace(base=law.state.base._replace(braking=Braking(shown_dead_s=(shown_s,))))
    assert tick(law, NEUTRAL, STANDSTILL).limit is limit
    assert law.state.config.dead_time_s == shown_s


def test_a_base_at_the_edge_of_the_error_is_not_weak() -> None:
    assert weakness(replace(CONFIG, shown_m_s2=WEAK_SHARE * CONFIG.deceleration_m_s2), ()) == ""
    assert weakness(replace(CONFIG, shown_dead_s=0.04), ()) == ""
    assert weakness(replace(CONFIG, shown_dead_s=math.nextafter(0.04, 1.0)), ())


def test_a_weak_base_does_not_hide_that_the_next_command_is_late() -> None:
    law = Law(room_m=6.0)
    stops_with(law, 1.0)
    asked(law, Velocity(1.0, 0.0))
    assert law.decision.limit is Limit.BASE_WEAK
    for _ in range(8):
        law.tick(odometry=odometry(0.0, law.now_s + TICK_S))
    assert law.decision.limit is Limit.COMMAND_AGE


@pytest.mark.parametrize(("commanded_m_s", "is_measured"), [(0.5, True), (1.0, False)])
def test_a_base_that_has_not_reached_its_command_shows_no_dead_time(
    commanded_m_s: float, *, is_measured: bool
) -> None:
    law = Law(room_m=8.0)
    tick(law, NEUTRAL, STANDSTILL)
    for _ in range(50):
        tick(law, Velocity(commanded_m_s, 0.0), FORWARD)
    for _ in range(11):
        tick(law, NEUTRAL, FORWARD)
    for speed_m_s in (0.4, 0.3, 0.2, 0.1, 0.0):
        tick(law, NEUTRAL, Velocity(speed_m_s, 0.0))
    assert len(law.state.base.braking.shown_m_s2) == 1
    assert len(law.state.base.braking.shown_dead_s) == is_measured


def test_a_base_that_reacts_as_configured_or_sooner_is_not_late() -> None:
    config = replace(CONFIG, base_dead_time_s=0.2, shown_dead_s=0.1)
    assert config.dead_time_s == 0.2
    assert weakness(config, ()) == ""


def test_a_late_base_is_named_with_both_numbers() -> None:
    late = replace(CONFIG, base_dead_time_s=0.05, shown_dead_s=0.15)
    assert weakness(late, ()) == "the base slows down after 0.15 s instead of 0.05"
    both = replace(late, shown_m_s2=1.0)
    assert weakness(both, ()) == (
        "the base brakes with 1.00 m/s² instead of 1.50, and slows down after 0.15 s instead of 0.05"
    )


def test_a_measured_dead_time_counts_wherever_a_configured_one_does() -> None:
    """In the reaction time, the reach, the time that braking takes, and the patience with a base that lags."""
    shown, told = replace(CONFIG, shown_dead_s=0.2), replace(CONFIG, base_dead_time_s=0.2)
    assert shown.late_s == told.late_s == pytest.approx(CONFIG.late_s + 0.2)
    assert shown.reach_m == told.reach_m > CONFIG.reach_m
    stuck_s: list[float] = []
    for config in (CONFIG, told):
        law = driving(config)
        began_s = law.now_s
        while tick(law, FORWARD, STANDSTILL).output == FORWARD:
            assert law.now_s - began_s < 1.0
        stuck_s.append(law.now_s - began_s)
    assert stuck_s[1] - stuck_s[0] == pytest.approx(0.2, abs=TICK_S / 2)


@pytest.mark.parametrize("turn_rad_s", [0.0, 2.0])
def test_a_late_base_approaches_as_if_its_dead_time_had_been_configured(turn_rad_s: float) -> None:
    """It has shown the dead time in a drive or in a turn on the spot."""
    late, configured = Law(), Law(config=replace(CONFIG, base_dead_time_s=0.2))
    drives = Velocity(0.0 if turn_rad_s else 0.5, turn_rad_s)
    tick(late, NEUTRAL, STANDSTILL)
    for _ in range(50):
        tick(late, drives, drives)
    for _ in range(11):  # the sample of the first tick with zero is from before it
        tick(late, NEUTRAL, drives)
    for share in (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0):
        tick(late, NEUTRAL, Velocity(share * drives.linear_m_s, share * drives.angular_rad_s))
    assert late.state.config.dead_time_s == pytest.approx(0.2, abs=0.01)
    limited: list[Decision] = []
    for one in (late, configured):
        one.ranges = ring(ahead_m=1.0)
        one.hold(0.1, ("teleop", NEUTRAL))
        limited.append(tick(one, Velocity(1.0, 0.0), STANDSTILL))
    assert limited[0].mode is Mode.LIMITED
    assert limited[0].limit is Limit.BASE_WEAK
    assert limited[0].output.linear_m_s == pytest.approx(limited[1].output.linear_m_s, rel=0.02)


def test_a_weak_base_approaches_as_if_its_brakes_had_been_configured() -> None:
    law, configured = Law(), Law(config=replace(CONFIG, deceleration_m_s2=1.0))
    stops_with(law, 1.0)
    limited: list[Decision] = []
    for one in (law, configured):
        one.ranges = ring(ahead_m=1.0)
        one.hold(0.1, ("teleop", NEUTRAL))
        limited.append(tick(one, Velocity(1.0, 0.0), STANDSTILL))
    assert limited[0].mode is Mode.LIMITED
    assert limited[0].output.linear_m_s == pytest.approx(limited[1].output.linear_m_s, rel=0.01)


def test_a_weak_base_is_given_more_time_to_brake_and_looks_farther() -> None:
    law = Law(room_m=6.0)
    stops_with(law, 0.5)
    weak = law.state.config
    assert weak.trusted.linear_m_s == pytest.approx(0.5, rel=0.01)
    assert weak.reach_m > CONFIG.reach_m + 1.0
    law.drive()
    tick(law, NEUTRAL, FORWARD)
    began_s = law.now_s
    while not law.decision.alarm:
        tick(law, NEUTRAL, Velocity(0.2, 0.0))
    assert law.now_s - began_s > CONFIG.max_linear_m_s / 0.51


def test_repeated_slip_is_part_of_the_weakness() -> None:
    weak = replace(CONFIG, shown_m_s2=0.75)
    assert weakness(weak, (0.0,)) == "the base brakes with 0.75 m/s² instead of 1.50"
    assert weakness(weak, (0.0, 0.5, 0.25)) == (
        "the base brakes with 0.75 m/s² instead of 1.50, and slid up to 0.50 m farther than odometry shows in 2 of 3 stops"
    )
    assert weakness(CONFIG, (0.5,)) == ""


def test_a_base_is_no_longer_weak_once_its_last_stops_are_good() -> None:
    law = Law(room_m=6.0)
    stops_with(law, 1.0)
    assert stops_with(law, 2.0).limit is None
    stops_with(law, 1.0)
    assert stops_with(law, 2.0).limit is Limit.BASE_WEAK


def test_a_stop_shows_its_reason_instead_of_the_weak_brakes() -> None:
    law = Law(room_m=6.0)
    stops_with(law, 1.0)
    law.drive()
    decision = law.hold(0.25)
    assert (decision.reasons, decision.limit) == ((StopReason.COMMAND_TIMEOUT,), None)


def test_odometry_that_no_base_can_have_is_no_measurement() -> None:
    law = Law(room_m=6.0)
    stops_with(law, 1.0, speed_m_s=0.5)
    before = law.state.base.braking
    tick(law, NEUTRAL, Velocity(5.0, 0.0))
    assert law.state.base.braking == before
