"""The interlock: its stops, and that only a neutral command after the cause permits motion again."""

import math
from dataclasses import replace

import pytest

from supervisor.law.decision import Mode
from supervisor.law.model import Command, Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import ROUNDING_S, initial_state, runs_out_s, step
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    BACK,
    CONFIG,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    TICK_S,
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


def test_the_law_starts_stopped_without_a_command() -> None:
    law = Law()
    assert law.decision.mode is Mode.STOPPED
    assert law.decision.reasons == (StopReason.NO_COMMAND,)
    assert law.decision.output == STANDSTILL


def test_the_law_starts_stopped_without_a_scan() -> None:
    law = Law(scanning=False)
    assert StopReason.SCAN_STALE in law.decision.reasons


def test_the_law_starts_with_an_estop_that_was_not_reset() -> None:
    for estop in (True, False):
        _, decision = step(initial_state(CONFIG, estop=estop), 1000.0, Inputs())
        assert (StopReason.ESTOP in decision.reasons) is estop


def test_no_distance_is_counted_before_the_first_step() -> None:
    state, _ = step(initial_state(CONFIG), 1000.0, Inputs(odometry=odometry(1.0, 1000.0)))
    assert state.base.way_m == 0.0


def test_a_first_command_that_is_not_neutral_moves_nothing() -> None:
    law = Law()
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL


def test_neutral_arms_and_then_a_motion_drives() -> None:
    law = Law()
    assert law.tick(("teleop", NEUTRAL)).mode is Mode.READY
    decision = law.tick(("teleop", FORWARD))
    assert decision.mode is Mode.DRIVING
    assert decision.output == FORWARD


def test_a_neutral_and_a_motion_within_one_tick_both_count() -> None:
    law = Law()
    law.tick()
    assert law.tick(("teleop", NEUTRAL), ("teleop", FORWARD)).output == FORWARD


def test_a_command_goes_stale_just_after_its_timeout() -> None:
    law = Law(ANY_AGE, now_s=-1.0)
    law.tick(("teleop", NEUTRAL))
    law.now_s = -TICK_S  # so that the command comes at 0, where its timeout adds up exactly
    law.state = law.state._replace(clock=law.state.clock._replace(now_s=None))
    law.tick(("teleop", FORWARD))
    assert law.now_s == 0.0
    for now_s in (0.1, law.config.command_timeout_s):
        law.now_s = now_s
        assert law.step().output == FORWARD
    law.now_s = math.nextafter(law.now_s, math.inf)
    assert law.step().output == STANDSTILL
    assert law.decision.reasons == (StopReason.COMMAND_TIMEOUT,)


@pytest.mark.parametrize("begin_s", [0.1 * begin for begin in range(20)] + [1e6])
@pytest.mark.parametrize(
    ("scanning", "reason"),
    [(True, StopReason.COMMAND_TIMEOUT), (False, StopReason.SCAN_STALE)],
    ids=["commands end", "scans end"],
)
def test_a_motion_ends_exactly_when_runs_out_s_predicts(
    *, scanning: bool, reason: StopReason, begin_s: float
) -> None:
    law = Law(ANY_AGE, now_s=begin_s)
    law.drive()
    law.scanning = scanning
    last_s, goes_on = law.now_s, [] if scanning else [("teleop", FORWARD)]
    timeout_s = law.config.command_timeout_s if scanning else SCAN_TIMEOUT_S
    law.hold(0.1, *goes_on)
    end_s = runs_out_s(law.state)
    assert end_s == pytest.approx(last_s + timeout_s + ROUNDING_S, abs=1e-9)
    while law.now_s + 1.5 * TICK_S < end_s:
        assert law.tick(*goes_on).output == FORWARD
        assert runs_out_s(law.state) == end_s
    law.now_s = end_s - 1.5 * ROUNDING_S
    assert law.step(Inputs()).output == FORWARD
    law.now_s = end_s
    assert law.step(Inputs()).output == STANDSTILL
    assert law.decision.reasons == (reason,)


def test_a_robot_at_rest_has_no_expiry() -> None:
    law = Law(scanning=False)
    assert runs_out_s(law.state) == math.inf
    law.scanning = True
    law.hold(0.1, ("teleop", NEUTRAL))
    assert law.decision.mode is Mode.READY
    assert runs_out_s(law.state) == math.inf


def test_a_source_that_resumes_with_a_motion_command_must_send_neutral_first() -> None:
    law = Law()
    law.drive()
    assert law.hold(0.3).reasons == (StopReason.COMMAND_TIMEOUT,)
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL
    assert law.tick(("teleop", NEUTRAL)).mode is Mode.READY
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_lost_token_stops_immediately_and_its_return_alone_does_not_arm() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), liveliness=back())
    law.tick(("teleop", FORWARD))
    decision = law.tick(("teleop", FORWARD), liveliness=lost())
    assert decision.output == STANDSTILL
    assert decision.reasons == (StopReason.SOURCE_LOST,)
    assert law.tick(("teleop", NEUTRAL)).reasons == (StopReason.SOURCE_LOST,)
    assert law.tick(("teleop", FORWARD), liveliness=back()).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_token_that_flaps_within_one_step_stops_too() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), liveliness=back())
    law.tick(("teleop", FORWARD))
    decision = law.tick(("teleop", FORWARD), liveliness=(*lost(), *back()))
    assert decision.reasons == (StopReason.SOURCE_LOST,)


@pytest.mark.parametrize(
    "velocity",
    [
        None,
        Velocity(math.nan, 0.0),
        Velocity(0.0, math.nan),
        Velocity(math.inf, 0.0),
        Velocity(0.0, -math.inf),
        Velocity(10.1, 0.0),
        Velocity(0.0, 20.1),
    ],
)
def test_an_invalid_command_stops_and_does_not_refresh_the_age(velocity: Velocity | None) -> None:
    law = Law()
    law.drive()
    sent_s = law.state.interlock.sources[0].sent_s
    decision = law.tick(("teleop", velocity))
    assert decision.reasons == (StopReason.COMMAND_INVALID,)
    assert decision.output == STANDSTILL
    assert law.state.interlock.sources[0].sent_s == sent_s
    assert law.state.interlock.sources[0].counts.invalid == 1
    assert law.tick(("teleop", FORWARD)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_an_invalid_command_stops_even_if_a_valid_one_follows_in_the_same_step() -> None:
    law = Law()
    law.drive()
    decision = law.tick(("teleop", None), ("teleop", FORWARD))
    assert decision.reasons == (StopReason.COMMAND_INVALID,)
    assert law.tick(("teleop", FORWARD)).output == STANDSTILL


def test_a_source_that_has_timed_out_does_not_prevent_a_reset() -> None:
    """A source without a token, dead at speed."""
    law = Law()
    law.drive()
    law.tick(estop=True)
    law.hold(1.0)
    reply = law.tick(reset=True).reset_reply
    assert reply is not None
    assert reply.success


def test_a_command_beyond_the_limits_is_clamped() -> None:
    law = Law()
    assert law.drive(Velocity(5.0, -9.0)).output == Velocity(1.0, -2.0)


def test_a_stale_scan_stops_and_fresh_scans_alone_do_not_arm() -> None:
    law = Law()
    law.drive()
    law.scanning = False
    driven_s = 0.0
    while law.tick(("teleop", FORWARD)).output != STANDSTILL:
        driven_s += TICK_S
    assert SCAN_TIMEOUT_S - TICK_S < driven_s <= SCAN_TIMEOUT_S
    assert law.decision.reasons == (StopReason.SCAN_STALE,)
    assert law.tick(("teleop", NEUTRAL)).mode is Mode.STOPPED
    law.scanning = True
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_an_undecodable_scan_stops_until_a_valid_scan_and_neutral_arrive() -> None:
    law = Law()
    law.drive()
    law.scanning = False
    assert law.tick(("teleop", FORWARD), undecodable_lidars=(0,)).reasons == (StopReason.SCAN_INVALID,)
    law.scanning = True
    law.tick(("teleop", FORWARD))
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_late_step_of_the_law_stops() -> None:
    law = Law()
    law.drive()
    law.now_s += law.config.overrun_s
    assert law.tick(("teleop", FORWARD)).reasons == (StopReason.OVERRUN,)
    assert law.tick(("teleop", FORWARD)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_base_that_still_moves_after_its_braking_time_raises_the_alarm() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL))
    stopped_s = law.now_s
    while law.now_s - stopped_s < 2.0:
        law.tick(("teleop", NEUTRAL), odometry=odometry(0.4, law.now_s))
        if law.decision.alarm:
            break
    assert 0.9 < law.now_s - stopped_s < 1.1
    assert law.decision.reasons == (StopReason.BASE_RUNAWAY,)
    assert law.hold(0.5, ("teleop", NEUTRAL)).alarm
    law.tick(("teleop", FORWARD), odometry=odometry(0.0, law.now_s))
    assert law.decision.output == STANDSTILL
    assert not law.decision.alarm
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_estop_latches_and_neither_neutral_nor_time_releases_it() -> None:
    law = Law()
    law.drive()
    assert law.tick(("teleop", FORWARD), estop=True).reasons == (StopReason.ESTOP,)
    assert law.hold(5.0, ("teleop", NEUTRAL)).reasons == (StopReason.ESTOP,)


def test_a_reset_is_refused_while_a_source_requests_motion() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD), estop=True)
    reply = law.tick(("teleop", FORWARD), reset=True).reset_reply
    assert reply is not None
    assert not reply.success
    assert "teleop" in reply.message
    assert law.decision.reasons == (StopReason.ESTOP,)


def test_a_reset_moves_nothing_and_neutral_must_follow_it() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL), estop=True)
    reply = law.tick(("teleop", NEUTRAL), reset=True).reset_reply
    assert reply is not None
    assert reply.success
    assert law.tick(("teleop", FORWARD)).output == STANDSTILL
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FORWARD)).output == FORWARD


def test_a_reset_in_the_same_step_as_a_press_is_refused() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), estop=True)
    reply = law.tick(("teleop", NEUTRAL), estop=True, reset=True).reset_reply
    assert reply is not None
    assert not reply.success


def test_a_reset_without_an_estop_succeeds_and_says_so() -> None:
    reply = Law().tick(reset=True).reset_reply
    assert reply is not None
    assert reply.success
    assert "no emergency stop" in reply.message


def test_the_higher_priority_takes_over_at_once_when_armed() -> None:
    law = Law()
    law.drive(FORWARD, "joy")
    law.tick(("joy", FORWARD), ("teleop", NEUTRAL))
    decision = law.tick(("joy", FORWARD), ("teleop", BACK))
    assert decision.owner == "teleop"
    assert decision.output == BACK


def test_a_higher_priority_that_is_not_armed_does_not_take_over() -> None:
    law = Law()
    law.drive(FORWARD, "joy")
    decision = law.tick(("joy", FORWARD), ("teleop", BACK))
    assert decision.owner == "joy"
    assert decision.output == FORWARD


def test_a_neutral_heartbeat_does_not_interrupt_a_source_of_lower_priority() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    decision = law.hold(1.0, ("teleop", NEUTRAL), ("path", FORWARD))
    assert decision.owner == "path"
    assert decision.output == FORWARD


def test_when_the_owner_dies_no_other_source_takes_over() -> None:
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL), liveliness=back())
    law.hold(0.5, ("teleop", BACK), ("path", FORWARD))
    assert law.decision.owner == "teleop"
    decision = law.tick(("path", FORWARD), liveliness=lost())
    assert decision.output == STANDSTILL
    assert law.hold(2.0, ("path", FORWARD)).output == STANDSTILL
    law.tick(("path", NEUTRAL))
    assert law.tick(("path", FORWARD)).output == FORWARD


def test_a_source_outside_the_configuration_is_shown_and_moves_nothing() -> None:
    law = Law()
    law.tick(("stranger", NEUTRAL), strangers=("stranger",))
    decision = law.tick(("stranger", FORWARD), strangers=("stranger", "stranger", "other"))
    assert decision.output == STANDSTILL
    assert decision.strangers == ("stranger", "other")


def test_the_token_of_an_unknown_source_is_ignored() -> None:
    law = Law()
    law.drive()
    assert law.tick(("teleop", FORWARD), liveliness=(*back("stranger"), *lost("stranger"))).output == FORWARD


def test_the_number_of_remembered_unknown_sources_is_limited() -> None:
    law = Law()
    decision = law.tick(strangers=tuple(f"stranger{n}" for n in range(100)))
    assert len(decision.strangers) == 8


@pytest.mark.parametrize("sent_before_s", [0.05, 0.15])
def test_a_neutral_command_that_waited_while_the_supervisor_was_stopped_does_not_arm(
    sent_before_s: float,
) -> None:
    law = Law()
    for velocity in (*[NEUTRAL] * 20, FORWARD):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(velocity, sent_s=law.now_s),)))
    law.now_s += 0.3
    waited = [
        law.stamped(velocity, sent_s=law.now_s - sent_before_s + n * 0.01)
        for n, velocity in enumerate((NEUTRAL, FORWARD))
    ]
    assert StopReason.OVERRUN in law.step().reasons
    law.now_s += 0.002
    arrived = tuple(replace(command, arrival_s=law.now_s) for command in waited)
    assert law.step(Inputs(commands=arrived)).output == STANDSTILL
    for velocity in (NEUTRAL, FORWARD):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(velocity, sent_s=law.now_s),)))
    assert law.decision.output == FORWARD


def test_all_reasons_are_named_the_most_restrictive_first() -> None:
    law = Law()
    law.drive()
    law.scanning = False
    law.tick(("teleop", None), estop=True, liveliness=lost())
    law.now_s += 1.0
    assert law.step().reasons == (
        StopReason.ESTOP,
        StopReason.OVERRUN,
        StopReason.SCAN_STALE,
        StopReason.SOURCE_LOST,
        StopReason.COMMAND_INVALID,
        StopReason.COMMAND_TIMEOUT,
    )


def test_a_backlog_after_a_stall_moves_nothing_and_is_counted() -> None:
    law = Law()
    clock = 500.0  # the sender's own
    offset = law.now_s - clock
    for _ in range(20):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(NEUTRAL, sent_s=law.now_s - offset),)))
    for _ in range(20):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(FORWARD, sent_s=law.now_s - offset),)))
    assert law.decision.output == FORWARD
    law.hold(3.0)
    stalled_s = law.now_s - 3.0
    backlog = tuple(
        law.stamped(FORWARD if n < 40 else NEUTRAL, sent_s=stalled_s + n * 0.05 - offset)
        for n in range(1, 51)
    )
    decision = law.step(Inputs(commands=backlog))
    assert decision.output == STANDSTILL
    assert StopReason.COMMAND_STALE in decision.reasons
    assert law.state.interlock.sources[0].counts.late == 50
    law.now_s += TICK_S
    live = law.stamped(FORWARD, sent_s=law.now_s - offset)
    assert law.step(Inputs(commands=(live,))).output == STANDSTILL


def test_a_backlog_of_an_unknown_epoch_moves_nothing() -> None:
    law = Law()
    burst = tuple(law.stamped(NEUTRAL if n < 30 else FORWARD, sent_s=n * 0.05) for n in range(60))
    law.now_s += TICK_S
    assert law.step(Inputs(commands=burst)).output == STANDSTILL
    assert law.hold(0.1).output == STANDSTILL


def speak(law: Law, epoch: bytes, velocity: Velocity, seconds: float) -> None:
    """Commands of one run of teleop at every tick, each with the next sequence."""
    for _ in range(round(seconds / TICK_S)):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(velocity, sent_s=law.now_s, epoch=epoch),)))


def test_a_replayed_run_is_refused() -> None:
    law = Law()
    for epoch in (b"A", b"B"):
        speak(law, epoch, NEUTRAL, 0.6)
        law.hold(0.3)
    refused = law.state.interlock.sources[0].counts.epoch
    assert refused == 0
    speak(law, b"A", FORWARD, 2.0)
    assert law.decision.output == STANDSTILL
    assert law.state.interlock.sources[0].counts.epoch == 100


def test_one_foreign_command_neither_moves_the_robot_nor_locks_out_the_operator() -> None:
    """Formerly, teleop's epoch ended with it, and all its commands were refused until it was restarted."""
    law = Law()
    speak(law, b"A", NEUTRAL, 0.4)
    speak(law, b"A", FORWARD, 0.1)
    foreign = Command("teleop", BACK, law.now_s, Sent(b"F", 2**40, 1e9))
    assert law.step(Inputs(commands=(foreign,))).output == FORWARD
    speak(law, b"A", FORWARD, 0.5)
    assert law.decision.output == FORWARD
    assert law.state.interlock.sources[0].counts.epoch == 1


def test_a_second_program_with_the_same_name_is_refused_while_the_first_one_sends() -> None:
    law = Law()
    speak(law, b"A", NEUTRAL, 0.4)
    for n in range(200):
        law.now_s += TICK_S
        first = law.stamped(NEUTRAL, sent_s=law.now_s)
        second = Command("teleop", FORWARD if n % 2 else BACK, law.now_s, Sent(b"B", n + 1, law.now_s))
        assert law.step(Inputs(commands=(first, second))).output == STANDSTILL
    assert law.state.interlock.sources[0].counts.epoch == 200
    assert law.decision.mode is Mode.READY


@pytest.mark.parametrize("pause_s", [0.02, 0.1, 0.2, 0.24, 5.0])
def test_a_restarted_teleop_drives_again_soon_after_its_neutral(pause_s: float) -> None:
    law = Law()
    speak(law, b"A", NEUTRAL, 0.4)
    speak(law, b"A", FORWARD, 0.4)
    law.tick(liveliness=lost())
    law.hold(pause_s - TICK_S)
    law.tick(liveliness=back())
    law.sequence = 0
    speak(law, b"B", NEUTRAL, 2 * CONFIG.command_timeout_s + 2 * TICK_S)
    assert law.decision.mode is Mode.READY
    speak(law, b"B", FORWARD, TICK_S)
    assert law.decision.output == FORWARD
    speak(law, b"B", NEUTRAL, TICK_S)
    law.hold(1.0)
    speak(law, b"A", FORWARD, 2.0)
    assert law.decision.output == STANDSTILL, "an epoch that was replaced never returns"


def test_a_scan_and_a_command_that_arrive_together_between_ticks_both_count() -> None:
    law = Law(scanning=False)
    law.now_s += TICK_S
    neutral = on_time("teleop", NEUTRAL, law.now_s - 0.001)
    decision = law.step(Inputs(commands=(neutral,), scans=(laser_scan(ring(), law.now_s),)))
    assert decision.mode is Mode.READY
