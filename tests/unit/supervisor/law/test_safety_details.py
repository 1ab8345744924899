"""Details that only mutation tests revealed: boundaries, and the explanation of each decision."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.base import RUNAWAY_GRACE_S
from supervisor.law.decision import Mode
from supervisor.law.interlock import IMPLAUSIBLE_FACTOR
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.scan import LaserScan
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    BACK,
    CONFIG,
    CONFIRMED_S,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    SPIN,
    TICK_S,
    UNSEEN_S,
    Law,
    back,
    laser_scan,
    lost,
    odometry,
    on_time,
    ring,
)
from wire.freshness import Sent
from wire.reasons import StopReason


def at_zero() -> Law:
    """A law that drives and whose last command and scan came at time 0, where timeouts add up exactly."""
    law = Law(now_s=-1.0)
    law.tick(("teleop", NEUTRAL))
    law.now_s = -TICK_S
    law.state = law.state._replace(clock=law.state.clock._replace(now_s=None))
    law.tick(("teleop", FORWARD))
    assert law.now_s == 0.0
    assert law.decision.output == FORWARD
    return law


# --- boundaries


def test_a_scan_goes_stale_just_after_its_timeout() -> None:
    law = at_zero()
    law.scanning = False
    timeout_s = SCAN_TIMEOUT_S
    for now_s in (0.1, 0.2, timeout_s):
        law.now_s = now_s
        law.step(Inputs(commands=(on_time("teleop", FORWARD, now_s),)))
        assert law.decision.output == FORWARD
    law.now_s = math.nextafter(timeout_s, 1.0)
    assert law.step().reasons == (StopReason.SCAN_STALE,)


def test_a_tick_is_late_just_after_its_limit() -> None:
    law = at_zero()
    law.now_s = 0.1
    assert law.step().output == FORWARD
    law = at_zero()
    law.now_s = math.nextafter(0.1, 1.0)
    assert law.step().reasons == (StopReason.OVERRUN,)


SLOW = replace(CONFIG, max_linear_m_s=0.5, max_angular_rad_s=1.5)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_command_is_implausible_just_beyond_many_times_its_limit(axis: int, sign: float) -> None:
    limit = (SLOW.max_linear_m_s, SLOW.max_angular_rad_s)[axis]
    asked = [0.0, 0.0]
    asked[axis] = sign * IMPLAUSIBLE_FACTOR * limit
    clamped = [0.0, 0.0]
    clamped[axis] = sign * limit
    assert Law(config=SLOW).drive(Velocity(*asked)).output == tuple(clamped)
    asked[axis] = math.nextafter(asked[axis], sign * math.inf)
    assert StopReason.COMMAND_INVALID in Law(config=SLOW).drive(Velocity(*asked)).reasons


def test_a_refusal_explains_a_silence_for_one_timeout_and_no_longer() -> None:
    for refused_s, reason in ((0.0, StopReason.COMMAND_STALE), (-1e-9, StopReason.COMMAND_TIMEOUT)):
        law = at_zero()
        teleop, *others = law.state.interlock.sources
        teleop = teleop._replace(sent_s=-1.0, refused_s=refused_s)
        law.state = law.state._replace(
            interlock=law.state.interlock._replace(sources=(teleop, *others)),
            clock=law.state.clock._replace(now_s=0.15),
        )
        law.now_s = 0.2
        assert law.step().reasons == (reason,)


@pytest.mark.parametrize(
    ("velocity", "alarm"),
    [
        (Velocity(CONFIG.runaway_linear_m_s, CONFIG.runaway_angular_rad_s), False),
        (Velocity(math.nextafter(CONFIG.runaway_linear_m_s, 1.0), 0.0), True),
        (Velocity(0.0, -math.nextafter(CONFIG.runaway_angular_rad_s, 1.0)), True),
    ],
)
def test_a_base_runs_away_just_above_either_threshold(velocity: Velocity, alarm: bool) -> None:  # noqa: FBT001
    law = Law()
    law.hold(2.0)
    still = odometry(0.0, law.now_s + TICK_S)
    assert law.tick(odometry=replace(still, velocity=velocity)).alarm is alarm


def test_a_base_runs_away_just_after_its_braking_time() -> None:
    config = replace(CONFIG, max_linear_m_s=1.0, deceleration_m_s2=2.0)
    braking_s = 0.5 + RUNAWAY_GRACE_S
    for now_s, alarm in ((braking_s, False), (math.nextafter(braking_s, 1.0), True)):
        law = Law(config=config, now_s=0.0)
        assert law.state.base.stopped_s == 0.0
        law.state = law.state._replace(clock=law.state.clock._replace(now_s=now_s - 0.05))
        law.now_s = now_s
        assert law.step(Inputs(odometry=odometry(0.4, now_s))).alarm is alarm


def test_old_odometry_is_no_runaway() -> None:
    law = Law()
    law.tick(odometry=odometry(0.4, law.now_s))
    assert not law.hold(3.0).alarm


def test_braking_time_counts_from_the_stop_and_not_from_the_one_before() -> None:
    law = Law()
    law.drive()
    for _ in range(100):
        law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s))
    for _ in range(30):
        assert not law.tick(("teleop", NEUTRAL), odometry=odometry(0.4, law.now_s)).alarm


def test_a_motion_is_worth_moving_for_from_just_the_creep_speed() -> None:
    law = Law(config=replace(CONFIG, blind_creep_m_s=CONFIG.creep_m_s))
    law.ranges = ring(ahead_m=math.nan)
    law.hold(UNSEEN_S)
    decision = law.drive(Velocity(0.5, 0.0))
    assert decision.output == Velocity(CONFIG.creep_m_s, 0.0)
    creep_m_s = math.nextafter(CONFIG.creep_m_s, 0.0)
    law = Law(config=replace(CONFIG, blind_creep_m_s=creep_m_s))
    law.ranges = ring(ahead_m=math.nan)
    law.hold(UNSEEN_S)
    assert law.drive(Velocity(0.5, 0.0)).reasons == (StopReason.SCAN_BLIND,)


def test_a_slow_arc_is_worth_moving_for_by_the_speed_of_its_rim() -> None:
    """0.01 m/s ahead alone is not; with 0.06 rad/s at a rim of 0.25 m it is."""
    config = replace(CONFIG, blind_creep_m_s=0.010001)
    for angular_rad_s, moves in ((0.0, False), (0.05, False), (0.6, True)):
        law = Law(config=config)
        law.ranges = ring(ahead_m=math.nan)
        law.hold(UNSEEN_S)
        assert (law.drive(Velocity(0.1, angular_rad_s)).output != STANDSTILL) is moves


def test_the_warning_comes_just_inside_its_distance() -> None:
    for distance_m, warning in ((0.75, False), (np.nextafter(np.float32(0.75), np.float32(0.0)), True)):
        law = Law(scanning=False)
        ranges = ring()
        ranges[180] = distance_m
        law.now_s += TICK_S
        assert law.step(Inputs(scans=(laser_scan(ranges, law.now_s),))).warning is warning


# --- freshness in the law


def test_the_time_on_the_way_counts_into_the_age() -> None:
    law = Law(ANY_AGE)
    for _ in range(20):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(NEUTRAL, sent_s=law.now_s),)))
    law.now_s += 0.09
    late = law.stamped(FORWARD, sent_s=law.now_s - 0.06)
    assert law.step(Inputs(commands=(late,))).output == FORWARD
    assert law.state.interlock.sources[0].sent_s == pytest.approx(law.now_s - 0.06, abs=1e-4)
    for wait_s in (0.09, 0.049):
        law.now_s += wait_s
        assert law.step().output == FORWARD
    law.now_s += 0.002
    assert law.step().reasons == (StopReason.COMMAND_TIMEOUT,)


def test_each_source_s_state_is_reported() -> None:
    law = Law()
    law.tick_unstamped(NEUTRAL)
    teleop = law.state.interlock.sources[0]
    assert teleop.stamped is False
    assert teleop.invalid is False
    law.now_s += TICK_S
    law.step(Inputs(commands=(law.stamped(NEUTRAL, sent_s=law.now_s),)))
    assert law.state.interlock.sources[0].stamped is True
    law.tick_unstamped(None)
    assert law.state.interlock.sources[0].invalid is True
    assert law.state.interlock.sources[0].stamped is False
    law.now_s += CONFIG.command_timeout_s
    for _ in range(12):
        law.tick_unstamped(NEUTRAL)
    assert law.state.interlock.sources[0].invalid is False


def test_an_accepted_command_shows_again_that_its_source_stamps() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL))
    law.tick_unstamped(None)
    assert law.state.interlock.sources[0].stamped is False
    law.tick(("teleop", NEUTRAL))
    assert law.state.interlock.sources[0].stamped is True


def test_commands_whose_clock_is_not_proven_yet_refuse_nothing() -> None:
    """A source with stamps has sent nothing yet: it is silent, not late."""
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD))
    accepted = law.state.interlock.sources[0].counts.accepted
    assert accepted == 3
    law.hold(CONFIG.command_timeout_s)
    for _ in range(3):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(FORWARD, sent_s=law.now_s),)))
    assert law.decision.reasons == (StopReason.COMMAND_TIMEOUT,)
    assert law.state.interlock.sources[0].counts.accepted == accepted


def test_a_command_without_a_stamp_is_anothers_while_somebody_who_stamps_is_heard() -> None:
    law = Law()
    for _ in range(20):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(NEUTRAL, sent_s=law.now_s),)))
    assert not law.decision.reasons
    accepted = law.state.interlock.sources[0].counts.accepted
    for _ in range(3):
        assert law.tick_unstamped(FORWARD).output == NEUTRAL
    source = law.state.interlock.sources[0]
    assert (source.counts.epoch, source.counts.accepted, source.stamped) == (3, accepted, True)
    assert source.velocity == NEUTRAL
    law.hold(CONFIG.command_timeout_s + TICK_S)
    for _ in range(12):
        law.tick_unstamped(NEUTRAL)
    assert law.tick_unstamped(FORWARD).output == FORWARD, "nobody else is heard any more"
    assert law.state.interlock.sources[0].stamped is False


def test_a_scan_without_a_stamp_is_anothers_while_a_lidar_that_stamps_is_heard() -> None:
    law = Law(scanning=False)
    walled = ring(ahead_m=0.4)
    for sequence in range(1, 21):
        law.now_s += 0.05
        noisy = walled + np.float32(1e-4 * (sequence % 2))
        scan = replace(laser_scan(noisy, law.now_s), sent=Sent(b"L", sequence, law.now_s))
        law.step(Inputs(scans=(scan,)))
    assert law.decision.warning
    law.now_s += TICK_S
    clear = law.step(Inputs(scans=(laser_scan(ring(), law.now_s),)))
    assert clear.warning
    assert clear.scan_counts.epoch == 1
    law.now_s += SCAN_TIMEOUT_S
    assert not law.step(Inputs(scans=(laser_scan(ring(), law.now_s),))).warning


def test_a_flap_does_not_hide_another_cause() -> None:
    law = Law()
    law.drive()
    decision = law.tick(("teleop", None), liveliness=(*lost(), *back()))
    assert decision.reasons == (StopReason.SOURCE_LOST, StopReason.COMMAND_INVALID)


# --- scans in the law


def sent_scan(law: Law, *, late_s: float = 0.0, sequence: int, ranges: np.ndarray | None = None) -> Inputs:
    noisy = (law.ranges if ranges is None else ranges) + np.float32(1e-4 * (sequence % 2))
    scan = laser_scan(noisy, law.now_s)
    return Inputs(
        commands=(on_time("teleop", law.asked, law.now_s),),
        scans=(replace(scan, sent=Sent(b"L", sequence, law.now_s - late_s + 77.0), writer=b"L"),),
    )


@pytest.fixture
def law_with_stamped_scans() -> Law:
    law = Law(scanning=False)
    law.asked = NEUTRAL
    for sequence in range(1, 30):
        law.now_s += TICK_S
        law.step(sent_scan(law, sequence=sequence))
    law.asked = FORWARD
    law.now_s += TICK_S
    assert law.step(sent_scan(law, sequence=30)).output == FORWARD
    return law


def test_a_stamped_scan_is_as_old_as_its_time_on_the_way(law_with_stamped_scans: Law) -> None:
    law = law_with_stamped_scans
    law.now_s += 0.1
    assert law.step(sent_scan(law, sequence=31, late_s=0.08)).scan_age_s == pytest.approx(0.08, abs=1e-3)
    assert law.decision.scan_counts.accepted > 10


def test_a_replayed_scan_counts_as_none(law_with_stamped_scans: Law) -> None:
    law = law_with_stamped_scans
    refused = 0
    while law.decision.output == FORWARD:
        law.now_s += TICK_S
        law.step(sent_scan(law, sequence=5))
        refused += 1
    assert law.decision.reasons == (StopReason.SCAN_STALE,)
    assert law.decision.scan_counts.sequence == refused
    assert refused * TICK_S == pytest.approx(0.25, abs=2 * TICK_S)


def test_the_newest_scan_once_more_counts_as_none(law_with_stamped_scans: Law) -> None:
    law = law_with_stamped_scans
    law.now_s += TICK_S
    assert law.step(sent_scan(law, sequence=30)).scan_counts.sequence == 1


@pytest.mark.parametrize("foreign", [Sent(b"header", 1, 5.0), Sent(b"F", 1, 1e9)])
def test_one_foreign_scan_does_not_blind_the_robot_permanently(
    law_with_stamped_scans: Law, foreign: Sent
) -> None:
    """Formerly, the lidar's own epoch ended, and SCAN_STALE held until the lidar was restarted."""
    law = law_with_stamped_scans
    law.now_s += TICK_S
    scan = replace(laser_scan(law.ranges, law.now_s), sent=foreign, writer=foreign.epoch)
    law.step(Inputs(scans=(scan,)))
    law.asked = NEUTRAL
    for sequence in range(31, 60):
        law.now_s += TICK_S
        law.step(sent_scan(law, sequence=sequence))
    law.asked = FORWARD
    law.now_s += TICK_S
    assert law.step(sent_scan(law, sequence=60)).output == FORWARD


def test_of_two_lidars_that_speak_in_turn_the_first_is_heard_and_the_robot_stops(
    law_with_stamped_scans: Law,
) -> None:
    law = law_with_stamped_scans
    wall = ring(0.31)
    for sequence in range(31, 60):
        law.now_s += TICK_S
        scan = replace(laser_scan(wall, law.now_s), sent=Sent(b"F", sequence, law.now_s), writer=b"F")
        law.step(Inputs(scans=(scan,)))
        law.now_s += TICK_S
        decision = law.step(sent_scan(law, sequence=sequence))
        assert decision.nearest_m == pytest.approx(2.75, abs=1e-3)
        assert (decision.output == FORWARD) is (sequence == 31), "a stray message is nobody"
    assert law.decision.reasons == (StopReason.SENSOR_CONFLICT,)
    assert law.decision.detail == "samples come from several writers: lidar: F and L"
    assert law.decision.scan_counts.epoch == 29


def test_a_lidar_is_seen_again_after_another_one_took_its_place(law_with_stamped_scans: Law) -> None:
    """A command's epoch would have ended permanently; a driver without attachments counts as a single epoch."""
    law = law_with_stamped_scans
    law.asked = NEUTRAL
    law.hold(0.3)
    for sequence in range(1, 30):
        law.now_s += TICK_S
        sent = Sent(b"F", sequence, law.now_s)
        noisy = law.ranges + np.float32(1e-4 * (sequence % 2))
        law.step(Inputs(scans=(replace(laser_scan(noisy, law.now_s), sent=sent, writer=b"F"),)))
    assert law.decision.scan_age_s == 0.0
    law.hold(0.3)
    for sequence in range(31, 60):
        law.now_s += TICK_S
        law.step(sent_scan(law, sequence=sequence))
    law.asked = FORWARD
    law.now_s += TICK_S
    assert law.step(sent_scan(law, sequence=60)).output == FORWARD


def test_a_late_scan_counts_as_none(law_with_stamped_scans: Law) -> None:
    law = law_with_stamped_scans
    law.now_s += 0.09
    law.step(Inputs(commands=(on_time("teleop", FORWARD, law.now_s),)))
    law.now_s += 0.09
    law.step(Inputs(commands=(on_time("teleop", FORWARD, law.now_s),)))
    law.now_s += 0.09
    law.step(sent_scan(law, sequence=31, late_s=0.26))
    assert law.decision.scan_counts.late == 1
    assert law.decision.reasons == (StopReason.SCAN_STALE,)


@pytest.mark.parametrize(("tolerance_s", "steady"), [(0.25, True), (None, False)])
def test_an_unsteady_header_clock_is_borne_as_far_as_it_is_allowed(
    tolerance_s: float | None,
    steady: bool,  # noqa: FBT001
) -> None:
    law = Law(scanning=False)
    accepted: list[bool] = []
    for n in range(60):
        law.now_s += 0.05
        late_s = 0.1 if n < 30 else 0.0  # then it is quicker than ever before
        scan = replace(
            laser_scan(law.ranges + np.float32(n * 1e-6), law.now_s),
            sent=Sent(b"header", n, law.now_s - late_s + 5.0),
            sent_tolerance_s=tolerance_s,
        )
        before = law.decision.scan_counts.accepted
        accepted.append(law.step(Inputs(scans=(scan,))).scan_counts.accepted > before)
    assert all(accepted[10:30])
    assert accepted[30] is steady
    assert all(accepted[40:])


def test_the_reaction_time_is_the_scan_s_age_its_period_and_the_way_to_the_wheels() -> None:
    law = Law(scanning=False)
    ranges = ring(ahead_m=1.0)
    for n in range(4):
        law.now_s += 0.08
        law.step(
            Inputs(
                commands=(on_time("teleop", NEUTRAL, law.now_s),),
                scans=(laser_scan(ranges + np.float32(n * 1e-6), law.now_s),),
            )
        )
    law.now_s += 0.05
    decision = law.step(Inputs(commands=(on_time("teleop", Velocity(1.0, 0.0), law.now_s),)))
    lost_m_s = CONFIG.deceleration_m_s2 * (0.05 + 0.08 + CONFIG.transport_s)
    kappa = math.sqrt(lost_m_s**2 + 2 * CONFIG.deceleration_m_s2 * (1.0 - 0.25 - 0.3)) - lost_m_s
    assert decision.output.linear_m_s == pytest.approx(kappa, rel=1e-3)


def test_the_first_scan_s_period_is_taken_for_the_longest() -> None:
    law = Law(scanning=False)
    law.now_s += TICK_S
    law.step(Inputs(scans=(laser_scan(ring(), law.now_s),)))
    scan = law.state.sight.lidars[0].scan
    assert scan is not None
    assert scan.period_s == SCAN_TIMEOUT_S
    assert scan.repeats == 0


def test_odometry_is_believed_up_to_twice_the_limits() -> None:
    law = Law(config=SLOW)
    for velocity, believed in (
        (Velocity(1.0, 3.0), True),
        (Velocity(1.01, 0.0), False),
        (Velocity(0.0, 3.01), False),
    ):
        law.tick(odometry=replace(odometry(0.0, law.now_s + TICK_S), velocity=velocity))
        assert law.state.base.odometer.velocity == (velocity if believed else STANDSTILL)


def test_what_is_nearer_by_odometry_counts_from_where_the_scan_was_taken() -> None:
    law = Law()
    law.drive()
    for _ in range(300):  # three metres, with scans all along
        law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s + TICK_S))
        assert law.decision.output == FORWARD
    assert law.state.base.odometer.pose.x_m > 2.9


def test_a_moving_robot_stops_at_what_is_inside_the_stop_zone() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s + TICK_S))
    law.ranges = ring(ahead_m=0.5)
    law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s + TICK_S))
    law.__post_init__()
    law.drive()
    law.scanning = False
    law.tick(
        ("teleop", FORWARD),
        odometry=odometry(0.5, law.now_s + TICK_S),
        scans=(laser_scan(ring(ahead_m=0.56), law.now_s + TICK_S),),
    )
    for _ in range(4):
        law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s + TICK_S))
    assert law.decision.output == STANDSTILL
    assert law.decision.causes == (StopReason.OBSTACLE,)
    law.scanning, law.ranges = True, ring(ahead_m=0.54)
    law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s + TICK_S))
    assert law.decision.reasons == (StopReason.OBSTACLE,)


def test_a_frozen_lidar_is_noticed_in_motion() -> None:
    law = Law(scanning=False)
    ranges = ring()

    def tick(velocity: Velocity, spinning: bool) -> None:  # noqa: FBT001
        law.now_s += TICK_S
        moving = Velocity(0.0, 1.0) if spinning else Velocity(0.5, 0.0)
        law.step(
            Inputs(
                commands=(on_time("teleop", velocity, law.now_s),),
                scans=(laser_scan(ranges, law.now_s),),
                odometry=replace(odometry(0.0, law.now_s), velocity=moving),
            )
        )

    for spinning in (False, True):
        law.__post_init__()
        tick(NEUTRAL, spinning)
        for _ in range(20):
            tick(FORWARD, spinning)
        assert law.decision.reasons == (StopReason.SCAN_INVALID,)
        assert "while the robot moves" in law.decision.scan_problem


def test_what_the_robot_drives_toward_between_scans_is_nearer_than_the_scan_shows() -> None:
    asked = Velocity(0.6, 0.0)
    outputs: list[float] = []
    for reported_m_s in (0.0, 0.6, -0.6):
        law = Law(scanning=False)
        law.now_s += TICK_S
        commands = (on_time("teleop", NEUTRAL, law.now_s),)
        moving = odometry(reported_m_s, law.now_s)
        law.step(
            Inputs(commands=commands, scans=(laser_scan(ring(ahead_m=0.8), law.now_s),), odometry=moving)
        )
        for _ in range(5):
            law.now_s += TICK_S
            moving = odometry(reported_m_s, law.now_s)
            law.step(Inputs(commands=(on_time("teleop", asked, law.now_s),), odometry=moving))
        outputs.append(law.decision.output.linear_m_s)
    standing, closing, leaving = outputs
    assert closing < standing - 0.02
    assert leaving == standing, "odometry alone never permits more than the scan"


# --- the explanation of a decision


def test_a_decision_reports_what_was_asked_and_what_is_given() -> None:
    law = Law()
    ready = law.tick(("teleop", NEUTRAL))
    assert (ready.commanded, ready.scale, ready.mode) == (NEUTRAL, 1.0, Mode.READY)
    driving = law.tick(("teleop", SPIN))
    assert (driving.commanded, driving.output, driving.scale) == (SPIN, SPIN, 1.0)
    assert driving.sources == law.state.interlock.sources
    assert driving.scan_age_s == 0.0
    assert driving.scan_problem == ""
    assert driving.scan_counts.accepted > 1
    stopped = law.tick(("teleop", BACK), estop=True)
    assert (stopped.commanded, stopped.output, stopped.scale) == (BACK, STANDSTILL, 0.0)


def test_a_decision_reports_the_scan_s_age_and_problem() -> None:
    law = Law()
    law.scanning = False
    law.tick()
    assert law.decision.scan_age_s == pytest.approx(TICK_S)
    law.tick(undecodable_lidars=(0,))
    assert law.decision.scan_problem == "undecodable"
    assert math.isnan(law.decision.nearest_m)
    assert math.isnan(Law(scanning=False).decision.scan_age_s)
    assert Law(scanning=False).decision.scan_problem == ""


def test_a_senseless_scan_reports_its_problem() -> None:
    law = Law()
    law.scanning = False
    law.now_s += TICK_S
    scan = LaserScan(ring(), -math.pi, 0.0, 0.05, 12.0, law.now_s)
    assert "more than a full turn" in law.step(Inputs(scans=(scan,))).scan_problem


@pytest.mark.parametrize("alive", [(), back()])
def test_every_answer_to_a_reset_is_a_sentence(alive: tuple[object, ...]) -> None:
    def answer(*commands: tuple[str, Velocity], **inputs: object) -> tuple[bool, str]:
        reply = law.tick(*commands, reset=True, **inputs).reset_reply
        assert reply is not None
        return reply.success, reply.message

    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL), liveliness=alive)
    assert answer() == (True, "there was no emergency stop to reset")
    assert answer(estop=True) == (False, "the emergency stop is being pressed")
    assert answer(("teleop", FORWARD), ("path", FORWARD)) == (
        False,
        "teleop, path still requests motion; stop it first",
    )
    assert law.state.interlock.estop is True
    assert answer(("teleop", NEUTRAL), ("path", NEUTRAL)) == (True, "the emergency stop is reset")
    assert law.state.interlock.estop is False


def test_a_dead_source_that_asked_for_motion_does_not_hinder_a_reset() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), liveliness=back())
    law.tick(("teleop", FORWARD))
    law.tick(estop=True, liveliness=lost())
    reply = law.tick(("path", NEUTRAL), reset=True).reset_reply
    assert reply is not None
    assert reply.success


def test_what_blocked_it_is_forgotten_with_its_stop() -> None:
    law = Law()
    for release in (NEUTRAL, BACK):
        law.ranges = ring()
        law.drive()
        law.ranges = ring(ahead_m=0.5)
        law.hold(CONFIRMED_S, ("teleop", FORWARD))
        assert law.state.interlock.sources[0].block is not None
        law.tick(("teleop", release))
        assert law.state.interlock.sources[0].block is None


def test_a_stop_for_another_reason_takes_the_escape_away() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    law.tick(("path", FORWARD), ("teleop", NEUTRAL))
    law.ranges = ring(ahead_m=0.5)
    law.hold(CONFIRMED_S, ("path", FORWARD), ("teleop", NEUTRAL))
    assert law.decision.reasons == (StopReason.OBSTACLE,)
    law.ranges = ring()
    law.tick(("path", FORWARD), ("teleop", NEUTRAL))
    law.tick(("path", FORWARD), ("teleop", BACK))
    assert law.decision.owner == "teleop"
    law.tick(("path", FORWARD), ("teleop", None))
    path = next(s for s in law.state.interlock.sources if s.config.name == "path")
    assert path.block is None


def test_a_flap_reports_the_other_causes_of_its_step() -> None:
    law = Law()
    law.drive()
    law.hold(0.18)
    law.now_s += 0.05
    decision = law.step(Inputs(liveliness=(*lost(), *back())))
    assert decision.reasons == (StopReason.SOURCE_LOST, StopReason.COMMAND_TIMEOUT)


def test_a_scan_whose_last_angle_does_not_fit_proves_nothing() -> None:
    law = Law()
    law.now_s += TICK_S
    scan = replace(laser_scan(ring(), law.now_s), angle_max=1.0)
    assert law.step(Inputs(scans=(scan,))).reasons == (
        StopReason.SCAN_INVALID,
        StopReason.NO_COMMAND,
    )


def test_a_robot_pushed_at_something_near_may_not_help_with_its_wheels() -> None:
    """Both evaluations of the surroundings permit nothing: neither is preferred, and nothing is raised."""
    law = Law(scanning=False)
    law.now_s += TICK_S
    law.step(
        Inputs(
            commands=(on_time("teleop", NEUTRAL, law.now_s),),
            scans=(laser_scan(ring(ahead_m=0.54), law.now_s),),
            odometry=odometry(0.5, law.now_s),
        )
    )
    law.tick(("teleop", NEUTRAL), odometry=odometry(0.5, law.now_s + TICK_S))
    asked = ("teleop", Velocity(0.5, 0.1))
    assert law.tick(asked, odometry=odometry(0.5, law.now_s + TICK_S)).output == STANDSTILL
    law.ranges, law.scanning = ring(ahead_m=0.53), True
    decision = law.tick(asked, odometry=odometry(0.5, law.now_s + TICK_S))
    assert decision.reasons == (StopReason.OBSTACLE,)
