"""An example of a command source: drive forward and back at 0.1 m/s, 3 s each way.

    python examples/command_source.py [ENDPOINT]

The supervisor must know the source's name: docs/how-to/command-source.md says how.
"""

import asyncio
import sys
from collections.abc import Iterator
from contextlib import suppress

from wire import topics
from wire.messages import planar_twist
from wire.zenoh.bus import DEFAULT_ENDPOINT, BusConfig, open_bus

SOURCE = "patrol"
PERIOD_S = 0.05
"""Well below the supervisor's `command_timeout_s` (0.2 s): an older command stops the robot."""


def speeds_m_s() -> Iterator[float]:
    """Yield zero first, because only a neutral command arms a source; then forward and back."""
    yield from [0.0] * 20
    while True:
        yield from [0.1] * 60
        yield from [-0.1] * 60


async def main() -> None:
    bus = await open_bus(BusConfig(sys.argv[1] if len(sys.argv) > 1 else DEFAULT_ENDPOINT), "client")
    commands = bus.publisher(topics.source_cmd_vel(SOURCE))
    bus.declare_alive(SOURCE)  # if this process dies, the robot stops within milliseconds
    try:
        for speed_m_s in speeds_m_s():
            commands.put(planar_twist(speed_m_s, 0.0))
            await asyncio.sleep(PERIOD_S)
    finally:
        commands.put(planar_twist(0.0, 0.0))  # zero before leaving: the source is not reported as lost
        await asyncio.sleep(PERIOD_S)  # Zenoh sends the end of the session before samples that still wait
        await bus.close()


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        asyncio.run(main())
