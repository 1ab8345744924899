"""`lifeline passport measure` with real processes: a person at a terminal, and a simulated robot whose brakes are known."""

import asyncio
import os
import re
import signal
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor

import pexpect
import pytest

from commission.commission import EXIT_INTERRUPTED
from deploy.stack import processes, supervisord
from deploy.stack.statedir import StateDir
from docs.generate.measure_passport import BRAKING_M_S2, DEMO_FILE, PATIENCE_S, SPEED_M_S, Site, answer, run
from docs.generate.measure_passport import site as new_site
from passport.cells import Fault
from tests.system.ports import free_endpoint
from tests.system.test_record import say
from wire import topics
from wire.standstill import STILL_M_S
from wire.tls import LEASE_S
from wire.zenoh.bus import BusConfig, open_bus

LATE_M = 0.25
"""On a busy machine, a fault is detected late; a robot that brakes later than this has not been stopped by it."""
BASE_TIMEOUT_S, PERIOD_S = 0.5, 0.05
"""Of a base that lets a command count for long; period of the operator's commands."""
UNHEARD = Fault.LINK_CUT_DOWN.words
"""The robot drives on until the operator's program ends its link."""
REST_S = 3.0
"""Braking takes a third of a second."""


@pytest.fixture
def site() -> Generator[Site]:
    with new_site(free_endpoint()) as one:
        yield one


def measured(terminal: "pexpect.spawn[str]") -> None:
    """Answer all questions of a measurement that reaches its end."""
    try:
        answer(terminal, say=say)
    finally:
        terminal.close(force=True)
    assert terminal.exitstatus == 0, terminal.before


async def comes_to_rest(site: Site) -> None:
    """Wait until the robot stands; one that is not braked drives for longer before the next wall."""
    bus = await open_bus(BusConfig(site.endpoint), "client")
    try:
        wake = asyncio.Event()
        odometry = bus.subscribe(topics.ODOM, wake=wake)
        async with asyncio.timeout(REST_S):
            while True:
                await wake.wait()
                wake.clear()
                latest = odometry.latest()
                if latest and latest.message and abs(latest.message.twist.twist.linear.x) < STILL_M_S:
                    return
    finally:
        await bus.close()


@pytest.mark.timed
@pytest.mark.timeout(600)
def test_the_stops_after_four_faults_are_those_of_the_robot_and_a_key_ends_the_next_drive(
    site: Site,
) -> None:
    site.up()
    measured(site.measure("operator-killed", "link-cut-down", "supervisor-killed", "estop"))
    record = site.record()
    assert [one.fault for one in record.cells] == [
        "operator's program killed",
        UNHEARD,
        "e-stop",
        "supervisor killed",
    ]
    brakes_m = SPEED_M_S**2 / (2.0 * BRAKING_M_S2)
    for cell in record.cells:
        (one,) = cell.runs
        say(f"{cell.fault}: {one.distance_m} m by the wall, {one.odometry_m} m by odometry, {one.t3_s} s")
        assert one.stopped
        assert one.v0_m_s == pytest.approx(SPEED_M_S, rel=0.05)
        assert one.distance_m is not None
        assert one.odometry_m is not None
        drives_on_m = SPEED_M_S * LEASE_S if cell.fault == UNHEARD else 0.0
        assert brakes_m - 0.02 < one.distance_m < brakes_m + drives_on_m + LATE_M
        assert one.distance_m == pytest.approx(one.odometry_m, abs=0.02)
        is_seen = cell.fault != "supervisor killed"
        assert (one.t3_s is not None, bool(one.trace)) == (is_seen, is_seen)
        if one.deceleration_m_s2 is not None:
            assert one.deceleration_m_s2 == pytest.approx(BRAKING_M_S2, rel=0.25)

    terminal = site.measure("operator-killed", runs=2)
    try:
        answer(terminal, until=r"operator's program killed: 0\.[2-9]")
        terminal.send("x")
        terminal.expect(r"a key was pressed.*Type again to repeat[^\r]*\r\n", timeout=PATIENCE_S)
        terminal.send("no\r")
        terminal.expect(pexpect.EOF, timeout=PATIENCE_S)
    finally:
        terminal.close(force=True)
    assert terminal.exitstatus == 1
    assert re.search("aborted: a key was pressed. The runs until now are in", terminal.before or "")
    asyncio.run(comes_to_rest(site))
    assert [len(one.runs) for one in site.record().cells] == [1, 1, 1, 1]


@pytest.mark.timeout(300)
def test_ctrl_c_while_lifeline_is_being_replaced_leaves_a_supervisor_that_runs(site: Site) -> None:
    site.up()
    terminal = site.measure("operator-killed", without=True)
    assert terminal.pid is not None
    with ThreadPoolExecutor(1) as pool:
        answering = pool.submit(answer, terminal)
        while runs(site):
            assert not answering.done()
        os.kill(terminal.pid, signal.SIGINT)
        answering.result()
    terminal.close(force=True)
    assert terminal.exitstatus == EXIT_INTERRUPTED
    assert runs(site)


def runs(site: Site) -> bool:
    """Return whether the supervisor runs, and supervisord does not end it."""
    programs = supervisord.programs(StateDir(site.state)) or []
    return any(one.name == topics.SUPERVISOR and one.state in supervisord.STARTED for one in programs)


@pytest.mark.smoke
def test_without_a_terminal_nothing_moves_and_it_says_why(site: Site) -> None:
    refused = run("passport", "measure", str(site.file), "--out", str(site.out))
    assert refused.returncode == 2
    assert "a person must confirm each step: run it in a terminal" in refused.stderr
    assert not site.out.exists()


def test_a_fault_that_does_not_exist_is_refused_with_the_names_of_all(site: Site) -> None:
    refused = run("passport", "measure", str(site.file), "--fault", "fire")
    assert refused.returncode == 2
    assert "'fire' is not a valid Fault; there are: zero, turn, operator-killed" in refused.stderr


SLOW_BASE = DEMO_FILE.replace(
    "[sim]", f"base_timeout_s = {BASE_TIMEOUT_S}\n\n[sim]\ncommand_timeout_s = {BASE_TIMEOUT_S}"
)


@pytest.mark.timed
@pytest.mark.timeout(600)
def test_without_lifeline_the_base_alone_stops_the_robot_and_nothing_does_when_the_lidar_is_silent() -> None:
    with new_site(free_endpoint(), SLOW_BASE) as site:
        site.up()
        measured(site.measure("operator-killed"))

        interrupted = site.measure("operator-killed", without=True)
        answer(interrupted, until=r"operator's program killed: 0\.[2-9]")
        interrupted.sendintr()
        interrupted.expect(pexpect.EOF, timeout=PATIENCE_S)
        interrupted.close(force=True)
        assert interrupted.exitstatus == 130
        assert "supervisor" in {one.name for one in processes.of(site.state)}
        asyncio.run(comes_to_rest(site))

        measured(site.measure("operator-killed", "lidar-silent", without=True))
        assert "supervisor" in {one.name for one in processes.of(site.state)}
        before, killed, silent = site.record().cells
        assert [one.with_lifeline for one in site.record().cells] == [True, False, False]
        (usual,), (one,) = before.runs, killed.runs
        say(f"without Lifeline: {one.distance_m} m by the wall, {one.odometry_m} m by odometry, {one.t3_s} s")
        assert usual.stopped
        assert one.stopped
        assert one.distance_m is not None
        brakes_m = SPEED_M_S**2 / (2.0 * BRAKING_M_S2)
        on_m = SPEED_M_S * (BASE_TIMEOUT_S - PERIOD_S)
        assert on_m + brakes_m - 0.02 < one.distance_m < SPEED_M_S * BASE_TIMEOUT_S + brakes_m + LATE_M
        assert [run.stopped for run in silent.runs] == [False]
        assert silent.refused == "ended in run 1: the robot did not stop"
        assert "without Lifeline" not in site.record().not_tested
