"""The simulated robot's faults and its time, on real processes over real Zenoh.

Bounds are generous, for loaded machines; the measured values are printed (`pytest -s`).
"""

import asyncio
import signal
import subprocess
import sys
import time
from datetime import datetime
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, Robot, free_endpoint, robot
from wire import topics
from wire.bus import Arrival
from wire.messages import Clock, DiagnosticStatus

pytestmark = pytest.mark.timeout(120)


def say(text: str) -> None:
    print(f"\n    measured: {text}")


async def ask(subject: Robot, service: topics.Service, text: str) -> str:
    assert subject.bus is not None
    answer = await subject.bus.call(service, text, timeout_s=5.0)
    assert answer.success, answer.message
    return answer.message


async def test_each_fault_of_the_lidar_stops_a_moving_robot_for_the_right_reason(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.until(lambda: subject.status.owner == topics.TELEOP, "teleop's heartbeat")
        for faults, reason in (
            ("freeze", "SCAN_INVALID"),
            ("all_nan", "SCAN_INVALID"),
            ("silent", "SCAN_STALE"),
            ("rate 1", "SCAN_STALE"),
        ):
            await subject.drive("www", 0.3)
            asked_s = time.monotonic()
            assert await ask(subject, topics.SIM_FAULTS, faults) == f"in force: {faults}"
            to_zero_s = await subject.zero_after(asked_s)
            await subject.until(lambda reason=reason: reason in subject.status.reasons, reason)
            say(f"{faults}: {reason}, zero on cmd_vel after {to_zero_s * 1e3:.0f} ms")
            await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
            await ask(subject, topics.SIM_FAULTS, "none")
            await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 0.3)
            subject.outputs.clear()
        await subject.drive("www", 0.3)


@pytest.mark.timed
async def test_a_fault_from_the_start_and_twice_the_speed_are_taken_from_the_command_line(
    tmp_path: Path,
) -> None:
    """The configured 4,096 beams delay neither."""
    config = tmp_path / "robot.toml"
    config.write_text("[sim]\nlidar_beams = 4096\n")
    subject = Robot(free_endpoint(), tmp_path)
    try:
        subject.start(topics.SUPERVISOR)
        start_sim(subject, "--config", str(config), "--speed", "2", "--faults", "all_nan")
        await subject.observe()
        assert subject.bus is not None
        clocks = subject.bus.subscribe(topics.CLOCK, depth=5000)
        imus = subject.bus.subscribe(topics.IMU, depth=5000)
        await subject.until(lambda: "SCAN_INVALID" in subject.status.reasons, "SCAN_INVALID")
        assert await ask(subject, topics.SIM_FAULTS, "") == "in force: all_nan"
        await ask(subject, topics.SIM_FAULTS, "none")
        subject.look()
        for arrived in (clocks.take(), imus.take(), subject.travel):
            arrived.clear()
        await asyncio.sleep(2.0)  # the length of the measurement, by the stamps of the arrivals
        subject.look()
        odom_hz = (len(subject.travel) - 1) / (subject.travel[-1][0] - subject.travel[0][0])
        imu = imus.take()
        imu_hz = (len(imu) - 1) / (imu[-1].arrival_s - imu[0].arrival_s)
        pace = 1.0 + drift(clocks.take())
        say(f"at --speed 2, 4,096 beams: odom {odom_hz:.1f} Hz, imu {imu_hz:.1f} Hz, {pace:.4f} of real time")
        assert odom_hz == pytest.approx(100, rel=0.05)
        assert imu_hz == pytest.approx(200, rel=0.05)
        assert pace == pytest.approx(2.0, rel=0.02)
        assert await base_reaction_s(subject) < 0.1
    finally:
        await subject.close()


@pytest.mark.timed
async def test_real_time_is_kept_and_a_stall_is_reported(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        assert subject.bus is not None
        clocks = subject.bus.subscribe(topics.CLOCK, depth=5000)
        diagnostics = subject.bus.subscribe(topics.DIAGNOSTICS, depth=100)
        await subject.until(lambda: bool(subject.travel), "odometry")
        clocks.take()
        await asyncio.sleep(4.0)  # the length of the measurement
        measured = drift(clocks.take())
        say(f"drift from real time over 4 s: {100 * measured:+.4f} %")
        if "cannot keep up" not in (tmp_path / "sim.log").read_text():
            assert abs(measured) < 0.002

        def stalled() -> list[DiagnosticStatus]:
            arrived = [a.message for a in diagnostics.take() if a.message is not None]
            return [s for m in arrived for s in m.status if s.message.startswith("cannot keep up")]

        diagnostics.take()
        subject.signal(topics.SIM, signal.SIGSTOP)
        await asyncio.sleep(0.5)  # the stall itself
        subject.signal(topics.SIM, signal.SIGCONT)
        told: list[DiagnosticStatus] = []
        await subject.until(lambda: bool(told.extend(stalled()) or told), "the stall in the diagnostics")
        assert told[0].level == DiagnosticStatus.WARN
        await subject.until(
            lambda: "cannot keep up" in (tmp_path / "sim.log").read_text(), "the stall in the log"
        )


@pytest.mark.smoke
async def test_a_paused_sim_is_stale_and_steps_and_runs_on_request(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        assert subject.bus is not None
        clocks = subject.bus.subscribe(topics.CLOCK, depth=5000)
        assert (await ask(subject, topics.SIM_TIME, "pause")).startswith("paused at")
        await subject.until(lambda: "SCAN_STALE" in subject.status.reasons, "SCAN_STALE")
        before = paused_at(await ask(subject, topics.SIM_TIME, ""))
        after = paused_at(await ask(subject, topics.SIM_TIME, "step 250"))
        assert after == pytest.approx(before + 0.5, abs=1e-3)
        assert paused_at(await ask(subject, topics.SIM_TIME, "")) == after
        clocks.take()
        assert (await ask(subject, topics.SIM_TIME, "run")).startswith("running at")
        await subject.until(lambda: bool(clocks.take()), "the clock")
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 0.5)
        await subject.drive()


@pytest.mark.timed
async def test_ten_times_too_fast_for_the_machine_the_base_still_brakes_when_its_supervisor_dies(
    tmp_path: Path,
) -> None:
    """Deliberate overload: 65,536 beams at 100 times real time. Commands and tokens are still processed."""
    config = tmp_path / "robot.toml"
    config.write_text("[sim]\nlidar_beams = 65536\n")
    subject = Robot(free_endpoint(), tmp_path)
    try:
        subject.start(topics.SUPERVISOR)
        start_sim(subject, "--config", str(config), "--speed", "100")
        log = tmp_path / "sim.log"
        await subject.observe()
        await subject.until(lambda: bool(subject.travel), "odometry")
        await subject.until(lambda: "cannot keep up" in log.read_text(), "the warning")
        assert await base_reaction_s(subject) < 0.5
    finally:
        await subject.close()


@pytest.mark.parametrize(
    ("arguments", "toml", "sentences"),
    [
        (["--speed", "0"], "", ["the speed has to be a number from 0.1 to 100 times real time, not '0'"]),
        (["--faults", "broken"], "", ["'broken' is no sensor fault; there are: none, freeze, "]),
        (
            [],
            "lidar_span_rad = 0\nlidar_dropout = 1.5\nlidar_beams = 65537",
            [
                "sim.lidar_span_rad = 0: must be from 0.01 to 6.28319; in rad",
                "sim.lidar_dropout = 1.5: must be from 0 to 1",
                "sim.lidar_beams = 65537: must be from 1 to 65536",
            ],
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence_before_anything_starts(
    tmp_path: Path, arguments: list[str], toml: str, sentences: list[str]
) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f"[sim]\n{toml}\n")
    ended = subprocess.run(
        [sys.executable, "-m", "sim", "--no-viewer", "--config", str(config), *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr.startswith("sim: ")
    assert all(sentence in ended.stderr for sentence in sentences)
    assert "Traceback" not in ended.stderr


def start_sim(subject: Robot, *arguments: str) -> None:
    with (subject.logs / "sim.log").open("ab") as log:
        subject.processes[topics.SIM] = subprocess.Popen(
            [sys.executable, "-m", "sim", "--no-viewer", "--endpoint", subject.endpoint, *arguments],
            stdout=log,
            stderr=log,
            env=subject.environment,
        )


async def base_reaction_s(subject: Robot) -> float:
    """Kill the supervisor; return the time until the base's target is zero, by its log."""
    log = subject.logs / "sim.log"
    await subject.until(lambda: "base: follows cmd_vel" in log.read_text(), "the base under command")
    before = len(_losses(subject))
    killed_s = time.time()
    subject.kill(topics.SUPERVISOR)
    await subject.until(lambda: len(_losses(subject)) > before, "the base's own stop")
    line = _losses(subject)[-1]
    lost_s = datetime.strptime(line[:23], "%Y-%m-%d %H:%M:%S,%f").astimezone().timestamp()
    say(f"supervisor's SIGKILL to the base's own stop: {(lost_s - killed_s) * 1e3:.0f} ms")
    return lost_s - killed_s


def _losses(subject: Robot) -> list[str]:
    lines = (subject.logs / "sim.log").read_text().splitlines()
    return [line for line in lines if "base: SUPERVISOR_LOST" in line]


def paused_at(sentence: str) -> float:
    """Return the time in a sentence such as `paused at 1.234 s of simulated time, speed 1`."""
    word, _, time_s, *_ = sentence.split()
    assert word == "paused"
    return float(time_s)


def drift(clocks: list[Arrival[Clock]]) -> float:
    """Return by what share simulated time ran faster than real time, from the least delayed message at each end.

    A message can only be late, and then shows too early a time: the most advanced one is the least delayed.
    """
    ahead_s: list[tuple[float, float]] = []  # of real time, and when
    for clock in clocks:
        assert clock.message is not None
        stamp = clock.message.clock
        ahead_s.append((stamp.sec + stamp.nanosec * 1e-9 - clock.arrival_s, clock.arrival_s))
    quarter = len(clocks) // 4
    before, after = max(ahead_s[:quarter]), max(ahead_s[-quarter:])
    return (after[0] - before[0]) / (after[1] - before[1])
