"""Observe a running robot: which nodes are alive, the newest status, odometry and reports of the ROS 2 process."""

import asyncio
import time
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager

from deploy.stack.errors import DeployError
from deploy.stack.ros2_reports import Report, reports_of
from wire import topics
from wire.bus import Bus, BusError, wait_until
from wire.messages import Odometry, SafetyStatus
from wire.zenoh.bus import BusConfig, open_bus

DEPTH = 8
"""Diagnostics that wait: a base and the ROS 2 process may both write them."""


class Observer:
    """Keeps the newest of what a robot publishes; updated by `until`."""

    def __init__(self, bus: Bus) -> None:
        self.alive: set[str] = set()
        """The nodes that are alive."""
        self.status: SafetyStatus | None = None
        self.odometry: Odometry | None = None
        self.ros2: tuple[Report, ...] = ()
        """The reports of the ROS 2 process; empty without one."""
        self._wake = asyncio.Event()
        self._liveliness = bus.watch_alive(self._wake)
        self._statuses = bus.subscribe(topics.STATUS, wake=self._wake)
        self._odometry = bus.subscribe(topics.ODOM, wake=self._wake)
        self._diagnostics = bus.subscribe(topics.DIAGNOSTICS, depth=DEPTH, wake=self._wake)

    async def until(self, condition: Callable[["Observer"], bool], limit_s: float) -> bool:
        """Wait until the condition holds; return whether it did within `limit_s`."""

        def holds() -> bool:
            self._update()
            return condition(self)

        return await seen_within(limit_s, self._wake, holds)

    def _update(self) -> None:
        for change in self._liveliness.take():
            (self.alive.add if change.alive else self.alive.discard)(change.node)
        if (status := self._statuses.latest()) is not None:
            self.status = status.message
        if (odometry := self._odometry.latest()) is not None:
            self.odometry = odometry.message
        for diagnostics in self._diagnostics.take():
            if diagnostics.message is not None:
                self.ros2 = reports_of(diagnostics.message) or self.ros2


async def seen_within(limit_s: float, wake: asyncio.Event, is_seen: Callable[[], bool]) -> bool:
    """Check a condition at each wake-up; return whether it held in time. The loop's clock is `time.monotonic`."""
    deadline_s = time.monotonic() + limit_s
    while not is_seen():
        if time.monotonic() >= deadline_s:
            return False
        wake.clear()
        await wait_until(wake, deadline_s)
    return True


@asynccontextmanager
async def observing(config: BusConfig, limit_s: float) -> AsyncGenerator[Observer]:
    """Open an observer on a connection of its own.

    Raises:
        TimeoutError: no hub answers within `limit_s`.
        DeployError: the endpoint is invalid.
    """
    try:
        bus = await asyncio.wait_for(open_bus(config, "client"), limit_s)
    except BusError as error:
        raise DeployError(str(error)) from error
    try:
        yield Observer(bus)
    finally:
        await bus.close()
