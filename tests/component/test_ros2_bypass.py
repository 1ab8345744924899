"""What takes the place of the process `ros2` without Lifeline: what reaches the base, and what never does."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import cast

import pytest

from passport import bypass, ros2_bypass
from passport.bypass import Valve
from passport.child import READY
from ros2.config import Ros2Section
from supervisor.estop_record import MemoryRecord
from tests.component.rig import Rig
from tests.component.ros2_rig import CMD_VEL, ODOM, SCAN, VirtualSession
from tests.unit.ros2.fake_ros import FakeRos
from tests.unit.ros2.programs import WALL_S, Program
from virtual.network import VirtualBus
from wire import cdr, topics
from wire.cdr import STANDSTILL, Planar
from wire.messages import encode, odometry, planar_twist
from wire.zenoh.session import ZenohSession

MOTION, SLOWER = Planar(0.4, 0.1), Planar(0.2, 0.0)
AHEAD_S = 5.0
"""The base's clock less this computer's."""


class Robot:
    """A ROS 2 robot without Lifeline.

    Args:
        stamped: whether the base listens to TwistStamped.
    """

    def __init__(self, *, stamped: bool = False) -> None:
        self.rig, self.node = Rig(), FakeRos()
        self.session = VirtualSession(self.rig.network.open_joined(topics.ROS2))
        self.config = Ros2Section(stamped=stamped)
        self._odometries = Program()

    @asynccontextmanager
    async def running(self) -> AsyncGenerator[VirtualBus]:
        """Run it beside a bus that stands for the hub."""
        stop = asyncio.Event()
        session = cast("ZenohSession", self.session)
        running = asyncio.create_task(
            ros2_bypass.pass_on(session, self.node, self.config, (topics.SCAN.key,), stop)
        )
        try:
            yield self.rig.network.open_joined(topics.SUPERVISOR)
        finally:
            stop.set()
            await running

    def measure(self) -> None:
        """Let the base publish odometry at rest, stamped by its own clock."""
        now_s = self.rig.loop.time()
        message = odometry((0.0, 0.0, 0.0), STANDSTILL, time_ns=round((now_s + WALL_S + AHEAD_S) * 1e9))
        sample = self._odometries.sample(encode(message), now_s)
        for heard in self.node.heard[ODOM]:
            heard(sample._replace(clock_ns=round(WALL_S * 1e9)))

    async def pass_time(self, seconds: float) -> list[Planar | None]:
        """Let time pass; return what was published on the base's command topic."""
        self.node.published[CMD_VEL] = []
        await self.rig.pass_time(seconds)
        return self.outputs()

    def outputs(self) -> list[Planar | None]:
        stamped = self.config.stamped
        return [
            cdr.planar_of(cdr.twist_of(payload, stamped=stamped) or b"")
            for payload in self.node.published[CMD_VEL]
        ]


async def test_each_velocity_is_published_once_as_it_arrives_and_zero_at_the_end(
    capsys: pytest.CaptureFixture[str],
) -> None:
    robot = Robot()
    async with robot.running() as hub:
        assert await robot.pass_time(0.1) == []
        assert capsys.readouterr().out == f"{READY}\n"
        commands = hub.publisher(topics.CMD_VEL)
        for velocity in (MOTION, SLOWER):
            commands.put(planar_twist(*velocity))
        assert await robot.pass_time(0.01) == [MOTION, SLOWER]
        assert await robot.pass_time(5.0) == []
        commands.put(planar_twist(*STANDSTILL))
        assert await robot.pass_time(1.0) == [STANDSTILL]
        commands.put(planar_twist(*MOTION))
        assert await robot.pass_time(0.01) == [MOTION]
    assert robot.outputs() == [MOTION, STANDSTILL]


async def test_scans_and_odometry_reach_the_hub() -> None:
    robot = Robot()
    async with robot.running() as hub:
        await robot.pass_time(0.1)
        arrived = hub.subscribe(topics.ODOM)
        robot.measure()
        await robot.pass_time(0.1)
        assert len(arrived.take()) == 1
        assert list(robot.node.heard) == [SCAN, ODOM, "/estop"]


async def test_an_e_stop_of_the_robot_latches_the_hub_which_sends_zero_until_its_reset() -> None:
    robot, record, stop = Robot(), MemoryRecord(), asyncio.Event()
    async with robot.running() as hub:
        passing = asyncio.create_task(bypass.pass_on(hub, ["teleop"], Valve(["teleop"], record), stop))
        await robot.pass_time(0.1)
        commands = robot.rig.network.open_joined("teleop").publisher(topics.source_cmd_vel("teleop"))
        commands.put(planar_twist(*MOTION))
        assert await robot.pass_time(0.5) == [MOTION]
        robot.node.heard["/estop"][0](Program().sample(cdr.TRUE, robot.rig.loop.time()))
        commands.put(planar_twist(*MOTION))
        outputs = await robot.pass_time(1.0)
        assert record.latched
        assert set(outputs[-19:]) == {STANDSTILL}
        assert len(outputs) >= 20
        stop.set()
        await passing


async def test_motion_passes_to_a_base_that_checks_stamps_only_while_its_clock_is_known_and_zero_always() -> (
    None
):
    robot = Robot(stamped=True)
    async with robot.running() as hub:
        await robot.pass_time(0.1)
        commands = hub.publisher(topics.CMD_VEL)
        robot.measure()
        commands.put(planar_twist(*MOTION))
        commands.put(planar_twist(*STANDSTILL))
        assert await robot.pass_time(0.02) == [STANDSTILL]
        for _ in range(50):
            robot.measure()
            await robot.pass_time(0.02)
        commands.put(planar_twist(*MOTION))
        assert await robot.pass_time(0.01) == [MOTION]
        await robot.pass_time(1.0)  # without odometry
        commands.put(planar_twist(*MOTION))
        assert await robot.pass_time(0.01) == []


async def test_the_base_shows_in_the_listings_as_long_as_it_is_connected() -> None:
    robot = Robot()
    async with robot.running():
        await robot.pass_time(0.1)
        assert [name.partition("/")[0] for name in robot.session.bus.own] == [topics.ROS2, topics.ROS2]
    assert robot.session.bus.own == []
