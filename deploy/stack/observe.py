"""Records the robot's messages, with the time of each arrival by `time.monotonic`."""

import asyncio
import itertools
import math
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.samples import Command, is_still
from wire import topics
from wire.bus import Bus, BusError, wait_until
from wire.messages import LaserScan, Odometry, SafetyStatus, Twist, yaw_of
from wire.zenoh_bus import BusConfig, open_bus

DEPTH = 256
KEPT = 8192
"""Samples of each kind: more than two minutes at 50 Hz."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A sample of `odom`."""

    arrival_s: float
    x_m: float
    y_m: float
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_still(self) -> bool:
        return is_still(self.linear_m_s, self.angular_rad_s)

    def position_at(self, time_s: float) -> tuple[float, float]:
        """Extrapolate the position at constant velocity; odometry period is 20 ms, or 1.2 cm at 0.6 m/s."""
        return (self.x_m, self.y_m) if self.is_still else self._ahead(time_s - self.arrival_s)

    def _ahead(self, duration_s: float) -> tuple[float, float]:
        return self.x_m + self.course[0] * duration_s, self.y_m + self.course[1] * duration_s

    course: tuple[float, float] = (0.0, 0.0)
    """Velocity in the odometry frame [m/s]."""


@dataclass(frozen=True, slots=True)
class State:
    """A sample of the supervisor's status."""

    arrival_s: float
    status: SafetyStatus

    @property
    def is_stopped(self) -> bool:
        return self.status.mode == SafetyStatus.STOPPED


@dataclass(slots=True)
class Record:
    """The newest `KEPT` samples of each kind, oldest first."""

    commands: deque[Command] = field(default_factory=lambda: deque[Command](maxlen=KEPT))
    motions: deque[Motion] = field(default_factory=lambda: deque[Motion](maxlen=KEPT))
    states: deque[State] = field(default_factory=lambda: deque[State](maxlen=KEPT))
    nearest_beams: deque[float] = field(default_factory=lambda: deque[float](maxlen=KEPT))
    """The shortest beam of each scan [m]."""
    alive: set[str] = field(default_factory=set[str])

    def commands_since(self, time_s: float) -> Iterator[Command]:
        return itertools.dropwhile(lambda c: c.arrival_s < time_s, self.commands)

    def motions_since(self, time_s: float) -> Iterator[Motion]:
        return itertools.dropwhile(lambda m: m.arrival_s < time_s, self.motions)

    def states_since(self, time_s: float) -> Iterator[State]:
        return itertools.dropwhile(lambda s: s.arrival_s < time_s, self.states)


class Observer:
    """Subscribes to the robot's messages and keeps them."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.seen = Record()
        self._wake = asyncio.Event()
        self._alive = bus.watch_alive(self._wake)
        self._commands = bus.subscribe(topics.CMD_VEL, depth=DEPTH, wake=self._wake)
        self._odometry = bus.subscribe(topics.ODOM, depth=DEPTH, wake=self._wake)
        self._status = bus.subscribe(topics.STATUS, depth=DEPTH, wake=self._wake)
        self._scans = bus.subscribe(topics.SCAN, wake=self._wake)

    def take(self) -> Record:
        """Add the samples that arrived since the last call, and return the record."""
        for change in self._alive.take():
            (self.seen.alive.add if change.alive else self.seen.alive.discard)(change.node)
        for arrival in self._commands.take():
            if arrival.message is not None:
                self.seen.commands.append(_command(arrival.arrival_s, arrival.message))
        for arrival in self._odometry.take():
            if arrival.message is not None:
                self.seen.motions.append(_motion(arrival.arrival_s, arrival.message))
        for arrival in self._status.take():
            if arrival.message is not None:
                self.seen.states.append(State(arrival.arrival_s, arrival.message))
        scan = self._scans.latest()
        if scan is not None and scan.message is not None:
            self.seen.nearest_beams.append(_nearest_m(scan.message))
        return self.seen

    async def until(self, condition: Callable[[Record], bool], limit_s: float) -> bool:
        """Wait until the condition holds; return whether it did within `limit_s`."""
        return await seen_within(limit_s, self._wake, lambda: condition(self.take()))

    async def watch(self, duration_s: float) -> float:
        """Record for a while; return the time of the start."""
        began_s = time.monotonic()
        await self.until(lambda _: False, duration_s)
        return began_s


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
    """Connect an observer while the context is open.

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


def _command(arrival_s: float, twist: Twist) -> Command:
    return Command(arrival_s, twist.linear.x, twist.angular.z)


def _motion(arrival_s: float, odometry: Odometry) -> Motion:
    pose, twist = odometry.pose.pose, odometry.twist.twist
    yaw_rad, v = yaw_of(pose.orientation), twist.linear.x
    course = (v * math.cos(yaw_rad), v * math.sin(yaw_rad))
    return Motion(arrival_s, pose.position.x, pose.position.y, v, twist.angular.z, course)


def _nearest_m(scan: LaserScan) -> float:
    beams = np.asarray(scan.ranges)
    beams = beams[np.isfinite(beams)]
    return float(beams.min()) if beams.size else math.inf
