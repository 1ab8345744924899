"""The supervisor's promises, through ROS: a ROS source, Lifeline, and a ROS robot, all as real processes.

The robot has its own timeout of 0.5 s. The wall of its room is 5.5 m ahead.
"""

import math
import signal
import statistics
import time
from collections.abc import Generator, Sequence
from pathlib import Path

import pytest

from tests.ros2.host import Host, ros_domain
from tests.ros2.stack import ESTOP_SUBSCRIPTIONS, SOURCE, SPEED_M_S, Stack, reset, send

KILLS = 20
TIMEOUT_MS = 200.0
"""The supervisor's command timeout."""
MARGIN_MS = 250.0
"""Tolerance for a loaded machine; the measured times are printed."""
BASE_TIMEOUT_MS, BRAKING_MS = 500.0, 300.0
"""Of the robot itself."""


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Generator[Stack]:
    """One stack for all tests of this file; each test leaves it running."""
    folder: Path = tmp_path_factory.mktemp("ros2")
    with ros_domain() as domain:
        host = Host(domain, folder)
        made: Stack | None = None
        try:
            host.start("diff_drive").ready()
            made = Stack(host, folder)
            yield made
        finally:
            if made is not None:
                made.close()
            host.close()


@pytest.fixture(autouse=True)
def tidy(stack: Stack) -> Generator[None]:
    """End the sources of each test, also of one that failed."""
    yield
    stack.tidy()


def directions() -> Generator[float]:
    """Alternate forward and backward, so that the robot stays where it is."""
    while True:
        yield SPEED_M_S
        yield -SPEED_M_S


def show(what: str, times_ms: Sequence[float]) -> None:
    ordered = sorted(times_ms)
    print(
        f"\n{what}: n {len(ordered)}, p50 {statistics.median(ordered):.1f} ms, "
        f"p99 {ordered[int(0.99 * (len(ordered) - 1))]:.1f} ms, max {ordered[-1]:.1f} ms"
    )


def test_sigkill_of_a_source_on_this_host_stops_the_robot_long_before_its_commands_time_out(
    stack: Stack,
) -> None:
    times_ms: list[float] = []
    for _, speed in zip(range(KILLS), directions(), strict=False):
        source = stack.source()
        stack.drive(source, speed)
        killed_ns = source.kill()
        times_ms.append(stack.zero_after(killed_ns))
        stack.rest_after(killed_ns)
    show("SIGKILL of a ROS source to zero on cmd_vel", times_ms)
    assert max(times_ms) < TIMEOUT_MS + MARGIN_MS
    assert statistics.median(times_ms) < 60.0


def test_a_stopped_source_stops_the_robot_and_moves_it_again_only_after_neutral(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source)
    times_ms = [stack.zero_after(send(source, signal.SIGSTOP))]
    show("SIGSTOP of a ROS source to zero", times_ms)
    assert times_ms[0] < TIMEOUT_MS + MARGIN_MS
    send(source, signal.SIGCONT)  # it goes on commanding the old velocity
    source.until(lambda line: line.get("sent") == [SPEED_M_S, 0.0], "commands", after=len(source.lines))
    stack.stays_at_rest()
    stack.drive(source, -SPEED_M_S)
    source.end()


def test_ctrl_c_of_a_source_stops_the_robot(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source)
    took_ms = stack.zero_after(send(source, signal.SIGINT))
    show("Ctrl-C of a ROS source to zero", [took_ms])
    assert took_ms < TIMEOUT_MS + MARGIN_MS


def test_a_restarted_source_that_commands_motion_at_once_does_not_move_the_robot(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source, -SPEED_M_S)
    stack.zero_after(source.kill())
    again = stack.source("--silent")
    again.tell(v=SPEED_M_S)
    stack.watch.report(f"source {SOURCE}", "guarded by")
    stack.stays_at_rest()
    stack.drive(again)
    again.end()


def test_sigkill_of_the_ros2_process_leaves_the_robots_own_timeout_and_a_restart_moves_nothing(
    stack: Stack,
) -> None:
    source = stack.source()
    times_ms: list[float] = []
    for _, speed in zip(range(KILLS), directions(), strict=False):
        stack.drive(source, speed)
        times_ms.append(stack.rest_after(stack.bridge.kill()))
        stack.start_bridge()
        stack.watch.report(f"source {SOURCE}", "guarded by")
        stack.stays_at_rest()
    show("SIGKILL of the ROS 2 process to standstill, by the robot's own timeout of 0.5 s", times_ms)
    assert max(times_ms) < BASE_TIMEOUT_MS + BRAKING_MS + MARGIN_MS
    source.end()


def test_a_stopped_ros2_process_leaves_the_robots_own_timeout_and_delivers_no_old_command(
    stack: Stack,
) -> None:
    source = stack.source()
    stack.drive(source, -SPEED_M_S)
    rest_ms = stack.rest_after(send(stack.bridge, signal.SIGSTOP))
    show("SIGSTOP of the ROS 2 process to standstill", [rest_ms])
    assert rest_ms < BASE_TIMEOUT_MS + BRAKING_MS + MARGIN_MS
    at_ns = send(stack.bridge, signal.SIGCONT)
    stack.stays_at_rest()
    assert all(line["v"] == 0.0 for line in stack.observer.of("cmd_vel", from_ns=at_ns))
    stack.drive(source)
    source.end()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_ros2_process_leaves_zero_on_cmd_vel_when_it_is_ended(
    stack: Stack, number: signal.Signals
) -> None:
    source = stack.source()
    stack.drive(source, SPEED_M_S if number == signal.SIGTERM else -SPEED_M_S)
    at_ns = send(stack.bridge, number)
    zero = stack.observer.until(
        lambda line: line.get("topic") == "cmd_vel" and line["at_ns"] > at_ns and line["v"] == 0.0, "zero"
    )
    show(f"{number.name} of the ROS 2 process to zero", [(zero["at_ns"] - at_ns) / 1e6])
    assert stack.bridge.process.wait(10) == 0
    stack.start_bridge()
    stack.watch.report(f"source {SOURCE}", "guarded by")
    stack.stays_at_rest()


def test_ctrl_c_of_the_supervisor_stops_the_robot_and_a_restart_moves_nothing(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source)
    took_ms = stack.zero_after(send(stack.supervisor, signal.SIGINT))
    show("Ctrl-C of the supervisor to zero", [took_ms])
    assert took_ms < MARGIN_MS
    assert stack.supervisor.process.wait(10) == 0
    stack.start_supervisor()
    stack.watch.report("supervisor", "STOPPED")
    stack.stays_at_rest()
    stack.drive(source, -SPEED_M_S)


def test_sigkill_of_the_supervisor_stops_the_robot_and_a_restart_moves_nothing(stack: Stack) -> None:
    source = stack.source()
    times_ms: list[float] = []
    for _, speed in zip(range(KILLS), directions(), strict=False):
        stack.drive(source, speed)
        times_ms.append(stack.zero_after(stack.supervisor.kill()))
        stack.start_supervisor()
        stack.watch.report("supervisor", "STOPPED")
        stack.stays_at_rest()
    show("SIGKILL of the supervisor to zero on cmd_vel", times_ms)
    assert max(times_ms) < 150.0 + MARGIN_MS
    source.end()


def test_a_stopped_supervisor_stops_the_robot_and_its_return_moves_nothing(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source)
    took_ms = stack.zero_after(send(stack.supervisor, signal.SIGSTOP))
    show("SIGSTOP of the supervisor to zero on cmd_vel", [took_ms])
    assert took_ms < 150.0 + MARGIN_MS
    send(stack.supervisor, signal.SIGCONT)
    stack.stays_at_rest()
    stack.drive(source, -SPEED_M_S)
    source.end()


def test_two_publishers_on_a_sources_topic_are_both_refused_and_named(stack: Stack) -> None:
    first = stack.source(name="first")
    stack.drive(first)
    second = stack.source(name="second")
    report = stack.watch.report(f"source {SOURCE}", "/first and /second all publish")
    assert report.level == report.ERROR
    stack.rest_after(time.monotonic_ns())
    stack.stays_at_rest()
    second.tell(v=0.1)
    stack.stays_at_rest()
    second.end()
    stack.watch.report(f"source {SOURCE}", "/first on")
    stack.drive(first, -SPEED_M_S)
    first.end()


def test_another_publisher_on_the_robots_topic_raises_an_alarm_that_names_it(stack: Stack) -> None:
    stranger = stack.source("--silent", name="stranger", topic="/cmd_vel")
    report = stack.watch.report("cmd_vel", "/stranger publishes")
    assert report.level == report.ERROR
    stranger.end()
    stack.watch.report("cmd_vel", "listen")


def test_a_stamped_publisher_on_a_plain_topic_is_reported_with_the_key_to_change(stack: Stack) -> None:
    stamped = stack.source("--stamped", name="stamped")
    report = stack.watch.report(f"source {SOURCE}", "/stamped uses geometry_msgs/msg/TwistStamped")
    assert "set stamped of the source joy = true" in report.message
    stamped.end()


def test_an_estop_topic_latches_and_only_the_reset_service_unlatches(stack: Stack) -> None:
    source, button, caller = (
        stack.source(),
        stack.host.start("estop").ready(),
        stack.host.start("call").ready(),
    )
    stack.drive(source)
    button.until(lambda line: line.get("listeners") == ESTOP_SUBSCRIPTIONS, "discovery")
    button.tell(estop=False)
    button.tell(estop=True)
    stack.watch.report("supervisor", "ESTOP")
    source.tell(v=SPEED_M_S)
    stack.stays_at_rest()
    assert not reset(caller)["success"]
    source.tell(v=0.0)
    stack.neutral()
    while not (accepted := reset(caller))["success"]:  # a loaded machine may stop the robot meanwhile
        pass
    assert accepted["service"] == "/lifeline/reset"
    stack.stays_at_rest()
    stack.drive(source, -SPEED_M_S)
    for peer in (source, button, caller):
        peer.end()


def test_a_planner_that_never_sends_zero_moves_only_after_a_persons_request(stack: Stack) -> None:
    planner = stack.source("--silent", name="planner", topic="/plan_vel")
    caller = stack.host.start("call").ready()
    planner.tell(v=SPEED_M_S)
    stack.watch.report("source plan", "/planner on")
    stack.stays_at_rest()
    caller.tell(service="/lifeline/arm")
    assert caller.until(lambda line: "success" in line, "a reply")["success"]
    stack.observer.until(
        lambda line: line.get("topic") == "cmd_vel" and line["v"] == SPEED_M_S,
        "motion",
        after=len(stack.observer.lines),
    )
    stack.zero_after(planner.kill())
    again = stack.source("--silent", name="planner", topic="/plan_vel")
    again.tell(v=-SPEED_M_S)
    stack.watch.report("source plan", "/planner on")
    stack.stays_at_rest()
    for peer in (again, caller):
        peer.end()


def test_a_driven_robot_stops_30_cm_before_the_wall_and_may_back_out(stack: Stack) -> None:
    source = stack.source()
    reasons: list[str] = []
    while "OBSTACLE" not in reasons:  # a loaded machine may stop the robot for another reason first
        stack.drive(source, 0.5)
        stack.watch.until(lambda w: w.status is not None and w.status.mode == w.status.STOPPED, "a stop")
        assert stack.watch.status is not None
        reasons = stack.watch.status.reasons
    stack.rest_after(time.monotonic_ns())
    assert stack.watch.status is not None
    print(f"\nclearance after the stop: {stack.watch.status.nearest_m:.3f} m")
    assert stack.watch.status.nearest_m > 0.29
    stack.drive(source, -SPEED_M_S)
    source.end()


def test_a_command_that_is_not_finite_stops_the_robot_at_once(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source, -SPEED_M_S)  # away from the wall of the test before
    seen = len(source.lines)
    source.tell(v=math.nan)
    sent = source.until(
        lambda line: "sent" in line and math.isnan(line["sent"][0]), "the message", after=seen
    )
    took_ms = stack.zero_after(sent["at_ns"])
    show("NaN to zero on cmd_vel", [took_ms])
    assert took_ms < MARGIN_MS
    stack.watch.report("supervisor", "COMMAND_INVALID")
    stack.drive(source, -SPEED_M_S)
    source.end()


def test_a_command_above_the_limits_is_limited_and_an_implausible_one_is_refused(stack: Stack) -> None:
    source = stack.source()
    stack.obeys(
        source,
        lambda line: line.get("topic") == "cmd_vel" and line["w"] == 2.0,
        "the limit",
        v=0.0,
        w=3.0,
    )
    source.tell(v=0.0, w=100.0)
    stack.watch.report("supervisor", "COMMAND_INVALID")
    stack.stays_at_rest()
    source.end()


def test_cmd_vel_was_finite_and_within_the_limits_in_all_these_tests(stack: Stack) -> None:
    commands = stack.observer.of("cmd_vel")
    assert len(commands) > 100
    assert all(abs(line["v"]) <= 1.0 and abs(line["w"]) <= 2.0 for line in commands)  # false for NaN
