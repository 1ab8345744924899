"""`lifeline passport measure` on a ROS 2 robot whose brakes and timeout are known."""

import os
import signal
import time
from collections.abc import Generator

import pytest

from commission.commission import EXIT_ABORTED, EXIT_INTERRUPTED
from deploy.stack import processes
from docs.generate.measure_passport import (
    ROS2_FILE,
    ROS2_SPEED_M_S,
    ROS2_TIMEOUT_S,
    ROS2_TURN_RAD_S,
    START_X_M,
    Site,
    answer,
)
from docs.generate.measure_passport import site as new_site
from tests.ros2.host import Host, Line, Peer
from tests.ros2.peers.drive import BRAKING_M_S2, TURN_BRAKING_RAD_S2
from tests.system.ports import free_endpoint
from tests.system.process_state import children_of, command_of
from wire import topics
from wire.tls import LEASE_S

LATE_S = 0.25
"""On a busy machine, the simulated robot receives a command late and therefore brakes late."""
BRAKES_M = ROS2_SPEED_M_S**2 / (2.0 * BRAKING_M_S2)
PERIOD_S = 0.05
"""Of the operator's commands: the last one is up to this much older than the fault."""
TURNS_RAD = ROS2_TURN_RAD_S**2 / (2.0 * TURN_BRAKING_RAD_S2)


@pytest.fixture
def site(host: Host) -> Generator[Site]:
    with new_site(free_endpoint(), ROS2_FILE.format(domain=host.domain)) as one:
        yield one


def measure(site: Site, *faults: str, without: bool = False) -> int | None:
    """Measure with a person who answers all questions; return the exit code."""
    site.up()
    terminal = site.measure(*faults, without=without)
    try:
        answer(terminal)
    finally:
        terminal.close(force=True)
    return terminal.exitstatus


@pytest.mark.timeout(300)
def test_the_stops_of_a_ros2_robot_are_those_of_its_brakes_and_without_ros2_of_its_timeout(
    host: Host, site: Site
) -> None:
    host.start("diff_drive", "--x", str(START_X_M), "--timeout", str(ROS2_TIMEOUT_S)).ready()
    assert measure(site, "turn", "operator-killed", "ros2-killed") == 0
    record = site.record()
    assert [cell.fault for cell in record.cells] == [
        "plain zero in a turn",
        "operator's program killed",
        "process ros2 killed",
    ]
    turn, killed, alone = (cell.runs[0] for cell in record.cells)
    assert killed.t1_s is not None
    assert turn.t1_s is not None
    assert alone.t3_s is None
    within_m, within_rad = record.instrument.uncertainty_m, record.instrument.uncertainty_rad
    assert within_rad is not None
    for run, truth, within, late in (
        (turn, ROS2_TURN_RAD_S * turn.t1_s + TURNS_RAD, within_rad, ROS2_TURN_RAD_S * LATE_S),
        (killed, ROS2_SPEED_M_S * killed.t1_s + BRAKES_M, within_m, ROS2_SPEED_M_S * LATE_S),
        (alone, ROS2_SPEED_M_S * ROS2_TIMEOUT_S + BRAKES_M, within_m, ROS2_SPEED_M_S * LATE_S),
    ):
        print(
            f"\n{run.distance_m} by the lidar, {run.odometry_m} by odometry, {truth} is true, within {within}"
        )
        assert run.distance_m is not None
        assert truth - within < run.distance_m < truth + within + late
        assert run.distance_m == pytest.approx(run.odometry_m, abs=within)


@pytest.mark.timeout(300)
def test_a_base_that_keeps_its_last_command_has_no_stop_although_ros2_stops_it_when_it_is_back(
    host: Host, site: Site
) -> None:
    host.start("diff_drive", "--x", str(START_X_M), "--timeout", "none").ready()
    assert measure(site, "ros2-killed") == 1
    ((run,),) = (cell.runs for cell in site.record().cells)
    assert not run.stopped


@pytest.mark.timeout(300)
def test_without_lifeline_a_ros2_robot_drives_on_for_the_timeout_of_its_base_and_then_both_processes_run_again(
    host: Host, site: Site
) -> None:
    host.start("diff_drive", "--x", str(START_X_M), "--timeout", str(ROS2_TIMEOUT_S)).ready()
    assert measure(site, "operator-killed", "link-cut-down", without=True) == 0
    killed, unheard = site.record().cells
    within_m = site.record().instrument.uncertainty_m
    for cell, link_s in ((killed, 0.0), (unheard, LEASE_S)):
        assert not cell.with_lifeline
        (run,) = cell.runs
        print(f"\n{run.distance_m} by the lidar, {run.odometry_m} by odometry, {run.t3_s} s")
        assert run.stopped
        assert run.distance_m is not None
        least_s, most_s = ROS2_TIMEOUT_S - PERIOD_S, link_s + ROS2_TIMEOUT_S + LATE_S
        assert ROS2_SPEED_M_S * least_s + BRAKES_M - within_m < run.distance_m
        assert run.distance_m < ROS2_SPEED_M_S * most_s + BRAKES_M + within_m
    assert lifelines(site) == {topics.SUPERVISOR, topics.ROS2}


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("victim", "code"),
    [(None, EXIT_INTERRUPTED), ("passport.ros2_bypass", EXIT_ABORTED)],
    ids=["Ctrl-C", "SIGKILL"],
)
def test_a_measurement_without_lifeline_that_is_interrupted_leaves_a_robot_at_rest_with_both_processes(
    host: Host, site: Site, victim: str | None, code: int
) -> None:
    host.start("diff_drive", "--x", str(START_X_M), "--timeout", str(ROS2_TIMEOUT_S)).ready()
    observer = host.start("observer").ready()
    site.up()
    terminal = site.measure("operator-killed", without=True)
    try:
        answer(terminal, until=r"operator's program killed: 0\.[2-9]")
        assert not lifelines(site)
        if victim is None:
            terminal.sendintr()
        else:
            os.kill(child_of(terminal.pid, victim), signal.SIGKILL)
        answer(terminal)
    finally:
        terminal.close(force=True)
    assert terminal.exitstatus == code, terminal.before
    assert lifelines(site) == {topics.SUPERVISOR, topics.ROS2}
    rests(observer)


def lifelines(site: Site) -> set[str]:
    """Return which of Lifeline's processes run under supervisord."""
    return {one.name for one in processes.of(site.state)} - {"supervisord"}


def child_of(parent: int | None, module: str) -> int:
    assert parent is not None
    (found,) = (pid for pid in children_of(parent) if module in command_of(pid))
    return found


def rests(observer: Peer) -> None:
    """Check that the robot comes to rest, and that only zero is commanded from then on, by `ros2` again."""
    now_ns = time.monotonic_ns()
    observer.until(
        lambda line: line.get("topic") == "odom" and line["at_ns"] > now_ns and not line["v"], "standstill"
    )
    begin_ns, zeros = time.monotonic_ns(), 0

    def enough(line: Line) -> bool:
        nonlocal zeros
        zeros += line.get("topic") == "cmd_vel" and line["at_ns"] > begin_ns
        return zeros >= 50

    observer.until(enough, "50 messages on cmd_vel")
    assert not [line for line in observer.of("cmd_vel", from_ns=begin_ns) if line["v"] or line["w"]]
