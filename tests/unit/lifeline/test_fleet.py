"""What `lifeline fleet` concludes from the statuses that it hears."""

from lifeline.watch.fleet import Remote
from wire.bus import Overheard
from wire.messages import SafetyStatus, encode, header
from wire.reasons import StopReason
from wire.stamp import Stamper

ASKED_S = 100.0


def status(supervisor: Stamper, arrival_s: float, *reasons: StopReason) -> Overheard:
    payload = encode(SafetyStatus(header("base_link"), reasons=[*reasons]))
    return Overheard("robot1/supervisor/status", payload, supervisor.next().pack(), arrival_s)


def test_a_stop_is_confirmed_only_when_each_supervisor_of_one_name_has_latched() -> None:
    first, second, robot = Stamper(), Stamper(), Remote("robot1", "tcp/127.0.0.1:7448")
    for supervisor in (first, second):
        robot.heard(status(supervisor, ASKED_S - 0.1))
    robot.heard(status(first, ASKED_S + 0.1, StopReason.ESTOP))
    assert not robot.is_latched_since(ASKED_S)
    robot.heard(status(second, ASKED_S + 0.2))
    assert not robot.is_latched_since(ASKED_S)
    robot.heard(status(second, ASKED_S + 0.3, StopReason.ESTOP))
    assert robot.is_latched_since(ASKED_S)


def test_a_latch_from_before_the_stop_and_a_robot_that_was_never_heard_confirm_nothing() -> None:
    supervisor, robot = Stamper(), Remote("robot1", "tcp/127.0.0.1:7448")
    assert not robot.is_latched_since(ASKED_S)
    robot.heard(status(supervisor, ASKED_S - 0.1, StopReason.ESTOP))
    assert not robot.is_latched_since(ASKED_S)


def test_the_row_says_that_two_supervisors_have_one_name() -> None:
    first, second, robot = Stamper(), Stamper(), Remote("robot1", "tcp/127.0.0.1:7448")
    for supervisor, at_s in ((first, 0.0), (second, 0.05), (first, 0.1), (second, 0.15)):
        robot.heard(status(supervisor, ASKED_S + at_s))
    assert robot.row_at(ASKED_S + 0.2).link == "2 supervisors"
    robot.heard(status(second, ASKED_S + 2.0))
    assert robot.row_at(ASKED_S + 2.0).link == "0.0 s"


def test_a_supervisor_that_was_restarted_is_not_two() -> None:
    before, after, robot = Stamper(), Stamper(), Remote("robot1", "tcp/127.0.0.1:7448")
    for supervisor, at_s in ((before, 0.0), (before, 0.1), (after, 0.6), (after, 0.7)):
        robot.heard(status(supervisor, ASKED_S + at_s))
    assert robot.row_at(ASKED_S + 0.8).link == "0.1 s"
