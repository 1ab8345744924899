"""`lifeline passport measure` with real processes: a person at a terminal, and a simulated robot whose brakes are known."""

import asyncio
import re
import shutil
import subprocess
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pexpect
import pytest

from passport.cells import Fault
from passport.record import Passport, from_json
from tests.system.ports import free_endpoint
from tests.system.test_record import lifeline, say
from wire import topics
from wire.standstill import STILL_M_S
from wire.tls import LEASE_S
from wire.zenoh.bus import BusConfig, open_bus

PATIENCE_S = 60.0
MOST_REPEATS = 20
"""A busy machine stops the robot; a person then repeats the run."""
BRAKING_M_S2, SPEED_M_S = 1.5, 0.5
LATE_M = 0.25
"""On a busy machine, a fault is detected late; a robot that brakes later than this has not been stopped by it."""
UNHEARD = Fault.LINK_CUT_DOWN.words
"""The robot drives on until the operator's program ends its link."""
REST_S = 3.0
"""Braking takes a third of a second."""
HALL = "[hall]\nsize_m = [12.0, 10.0]\n\n[start]\nx_m = 2.0\n"
ROBOT = f"""\
[supervisor]
max_linear_m_s = {SPEED_M_S}

[sim]
scene = "hall.toml"
moving = false
max_linear_m_s = {SPEED_M_S}
braking_m_s2 = {BRAKING_M_S2}
"""
QUESTIONS = {
    r"Type yes if it agrees\.": "yes",
    r"Type what the floor is": "concrete",
    r"Type go to drive": "go",
    r"Type the mass": "0 kg",
    r"Type again to repeat": "again",
    r"Type reset to reset": "reset",
}


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, without a terminal."""
    return subprocess.run(
        lifeline(*arguments),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=90,
    )


class Site:
    """A robot in front of a wall, in its own directory.

    Args:
        directory: short, because of the socket in it.
        robot: its file; default: a simulated robot.
    """

    def __init__(self, directory: Path, robot: str = ROBOT) -> None:
        self.file, self.out = directory / "robot.toml", directory / "passport.json"
        self.endpoint = free_endpoint()
        self._options = ("--endpoint", self.endpoint, "--state-dir", str(directory / "state"))
        self.file.write_text(robot)
        (directory / "hall.toml").write_text(HALL)

    def up(self) -> None:
        started = run("up", "--detach", "--no-viewer", "--config", str(self.file), *self._options)
        assert started.returncode == 0, started.stderr

    def down(self) -> None:
        run("down", *self._options[2:])

    def measure(self, *faults: str, runs: int = 1) -> "pexpect.spawn[str]":
        named = [word for fault in faults for word in ("--fault", fault)]
        command = lifeline(
            "passport", "measure", str(self.file), *self._options, *named,
            "--out", str(self.out), "--load", "0", "--runs", str(runs),
        )  # fmt: skip
        return pexpect.spawn(command[0], command[1:], dimensions=(50, 200), encoding="utf-8")

    def record(self) -> Passport:
        return from_json(self.out.read_text())


@pytest.fixture
def site() -> Generator[Site]:
    directory = Path(tempfile.mkdtemp(prefix="lifeline-"))  # pytest's paths are too long for a socket
    one = Site(directory)
    try:
        yield one
    finally:
        one.down()
        shutil.rmtree(directory, ignore_errors=True)


def answer(terminal: "pexpect.spawn[str]", until: str | None = None) -> None:
    """Answer all questions until a text is shown; None: until the end."""
    patterns: list[Any] = [*(f"{question}[^\r]*\r\n" for question in QUESTIONS), until or pexpect.EOF]
    repeats = 0
    while (asked := terminal.expect(patterns, timeout=PATIENCE_S)) < len(QUESTIONS):
        word = list(QUESTIONS.values())[asked]
        repeats += word == "again"
        assert repeats < MOST_REPEATS, terminal.before
        terminal.send(f"{word}\r")


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
    terminal = site.measure("operator-killed", "link-cut-down", "supervisor-killed", "estop")
    try:
        answer(terminal)
    finally:
        terminal.close(force=True)
    assert terminal.exitstatus == 0, terminal.before
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


def test_without_a_terminal_nothing_moves_and_it_says_why(site: Site) -> None:
    refused = run("passport", "measure", str(site.file), "--out", str(site.out))
    assert refused.returncode == 2
    assert "a person must confirm each step: run it in a terminal" in refused.stderr
    assert not site.out.exists()


def test_a_fault_that_does_not_exist_is_refused_with_the_names_of_all(site: Site) -> None:
    refused = run("passport", "measure", str(site.file), "--fault", "fire")
    assert refused.returncode == 2
    assert "'fire' is not a valid Fault; there are: zero, turn, operator-killed" in refused.stderr
