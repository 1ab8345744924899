"""Runs a supervisor, or the whole simulated robot, and feeds a supervisor with the data of a robot at the robot's rates.

`python -m bench.rig.feed ENDPOINT` plays a robot in a process of its own.
"""

import asyncio
import itertools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncGenerator, Callable, Coroutine, Generator, Iterable, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

from bench.rig import scenery
from bench.rig.program import running
from deploy.stack.errors import ignore, interrupts
from deploy.stack.launch import free_loopback_endpoint
from deploy.stack.statedir import StateDir
from wire import topics
from wire.bus import Arrival, BusError, Subscription
from wire.message_types import MODES, M
from wire.messages import LaserScan, SafetyStatus, laser_scan, odometry
from wire.topics import Topic
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

BEAMS, SCANS = 360, 64
SCAN_HZ, ODOM_HZ = 20.0, 50.0
START_S, UP_LIMIT_S = 20.0, 60.0


@dataclass(frozen=True)
class Supervisor:
    """A running supervisor."""

    endpoint: str
    pid: int


@contextmanager
def supervisor(module: str = "supervisor", options: Sequence[str] = ()) -> Generator[Supervisor]:
    """Run a supervisor, or another module in its place, while the context is open.

    Args:
        module: what runs.
        options: of its command line, beside the endpoint.

    Raises:
        RuntimeError: the context body timed out or lost the bus; the message contains the error and the end of the log.
    """
    endpoint = free_loopback_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "supervisor.log"
        command = [sys.executable, "-m", module, "--endpoint", endpoint, *options]
        environment = os.environ | {"LIFELINE_STATE_DIR": folder}
        with (
            log.open("wb") as file,
            running(command, environment, stdout=file, stderr=file) as process,
        ):
            try:
                yield Supervisor(endpoint, process.pid)
            except (TimeoutError, BusError) as error:
                reason = str(error) or "no answer in time"
                raise RuntimeError(
                    f"the {module} cannot be measured: {reason}; its log ends with:\n{log.read_text()[-600:]}"
                ) from error


@dataclass(frozen=True)
class SimulatedRobot:
    """A running sim and supervisor."""

    state: StateDir
    endpoint: str
    up_s: float
    """Duration of `lifeline up --detach`, which ends when every node is alive."""


@contextmanager
def simulated_robot() -> Generator[SimulatedRobot]:
    """Start the simulated robot as its users do, without teleop, and take it down at the end; the first signal raises `Interrupted`.

    Raises:
        RuntimeError: it does not start.
    """
    with tempfile.TemporaryDirectory(prefix="lifeline-", ignore_cleanup_errors=True) as folder:
        state, endpoint = StateDir(Path(folder).resolve()), free_loopback_endpoint()
        options = ("--state-dir", folder)
        with interrupts():
            try:
                try:
                    began_s = time.perf_counter()
                    _lifeline("up", "--detach", "--no-viewer", "--endpoint", endpoint, *options)
                    yield SimulatedRobot(state, endpoint, time.perf_counter() - began_s)
                finally:
                    ignore()
            finally:
                _lifeline("down", *options)


def _lifeline(*arguments: str) -> None:
    command = [sys.executable, "-c", "from lifeline.cli.entry import main; main()", *arguments]
    # In a separate process session, so that Ctrl-C does not interrupt the command.
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=UP_LIMIT_S, start_new_session=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"lifeline {arguments[0]} failed: {done.stderr}")


@asynccontextmanager
async def client(endpoint: str) -> AsyncGenerator[ZenohBus]:
    """Open a client bus while the context is open."""
    async with asyncio.timeout(START_S):
        bus = await open_bus(BusConfig(endpoint), "client")
    try:
        yield bus
    finally:
        await bus.close()


@asynccontextmanager
async def feeding(feeds: Iterable[Coroutine[None, None, None]]) -> AsyncGenerator[None]:
    """Run the coroutines concurrently while the context is open."""
    tasks = [asyncio.ensure_future(feed) for feed in feeds]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


class Stream(Generic[M]):
    """The messages of a topic; `next` waits for one."""

    def __init__(self, bus: ZenohBus, topic: Topic[M], depth: int = 64) -> None:
        self._wake = asyncio.Event()
        self._inbox: Subscription[M] = bus.subscribe(topic, depth=depth, wake=self._wake)
        self._runs: set[bytes | None] = {None}

    def take(self) -> list[Arrival[M]]:
        return self._inbox.take()

    async def next(
        self, holds: Callable[[M], bool] = lambda _: True, *, of_new_run: bool = False
    ) -> tuple[float, M]:
        """Return the next message and its arrival time [s]; drop those before it.

        Args:
            holds: a condition for the message.
            of_new_run: whether no message of the same run of its sender may have been returned before.

        Raises:
            TimeoutError: there is none in time.
        """
        async with asyncio.timeout(START_S):
            while True:
                self._wake.clear()
                for arrival in self.take():
                    run = None if arrival.stamp is None else arrival.stamp.gid
                    is_expected = not of_new_run or run not in self._runs
                    if is_expected and arrival.message is not None and holds(arrival.message):
                        self._runs.add(run)
                        return arrival.arrival_s, arrival.message
                await self._wake.wait()


async def at_rate(rate_hz: float, act: Callable[[], object]) -> None:
    loop = asyncio.get_running_loop()
    next_s = loop.time()
    while True:
        act()
        next_s = max(next_s + 1.0 / rate_hz, loop.time())
        await asyncio.sleep(next_s - loop.time())


def scan(ranges: scenery.Ranges) -> LaserScan:
    """Return a LaserScan that covers a full turn."""
    return laser_scan(
        ranges,
        angle_min_rad=scenery.ANGLE_MIN,
        angle_increment_rad=scenery.angle_increment(len(ranges)),
        range_m=(scenery.RANGE_MIN_M, scenery.RANGE_MAX_M),
        period_s=1.0 / SCAN_HZ,
    )


class Robot:
    """Plays the lidar and the base of a robot on a bus; the base follows each command at once, at its place.

    Args:
        bus: of a client.
        ranges: the scans, again and again.
    """

    def __init__(self, bus: ZenohBus, ranges: Iterable[scenery.Ranges]) -> None:
        self.ranges = itertools.cycle(ranges)
        self.velocity = (0.0, 0.0)
        """Linear [m/s] and angular [rad/s]: the last command."""
        self.arrivals_s: list[float] = []
        """When each command arrived."""
        self._commands = bus.subscribe(topics.CMD_VEL, depth=100_000)
        self._scans, self._odometry = bus.publisher(topics.SCAN), bus.publisher(topics.ODOM)

    def feeds(self) -> list[Coroutine[None, None, None]]:
        """Return what sends scans and odometry at their rates."""
        return [
            at_rate(SCAN_HZ, lambda: self._scans.put(scan(next(self.ranges)))),
            at_rate(ODOM_HZ, self._move),
        ]

    def _move(self) -> None:
        for arrival in self._commands.take():
            self.arrivals_s.append(arrival.arrival_s)
            if arrival.message is not None:
                self.velocity = arrival.message.linear.x, arrival.message.angular.z
        self._odometry.put(odometry(self.pose(), self.velocity))

    def pose(self) -> tuple[float, float, float]:
        """Return x [m], y [m] and yaw [rad] after another period of the odometry."""
        return 0.0, 0.0, 0.0


def mode_of(status: SafetyStatus) -> str:
    """Return the mode's name and the stop reasons."""
    return " ".join([MODES[status.mode], *status.reasons])


async def play(endpoint: str) -> None:
    """Play a robot in a free room until this task is cancelled."""
    async with client(endpoint) as bus:
        robot = Robot(bus, scenery.scans(BEAMS, SCANS, wall_m=scenery.ROOM_M))
        async with feeding(robot.feeds()):
            await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(play(sys.argv[1]))
