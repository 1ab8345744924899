"""A robot in one event loop: the real services on a memory network, and a person at a keyboard's place."""

import asyncio
import itertools
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import numpy as np

from sim.config import SimSection
from sim.plant import Plant
from sim.service import SimService
from supervisor.blackbox import BlackBox
from supervisor.config import SupervisorSection
from supervisor.estop_record import Record
from supervisor.service import SupervisorService
from virtual.memory_bus import MemoryBus, MemoryNetwork, MemoryPublisher
from wire import messages, topics
from wire.bus import Subscription
from wire.messages import LaserScan, Odometry, SafetyStatus, Twist, header, planar_twist
from wire.suspend import never_suspended


def laser_scan(ranges: np.ndarray) -> LaserScan:
    """360 beams, counter-clockwise from straight behind."""
    return messages.laser_scan(ranges.astype(np.float32), range_m=(0.1, 12.0), period_s=0.05)


@dataclass
class Rig:
    """The network, what an outsider sees of it, and what a scripted source asks for."""

    network: MemoryNetwork = field(default_factory=MemoryNetwork)

    def __post_init__(self) -> None:
        self.outsider = MemoryBus(self.network)
        self.cmd_vel: Subscription[Twist] = self.outsider.subscribe(topics.CMD_VEL, depth=10_000)
        self.status: Subscription[SafetyStatus] = self.outsider.subscribe(topics.STATUS, depth=10_000)
        self.odom: Subscription[Odometry] = self.outsider.subscribe(topics.ODOM)
        self.loop = asyncio.get_running_loop()
        self.velocity = (0.0, 0.0)
        self.newest_output = (0.0, 0.0)
        self.newest_status = SafetyStatus(header(""))

    @asynccontextmanager
    async def supervisor(
        self,
        config: SupervisorSection | None = None,
        black_box: BlackBox | None = None,
        estop_record: Record | None = None,
        suspended_s: Callable[[], float] = never_suspended,
    ) -> AsyncGenerator[MemoryBus]:
        bus = MemoryBus(self.network)
        stop = asyncio.Event()
        service = SupervisorService(bus, config or SupervisorSection(), black_box, estop_record, suspended_s)
        running = asyncio.create_task(service.run(stop))
        try:
            yield bus
        finally:
            stop.set()
            await running

    @asynccontextmanager
    async def sim(
        self, plant: Plant, suspended_s: Callable[[], float] = never_suspended
    ) -> AsyncGenerator[MemoryBus]:
        bus = MemoryBus(self.network)
        stop = asyncio.Event()
        running = asyncio.create_task(SimService(bus, SimSection(), plant, suspended_s=suspended_s).run(stop))
        try:
            yield bus
        finally:
            stop.set()
            await running

    @asynccontextmanager
    async def lidar(self, distance_m: float = 3.0) -> AsyncGenerator[np.ndarray]:
        """A lidar at 20 Hz in a round room; the readings may be changed while it runs."""
        ranges = np.full(360, distance_m)
        publisher = MemoryBus(self.network).publisher(topics.SCAN)
        jitter = itertools.cycle((0.0, 1e-4))  # no real scan repeats itself
        async with self.every(0.05, lambda: publisher.put(laser_scan(ranges + next(jitter)))):
            yield ranges

    @asynccontextmanager
    async def source(self, name: str = topics.TELEOP) -> AsyncGenerator[MemoryBus]:
        """A heartbeat of `velocity` at 20 Hz, with a token."""
        bus = MemoryBus(self.network)
        bus.declare_alive(name)
        publisher: MemoryPublisher = bus.publisher(topics.source_cmd_vel(name))
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
        """Neutral until armed, then this motion, until it is on `cmd_vel`."""
        self.velocity = (0.0, 0.0)
        await self.pass_time(0.5)
        assert self.newest_status.reasons == []
        self.velocity = (linear_m_s, angular_rad_s)
        await self.pass_time(0.1)
        assert self.output() != (0.0, 0.0)
