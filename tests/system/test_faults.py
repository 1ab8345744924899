"""What happens to a moving robot if a process dies, hangs or sends false data?

Bounds are generous, for loaded machines; the measured values are printed (`pytest -s`).
No test passes unless the robot has moved first.
"""

import asyncio
import math
import signal
import statistics
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

from tests.system.harness import PATIENCE_S, Robot, free_endpoint, is_zero, patiently, robot
from tests.system.ports import participants
from tests.system.rogue import open_rogue
from wire import topics
from wire.messages import Point, SafetyStatus, encode, planar_twist

pytestmark = [pytest.mark.timeout(120), pytest.mark.smoke]


def say(text: str) -> None:
    print(f"\n    measured: {text}")


@pytest.mark.timed
async def test_ten_teleops_killed_at_speed_each_stop_the_robot_well_before_the_timeout(
    tmp_path: Path,
) -> None:
    to_zero_s: list[float] = []
    to_rest: list[tuple[float, float]] = []
    async with robot(tmp_path) as subject:
        for _ in range(10):
            if subject.terminal is None:
                subject.start_teleop()
            await subject.drive()
            killed_s = subject.kill(topics.TELEOP)
            to_zero_s.append(await subject.zero_after(killed_s))
            to_rest.append(await subject.standstill_after(killed_s))
            await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "SOURCE_LOST")
            assert subject.bus is not None
            assert (await subject.bus.call(topics.SIM_RESET, timeout_s=PATIENCE_S)).success
    say(
        f"SIGKILL to zero on cmd_vel: median {statistics.median(to_zero_s) * 1e3:.1f} ms, "
        f"worst {max(to_zero_s) * 1e3:.1f} ms; to standstill from 0.5 m/s: "
        f"{max(t for t, _ in to_rest) * 1e3:.0f} ms and {max(d for _, d in to_rest) * 100:.1f} cm at worst"
    )
    # What the kernel takes to end a process is the machine's: 5.9 ms one day, 9.3 ms another, for the same commit. The
    # promise of 10 ms is for a quiet machine, and is judged by the demo and the campaign; this finds a slower detector.
    assert statistics.median(to_zero_s) < 0.030
    assert max(to_zero_s) < 0.1, "the command timeout stopped it, not the token"
    assert max(d for _, d in to_rest) < 0.2


@pytest.mark.timed
async def test_a_stopped_teleop_is_timed_out_and_moves_nothing_when_it_wakes_up(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        stopped_s = subject.signal(topics.TELEOP, signal.SIGSTOP)
        to_zero_s = await subject.zero_after(stopped_s)
        say(f"SIGSTOP to zero on cmd_vel: {to_zero_s * 1e3:.0f} ms")
        assert to_zero_s < 0.2 + 0.02 + 0.2
        await subject.standstill_after(stopped_s)
        await subject.until(lambda: "COMMAND_TIMEOUT" in subject.status.reasons, "COMMAND_TIMEOUT")
        woken_s = subject.signal(topics.TELEOP, signal.SIGCONT)
        await subject.ready()  # it has detected its hang, and requests nothing
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved by itself", 1.0)
        assert all(is_zero(twist) for at_s, twist in subject.outputs if at_s > woken_s)
        await subject.drive()


async def test_a_source_that_wakes_up_still_asking_for_motion_gets_none(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        source = await driving_source(subject)
        stopped_s = subject.signal("source", signal.SIGSTOP)
        await subject.zero_after(stopped_s)
        await subject.standstill_after(stopped_s)
        await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "the lapse of its lease")
        woken_s = subject.signal("source", signal.SIGCONT)
        accepted = subject.status.sources[0].accepted
        await subject.until(
            lambda: subject.status.sources[0].accepted > accepted + 20, "a second of its fresh commands"
        )
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 0.5)
        assert all(is_zero(twist) for at_s, twist in subject.outputs if at_s > woken_s)
        source.close()


async def driving_source(subject: Robot) -> IO[bytes]:
    """Start a source that keeps 0.5 m/s, and return its stdin.

    It never sends zero after a stop: if a busy machine stops it, a new one is started.
    """

    async def attempt() -> IO[bytes]:
        source = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("stubborn_source.py"), subject.endpoint],
            stdin=subprocess.PIPE,
        )
        subject.processes["source"] = source
        assert source.stdin is not None
        try:
            await subject.ready()
            source.stdin.write(b"drive\n")
            source.stdin.flush()
            await subject.until_it_drives(0.5)
        except AssertionError:
            source.stdin.close()
            subject.kill("source")
            raise
        return source.stdin

    return await patiently(attempt)


async def test_a_killed_supervisor_lets_the_base_brake_and_its_return_moves_nothing(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        # A delayed teleop would become neutral; this one must continue to request motion.
        subject.start_teleop(module="tests.system.patient_teleop")
        await subject.drive("wwwwwwww", 0.8)
        log = tmp_path / "sim.log"
        written = len(log.read_text())
        killed_s = subject.kill(topics.SUPERVISOR)
        # Without the hub, the observer receives nothing: odometry returns with the supervisor.
        subject.start(topics.SUPERVISOR)
        await subject.until(lambda: subject.travel[-1][0] > killed_s + 0.1, "odometry over the new hub")
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        await subject.until(
            lambda: "base: SUPERVISOR_LOST" in log.read_text()[written:], "the base's own stop"
        )
        await subject.until(
            lambda: not subject.status.sources[0].neutral and subject.status.sources[0].age_s < 0.2,
            "teleop back on the new hub, still asking for motion",
        )
        x_m = subject.x_m
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 1.0)
        assert subject.x_m == pytest.approx(x_m, abs=0.005)
        await subject.drive()


async def test_a_stopped_supervisor_lets_the_base_brake_within_its_own_timeout(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        # A delayed teleop would become neutral, which ends the latch.
        subject.start_teleop(module="tests.system.patient_teleop")
        log = tmp_path / "sim.log"
        while True:
            await subject.drive()
            written = len(log.read_text())
            supervisor = subject.processes[topics.SUPERVISOR]
            subject.signal(topics.SUPERVISOR, signal.SIGSTOP)
            # The hub is stopped, so the base's log is read, which also contains a stop at its start.
            await subject.until(
                lambda written=written: "base: COMMAND_TIMEOUT" in log.read_text()[written:],
                "the base brakes by itself",
            )
            subject.signal(topics.SUPERVISOR, signal.SIGCONT)
            await subject.until(
                lambda supervisor=supervisor: (
                    supervisor.poll() is not None
                    or ("OVERRUN" in subject.status.latched and not subject.status.causes)
                ),
                "every cause is over, and the lateness is latched",
            )
            if supervisor.poll() is None:
                break
            # A busy machine has kept it stopped for longer than TURN_LIMIT_S.
            assert supervisor.poll() == -signal.SIGALRM
            subject.start(topics.SUPERVISOR)
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 0.5)


@pytest.mark.timed
async def test_a_killed_sim_stops_everything_and_its_return_moves_nothing(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        killed_s = subject.kill(topics.SIM)
        to_zero_s = await subject.zero_after(killed_s)
        say(f"sim SIGKILL to zero on cmd_vel: {to_zero_s * 1e3:.0f} ms")
        assert to_zero_s < 0.25 + 0.02 + 0.2
        await subject.until(lambda: "SCAN_STALE" in subject.status.reasons, "SCAN_STALE")
        subject.travel.clear()
        subject.start(topics.SIM)
        await subject.until(lambda: bool(subject.travel), "the new sim's odometry")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved before neutral", 1.0)
        await subject.drive()


@pytest.mark.timed
async def test_a_pillar_dropped_ahead_of_a_fast_robot_stops_it_short(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive("w" * 10, 1.0)
        assert subject.bus is not None
        start_x_m = -4.5
        pillar_x_m = start_x_m + subject.x_m + 1.6
        subject.bus.publisher(topics.OBSTACLE).put(Point(pillar_x_m, 0.0, 0.0))
        await subject.until(lambda: "OBSTACLE" in subject.status.reasons, "OBSTACLE")
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        clearance_m = pillar_x_m - 0.05 - (start_x_m + subject.x_m + 0.25)
        say(f"clearance to the pillar after 1.0 m/s: {clearance_m * 100:.1f} cm")
        assert 0.29 <= clearance_m < 0.45
        await back_out(subject)


@pytest.mark.timed
async def test_driven_straight_at_the_rack_it_stops_short_and_backs_out(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive("w" * 10, 1.0)
        await subject.until(lambda: "OBSTACLE" in subject.status.reasons, "OBSTACLE")
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        say(f"clearance to the rack after 1.0 m/s: {subject.status.nearest_m * 100:.1f} cm")
        assert 0.28 <= subject.status.nearest_m < 0.40
        await back_out(subject)


async def back_out(subject: Robot) -> None:
    await subject.press("sxxx", lambda: subject.speed_m_s < -0.25, "backing out")
    await subject.until(lambda: subject.status.nearest_m > 0.5, "half a metre of room")


async def test_estop_by_the_space_bar_latches_until_reset(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        subject.type(" ")
        await subject.until(lambda: "ESTOP" in subject.status.reasons, "ESTOP")
        await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        subject.type("www")
        await subject.never(lambda: abs(subject.speed_m_s) > 0.01, "it moved under e-stop", 0.5)
        await subject.press("s", lambda: subject.status.sources[0].neutral, "neutral")
        await subject.press("r", lambda: subject.status.mode == SafetyStatus.READY, "a reset")
        await subject.drive()


async def test_a_rogue_put_on_cmd_vel_never_reaches_the_base(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        await subject.press("s", lambda: abs(subject.speed_m_s) < 0.005, "standstill")
        rogue = open_rogue(participants(subject.endpoint))
        try:
            payload = encode(planar_twist(1.0, 0.0))
            x_m = subject.x_m
            for _ in range(100):
                for key in ("robot/cmd_vel", "robot/*", "robot/**", "**"):
                    rogue.put(key, payload)
                await asyncio.sleep(0.01)
                subject.look()
            assert all(is_zero(twist) for _, twist in subject.outputs[-40:])
            assert subject.x_m == pytest.approx(x_m, abs=0.002)
            assert math.isclose(subject.speed_m_s, 0.0, abs_tol=0.005)
        finally:
            rogue.close()


@pytest.mark.parametrize(
    "order",
    [
        "teleop sim supervisor",
        "sim supervisor teleop",
        "teleop supervisor sim",
    ],
)
async def test_any_start_order_comes_to_drivable(tmp_path: Path, order: str) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    try:
        for node in order.split():
            if node == topics.TELEOP:
                subject.start_teleop()
            else:
                subject.start(node)
        await subject.observe()
        await subject.drive()
    finally:
        await subject.close()
