"""`lifeline passport measure` on a ROS 2 robot whose brakes and timeout are known."""

from collections.abc import Generator

import pytest

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
from tests.ros2.host import Host
from tests.ros2.peers.drive import BRAKING_M_S2, TURN_BRAKING_RAD_S2
from tests.system.ports import free_endpoint

LATE_S = 0.25
"""On a busy machine, the simulated robot receives a command late and therefore brakes late."""
BRAKES_M = ROS2_SPEED_M_S**2 / (2.0 * BRAKING_M_S2)
TURNS_RAD = ROS2_TURN_RAD_S**2 / (2.0 * TURN_BRAKING_RAD_S2)


@pytest.fixture
def site(host: Host) -> Generator[Site]:
    with new_site(free_endpoint(), ROS2_FILE.format(domain=host.domain)) as one:
        yield one


def measure(site: Site, *faults: str) -> int | None:
    """Measure with a person who answers all questions; return the exit code."""
    site.up()
    terminal = site.measure(*faults)
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
