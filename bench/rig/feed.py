"""Feeds the processes under measurement at the robot's rates, and runs the supervisor that they use."""

import asyncio
import os
import subprocess
import sys
import tempfile
from collections.abc import AsyncGenerator, Callable, Coroutine, Generator, Iterable, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.rig import scenery
from bench.rig.terminal import end
from deploy.stack.launch import free_loopback_endpoint
from wire.bus import BusError
from wire.messages import LaserScan, SafetyStatus, laser_scan
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

BEAMS = 360
SCAN_HZ, ODOM_HZ = 20.0, 50.0
START_S = 20.0
MODES = ("STOPPED", "READY", "DRIVING", "LIMITED")


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
        with log.open("wb") as file:
            process = subprocess.Popen(
                [sys.executable, "-m", module, "--endpoint", endpoint, *options],
                stdout=file,
                stderr=file,
                env=os.environ | {"LIFELINE_STATE_DIR": folder},
            )
        try:
            yield Supervisor(endpoint, process.pid)
        except (TimeoutError, BusError) as error:
            reason = str(error) or "no answer in time"
            raise RuntimeError(
                f"the {module} cannot be measured: {reason}; its log ends with:\n{log.read_text()[-600:]}"
            ) from error
        finally:
            end(process)


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


def mode_of(status: SafetyStatus) -> str:
    """Return the mode's name and the stop reasons."""
    return " ".join([MODES[status.mode], *status.reasons])
