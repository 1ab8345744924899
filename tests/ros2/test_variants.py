"""Other robots: stamped topics in a namespace, drivers that die, bases with and without a timeout."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros2.host import ROOT, Host
from tests.ros2.stack import SPEED_M_S, MakeStack

CHECK_LIMIT_S = 60.0


def test_a_stamped_robot_in_a_namespace_is_driven_and_stopped(host: Host, make_stack: MakeStack) -> None:
    in_namespace = ("--ros-args", "-r", "__ns:=/r1")
    host.start("diff_drive", "--stamped", *in_namespace).ready()
    stack = make_stack('namespace = "r1"\nstamped = true', "--stamped", *in_namespace)
    stack.watch.report("cmd_vel", "/r1/diff_drive and /r1/observer")
    source = stack.source()
    stack.drive(source)
    assert stack.zero_after(source.kill()) < 300.0


def test_a_dead_driver_stops_the_robot_and_its_return_moves_nothing(
    host: Host, make_stack: MakeStack
) -> None:
    driver = host.start("diff_drive").ready()
    stack = make_stack()
    source = stack.source()
    stack.drive(source)
    took_ms = stack.zero_after(driver.kill())
    print(f"\nSIGKILL of the driver of lidar and base to zero: {took_ms:.0f} ms")
    assert took_ms < 400.0
    stack.watch.report("scan scan", "scan")
    host.start("diff_drive").ready()
    stack.watch.until(lambda w: w.status is not None and not w.status.causes, "all causes over")
    stack.stays_at_rest()
    stack.drive(source, -SPEED_M_S)


def test_the_wrong_type_of_the_base_is_reported_with_the_key_to_change(
    host: Host, make_stack: MakeStack
) -> None:
    host.start("diff_drive", "--stamped").ready()
    stack = make_stack()
    report = stack.watch.report("cmd_vel", "/diff_drive uses geometry_msgs/msg/TwistStamped")
    assert "set stamped = true" in report.message


@pytest.mark.parametrize(
    ("timeout", "code", "sentence"),
    [
        ("0.5", 0, "it has a timeout of its own\nset base_timeout_s in [supervisor] to at least 0."),
        ("1.5", 0, "to 0.25 s for example\nuntil then, set base_timeout_s in [supervisor] to at least 1."),
        ("none", 1, "it keeps its last command"),
    ],
)
def test_check_base_measures_whether_the_base_has_a_timeout(
    host: Host, tmp_path: Path, timeout: str, code: int, sentence: str
) -> None:
    host.start("diff_drive", "--timeout", timeout).ready()
    done = check_base(host, tmp_path)
    assert sentence in done.stdout, done.stdout + done.stderr
    assert done.returncode == code


def check_base(host: Host, folder: Path, ros2: str = "") -> "subprocess.CompletedProcess[str]":
    config = folder / "check.toml"
    config.write_text(f"[ros2]\ndomain_id = {host.domain}\n{ros2}\n")
    lifeline = Path(sys.executable).with_name("lifeline")
    return subprocess.run(
        [lifeline, "ros2", "check-base", "--config", config, "--yes"],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=CHECK_LIMIT_S,
        check=False,
    )


def test_check_base_moves_nothing_while_lifeline_or_another_program_commands_the_base(
    host: Host, make_stack: MakeStack, tmp_path: Path
) -> None:
    host.start("diff_drive").ready()
    other = host.start("source", "--name", "other").ready()
    done = check_base(host, tmp_path)
    assert "/other publishes on /cmd_vel" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 3
    other.end()
    stack = make_stack()
    done = check_base(host, tmp_path)
    assert "Lifeline itself commands /cmd_vel" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 3
    assert not any(line["w"] for line in stack.observer.of("cmd_vel"))
