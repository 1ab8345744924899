"""Faults that real sensors have, on real processes over real Zenoh: driven straight at a 10 cm pillar.

Distances are those of the truth, between the hull of 0.5 m and the pillar; they are printed (`pytest -s`).
"""

import asyncio
import math
import random
import time
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from faults.attacks import free_scan
from tests.system.harness import PATIENCE_S, Robot, free_endpoint, robot
from wire import topics
from wire.bus import Subscription
from wire.messages import LaserScan, Odometry, Point, SafetyStatus
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

pytestmark = pytest.mark.timeout(120)

START_M = (-4.5, 0.0)
PILLAR_AHEAD_M = 4.0
HULL_M, PILLAR_M = 0.25, 0.05
LEAST_M = 0.29
PERIOD_S = 0.05
AT_PILLAR_S = 6.0
"""Long enough to reach the pillar from where the fault begins."""


@dataclass
class Approach:
    """The clearance of the hull to a pillar straight ahead."""

    subject: Robot
    truth: Subscription[Odometry]
    least_m: float = math.inf
    now_m: float = math.inf

    def look(self) -> bool:
        """Update the true pose; return False, so that it can be used as a condition."""
        x_m = START_M[0] + PILLAR_AHEAD_M
        for arrival in self.truth.take():
            if arrival.message is not None:
                at = arrival.message.pose.pose.position
                self.now_m = math.dist((at.x, at.y), (x_m, START_M[1])) - HULL_M - PILLAR_M
                self.least_m = min(self.least_m, self.now_m)
        return False

    async def until_within(self, distance_m: float, keys: str) -> None:
        """If a busy machine stopped the robot, the operator starts again."""
        subject, end_s = self.subject, time.monotonic() + 2 * PATIENCE_S
        at_rest = (SafetyStatus.STOPPED, SafetyStatus.READY)

        def is_near() -> bool:
            self.look()
            return self.now_m <= distance_m

        while not is_near():
            await subject.until(
                lambda: is_near() or subject.status.mode in at_rest,
                f"{distance_m} m to the pillar",
            )
            if not is_near():
                assert time.monotonic() < end_s, subject.picture()
                subject.type("s")
                await subject.ready()
                await subject.press(keys, lambda: subject.status.mode != SafetyStatus.READY, "motion")

    async def drive_on(self, for_s: float, keys: str = "ww") -> None:
        """The operator re-arms after a stop, and requests the same motion."""
        end_s = time.monotonic() + for_s
        while time.monotonic() < end_s:
            self.subject.look()
            if self.subject.status.reasons:
                self.subject.type("s")
                await self.subject.never(self.look, "", 0.2)
            self.subject.type(keys)
            await self.subject.never(self.look, "", 0.3)


@asynccontextmanager
async def approach(subject: Robot) -> AsyncGenerator[Approach]:
    """Place a pillar ahead of a robot at its start, with a connected teleop."""
    assert subject.bus is not None
    found = Approach(subject, subject.bus.subscribe(topics.TRUTH, depth=5000))
    await subject.until(lambda: subject.status.owner == topics.TELEOP, "teleop's heartbeat")
    subject.bus.publisher(topics.OBSTACLE).put(Point(START_M[0] + PILLAR_AHEAD_M, START_M[1], 0.0))
    try:
        yield found
    finally:
        found.look()
        print(f"\n    measured: {100 * found.least_m:.1f} cm from hull to pillar")


async def ask_faults(subject: Robot, text: str) -> None:
    assert subject.bus is not None
    answer = await subject.bus.call(topics.SIM_FAULTS, text, timeout_s=5.0)
    assert answer.success, answer.message


async def test_driven_at_1_m_s_at_a_pillar_within_14_degrees_of_dirt_the_hull_keeps_its_distance(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject, approach(subject) as way:
        await subject.drive("w" * 10, 1.0)
        await way.until_within(1.5, "w" * 10)
        await ask_faults(subject, "blocked -0.12 0.12")
        await way.drive_on(AT_PILLAR_S)
        assert way.least_m >= LEAST_M


async def test_driven_at_0_8_m_s_with_a_frozen_lidar_and_no_odometry_the_robot_stops_and_says_why(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject, approach(subject) as way:
        await subject.drive("w" * 8, 0.8)
        await way.until_within(2.0, "w" * 8)
        said: set[str] = set()
        await ask_faults(subject, "freeze; no_odom")

        def is_measured() -> bool:
            way.look()
            said.update(subject.status.reasons)
            return bool(said & {"ODOM_STALE", "SCAN_INVALID"})

        await subject.until(is_measured, "ODOM_STALE or SCAN_INVALID")
        await way.drive_on(AT_PILLAR_S)
        assert way.least_m >= LEAST_M


@pytest.mark.timed  # a drive of 17 s; the virtual faults drive with dim lidars too
@pytest.mark.parametrize("range_m", [0.6, 0.7])
async def test_with_a_lidar_that_reaches_less_than_a_metre_the_hull_keeps_its_distance(
    tmp_path: Path, range_m: float
) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f"[sim]\nlidar_range_max_m = {range_m}\n")
    async with started(tmp_path, "--config", str(config)) as subject, approach(subject) as way:
        await way.drive_on(2.5 * AT_PILLAR_S, "wwwww")
        assert way.least_m >= LEAST_M


async def test_a_lidar_that_is_covered_from_the_start_and_reads_inf_everywhere_lets_nothing_drive(
    tmp_path: Path,
) -> None:
    async with (
        started(tmp_path, "--faults", "blocked -4 4 inf") as subject,
        approach(subject) as way,
    ):
        await way.drive_on(4.0)
        assert way.least_m > PILLAR_AHEAD_M - HULL_M - PILLAR_M - 0.02, "it moved"
        assert subject.status.reasons


@asynccontextmanager
async def started(tmp_path: Path, *options: str) -> AsyncGenerator[Robot]:
    """A robot whose sim has these options."""
    subject = Robot(free_endpoint(), tmp_path)
    try:
        subject.start(topics.SUPERVISOR)
        subject.start(topics.SIM, *options)
        await subject.observe()
        subject.start_teleop()
        yield subject
    finally:
        await subject.close()


@asynccontextmanager
async def foreign_client(subject: Robot) -> AsyncGenerator[ZenohBus]:
    bus = await open_bus(BusConfig(subject.endpoint), "client")
    try:
        yield bus
    finally:
        await bus.close()


@contextmanager
def scans_of_free_space(bus: ZenohBus, period_s: float) -> Generator[None]:
    """Another program that publishes scans of free space for 5 m around."""
    publisher, chance = bus.publisher(topics.SCAN), random.Random(1)

    async def speak() -> None:
        scans: list[LaserScan] = [free_scan(chance) for _ in range(50)]
        number = 0
        while True:
            publisher.put(scans[number % len(scans)])
            number += 1
            await asyncio.sleep(period_s)

    speaking = asyncio.ensure_future(speak())
    try:
        yield
    finally:
        speaking.cancel()


@pytest.mark.timed  # a drive of 19 s; its twins in virtual time are the faults wire_second_lidar_*
@pytest.mark.parametrize("period_s", [PERIOD_S, 0.001], ids=["steady", "flood"])
async def test_a_second_writer_of_scan_stops_the_robot_by_name_and_when_it_ends_the_lidar_is_heard_again(
    tmp_path: Path, period_s: float
) -> None:
    """The real lidar pauses once; it must not be refused permanently."""
    async with robot(tmp_path) as subject, foreign_client(subject) as foreigner, approach(subject) as way:
        await subject.drive("w" * 5, 0.5)
        await way.until_within(2.5, "w" * 5)
        said: set[str] = set()

        def is_measured() -> bool:
            way.look()
            said.update(subject.status.reasons)
            return "SENSOR_CONFLICT" in said

        with scans_of_free_space(foreigner, period_s):
            try:
                await subject.until(is_measured, "SENSOR_CONFLICT")
            finally:
                await ask_faults(subject, "silent")
                await subject.never(way.look, "", 0.6)
                await ask_faults(subject, "none")
                await way.drive_on(AT_PILLAR_S)
        assert way.least_m >= LEAST_M
        subject.type("s")
        await subject.ready()
        await way.drive_on(AT_PILLAR_S)
        assert way.least_m >= LEAST_M, "the real lidar is not heard"
