"""Programs that share a process id with another one, have the wrong type, or outlive `lifeline ros2 exec`."""

import os
import signal
import sys

import pytest

from tests.ros2.host import ROS_PYTHON, Host, Peer
from tests.ros2.stack import SOURCE, SPEED_M_S, TOPIC, Stack, send

SOURCE_WORDS = (str(ROS_PYTHON), "-m", "tests.ros2.peers.source", "--topic", TOPIC)
SHELL = 'echo $0 > /proc/sys/kernel/ns_last_pid; "$@"; exit'


def contained_source(host: Host, pid: int) -> Peer:
    """Start a source with a process id in a namespace of its own, as in a container that shares the host's network."""
    words = ["unshare", "--pid", "--fork", "--mount-proc", "sh", "-c", SHELL, str(pid - 1), *SOURCE_WORDS]
    return host.run("contained", words, host.variables, ends_with_stdin=True).ready()


@pytest.mark.skipif(os.geteuid() != 0, reason="needs a pid namespace")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_signal_to_a_process_with_the_number_that_a_source_has_in_its_container_does_not_stop_the_source(
    stack: Stack, number: signal.Signals
) -> None:
    bystander = stack.host.start("publishers", "--name", "bystander", "--topic", "/elsewhere").ready()
    source = contained_source(stack.host, bystander.pid)
    stack.drive(source)
    from_ns = send(bystander, number)
    stack.observer.until(lambda line: line["at_ns"] > from_ns + 1_000_000_000, "1 s")
    assert stack.watch.report(f"source {SOURCE}", "/source on")
    assert all(line["v"] == SPEED_M_S for line in stack.observer.of("cmd_vel", from_ns=from_ns))


def test_an_estop_button_of_another_type_is_reported(stack: Stack) -> None:
    stack.host.start("raw", "--topic", "/estop", "--type", "std_msgs/msg/Empty", "--name", "button").ready()
    stack.watch.until(
        lambda watch: any("/button" in report.message for report in watch.reports.values()),
        "a report of the button",
        within_s=5.0,
    )


def test_a_program_that_outlives_its_wrapper_is_named_in_the_report(stack: Stack) -> None:
    """Its `lifeline ros2 exec` is killed; the program was started by a shell and goes on to publish."""
    script = f"setsid --wait {' '.join(SOURCE_WORDS)}"
    words = ["ros2", "exec", "--source", SOURCE, "--config", str(stack.config), "--", "sh", "-c", script]
    wrapper = stack.host.run("exec", [sys.executable, "-m", "lifeline.cli.app", *words], stack.host.variables)
    stack.watch.report(f"source {SOURCE}", "lifeline ros2 exec")
    stack.drive(wrapper)
    stack.zero_after(wrapper.kill())
    stack.stays_at_rest(100)
    assert "/source" in stack.watch.reports[f"source {SOURCE}"].message
