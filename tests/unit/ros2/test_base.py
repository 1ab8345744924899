"""What is published on the robot's command topic, and when."""

import math

import pytest

from ros2.commands import PATIENCE_S, REPEAT_S, Base, message
from ros2.config import Ros2Section
from wire import cdr
from wire.cdr import STANDSTILL, Planar
from wire.stamp import Stamp
from wire.watchdog import BaseReason

TIMEOUT_S = 0.15
TICK_S = 0.02
FORWARD = Planar(0.5, -0.2)
PAYLOAD = cdr.twist(FORWARD)


class Robot:
    """A base whose supervisor sends a stamped command every 20 ms."""

    def __init__(self) -> None:
        self.base = Base(TIMEOUT_S)
        self.now_s = 100.0
        self.sequence = 0
        self.epoch = b"A" * 16
        self.base.supervisor_alive(alive=True, arrival_s=self.now_s)

    def stamp(self, sent_s: float) -> bytes:
        self.sequence += 1
        return Stamp(self.sequence, round(sent_s * 1e9), self.epoch).pack()

    def tick(self, payload: bytes = PAYLOAD) -> Planar:
        self.now_s += TICK_S
        self.base.command(payload, self.stamp(self.now_s), self.now_s)
        return self.base.target(self.now_s, repeated=False)

    def drive(self) -> "Robot":
        for _ in range(20):
            self.tick()
        assert self.tick() == FORWARD
        return self


def test_before_any_supervisor_it_publishes_zero_at_once_and_50_times_a_second() -> None:
    base = Base(TIMEOUT_S)
    assert base.due_s <= 0.0
    assert base.target(7.0, repeated=True) == STANDSTILL
    assert base.reason is BaseReason.SUPERVISOR_LOST
    assert base.due_s == 7.0 + REPEAT_S == 7.02


def test_a_command_is_published_at_once_and_the_next_one_is_awaited_for_longer_than_its_period() -> None:
    robot = Robot().drive()
    robot.base.command(PAYLOAD, robot.stamp(robot.now_s), robot.now_s)
    assert robot.base.due_s <= robot.now_s
    assert robot.base.target(robot.now_s, repeated=False) == FORWARD
    assert robot.base.due_s == robot.now_s + PATIENCE_S
    assert robot.base.due_s > robot.now_s + TICK_S, (
        "or each command of the supervisor would be published twice"
    )


def test_the_last_command_ends_just_after_its_timeout() -> None:
    robot = Robot().drive()
    decided_s = robot.now_s  # the transport time is zero
    almost_s = decided_s + TIMEOUT_S - 1e-6
    assert robot.base.target(almost_s, repeated=True) == FORWARD
    assert robot.base.reason is BaseReason.OK
    assert robot.base.target(decided_s + TIMEOUT_S + 1e-6, repeated=True) == STANDSTILL
    assert robot.base.reason is BaseReason.COMMAND_TIMEOUT


def test_an_unstamped_command_ends_exactly_after_its_timeout() -> None:
    base = Base(0.125)
    base.supervisor_alive(alive=True, arrival_s=1.0)
    for arrival_s in (1.0, 1.125):  # the second one is proven
        base.command(PAYLOAD, None, arrival_s)
    assert base.target(1.25, repeated=True) == FORWARD
    assert base.target(math.nextafter(1.25, 2.0), repeated=True) == STANDSTILL


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        PAYLOAD[:-1],
        b"\x00\x00" + PAYLOAD[2:],
        cdr.twist(Planar(math.nan, 0.0)),
        cdr.twist(Planar(0.0, math.inf)),
        PAYLOAD[:12] + PAYLOAD[4:12] + PAYLOAD[20:],
    ],
    ids=["nothing", "short", "big-endian", "NaN", "infinite", "sideways"],
)
def test_a_command_that_is_no_planar_velocity_stops(payload: bytes) -> None:
    robot = Robot().drive()
    assert robot.tick(payload) == STANDSTILL
    assert robot.base.reason is BaseReason.COMMAND_INVALID
    assert robot.tick() == FORWARD


def test_a_command_of_zero_is_a_command() -> None:
    robot = Robot().drive()
    assert robot.tick(cdr.twist(STANDSTILL)) == STANDSTILL
    assert robot.base.reason is BaseReason.OK


def test_a_lost_token_stops_at_once_and_its_return_alone_moves_nothing() -> None:
    robot = Robot().drive()
    for alive, reason in ((False, BaseReason.SUPERVISOR_LOST), (True, BaseReason.NO_COMMAND)):
        robot.base.target(robot.now_s, repeated=False)
        robot.base.supervisor_alive(alive, robot.now_s)
        assert robot.base.due_s <= robot.now_s, "it is published at once"
        assert robot.base.target(robot.now_s, repeated=True) == STANDSTILL
        assert robot.base.reason is reason


def test_a_flapping_token_moves_nothing_with_a_command_of_before() -> None:
    robot = Robot().drive()
    before_s, flapped_s = robot.now_s, robot.now_s + 0.002
    robot.base.supervisor_alive(alive=False, arrival_s=robot.now_s + 0.001)
    robot.base.supervisor_alive(alive=True, arrival_s=flapped_s)
    robot.base.target(flapped_s, repeated=True)
    due_s = robot.base.due_s
    for arrival_s in (before_s, math.nextafter(flapped_s, 0.0)):
        robot.base.command(PAYLOAD, robot.stamp(arrival_s), arrival_s)
        assert robot.base.target(flapped_s, repeated=True) == STANDSTILL
        assert robot.base.due_s == due_s
    robot.base.command(PAYLOAD, robot.stamp(flapped_s), flapped_s)
    assert robot.base.target(flapped_s, repeated=False) == FORWARD


def test_a_restarted_supervisor_moves_the_robot_once_its_run_is_proven() -> None:
    robot = Robot().drive()
    robot.base.supervisor_alive(alive=False, arrival_s=robot.now_s)
    robot.now_s += 1.0
    robot.base.supervisor_alive(alive=True, arrival_s=robot.now_s)
    robot.epoch, robot.sequence = b"B" * 16, 0
    targets = [robot.tick() for _ in range(20)]
    first = targets.index(FORWARD)
    assert (first - 1) * TICK_S < TIMEOUT_S <= first * TICK_S + 1e-9
    assert targets[first:] == [FORWARD] * (20 - first)


def test_nothing_of_before_a_suspend_moves_the_robot_after_it() -> None:
    robot = Robot().drive()
    robot.base.resumed(robot.now_s)
    assert robot.base.due_s <= robot.now_s
    assert robot.base.target(robot.now_s, repeated=True) == STANDSTILL
    resumed_s = robot.now_s
    while robot.tick() != FORWARD:
        assert robot.now_s < resumed_s + 1.0
    assert TIMEOUT_S < robot.now_s - resumed_s <= TIMEOUT_S + TICK_S


def test_a_command_without_a_stamp_stops_while_stamped_ones_arrive() -> None:
    robot = Robot().drive()
    for attachment in (None, b"", b"x" * 33):
        robot.base.command(cdr.twist(Planar(0.9, 0.0)), attachment, robot.now_s)
        assert robot.base.target(robot.now_s, repeated=False) == STANDSTILL
        assert robot.base.reason is BaseReason.COMMAND_STALE
    assert robot.tick() == FORWARD


def test_a_command_that_was_delayed_moves_nothing() -> None:
    robot = Robot().drive()
    robot.now_s += 0.5
    robot.base.command(PAYLOAD, robot.stamp(robot.now_s - 0.5), robot.now_s)
    assert robot.base.target(robot.now_s, repeated=False) == STANDSTILL


def test_a_command_has_the_type_that_the_base_listens_to() -> None:
    velocity = Planar(0.3, -0.2)
    assert message(velocity, Ros2Section(), 7) == cdr.twist(velocity)
    stamped = Ros2Section(stamped=True, frame_id="base")
    assert message(velocity, stamped, 7) == cdr.twist_stamped(velocity, 7, "base")


def test_while_the_clock_of_the_base_is_unproven_zero_is_published() -> None:
    robot = Robot().drive()
    assert robot.base.target(robot.now_s, repeated=False, may_move=False) == STANDSTILL
    assert robot.base.reason is BaseReason.COMMAND_STALE


def test_after_an_unproven_clock_nothing_moves_before_the_supervisor_has_commanded_zero() -> None:
    robot = Robot().drive()
    robot.base.target(robot.now_s, repeated=False, may_move=False)
    for _ in range(100):
        assert robot.tick() == STANDSTILL
        assert robot.base.reason is BaseReason.COMMAND_STALE
    assert robot.tick(cdr.twist(STANDSTILL)) == STANDSTILL
    assert robot.base.reason is BaseReason.OK
    assert robot.tick() == FORWARD


def test_zero_with_an_unproven_clock_does_not_release_the_base() -> None:
    robot = Robot().drive()
    robot.tick(cdr.twist(STANDSTILL))
    robot.base.target(robot.now_s, repeated=True, may_move=False)
    assert robot.tick() == STANDSTILL


def test_with_an_unproven_clock_the_watchdogs_own_reason_is_kept() -> None:
    robot = Robot().drive()
    robot.base.supervisor_alive(alive=False, arrival_s=robot.now_s)
    robot.base.target(robot.now_s, repeated=False, may_move=False)
    assert robot.base.reason is BaseReason.SUPERVISOR_LOST
