"""The commands of one topic: what the supervisor's own law makes of them."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros2.commands import NEUTRAL, PERIOD_S, Command
from ros2.header_age import HeaderAge
from tests.unit.ros2.programs import PROGRAM, TIMEOUT_S, WALL_S, Program, Robot, new_source
from tests.unit.supervisor.law.law_harness import FORWARD, TICK_S, ring
from wire import cdr

HOLD_S = 0.6
SPEED_M_S = FORWARD.linear_m_s
TWIST = cdr.twist(cdr.Planar(SPEED_M_S, 0.0))
NOT_FINITE = cdr.twist(cdr.Planar(math.nan, 0.0))
SIDEWAYS = cdr.LITTLE_ENDIAN + struct.pack("<6d", SPEED_M_S, 0.1, 0, 0, 0, 0)


def keyboard() -> Robot:
    """A program under `hold_s` that has been silent for so long that its source is armed."""
    robot = Robot(new_source(hold_s=HOLD_S))
    robot.wait(HOLD_S + 0.4)
    assert robot.decision.sources[0].armed
    robot.say(SPEED_M_S)  # the first event of a run proves nothing yet
    robot.wait(0.5)
    assert not robot.moves
    return robot


def hold_key(robot: Robot, seconds: float = 1.0) -> Robot:
    """Hold a key: an event, and after 0.5 s one every 40 ms."""
    robot.say(SPEED_M_S)
    robot.wait(0.5)
    robot.stream(SPEED_M_S, seconds - 0.5)
    return robot


# --- programs that publish at a steady rate pass unchanged


def plain() -> Robot:
    return Robot(new_source())


def test_a_steady_program_passes_with_the_stamps_of_its_own_run() -> None:
    robot = plain()
    (first,) = robot.say(SPEED_M_S, late_s=0.01)
    (second,) = robot.say(0.0)
    assert first.twist == TWIST
    assert first.true_at_s == robot.now_s
    assert first.sent is not None
    assert second.sent is not None
    assert (first.sent.epoch, first.sent.sequence, second.sent.sequence) == (second.sent.epoch, 1, 2)
    assert first.sent.source_time_s == pytest.approx(robot.now_s - 0.01 + WALL_S, abs=1e-5)
    assert (robot.source.accepted, robot.source.refused) == (2, 0)
    assert robot.source.due_s() == math.inf
    assert robot.source.repeat(robot.now_s + 1e6) == []


def test_the_law_accepts_the_stamps_of_a_steady_program_once_they_are_proven() -> None:
    robot = plain()
    robot.stream(0.0, 0.4)
    robot.stream(SPEED_M_S, 1.0)
    assert robot.moves
    counts = robot.decision.sources[0].counts
    assert (counts.late, counts.sequence, counts.epoch, counts.invalid) == (0, 0, 0, 0)


def test_a_steady_program_that_never_sends_zero_never_moves_the_robot() -> None:
    robot = plain()
    assert robot.stream(SPEED_M_S, 3.0).reasons
    assert not robot.moves


def test_a_restarted_program_is_another_epoch_that_must_send_zero_first() -> None:
    robot = plain()
    robot.stream(0.0, 0.4)
    robot.stream(SPEED_M_S, 1.0)
    robot.end()
    robot.tick()
    assert robot.reasons == ["SOURCE_LOST"]
    robot.begin()
    robot.stream(SPEED_M_S, 2.0)
    assert not robot.moves
    robot.stream(0.0, 0.1)
    robot.stream(SPEED_M_S, 0.1)
    assert robot.moves


def test_a_burst_of_old_messages_of_a_steady_program_moves_nothing() -> None:
    robot = plain()
    robot.stream(0.0, 1.0)
    robot.wait(1.0)
    for late_s in (0.8, 0.6, 0.4, 0.25):
        robot.say(SPEED_M_S, late_s)
    assert robot.moved_within(1.0) == -math.inf
    assert robot.decision.sources[0].counts.late == 4


@pytest.mark.parametrize("payload", [b"", b"text", TWIST[:-1], NOT_FINITE, SIDEWAYS])
def test_bytes_that_are_no_planar_twist_stop_a_steady_program_until_it_sends_zero(payload: bytes) -> None:
    robot = plain()
    robot.stream(0.0, 0.4)
    robot.stream(SPEED_M_S, 0.4)
    assert robot.moves
    robot.say_bytes(payload)
    robot.tick()
    assert robot.reasons == ["COMMAND_INVALID"]
    robot.stream(SPEED_M_S, 1.0)
    assert not robot.moves
    robot.stream(0.0, 0.1)
    robot.stream(SPEED_M_S, 0.1)
    assert robot.moves


def test_a_twist_stamped_passes_as_a_twist_and_a_twist_as_nothing() -> None:
    source = new_source(headers=HeaderAge("joy", TIMEOUT_S, 1.0))
    source.attend(PROGRAM, 0.0, is_here=True)
    program = Program()
    payload = cdr.twist_stamped(cdr.Planar(SPEED_M_S, 0.0), round(1e9), "odd frame/ø")
    (command,) = source.heard(program.sample(payload, 1.0))
    assert command.twist == TWIST
    (command,) = source.heard(program.sample(TWIST, 1.0))
    assert command.twist == b""


@pytest.mark.parametrize("hold_s", [None, HOLD_S])
@pytest.mark.parametrize("on_request", [False, True])
def test_nothing_passes_while_no_program_is_alone(hold_s: float | None, on_request: bool) -> None:  # noqa: FBT001
    source, program = new_source(hold_s=hold_s, on_request=on_request), Program()
    assert source.heard(program.sample(TWIST, 1.0)) == []
    assert source.arm(1.0) == []
    source.attend(PROGRAM, 1.0, is_here=True)
    source.leave()
    assert source.heard(program.sample(TWIST, 2.0)) == []
    assert source.arm(2.0) == []
    assert source.due_s() == math.inf
    assert (source.accepted, source.refused) == (0, 2)


# --- hold_s: programs that publish on key events only


def test_neutral_is_sent_once_a_program_has_been_silent_for_hold_s() -> None:
    source = new_source(hold_s=0.5)
    source.attend(PROGRAM, 10.0, is_here=True)
    assert source.due_s() == 10.5
    assert source.repeat(math.nextafter(10.5, 0.0)) == []
    assert source.repeat(10.5) == [Command(NEUTRAL, 10.5)]
    assert source.due_s() == 10.5 + PERIOD_S
    assert source.repeat(10.5) == []


def test_the_robot_moves_while_a_key_repeats() -> None:
    robot = hold_key(keyboard())
    for _ in range(100):
        robot.stream(SPEED_M_S, 0.04)
        assert robot.moves


@pytest.mark.parametrize("released_after_s", [0.02 * n for n in range(4)])
def test_the_robot_stops_within_hold_s_and_a_timeout_after_the_last_repeat(released_after_s: float) -> None:
    robot = hold_key(keyboard(), 1.0 + released_after_s)
    robot.say(SPEED_M_S)
    last_s = robot.moved_within(3.0)
    assert HOLD_S - 2 * TICK_S <= last_s <= HOLD_S + 0.2
    assert robot.reasons == [], "neutral was sent, so it is ready"


def test_a_new_key_press_after_silence_drives_again() -> None:
    robot = hold_key(keyboard())
    for pause_s in (1.0, 30.0):
        robot.wait(pause_s)
        assert not robot.moves
        robot.say(SPEED_M_S)
        robot.wait(0.1)
        assert robot.moves


def test_a_key_event_is_held_from_when_it_was_published() -> None:
    robot = hold_key(keyboard())
    robot.wait(1.0)
    robot.say(SPEED_M_S, late_s=0.14)
    repeated = [robot.source.repeat(robot.now_s + PERIOD_S * n)[0] for n in range(1, 14)]
    moving = [command.true_at_s - robot.now_s for command in repeated if command.twist == TWIST]
    assert HOLD_S - 0.14 - PERIOD_S <= moving[-1] <= HOLD_S - 0.14


def test_a_key_for_zero_stops_at_once() -> None:
    robot = hold_key(keyboard())
    robot.say(0.0)
    robot.tick()
    assert not robot.moves
    robot.say(SPEED_M_S)
    robot.tick()
    assert robot.moves


def test_the_end_of_the_program_stops_at_once_and_a_held_key_of_its_next_run_moves_nothing() -> None:
    robot = hold_key(keyboard())
    robot.end()
    robot.tick()
    assert robot.reasons == ["SOURCE_LOST"]
    assert not robot.moves
    robot.wait(0.3)
    robot.begin()
    robot.stream(SPEED_M_S, 5.0)
    assert robot.moved_within(HOLD_S + 1.0) == -math.inf
    hold_key(robot)
    assert robot.moves


@pytest.mark.parametrize("every_ticks", [1, 2, 5, 25])
def test_a_streaming_program_under_hold_s_is_never_armed_after_a_start(every_ticks: int) -> None:
    """Its period is shorter than `hold_s`; a slower one cannot be distinguished from a key that is pressed again."""
    robot = Robot(new_source(hold_s=HOLD_S))
    for _ in range(100):
        robot.stream(SPEED_M_S, every_ticks * TICK_S, every_ticks)
        assert not robot.moves
    assert robot.neutrals == 0
    robot.wait(HOLD_S + 0.1)
    assert robot.neutrals > 0


def test_a_streaming_program_is_not_armed_by_the_adapter_after_an_obstacle() -> None:
    robot = hold_key(keyboard())
    robot.law.ranges = ring(3.0, ahead_m=0.35)
    robot.stream(SPEED_M_S, 0.5)
    assert robot.reasons == ["OBSTACLE"]
    robot.law.ranges = ring(3.0)
    neutrals = robot.neutrals
    robot.stream(SPEED_M_S, 5.0)
    assert not robot.moves
    assert robot.neutrals == neutrals
    robot.wait(HOLD_S + 0.2)
    hold_key(robot)
    assert robot.moves


def test_a_program_that_continues_after_a_stop_must_release_its_key() -> None:
    """As after SIGSTOP and SIGCONT, which the guard reports as leave and attend."""
    robot = hold_key(keyboard())
    robot.end()
    robot.wait(0.2)
    robot.begin(robot.program)  # the same run
    robot.stream(SPEED_M_S, 3.0)
    assert not robot.moves


@pytest.mark.parametrize("stalled_s", [0.3, HOLD_S, 2.0])
def test_a_stalled_ros_2_process_does_not_take_its_own_silence_for_the_programs(stalled_s: float) -> None:
    robot = hold_key(keyboard())
    neutrals = robot.neutrals
    robot.law.hold(stalled_s)  # the law goes on
    robot.program.sequence += 7
    robot.pass_on(robot.source.repeat(robot.now_s))
    robot.stream(SPEED_M_S, 3.0)
    assert robot.neutrals == neutrals
    assert not robot.moves
    robot.wait(HOLD_S + 0.2)
    hold_key(robot)
    assert robot.moves


def test_the_wait_for_release_begins_just_after_a_stall_of_the_timeout() -> None:
    for now_s, neutral in ((0.75, True), (math.nextafter(0.75, 1.0), False)):
        source = new_source(hold_s=0.5, timeout_s=0.25)
        source.attend(PROGRAM, 0.0, is_here=True)
        assert bool(source.repeat(now_s)) is neutral
        assert neutral or source.due_s() == now_s + 0.5


def test_a_stall_of_dds_does_not_count_as_a_release() -> None:
    robot = hold_key(keyboard())
    robot.wait(HOLD_S + 0.5)  # nothing arrives, although the key is held
    assert robot.reasons == []
    for late_s in (0.9, 0.7, 0.5, 0.3):
        assert robot.say(SPEED_M_S, late_s) == []
    robot.stream(SPEED_M_S, 3.0)
    assert not robot.moves
    robot.wait(HOLD_S + 0.2)
    hold_key(robot)
    assert robot.moves


def test_a_burst_of_old_key_events_moves_nothing() -> None:
    robot = keyboard()
    for late_s in (1.2, 0.9, 0.6, 0.3, 0.21):
        robot.say(SPEED_M_S, late_s)
    assert robot.moved_within(2.0) == -math.inf


def test_a_backlog_as_the_first_messages_of_a_program_moves_nothing() -> None:
    robot = Robot(new_source(hold_s=HOLD_S))
    robot.wait(HOLD_S + 0.4)
    for late_s in (2.0, 1.5, 1.0, 0.5, 0.1):
        robot.say(SPEED_M_S, late_s)
    assert robot.moved_within(2.0) == -math.inf


@pytest.mark.parametrize("payload", [b"", NOT_FINITE, SIDEWAYS])
@pytest.mark.parametrize("every_ticks", [2, 5, 10])
def test_a_streaming_program_is_not_armed_by_the_adapter_after_an_invalid_command(
    payload: bytes, every_ticks: int
) -> None:
    robot = hold_key(keyboard())
    robot.say_bytes(payload)
    robot.tick()
    assert robot.reasons == ["COMMAND_INVALID"]
    neutrals = robot.neutrals
    robot.wait(0.1)
    robot.stream(SPEED_M_S, 3.0, every_ticks)
    assert not robot.moves
    assert robot.neutrals == neutrals
    robot.wait(HOLD_S + 0.2)
    hold_key(robot)
    assert robot.moves


def test_the_programs_own_zero_releases_it_at_once() -> None:
    robot = Robot(new_source(hold_s=HOLD_S))
    robot.stream(SPEED_M_S, 0.5)
    robot.stream(0.0, 0.4)  # as long as the proof of the adapter's own stamps takes
    robot.stream(SPEED_M_S, 0.1)
    assert robot.moves


def test_a_clock_of_the_program_that_steps_moves_nothing_without_proof() -> None:
    robot = hold_key(keyboard())
    robot.wait(HOLD_S + 0.2)
    robot.program.clock_s -= 3600.0
    assert robot.say(SPEED_M_S) == []
    assert robot.moved_within(1.0) == -math.inf
    robot.say(SPEED_M_S)
    robot.wait(0.1)
    assert robot.moves


# --- on request: programs that never send zero


def test_a_request_arms_a_program_that_never_sends_zero() -> None:
    robot = Robot(new_source(on_request=True))
    robot.stream(SPEED_M_S, 1.0)
    assert not robot.moves
    (command,) = robot.arm()
    assert command == Command(NEUTRAL, robot.now_s)
    robot.stream(SPEED_M_S, 1.0)
    assert robot.moves


def test_each_stop_needs_another_request() -> None:
    robot = Robot(new_source(on_request=True))
    robot.stream(SPEED_M_S, 0.5)
    robot.arm()
    robot.stream(SPEED_M_S, 0.5)
    robot.wait(0.5)
    assert robot.reasons == ["COMMAND_TIMEOUT"]
    robot.stream(SPEED_M_S, 1.0)
    assert not robot.moves
    robot.arm()
    robot.stream(SPEED_M_S, 0.5)
    assert robot.moves


def test_old_messages_of_a_program_that_is_armed_on_request_are_refused() -> None:
    robot = Robot(new_source(on_request=True))
    robot.stream(SPEED_M_S, 0.5)
    robot.wait(0.5)
    robot.arm()
    assert robot.say(SPEED_M_S, late_s=TIMEOUT_S + 0.01) == []
    assert robot.moved_within(0.5) == -math.inf


def test_a_request_replaces_the_release_of_a_held_key() -> None:
    robot = Robot(new_source(hold_s=HOLD_S, on_request=True))
    robot.stream(SPEED_M_S, 0.5)
    assert not robot.moves
    robot.arm()
    robot.wait(0.3)  # by now the adapter's own stamps are proven
    assert not robot.moves
    robot.arm()
    robot.stream(SPEED_M_S, 0.5)
    assert robot.moves


# --- the stamps that the ROS 2 process gives to adapted commands


def test_a_key_event_that_was_on_its_way_during_a_repeat_does_not_look_like_a_step_of_the_clock() -> None:
    robot = hold_key(keyboard())
    source, program = robot.source, robot.program
    now_s = robot.now_s + PERIOD_S
    (repeated,) = source.repeat(now_s)
    (late,) = source.heard(program.sample(TWIST, now_s + 0.001, 0.03))
    assert repeated.true_at_s <= late.true_at_s <= now_s + 0.001
    (earlier,) = source.heard(program.sample(TWIST, now_s, 0.02))
    assert earlier.true_at_s >= late.true_at_s


@given(
    st.lists(
        st.tuples(st.sampled_from(["say", "zero", "invalid", "wait", "arm", "pause"]), st.floats(0.0, 0.15)),
        max_size=60,
    ),
    st.sampled_from([None, 0.05, HOLD_S]),
)
def test_the_time_of_adapted_commands_never_decreases_nor_leads(
    events: list[tuple[str, float]], hold_s: float | None
) -> None:
    source, program, now_s = new_source(hold_s=hold_s, on_request=True), Program(), 1000.0
    source.attend(PROGRAM, now_s, is_here=True)
    newest_s = -math.inf
    for kind, seconds in events:
        payload = {"say": TWIST, "zero": NEUTRAL, "invalid": NOT_FINITE}.get(kind)
        if payload is not None:
            commands = source.heard(program.sample(payload, now_s, seconds))
        else:
            now_s += seconds * (20.0 if kind == "pause" else 1.0)
            commands = source.arm(now_s) if kind == "arm" else source.repeat(now_s)
        for command in commands:
            assert newest_s <= command.true_at_s <= now_s
            assert now_s - command.true_at_s <= TIMEOUT_S
            newest_s = command.true_at_s


@given(
    st.lists(
        st.tuples(
            st.sampled_from([0.0, SPEED_M_S]),
            st.sampled_from([0.0, 0.01, 0.5]),
            st.integers(0, 40),
            st.booleans(),
        ),
        max_size=12,
    )
)
def test_under_hold_s_no_motion_passes_before_zero_or_silence(
    events: list[tuple[float, float, int, bool]],
) -> None:
    source, program, now_s = new_source(hold_s=HOLD_S), Program(), 1000.0
    source.attend(PROGRAM, now_s, is_here=True)
    passed: list[Command] = []
    for linear_m_s, late_s, ticks, restarts in events:
        if restarts:
            source.leave()
            source.attend(PROGRAM, now_s, is_here=True)
            passed.clear()
        passed += source.heard(program.sample(cdr.twist(cdr.Planar(linear_m_s, 0.0)), now_s, late_s))
        for _ in range(ticks):
            now_s += TICK_S
            passed += source.repeat(now_s)
        assert [command.twist for command in passed[:1]] in ([], [NEUTRAL])


@pytest.mark.parametrize("lost", [1, 37, 1500])
def test_a_streaming_program_whose_messages_were_lost_does_not_move_the_robot_again_by_itself(
    lost: int,
) -> None:
    robot = hold_key(keyboard(), 1.5)
    assert robot.moves
    robot.wait(1.5)
    assert not robot.moves
    robot.program.sequence += lost
    robot.stream(SPEED_M_S, 1.0)
    assert not robot.moves


def test_a_lost_message_within_the_hold_does_not_interrupt_a_held_key() -> None:
    robot = hold_key(keyboard(), 1.5)
    robot.program.sequence += 3
    robot.stream(SPEED_M_S, 0.5)
    assert robot.moves
