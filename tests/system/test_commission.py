"""`lifeline commission` with real processes: a person at a terminal, and a simulated robot whose truth is known."""

import asyncio
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pexpect
import pytest

from tests.system.harness import PATIENCE_S, robot
from tests.system.test_record import lifeline, say
from wire import topics
from wire.messages import Bool

pytestmark = [pytest.mark.timed, pytest.mark.timeout(900)]

MOST_REPEATS = 20
"""A busy machine stops the robot; a person then repeats the step."""
BRAKING_M_S2, NOISE_M, ODOM_ERROR = 1.3, 0.004, 0.04
HALL = "[hall]\nsize_m = [12.0, 10.0]\n\n[start]\nx_m = 2.0\n"
ROBOT = f"""\
# my robot
[supervisor]
deceleration_m_s2 = 1.2   # as its manual says

[sim]
scene = "hall.toml"
moving = false
braking_m_s2 = {BRAKING_M_S2}
lidar_noise_m = {NOISE_M}
odom_left_error = {ODOM_ERROR}
odom_right_error = {ODOM_ERROR}
"""
QUESTIONS = {
    r"if it agrees\.": "yes",
    r"Type ahead or back\.": "ahead",
    r"Type left or right\.": "left",
    r"Type go to drive": "go",
    r"Type again for this step": "again",
    r"Type write": "write",
}


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, without a terminal."""
    return subprocess.run(
        lifeline(*arguments), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )


async def test_a_simulated_robot_is_measured_and_its_file_compared(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT)
    (tmp_path / "hall.toml").write_text(HALL)
    async with robot(tmp_path, teleop=False, config=file) as subject:
        await subject.until(lambda: subject.status.scans_accepted > 0, "the robot")
        assert subject.bus is not None
        estop = subject.bus.publisher(topics.ESTOP)
        command = lifeline("commission", str(file), "--endpoint", subject.endpoint)
        terminal: pexpect.spawn[str] = pexpect.spawn(
            command[0], command[1:], dimensions=(50, 200), encoding="utf-8", env=subject.environment
        )
        patterns: list[Any] = [*(f"{question}[^\r]*\r\n" for question in QUESTIONS), pexpect.EOF]
        repeats = 0
        try:
            while True:
                asked = await asyncio.to_thread(terminal.expect, patterns, timeout=20 * PATIENCE_S)
                if asked == len(QUESTIONS):
                    break
                answer = list(QUESTIONS.values())[asked]
                repeats += answer == "again"
                assert repeats < MOST_REPEATS, terminal.before
                is_estop = "Step e-stop" in (terminal.before or "")
                terminal.send(f"{answer}\r")
                if is_estop and answer == "go":
                    await subject.until(lambda: subject.speed_m_s > 0.08, "the drive of the e-stop")
                    estop.put(Bool(data=True))
            terminal.close()
            assert terminal.exitstatus == 0, terminal.before
        finally:
            terminal.close(force=True)
    text = file.read_text()
    assert text.startswith(ROBOT)
    measured = tomllib.loads(text)["measured"]
    lidar = measured["lidars"]["lidar"]
    for name, found in [*measured.items(), *lidar.items()]:
        if name != "lidars":
            say(f"{name} = {found['value']} (limit {found.get('limit')}, n = {found['n']})")
    assert measured["deceleration_m_s2"]["value"] == pytest.approx(BRAKING_M_S2, rel=0.1)
    assert measured["odometry_scale"]["value"] == pytest.approx(1.0 / (1.0 + ODOM_ERROR), rel=0.01)
    assert lidar["noise_m"]["value"] == pytest.approx(NOISE_M, rel=0.05)
    assert lidar["yaw_rad"]["value"] == pytest.approx(0.0, abs=0.03)
    assert "estop_s" in measured
    checked = await asyncio.to_thread(run, "check", str(file))
    assert checked.returncode in {0, 1}, checked.stderr
    assert "the configuration is valid" in checked.stdout


async def test_without_a_terminal_nothing_moves_and_it_says_why(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("[sim]\n")
    refused = await asyncio.to_thread(run, "commission", str(file))
    assert refused.returncode == 2
    assert "a person must confirm each step: run it in a terminal" in refused.stderr
