"""Causes hold now; latched reasons have ended, and only a neutral command is missing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Command, Inputs, SourceConfig
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import RELEASED_FACTOR, initial_state
from supervisor.law.scan import BLANK_SHARE
from tests.unit.supervisor.law.law_harness import (
    BACK,
    CONFIG,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    SPIN,
    TICK_S,
    UNSEEN_S,
    Law,
    back,
    lost,
    odometry,
    ring,
)
from wire.reasons import StopReason

HULL_M = 0.25
"""From the lidar to the hull."""


def told(decision: Decision) -> tuple[set[str], set[str]]:
    return {str(r) for r in decision.causes}, {str(r) for r in decision.latched}


def test_at_the_start_the_causes_are_a_missing_command_and_a_missing_scan() -> None:
    law = Law(scanning=False)
    assert told(law.decision) == ({"SCAN_STALE", "NO_COMMAND"}, set())


def test_a_driving_robot_has_neither_causes_nor_latches() -> None:
    law = Law()
    law.drive()
    assert law.decision.mode is Mode.DRIVING
    assert told(law.decision) == (set(), set())


def test_after_one_late_step_only_a_neutral_command_is_missing() -> None:
    law = Law()
    law.drive()
    law.now_s += 0.13
    assert told(law.tick(("teleop", FORWARD))) == ({"OVERRUN"}, set())
    decision = law.tick(("teleop", FORWARD))
    assert told(decision) == (set(), {"OVERRUN"})
    assert decision.reasons == (StopReason.OVERRUN,)
    assert decision.mode is Mode.STOPPED
    assert told(law.tick(("teleop", NEUTRAL))) == (set(), set())


def test_each_of_two_reasons_is_over_when_its_own_cause_ends() -> None:
    law = Law()
    law.drive()
    law.scanning = False
    law.hold(0.3)
    assert told(law.decision) == ({"SCAN_STALE", "COMMAND_TIMEOUT"}, set())
    law.hold(0.1, ("teleop", FORWARD))
    assert told(law.decision) == ({"SCAN_STALE"}, {"COMMAND_TIMEOUT"})
    law.scanning = True
    law.hold(0.1, ("teleop", FORWARD))
    assert told(law.decision) == (set(), {"SCAN_STALE", "COMMAND_TIMEOUT"})
    assert law.decision.latched == law.decision.reasons


def test_a_lost_token_is_a_cause_until_it_is_back() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", FORWARD), liveliness=lost())) == ({"SOURCE_LOST"}, set())
    assert told(law.tick(("teleop", FORWARD), liveliness=back())) == (set(), {"SOURCE_LOST"})


def test_the_end_of_the_run_that_commands_is_a_cause_though_others_hold_the_token_of_its_source() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD), liveliness=back() + back(epoch=b"teleop"))
    assert told(law.tick(("teleop", FORWARD), liveliness=lost(epoch=b"teleop"))) == ({"SOURCE_LOST"}, set())
    assert law.decision.output == STANDSTILL
    # The tokens of others do not bring it back.
    foreign = back() + back(epoch=b"other") + lost(epoch=b"other")
    assert told(law.tick(("teleop", NEUTRAL), liveliness=foreign)) == ({"SOURCE_LOST"}, set())
    assert told(law.tick(("teleop", FORWARD), liveliness=back(epoch=b"teleop"))) == (set(), {"SOURCE_LOST"})


def test_the_end_of_a_run_that_does_not_command_stops_nothing() -> None:
    law = Law()
    law.drive()
    assert law.tick(("teleop", FORWARD), liveliness=lost(epoch=b"other")).mode is Mode.DRIVING


def test_the_end_of_a_run_stops_no_source_that_sends_no_stamps() -> None:
    law = Law()
    law.state = initial_state(law.config)
    for _ in range(20):
        law.tick_unstamped(NEUTRAL)
    law.tick_unstamped(FORWARD)
    law.now_s += TICK_S
    command = Command("teleop", FORWARD, law.now_s)
    assert law.step(Inputs(commands=(command,), liveliness=lost(epoch=b"other"))).mode is Mode.DRIVING


def test_a_run_that_ended_is_forgotten_once_another_run_commands() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD), liveliness=lost(epoch=b"teleop"))
    law.hold(0.3)
    for _ in range(20):
        law.now_s += TICK_S
        law.step(Inputs(commands=(law.stamped(NEUTRAL, sent_s=law.now_s, epoch=b"next"),)))
    assert law.decision.mode is Mode.READY


def test_a_run_that_sends_zero_and_ends_is_not_lost() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", NEUTRAL), liveliness=lost(epoch=b"teleop"))) == ({"NO_COMMAND"}, set())


def test_a_source_that_sends_zero_and_leaves_is_not_lost() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", NEUTRAL), liveliness=lost())) == ({"NO_COMMAND"}, set())
    assert law.tick().mode is Mode.STOPPED
    assert law.tick(("teleop", NEUTRAL), liveliness=back()).mode is Mode.READY


def test_a_source_that_has_left_and_sends_without_its_token_is_lost() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL), liveliness=lost())
    assert told(law.tick(("teleop", NEUTRAL))) == ({"SOURCE_LOST"}, {"NO_COMMAND"})


def test_a_source_whose_last_command_was_invalid_is_lost_when_its_token_is_deleted() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL))
    assert "SOURCE_LOST" in told(law.tick(("teleop", None), liveliness=lost()))[0]


def test_a_cause_that_begins_and_ends_within_one_step_is_latched() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", FORWARD), liveliness=lost() + back())) == (set(), {"SOURCE_LOST"})


def test_an_invalid_command_is_a_cause_until_a_valid_one_arrives() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", None))) == ({"COMMAND_INVALID"}, set())
    assert told(law.tick(("teleop", FORWARD))) == (set(), {"COMMAND_INVALID"})


def test_a_pressed_e_stop_is_a_cause_until_the_step_after_its_reset() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL), estop=True)
    assert told(law.decision) == ({"ESTOP"}, set())
    law.tick(reset=True)
    assert told(law.decision) == ({"ESTOP"}, set())
    assert told(law.tick()) == (set(), {"ESTOP"})


def test_an_e_stop_that_could_not_be_recorded_stops_a_driving_robot_until_neutral() -> None:
    law = Law()
    law.drive()
    assert told(law.tick(("teleop", FORWARD), estop_unrecorded=True)) == ({"ESTOP_UNRECORDED"}, set())
    assert law.decision.output == STANDSTILL
    law.tick(("teleop", NEUTRAL), estop_unrecorded=True)
    assert told(law.tick(("teleop", FORWARD))) == (set(), {"ESTOP_UNRECORDED"})
    assert law.decision.output == STANDSTILL
    assert law.drive().mode is Mode.DRIVING


def test_a_base_that_runs_away_is_a_cause_until_it_stands() -> None:
    law = Law()
    law.drive()
    law.tick(("teleop", NEUTRAL))
    for _ in range(100):
        law.tick(("teleop", FORWARD), estop=True, odometry=odometry(0.5, law.now_s + 0.02))
    assert "BASE_RUNAWAY" in told(law.decision)[0]
    law.tick(("teleop", FORWARD), odometry=odometry(0.0, law.now_s + 0.02))
    assert told(law.decision) == ({"ESTOP"}, {"BASE_RUNAWAY"})


def test_another_sources_stop_is_latched_on_the_one_that_takes_over() -> None:
    two = (SourceConfig("teleop", 100), SourceConfig("path", 10))
    law = Law(config=replace(CONFIG, sources=two))
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    law.tick(("teleop", FORWARD), ("path", NEUTRAL))
    law.tick(("path", BACK), liveliness=lost())
    assert law.decision.owner == "path"
    assert told(law.decision) == (set(), {"SOURCE_LOST"})


# --- the barrier


def approached(law: Law) -> Decision:
    law.ranges = ring(ahead_m=CONFIG.stop_distance_m + HULL_M)
    return law.drive()


def test_an_obstacle_is_a_cause_while_the_command_closes_on_it() -> None:
    law = Law()
    assert told(approached(law)) == ({"OBSTACLE"}, set())
    assert told(law.hold(0.5, ("teleop", FORWARD))) == ({"OBSTACLE"}, set())


def test_an_obstacle_that_moves_away_is_no_longer_a_cause_but_does_not_start_the_robot() -> None:
    law = Law()
    approached(law)
    law.ranges = ring()
    law.hold(0.1, ("teleop", FORWARD))
    assert told(law.decision) == (set(), {"OBSTACLE"})
    assert law.decision.output == NEUTRAL


def permitted_at(clearance_m: float) -> float:
    """The permitted closing speed for a scan that arrives at every tick [m/s]."""
    lost_m_s = CONFIG.deceleration_m_s2 * (0.02 + CONFIG.transport_s)
    margin_m = clearance_m - CONFIG.stop_distance_m
    return math.sqrt(lost_m_s**2 + 2 * CONFIG.deceleration_m_s2 * margin_m) - lost_m_s


@pytest.mark.parametrize(("beyond_m", "is_over"), [(0.0062, False), (0.0088, True)])
def test_an_obstacle_is_over_at_five_times_the_minimum_useful_speed(
    beyond_m: float, *, is_over: bool
) -> None:
    useful_m_s = RELEASED_FACTOR * CONFIG.creep_m_s
    assert RELEASED_FACTOR == 5.0
    clearance_m = CONFIG.stop_distance_m + beyond_m
    assert (permitted_at(clearance_m) > useful_m_s) == is_over, "the numbers of this test"
    law = Law()
    approached(law)
    law.ranges = ring(ahead_m=clearance_m + HULL_M)
    law.hold(0.1, ("teleop", FORWARD))
    assert (law.decision.causes == ()) == is_over
    assert law.decision.reasons == (StopReason.OBSTACLE,)


def test_a_block_of_a_slow_command_ends_where_the_full_command_is_permitted() -> None:
    law = Law()
    law.ranges = ring(ahead_m=CONFIG.stop_distance_m + HULL_M)
    slow = FORWARD._replace(linear_m_s=0.05)
    law.drive(slow)
    assert told(law.decision) == ({"OBSTACLE"}, set())
    for beyond_m, causes in ((0.002, {"OBSTACLE"}), (0.02, set[str]())):
        law.ranges = ring(ahead_m=CONFIG.stop_distance_m + HULL_M + beyond_m)
        law.hold(0.1, ("teleop", slow))
        assert told(law.decision) == (causes, {"OBSTACLE"} - causes)


def test_an_obstacle_is_no_cause_while_nothing_is_commanded() -> None:
    law = Law()
    approached(law)
    law.tick(("teleop", NEUTRAL), estop=True)
    assert told(law.decision) == ({"ESTOP"}, {"OBSTACLE"})


@pytest.mark.parametrize("undecodable", [False, True])
def test_without_a_valid_scan_an_obstacle_is_latched_but_no_cause(*, undecodable: bool) -> None:
    law = Law()
    approached(law)
    law.scanning = False
    if undecodable:
        law.tick(("teleop", FORWARD), undecodable_lidars=(0,))
        assert told(law.decision) == ({"SCAN_INVALID"}, {"OBSTACLE"})
    else:
        law.hold(0.3, ("teleop", FORWARD))
        assert told(law.decision) == ({"SCAN_STALE"}, {"OBSTACLE"})


def test_scan_blind_is_a_cause_until_the_gap_of_the_scan_is_filled() -> None:
    law = Law()
    law.ranges = ring()
    law.ranges[120:241] = np.nan
    law.hold(UNSEEN_S)
    assert told(law.drive()) == ({"SCAN_BLIND"}, set())
    law.ranges = ring()
    law.hold(0.1, ("teleop", FORWARD))
    assert told(law.decision) == (set(), {"SCAN_BLIND"})


def test_the_detail_of_scan_invalid_is_the_problem_of_the_scan() -> None:
    law = Law()
    law.drive()
    law.ranges = np.full(360, np.nan, dtype=np.float32)
    law.hold(BLANK_SHARE * SCAN_TIMEOUT_S + TICK_S, ("teleop", FORWARD))
    assert law.decision.causes == (StopReason.SCAN_INVALID,)
    assert law.decision.detail == law.decision.scan_problem != ""
    law.ranges = ring()
    assert law.tick(("teleop", FORWARD)).detail == ""


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([NEUTRAL, FORWARD, BACK, SPIN, None]),
            st.sampled_from(
                ["", "silence", "lost", "back", "late", "estop", "reset", "no scan", "near", "far"]
            ),
        ),
        max_size=40,
    )
)
def test_every_reason_is_either_a_cause_or_latched_and_never_both(events: list[tuple[object, str]]) -> None:
    law = Law()
    for velocity, event in events:
        law.now_s += 0.2 if event == "late" else 0.0
        law.scanning = event != "no scan"
        law.ranges = ring(ahead_m=0.5) if event == "near" else ring()
        commands = () if event == "silence" else (("teleop", velocity),)
        inputs: dict[str, object] = {"estop": event == "estop", "reset": event == "reset"}
        if event in ("lost", "back"):
            inputs["liveliness"] = (lost if event == "lost" else back)()
        decision = law.tick(*commands, **inputs)  # type: ignore[arg-type]
        assert not set(decision.causes) & set(decision.latched)
        if decision.reasons:
            assert set(decision.causes) | set(decision.latched) == set(decision.reasons)
        else:  # a single reading limits to zero, and latches nothing
            assert set(decision.causes) <= {StopReason.OBSTACLE}
            assert decision.latched == ()
        for part in (decision.causes, decision.latched):
            assert list(part) == [reason for reason in StopReason if reason in part]


def test_a_step_without_inputs_still_reports_the_causes() -> None:
    law = Law()
    law.drive()
    law.scanning = False
    law.now_s += 0.09
    assert law.step(Inputs()).causes == ()
    law.now_s += 0.09
    law.step(Inputs())
    law.now_s += 0.09
    assert told(law.step(Inputs())) == ({"SCAN_STALE", "COMMAND_TIMEOUT"}, set())


@pytest.mark.parametrize(
    ("beam", "motion", "words"),
    [
        (180, FORWARD, "something is too close ahead"),
        (0, BACK, "something is too close behind"),
        (210, FORWARD, "something is too close at 30° left"),
    ],
)
def test_the_detail_of_a_barrier_stop_is_its_direction(beam: int, motion: Velocity, words: str) -> None:
    law = Law()
    law.drive(motion)
    law.ranges[np.arange(beam - 5, beam + 6) % 360] = 0.6
    law.ranges[beam] = 0.5
    assert law.tick(("teleop", motion)).detail == words
    assert law.tick(("teleop", motion)).detail == words, "when it is latched, too"


def test_a_latched_barrier_stop_stays_a_cause_during_an_estop() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=0.5)
    law.hold(0.1, ("teleop", FORWARD))
    decision = law.tick(("teleop", FORWARD), estop=True)
    assert told(decision) == ({"ESTOP", "OBSTACLE"}, set())


def test_obstacle_is_reported_if_a_seen_and_a_hidden_point_limit_the_motion_equally() -> None:
    law = Law()
    law.ranges = ring(ahead_m=0.4)
    law.ranges[200:230] = math.nan
    law.hold(UNSEEN_S, ("teleop", NEUTRAL))
    assert law.hold(0.1, ("teleop", FORWARD)).reasons == (StopReason.OBSTACLE,)


def test_the_barrier_adds_no_cause_to_another_stop() -> None:
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=0.5)
    decision = law.tick(("teleop", FORWARD), estop=True)
    assert told(decision) == ({"ESTOP"}, set())
    assert law.tick(("teleop", FORWARD)).causes == (StopReason.ESTOP,)
