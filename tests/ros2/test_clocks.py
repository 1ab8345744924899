"""Clocks that differ: a base that checks stamps, and sources and relays with old headers."""

import time
from pathlib import Path

import pytest

from tests.ros2.host import Host
from tests.ros2.stack import SOURCE, SPEED_M_S, TOPIC, MakeStack
from tests.ros2.test_variants import check_base

AHEAD_S = 5.0
RELAYED, SOURCE_HZ = "/relayed_vel", 20.0
REST_S = 2.0
"""0.4 s until the age is the command timeout, the timeout itself, and the braking; the rest is margin."""
BASE_TIMEOUT_MS, BRAKING_MS, MARGIN_MS = 500.0, 300.0, 250.0


@pytest.mark.parametrize("ahead_s", [AHEAD_S, -AHEAD_S])
def test_a_base_with_another_clock_drives_and_stops_by_its_own_timeout(
    host: Host, make_stack: MakeStack, ahead_s: float
) -> None:
    host.start("diff_drive", "--stamped", f"--ahead={ahead_s}").ready()
    stack = make_stack("stamped = true", "--stamped")
    source = stack.source()
    stack.drive(source)
    killed_ns = stack.bridge.kill()  # first: it would command zero when the supervisor ends
    stack.supervisor.kill()
    took_ms = stack.rest_after(killed_ns, within_s=AHEAD_S + 2.0)
    assert took_ms < BASE_TIMEOUT_MS + BRAKING_MS + MARGIN_MS


@pytest.mark.parametrize("step_s", [AHEAD_S, -AHEAD_S])
def test_a_step_of_the_bases_clock_stops_the_robot_until_a_neutral_command(
    host: Host, make_stack: MakeStack, step_s: float
) -> None:
    base = host.start("diff_drive", "--stamped").ready()
    stack = make_stack("stamped = true", "--stamped")
    source = stack.source()
    stack.drive(source)
    base.tell(ahead=step_s)
    stack.rest_after(time.monotonic_ns())
    stack.watch.report("cmd_vel", f"it has changed by {step_s:+.2f} s")
    stack.watch.until(
        lambda watch: watch.status is not None and "BASE_UNRESPONSIVE" in watch.status.reasons, "the reason"
    )
    stack.stays_at_rest()
    stack.drive(source)


def test_a_base_that_takes_its_own_time_for_stamps_of_zero_drives(host: Host, make_stack: MakeStack) -> None:
    host.start("diff_drive", "--stamped", f"--ahead={AHEAD_S}").ready()
    stack = make_stack('stamped = true\nstamp = "zero"', "--stamped")
    stack.drive(stack.source())


def test_with_now_the_base_that_ignores_each_command_is_reported_with_its_clock(
    host: Host, make_stack: MakeStack
) -> None:
    host.start("diff_drive", "--stamped", f"--ahead={AHEAD_S}").ready()
    stack = make_stack('stamped = true\nstamp = "now"', "--stamped")
    report = stack.watch.report("cmd_vel", "ahead of this computer's")
    assert 'set stamp = "base"' in report.message


@pytest.mark.parametrize(("ahead_s", "code", "part"), [(AHEAD_S, 3, "ahead of"), (-AHEAD_S, 1, "behind")])
def test_check_base_names_the_clock_as_the_cause(
    host: Host, tmp_path: Path, ahead_s: float, code: int, part: str
) -> None:
    host.start("diff_drive", "--stamped", f"--ahead={ahead_s}").ready()
    done = check_base(host, tmp_path, 'stamped = true\nstamp = "now"')
    assert f"{part} this computer's" in done.stdout, done.stdout + done.stderr
    assert done.returncode == code


def test_check_base_measures_a_base_with_another_clock(host: Host, tmp_path: Path) -> None:
    host.start("diff_drive", "--stamped", f"--ahead={AHEAD_S}").ready()
    done = check_base(host, tmp_path, "stamped = true")
    assert "it has a timeout of its own" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0


def test_a_source_whose_headers_are_10_s_old_moves_nothing_and_is_named(
    host: Host, make_stack: MakeStack
) -> None:
    host.start("diff_drive").ready()
    stack = make_stack("", source="stamped = true")
    source = stack.source("--stamped", "--late=10")
    stack.watch.report(f"source {SOURCE}", "behind this computer's clock")
    source.tell(v=SPEED_M_S)
    time.sleep(1.0)
    stack.stays_at_rest()
    source.end()
    fresh = stack.source("--stamped", name="fresh")
    stack.drive(fresh)


def test_a_slow_backlog_of_a_relay_that_keeps_the_headers_stops_the_robot(
    host: Host, make_stack: MakeStack
) -> None:
    host.start("diff_drive").ready()
    stack = make_stack("", source="stamped = true")
    relay = host.start("relay", "--stamped", "--from", RELAYED, "--to", TOPIC).ready()
    source = stack.source("--stamped", topic=RELAYED)
    stack.drive(source)
    # From now on, the age of what arrives grows by half of the time, while the relay's own stamps are fresh.
    relay.tell(period_s=2 / SOURCE_HZ)
    stack.rest_after(time.monotonic_ns(), within_s=REST_S)
    stack.watch.report(f"source {SOURCE}", "its commands")
    stack.stays_at_rest()
