"""Latency and processor time that Lifeline adds between a ROS source and a ROS robot, beside a bare relay of the same run."""

import os
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

from tests.ros2.host import Line, Peer
from tests.ros2.stack import TOPIC, Stack

COMMANDS = 200
CPU_S = 10.0
RELAYED = "/relayed"


def arrival(observer: Peer, turn_rad_s: float, after: int) -> Line:
    return observer.until(
        lambda line: line.get("topic") == "cmd_vel" and line["w"] == turn_rad_s,
        "the command",
        after=after,
        within_s=1.0,
    )


def percentile(times_ms: Sequence[float], share: float) -> float:
    ordered = sorted(times_ms)
    return ordered[int(share * (len(ordered) - 1))]


def test_a_command_takes_a_few_milliseconds_more_than_through_a_bare_relay(stack: Stack) -> None:
    stack.host.start("relay", "--from", TOPIC, "--to", RELAYED).ready()
    relayed = stack.host.start("observer", "--name", "relayed", "--cmd-vel", RELAYED).ready()
    source = stack.source()
    source.tell(v=0.0)
    stack.armed()
    through_ms: list[float] = []
    bare_ms: list[float] = []
    for number in range(COMMANDS):
        turn_rad_s = round(0.3 + 0.001 * number, 6) * (-1) ** number
        marks = len(stack.observer.lines), len(relayed.lines), len(source.lines)
        source.tell(v=0.0, w=turn_rad_s)
        sent = source.until(
            lambda line, w=turn_rad_s: line.get("sent") == [0.0, w], "the message", after=marks[2]
        )
        try:
            passed = arrival(stack.observer, turn_rad_s, marks[0])
            relay = arrival(relayed, turn_rad_s, marks[1])
        except AssertionError:  # stopped, or the message was lost: arm again, leave this command out
            source.tell(v=0.0)
            stack.armed()
            continue
        through_ms.append((passed["at_ns"] - sent["at_ns"]) / 1e6)
        bare_ms.append((relay["at_ns"] - sent["at_ns"]) / 1e6)
    assert len(through_ms) > COMMANDS / 2
    for what, times_ms in (("through Lifeline", through_ms), ("bare relay", bare_ms)):
        print(
            f"\n{what}: n {len(times_ms)}, p50 {statistics.median(times_ms):.2f} ms, "
            f"p99 {percentile(times_ms, 0.99):.2f} ms"
        )
    added_ms = statistics.median(through_ms) - statistics.median(bare_ms)
    print(f"added: p50 {added_ms:.2f} ms")
    assert added_ms < 10.0


def test_the_ros2_process_needs_a_small_share_of_a_core(stack: Stack) -> None:
    source = stack.source()
    stack.drive(source, 0.1)
    before_s, start_s = cpu_s(stack.bridge.pid), time.monotonic()
    stack.watch.until(lambda _: time.monotonic() - start_s > CPU_S, "the end of the measurement")
    share = (cpu_s(stack.bridge.pid) - before_s) / (time.monotonic() - start_s)
    status = Path(f"/proc/{stack.bridge.pid}/status").read_text()
    memory = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    print(f"\nROS 2 process: {100 * share:.1f} % of a core; {memory}")
    assert share < 0.3


def cpu_s(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
