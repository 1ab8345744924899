"""Requests and presses that reach their process at another time than a person made them."""

import signal
from pathlib import Path

from tests.ros2.host import Host, Peer
from tests.ros2.stack import (
    ESTOP_SUBSCRIPTIONS,
    LATCHED_ESTOP_SUBSCRIPTIONS,
    SPEED_M_S,
    Stack,
    reset,
    send,
)
from wire import cdr

REQUESTS = 5
ROUNDS = 10


def calling(stack: Stack, *services: str) -> Peer:
    """Start a caller that has discovered these services."""
    caller = stack.host.start("call").ready()
    for service in services:
        seen = len(caller.lines)
        caller.tell(service=service)
        caller.until(lambda line: "success" in line, f"a reply of {service}", after=seen)
    return caller


def test_a_request_to_arm_whose_caller_has_gone_does_not_move_the_robot(stack: Stack) -> None:
    """A person asks several times while the process `ros2` is stopped by a signal, and gives up."""
    caller = calling(stack, "/lifeline/reset", "/lifeline/arm")
    planner = stack.source("--silent", name="planner", topic="/plan_vel")
    planner.tell(v=SPEED_M_S)
    stack.watch.report("source plan", "/planner on")
    stack.stays_at_rest()
    send(stack.bridge, signal.SIGSTOP)
    seen = len(planner.lines)
    for _ in range(REQUESTS):
        caller.tell(service="/lifeline/reset")
        caller.tell(service="/lifeline/arm")
    planner.until(
        lambda line: "sent" in line and line["at_ns"] > planner.lines[seen]["at_ns"] + 1e9,
        "1 s of commands, for less than the time after which the kernel ends the process",
        after=seen,
    )
    caller.kill()
    send(stack.bridge, signal.SIGCONT)
    stack.stays_at_rest(100)


def test_a_reset_that_was_answered_as_failed_does_not_unlatch_the_estop_later(stack: Stack) -> None:
    """The supervisor is stopped by a signal meanwhile; whether it then takes up the old request is a race."""
    caller, source = calling(stack, "/lifeline/reset"), stack.source()
    button = stack.host.start("estop").ready()
    button.until(lambda line: line.get("listeners") == ESTOP_SUBSCRIPTIONS, "discovery")
    for _ in range(ROUNDS):
        stack.armed()
        button.tell(estop=True)
        stack.watch.until(lambda w: w.status is not None and "ESTOP" in w.status.reasons, "the press")
        send(stack.supervisor, signal.SIGSTOP)
        failed = reset(caller)
        send(stack.supervisor, signal.SIGCONT)
        assert not failed["success"]
        stack.neutral()
        status = stack.watch.status
        assert status is not None
        assert "ESTOP" in status.reasons
        while not reset(caller)["success"]:  # its link comes back, and requests may still be old
            pass
    source.end()


def test_an_estop_that_its_topic_has_latched_before_the_start_stops_the_robot(
    host: Host, tmp_path: Path
) -> None:
    """The button publishes once, transient local, as for a state that changes rarely."""
    button = host.start("raw", "--topic", "/estop", "--type", "std_msgs/msg/Bool", "--transient").ready()
    button.tell(hex=cdr.TRUE.hex())
    host.start("diff_drive").ready()
    stack = Stack(host, tmp_path)
    try:
        button.until(lambda line: line.get("listeners") == LATCHED_ESTOP_SUBSCRIPTIONS, "discovery")
        stack.source()
        stack.watch.report("supervisor", "ESTOP")
    finally:
        stack.tidy()
        stack.close()
