"""A robot in one event loop: the real services on a perfect network, and a scripted operator."""

import asyncio
import itertools
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager

import numpy as np

from sim.config import SimSection
from sim.plant import Plant
from sim.service import SimService
from supervisor.base_record import BaseRecord
from supervisor.blackbox.people import People
from supervisor.blackbox.recorder import BlackBox
from supervisor.config import SupervisorSection
from supervisor.estop_record import MemoryRecord, Record
from supervisor.law.model import LawConfig
from supervisor.service import SupervisorService
from virtual.network import VirtualBus, VirtualNetwork
from wire import messages, topics
from wire.bus import Subscription
from wire.host.pauses import never_suspended
from wire.messages import (
    LaserScan,
    Message,
    Odometry,
    SafetyStatus,
    Twist,
    encode,
    header,
    planar_twist,
)
from wire.stamp import Stamp

SIM = SimSection(imu_hz=1.0)
"""The default configuration; the inertial unit is slow, because no service uses it."""


def laser_scan(ranges: np.ndarray) -> LaserScan:
    """360 beams, counter-clockwise from straight behind."""
    return messages.laser_scan(ranges.astype(np.float32), range_m=(0.1, 12.0), period_s=0.05)


class Rig:
    """The network, an outside observer as its hub, and a scripted source."""

    def __init__(self) -> None:
        self.network = VirtualNetwork()
        self.network.tap = self._encode_unheard
        self.outsider = self.network.open_hub("outsider")
        self.cmd_vel: Subscription[Twist] = self.outsider.subscribe(topics.CMD_VEL, depth=10_000)
        self.status: Subscription[SafetyStatus] = self.outsider.subscribe(topics.STATUS, depth=10_000)
        self.odom: Subscription[Odometry] = self.outsider.subscribe(topics.ODOM)
        self.loop = asyncio.get_running_loop()
        self.velocity = (0.0, 0.0)
        self.newest_output = (0.0, 0.0)
        self.newest_status = SafetyStatus(header(""))

    def _encode_unheard(self, _node: str, key: str, message: Message, _stamp: Stamp) -> None:
        """Encode a message without subscribers, to check that it can be encoded; the network encodes all others."""
        if not self.network.is_heard(key):
            encode(message)

    @asynccontextmanager
    async def supervisor(
        self,
        config: SupervisorSection | None = None,
        black_box: BlackBox | None = None,
        estop_record: Record | None = None,
        suspended_s: Callable[[], float] = never_suspended,
        law: LawConfig | None = None,
        base_record: BaseRecord | None = None,
        people: People | None = None,
    ) -> AsyncGenerator[VirtualBus]:
        bus = self.network.open_joined(topics.SUPERVISOR)
        stop = asyncio.Event()
        record = estop_record or MemoryRecord()
        service = SupervisorService(
            bus,
            config or SupervisorSection(),
            black_box,
            record,
            suspended_s,
            law=law,
            base_record=base_record,
            people=people,
        )
        running = asyncio.create_task(service.run(stop))
        try:
            yield bus
        finally:
            stop.set()
            await running
            await bus.close()

    @asynccontextmanager
    async def sim(
        self, plant: Plant, suspended_s: Callable[[], float] = never_suspended, config: SimSection = SIM
    ) -> AsyncGenerator[VirtualBus]:
        bus = self.network.open_joined(topics.SIM)
        stop = asyncio.Event()
        running = asyncio.create_task(SimService(bus, config, plant, suspended_s=suspended_s).run(stop))
        try:
            yield bus
        finally:
            stop.set()
            await running

    @asynccontextmanager
    async def lidar(self, distance_m: float = 3.0) -> AsyncGenerator[np.ndarray]:
        """A lidar at 20 Hz in a round room; the readings may be changed while it runs."""
        ranges = np.full(360, distance_m)
        publisher = self.network.open_joined("lidar").publisher(topics.SCAN)
        jitter = itertools.cycle((0.0, 1e-4))  # no real scan repeats itself
        async with self.every(0.05, lambda: publisher.put(laser_scan(ranges + next(jitter)))):
            yield ranges

    @asynccontextmanager
    async def source(self, name: str = topics.TELEOP) -> AsyncGenerator[VirtualBus]:
        """A heartbeat of `velocity` at 20 Hz, with a token."""
        bus = self.network.open_joined(name)
        bus.declare_alive(name)
        publisher = bus.publisher(topics.source_cmd_vel(name))
        async with self.every(0.05, lambda: publisher.put(planar_twist(*self.velocity))):
            yield bus

    @asynccontextmanager
    async def every(self, period_s: float, act: object) -> AsyncGenerator[None]:
        assert callable(act)

        async def repeat() -> None:
            while True:
                act()
                await asyncio.sleep(period_s)

        task = asyncio.create_task(repeat())
        try:
            yield
        finally:
            task.cancel()

    async def pass_time(self, seconds: float) -> None:
        await asyncio.sleep(seconds)  # the clock is virtual: this takes no time
        for arrival in self.status.take():
            if arrival.message is not None:
                self.newest_status = arrival.message

    def output(self) -> tuple[float, float]:
        """The newest command on `cmd_vel`."""
        arrival = self.cmd_vel.latest()
        if arrival is not None and arrival.message is not None:
            self.newest_output = (arrival.message.linear.x, arrival.message.angular.z)
        return self.newest_output

    async def drive(self, linear_m_s: float, angular_rad_s: float = 0.0) -> None:
        """Send neutral until armed, then this motion until it appears on `cmd_vel`."""
        self.velocity = (0.0, 0.0)
        await self.pass_time(0.5)
        assert self.newest_status.reasons == []
        self.velocity = (linear_m_s, angular_rad_s)
        await self.pass_time(0.1)
        assert self.output() != (0.0, 0.0)
