"""Draws docs/images/dashboard.png: `python -m docs.generate.draw_dashboard`.

The picture is a real one: supervisor, simulator and teleop run, somebody presses the keys of a drive along the
aisle past a pillar, and the screen is taken as it is while the supervisor slows the robot down.
"""

import asyncio
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pyte

from bench.rig.nodes import supervisor
from bench.rig.program import running
from deploy.stack.reach import Observer
from docs.generate.screen import Screen, teleop
from docs.generate.terminal_picture import draw
from teleop.path.course import Pose
from wire import topics
from wire.messages import Odometry, Point, SafetyStatus
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

IMAGE = Path(__file__).parents[1] / "images" / "dashboard.png"
COLUMNS, ROWS = 112, 31
PATIENCE_S = 40.0
PILLAR_AHEAD_M, PILLAR_LEFT_M = 2.2, 0.5
KEYS = "wwwwww"
NEAR_M = 0.42
"""The screen is taken when the nearest obstacle is this near, and when it says so."""
WORDS = ("LIMITED", "COLLISION WARNING")


def take_screen() -> pyte.Screen:
    """The screen of a teleop that drives past a pillar, at its nearest.

    Raises:
        TimeoutError: the robot did not get there.
    """
    with supervisor() as hub:
        sim = [sys.executable, "-m", topics.SIM, "--endpoint", hub.endpoint]
        with running(sim, stderr=subprocess.DEVNULL):
            return asyncio.run(_drive(hub.endpoint))


async def _drive(endpoint: str) -> pyte.Screen:
    bus = await open_bus(BusConfig(endpoint), "client")
    try:
        return await _pass_pillar(bus, endpoint)
    finally:
        await bus.close()


async def _pass_pillar(bus: ZenohBus, endpoint: str) -> pyte.Screen:
    truths, robot, screen = bus.subscribe(topics.TRUTH), Observer(bus), Screen(COLUMNS, ROWS)

    async def until(condition: Callable[[SafetyStatus], bool]) -> None:
        if not await robot.until(lambda one: one.status is not None and condition(one.status), PATIENCE_S):
            raise TimeoutError("\n".join(screen.rows))

    with teleop(screen, "--endpoint", endpoint):
        await until(lambda status: status.mode == SafetyStatus.READY)
        truth = truths.latest()
        assert truth is not None, "the simulator of our own says where the robot is"
        assert truth.message is not None
        bus.publisher(topics.OBSTACLE).put(_beside_the_way(truth.message))
        screen.type(" ")
        await until(lambda status: "ESTOP" in status.reasons)
        screen.type("r")
        await until(lambda status: status.mode == SafetyStatus.READY)
        screen.type(KEYS)
        await until(lambda status: status.mode == SafetyStatus.LIMITED and status.nearest_m < NEAR_M)
        await until(lambda _: all(any(word in row for row in screen.rows) for word in WORDS))
        return screen.screen


def _beside_the_way(truth: Odometry) -> Point:
    """Where the pillar stands, in the world."""
    pose = Pose.of(truth)
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x_m = pose.x_m + PILLAR_AHEAD_M * cos - PILLAR_LEFT_M * sin
    y_m = pose.y_m + PILLAR_AHEAD_M * sin + PILLAR_LEFT_M * cos
    return Point(x_m, y_m, 0.0)


if __name__ == "__main__":
    draw(take_screen(), IMAGE)
