"""Hazards found in the code of other projects, and requests of their users: one named test each.

Hazards beyond the law are tested on the processes:

* a key's release and a lost keyboard: `tests/unit/teleop`, `tests/component/test_teleop_service.py`;
* a process that hangs while its supervisor shows RUNNING, and its independent base watchdog:
  `tests/system/test_faults.py` (`a_stopped_supervisor_…`, `a_stopped_teleop_…`), `tests/unit/wire/test_watchdog.py`;
* children that survive their supervisord, with their ports: `tests/system/test_deploy_stack.py`
  (`a_killed_supervisor_is_restarted_and_a_killed_supervisord_is_cleaned_up_after`);
* a keyboard that supervisord's children do not have: `test_deploy_stack.py`
  (`without_a_terminal_up_says_what_to_do_instead`, `up_drives_from_this_terminal_…`);
* zeros at 50 Hz, and the status while nothing changes: `tests/component/test_supervisor_service.py`.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.config import SupervisorSection
from supervisor.law.clearance import ConvexPolygon
from supervisor.law.decision import Mode
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.messages import HEADER_EPOCH, to_scan
from tests.unit.supervisor.law.law_harness import (
    BACK,
    BEAMS,
    CONFIG,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    SPIN,
    TICK_S,
    Law,
    back,
    laser_scan,
    lost,
    odometry,
    on_time,
    proven_state,
    ring,
)
from wire import messages as ros
from wire.bus import Arrival
from wire.freshness import Sent
from wire.reasons import StopReason

FULL_SPEED = Velocity(1.0, 2.0)


def full(reading: float) -> np.ndarray:
    return np.full(BEAMS, reading, dtype=np.float32)


# --- hazards read in their code


@pytest.mark.parametrize("reading", [math.nan, 0.0, -math.inf, 0.01, 0.049])
@pytest.mark.parametrize("motion", [FORWARD, BACK])
def test_a_fresh_scan_of_nothing_but_dropped_readings_is_not_clear(reading: float, motion: Velocity) -> None:
    """Nav2 scan.cpp: a fresh scan that is all NaN, all zero or all too close reads as clear."""
    state = proven_state(CONFIG)
    now_s = 1000.0
    for velocity in (NEUTRAL, NEUTRAL, motion, motion):
        now_s += TICK_S
        scan = laser_scan(full(reading), now_s)
        state, decision = step(state, now_s, Inputs((on_time("teleop", velocity, now_s),), scans=(scan,)))
        assert decision.output == STANDSTILL
    assert set(decision.reasons) & {StopReason.SCAN_INVALID, StopReason.OBSTACLE}


@pytest.mark.parametrize("reading", [math.nan, 0.0, -math.inf, 0.01])
def test_a_scan_that_turns_into_dropped_readings_stops_a_driving_robot(reading: float) -> None:
    """Nav2 scan.cpp: out-of-range beams are dropped, and an empty set of points is a clear one."""
    law = Law()
    law.drive()
    law.ranges = full(reading)
    law.tick(("teleop", FORWARD))
    if math.isnan(reading):  # a scan without any reading counts as missing at first
        law.hold(SCAN_TIMEOUT_S, ("teleop", FORWARD))
    assert law.decision.output == STANDSTILL


@pytest.mark.parametrize("ahead_s", [0.3, 10.0, 1e6])
def test_a_scan_from_the_future_goes_stale_by_its_arrival(ahead_s: float) -> None:
    """Nav2 sourceValid(): a scan stamped in the future never goes stale."""
    law = Law(scanning=False)
    for n in range(100):
        law.now_s += TICK_S
        scan = laser_scan(ring() + np.float32(1e-4 * (n % 2)), law.now_s)
        sent = Sent(HEADER_EPOCH, n + 1, law.now_s + ahead_s)
        command = on_time("teleop", NEUTRAL if n < 50 else FORWARD, law.now_s)
        law.step(Inputs((command,), scans=(replace(scan, sent=sent, sent_tolerance_s=0.25),)))
    assert law.decision.output == FORWARD
    assert law.hold(SCAN_TIMEOUT_S - TICK_S, ("teleop", FORWARD)).output == FORWARD
    assert law.hold(2 * TICK_S, ("teleop", FORWARD)).output == STANDSTILL
    assert StopReason.SCAN_STALE in law.decision.reasons


def test_a_clock_that_leaps_into_the_future_and_back_neither_extends_nor_locks_out() -> None:
    """Nav2 sourceValid(): with one scan from the future, all later ones look old, or never do."""
    law = Law(scanning=False)
    leap_s = {60: 1000.0}
    for n in range(120):
        law.now_s += TICK_S
        scan = laser_scan(ring() + np.float32(1e-4 * (n % 2)), law.now_s)
        sent = Sent(HEADER_EPOCH, n + 1, law.now_s + leap_s.get(n, 0.0))
        command = on_time("teleop", NEUTRAL if n < 50 or n > 100 else FORWARD, law.now_s)
        law.step(Inputs((command,), scans=(replace(scan, sent=sent, sent_tolerance_s=0.25),)))
        if n in range(75, 101):
            assert law.decision.output == STANDSTILL, "the proof of the clock began anew, and no scan counted"
    assert law.tick(("teleop", FORWARD)).output == FORWARD


@pytest.mark.parametrize("silent_s", [1.0, 3600.0, 7 * 86400.0])
def test_a_driver_without_sequences_is_seen_again_after_any_silence(silent_s: float) -> None:
    """Its arrivals stand for a sequence; none of them may look like one that jumped."""
    state, reasons = initial_state(CONFIG), frozenset[StopReason]()
    arrivals_s = [1e5 + n * 0.1 for n in range(20)]
    arrivals_s += [arrivals_s[-1] + silent_s + n * 0.1 for n in range(20)]
    for n, arrival_s in enumerate(arrivals_s):
        message = ros.laser_scan(
            ring() + np.float32(1e-4 * (n % 2)),
            range_m=(0.05, 12.0),
            period_s=0.1,
            time_ns=round(arrival_s * 1e9),
        )
        scan = to_scan(Arrival(message, arrival_s, None), SCAN_TIMEOUT_S)
        assert scan is not None
        state, decision = step(state, arrival_s, Inputs(scans=(scan,)))
        reasons = frozenset(decision.reasons)
    assert state.sight.lidars[0].counts.sequence == 0
    assert reasons
    assert StopReason.SCAN_STALE not in reasons


def test_a_driver_that_republishes_its_last_scan_with_its_old_header_goes_stale() -> None:
    """Nav2: a source is valid as long as something arrives."""
    law = Law(scanning=False)
    taken_s = law.now_s
    for n in range(120):
        law.now_s += TICK_S
        taken_s = law.now_s if n < 60 else taken_s
        scan = laser_scan(ring() + np.float32(1e-4 * (n % 2)), law.now_s)
        sent = Sent(HEADER_EPOCH, n + 1, taken_s)
        command = on_time("teleop", NEUTRAL if n < 50 else FORWARD, law.now_s)
        law.step(Inputs((command,), scans=(replace(scan, sent=sent, sent_tolerance_s=0.25),)))
        if n == 59:
            assert law.decision.output == FORWARD
    assert law.decision.output == STANDSTILL
    assert StopReason.SCAN_STALE in law.decision.reasons


@pytest.mark.parametrize("ahead_s", [0.3, 10.0, 1e6])
def test_a_command_from_the_future_goes_stale_by_its_arrival(ahead_s: float) -> None:
    """diff_drive, velocity_smoother: a command stamped in the future never goes stale."""
    law = Law()
    for n in range(30):
        law.now_s += TICK_S
        velocity = NEUTRAL if n < 20 else FORWARD
        law.step(Inputs((law.stamped(velocity, sent_s=law.now_s + ahead_s),)))
    assert law.decision.output == FORWARD
    law.hold(CONFIG.command_timeout_s - TICK_S / 2)
    assert law.tick().output == STANDSTILL
    assert StopReason.COMMAND_TIMEOUT in law.decision.reasons


@pytest.mark.parametrize("senseless", [Velocity(math.nan, 0.0), Velocity(0.0, math.nan), None])
def test_a_nan_command_neither_keeps_the_reference_nor_refreshes_its_age(senseless: Velocity | None) -> None:
    """diff_drive: a NaN command keeps the previous reference while it refreshes the age."""
    law = Law()
    law.drive()
    sent_s = law.decision.sources[0].sent_s
    law.tick(("teleop", senseless))
    assert law.decision.output == STANDSTILL
    assert law.decision.sources[0].sent_s == sent_s
    law.hold(1.0, ("teleop", senseless))
    assert law.decision.output == STANDSTILL
    assert {StopReason.COMMAND_INVALID, StopReason.COMMAND_TIMEOUT} <= set(law.decision.reasons)


@pytest.mark.parametrize(
    ("cause", "reason"),
    [
        ({"estop": True}, StopReason.ESTOP),
        ({"liveliness": lost()}, StopReason.SOURCE_LOST),
        ({"undecodable_lidars": (0,)}, StopReason.SCAN_INVALID),
    ],
)
def test_a_stop_is_zero_in_the_very_step_from_full_speed(
    cause: dict[str, object], reason: StopReason
) -> None:
    """navigation2 #4679: a smoother ramps a safety stop; stops bypass every ramp."""
    law = Law(room_m=8.0)
    assert law.drive(FULL_SPEED).output == FULL_SPEED
    law.scanning = False
    law.tick(("teleop", FULL_SPEED), **cause)
    assert law.decision.output == STANDSTILL
    assert law.decision.reasons[0] is reason


def test_an_obstacle_that_steps_in_stops_full_speed_in_the_very_step() -> None:
    """navigation2 #4679: a smoother ramps a safety stop; stops bypass every ramp."""
    law = Law(room_m=8.0)
    law.drive(Velocity(1.0, 0.0))
    law.ranges = ring(8.0, ahead_m=0.5)
    assert law.tick(("teleop", Velocity(1.0, 0.0))).output == STANDSTILL


def test_a_turn_on_the_spot_does_not_sweep_a_corner_into_something() -> None:
    """navigation2 #3171: a pure rotation sweeps a corner into something."""
    box = ConvexPolygon(((0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2)))
    law = Law(config=replace(CONFIG, hull=box))
    ranges = ring()
    degrees = np.arange(BEAMS) - 180
    ranges[np.abs(degrees - 50) <= 3] = 0.62  # to the left of the front left corner
    law.ranges = ranges
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", SPIN)).output == STANDSTILL
    assert law.decision.reasons == (StopReason.OBSTACLE,)
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", Velocity(0.0, -1.0))).output.angular_rad_s < 0.0, "away from it is free"


def test_a_token_that_lives_on_while_setpoints_are_dead_does_not_drive() -> None:
    """PX4 #20519: a heartbeat that stays alive while setpoints are dead."""
    law = Law()
    law.tick(("teleop", NEUTRAL), liveliness=back())
    law.tick(("teleop", FORWARD))
    for _ in range(round(1.0 / TICK_S)):
        law.tick(liveliness=back())
    assert law.decision.output == STANDSTILL
    assert law.decision.reasons == (StopReason.COMMAND_TIMEOUT,)
    assert law.decision.sources[0].alive


def test_the_last_setpoint_is_not_driven_beyond_its_timeout() -> None:
    """PX4 #18346: a rover continues its last setpoint; diff_drive and joystick_drivers #92 likewise."""
    law = Law()
    law.drive()
    law.hold(CONFIG.command_timeout_s - TICK_S / 2)
    assert law.tick().output == STANDSTILL
    assert law.hold(5.0).output == STANDSTILL


def test_a_receiver_that_repeats_the_last_message_for_ever_does_not_drive() -> None:
    """joystick_drivers #92: a lost joystick repeats its last command for ever; a repetition is no news."""
    law = Law()
    for n in range(30):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(NEUTRAL if n < 20 else FORWARD, sent_s=law.now_s),)))
    assert law.decision.output == FORWARD
    last_s = law.now_s
    for _ in range(30):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(FORWARD, sent_s=last_s, sequence=law.sequence),)))
    assert law.decision.output == STANDSTILL
    assert StopReason.COMMAND_STALE in law.decision.reasons


@pytest.mark.parametrize("epoch", [b"A", b"B"])
def test_a_latched_command_replayed_on_reconnect_moves_nothing(epoch: bytes) -> None:
    """ArduPilot #6623: a latched override is replayed on reconnect; of the same run, or of a new one."""
    law = Law()
    for n in range(30):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(NEUTRAL if n < 20 else FORWARD, sent_s=law.now_s),)))
    assert law.decision.output == FORWARD
    law.tick(liveliness=lost())
    law.hold(1.0)
    law.tick(liveliness=back())
    for n in range(100):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(FORWARD, sent_s=law.now_s, epoch=epoch, sequence=1000 + n),)))
        assert law.decision.output == STANDSTILL


def test_a_supervisor_that_hung_moves_nothing_when_it_goes_on() -> None:
    """Supervisord shows RUNNING while a process hangs: it notices by itself that its tick came late."""
    law = Law()
    law.drive()
    law.now_s += 2.0
    command = on_time("teleop", FORWARD, law.now_s)
    assert law.step(Inputs((command,))).output == STANDSTILL
    assert StopReason.OVERRUN in law.decision.reasons
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL
    assert law.drive().output == FORWARD


def test_a_stop_needs_no_command_to_happen() -> None:
    """navigation2 #4555: the collision monitor runs only when a command arrives."""
    law = Law()
    law.drive()
    law.ranges = ring(ahead_m=0.5)
    assert law.tick().output == STANDSTILL
    law.tick()
    assert law.decision.reasons == (StopReason.OBSTACLE,)


def test_an_invalid_scan_has_a_way_out() -> None:
    """Nav2: "invalid source" has no way out but the timeout."""
    law = Law()
    law.drive()
    good, law.ranges = law.ranges, full(math.nan)
    law.tick(("teleop", FORWARD))
    law.ranges = good
    assert law.drive().output == FORWARD


# --- requests of their users


@pytest.mark.parametrize("away", [BACK, SPIN])
def test_it_may_back_out_of_a_stop_zone(away: Velocity) -> None:
    """navigation2 #3313, #3748, mowglinext #159: a robot is wedged in its own stop zone for 414 s."""
    law = Law()
    law.ranges = ring(ahead_m=0.4)
    law.drive()
    assert law.decision.reasons == (StopReason.OBSTACLE,)
    assert law.hold(0.1, ("teleop", away)).output == away


def test_a_lost_source_is_answered_by_zeros_and_not_by_silence() -> None:
    """twist_mux PR #42, yujin_ocs #16, teleop_tools #45: a zero when a source is lost or locked."""
    law = Law()
    law.drive()
    for n in range(20):
        decision = law.tick(liveliness=lost() if n == 0 else ())
        assert decision.output == STANDSTILL
        assert decision.mode is Mode.STOPPED
        assert StopReason.SOURCE_LOST in decision.reasons


def test_when_the_driver_dies_nobody_else_drives_on() -> None:
    """twist_mux #62: a fallback to another source."""
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    law.tick(("teleop", FORWARD), ("path", BACK))
    law.tick(("path", BACK), liveliness=lost())
    assert law.hold(1.0, ("path", BACK)).output == STANDSTILL


def test_an_idle_stream_of_zeros_fights_nobody() -> None:
    """twist_mux #62: an idle zero stream of a higher priority takes the robot, or makes it stutter."""
    law = Law()
    law.tick(("teleop", NEUTRAL), ("path", NEUTRAL))
    for _ in range(50):
        assert law.tick(("path", FORWARD), ("teleop", NEUTRAL)).output == FORWARD


def test_releasing_an_estop_gives_no_lurch() -> None:
    """farm-ng/tractor #82, ubiquity_motor #42: the robot lurches when an e-stop is released."""
    law = Law()
    law.drive()
    law.tick(("teleop", FORWARD), estop=True)
    law.tick(("teleop", FORWARD), reset=True)
    assert law.decision.reset_reply is not None
    assert not law.decision.reset_reply.success
    law.tick(("teleop", NEUTRAL), reset=True)
    assert law.decision.reset_reply is not None
    assert law.decision.reset_reply.success
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL
    assert law.drive().output == FORWARD


def test_the_state_under_an_estop_is_the_true_one() -> None:
    """clearpath_robot #329: the state that is reported is not the e-stop's."""
    law = Law()
    law.drive()
    law.tick(estop=True)
    for _ in range(100):
        decision = law.tick(("teleop", NEUTRAL))
        assert decision.mode is Mode.STOPPED
        assert decision.reasons[0] is StopReason.ESTOP


def test_ghost_commands_after_a_stall_move_nothing() -> None:
    """teleop_twist_joy #27: "ghost commands", a burst of delayed ones after a network stall."""
    law = Law()
    for n in range(30):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(NEUTRAL if n < 20 else FORWARD, sent_s=law.now_s),)))
    assert law.decision.output == FORWARD
    stalled_s = law.now_s
    law.hold(3.0)
    backlog = tuple(law.stamped(FORWARD, sent_s=stalled_s + 0.05 * (n + 1)) for n in range(50))
    assert law.step(Inputs(backlog)).output == STANDSTILL
    assert law.decision.sources[0].counts.late == 50
    assert StopReason.COMMAND_STALE in law.decision.reasons
    assert law.hold(1.0, ("teleop", FORWARD)).output == STANDSTILL


def test_it_says_why_it_stands_also_while_idle() -> None:
    """navigation2 #3496, turtlebot4 #11, #600: why did it stop?"""
    law = Law()
    assert law.decision.reasons == (StopReason.NO_COMMAND,)
    law.drive()
    law.hold(0.5)
    for _ in range(100):
        decision = law.tick()
        assert decision.mode is Mode.STOPPED
        assert decision.reasons == (StopReason.COMMAND_TIMEOUT,)
        assert decision.owner == "teleop"


def test_a_command_expires_by_its_own_age_and_not_by_its_arrival() -> None:
    """pr2_controllers #320: a per-command expiry."""
    law = Law()
    for n in range(30):
        law.now_s += TICK_S
        law.step(Inputs((law.stamped(NEUTRAL if n < 20 else FORWARD, sent_s=law.now_s),)))
    law.hold(0.1)
    law.step(Inputs((law.stamped(FORWARD, sent_s=law.now_s - 0.1),)))
    assert law.decision.output == FORWARD
    assert law.now_s - law.decision.sources[0].sent_s == pytest.approx(0.1, abs=1e-3)
    law.hold(CONFIG.command_timeout_s - 0.1)
    assert law.tick().output == STANDSTILL


_NUMBERS = [
    "command_timeout_s",
    "scan_timeout_s",
    "overrun_s",
    "stop_distance_m",
    "deceleration_m_s2",
    "base_timeout_s",
    "creep_m_s",
    "max_linear_m_s",
    "runaway_linear_m_s",
]


@pytest.mark.parametrize("key", _NUMBERS)
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_no_protection_has_an_off_switch(key: str, value: float) -> None:
    """Autoware #2155, autoware_launch #119: defaults are switched off because they block people; Nav2: 0.0 disables."""
    with pytest.raises(ValueError, match=key):
        SupervisorSection.model_validate({key: value})


def test_a_base_that_drives_on_against_zero_raises_the_alarm_and_stays_stopped() -> None:
    """Husarion and others trust the base: a zero that is not obeyed goes unnoticed."""
    law = Law()
    law.drive()
    law.tick(estop=True)
    for _ in range(75):
        law.now_s += TICK_S
        law.step(Inputs(odometry=odometry(0.3, law.now_s)))
    assert law.decision.alarm
    assert StopReason.BASE_RUNAWAY in law.decision.reasons
