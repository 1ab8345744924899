"""The least that the supervisor's place on the wire costs: it hears and says as much, and has no law.

`python -m bench.relay --endpoint ENDPOINT` is the hub, decodes all that arrives, and publishes a zero at every
tick and a status ten times a second. What the supervisor takes beyond it is the law, the black box and the steps
between two ticks.
"""

import argparse
import asyncio

from wire import topics
from wire.bus import wait_until
from wire.messages import SafetyStatus, header, zero_twist
from wire.process import run_process
from wire.zenoh_bus import BusConfig, open_bus

TICK_S = 0.02
TICKS_PER_STATUS = 5
COMMAND_DEPTH = 32


async def relay(endpoint: str, stop: asyncio.Event) -> None:
    """Until `stop` is set."""
    bus = await open_bus(BusConfig(endpoint), "hub")
    try:
        commands = bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=COMMAND_DEPTH)
        scans = bus.subscribe(topics.SCAN)
        odometry = bus.subscribe(topics.ODOM)
        cmd_vel, statuses = bus.publisher(topics.CMD_VEL), bus.publisher(topics.STATUS)
        loop = asyncio.get_running_loop()
        ticks, heard, next_s = 0, 0, loop.time()
        while not stop.is_set():
            await wait_until(stop, next_s)
            next_s = max(next_s + TICK_S, loop.time())
            commands.take()
            odometry.take()
            heard += len(scans.take())
            cmd_vel.put(zero_twist())
            if ticks % TICKS_PER_STATUS == 0:
                statuses.put(SafetyStatus(header("base_link"), scans_accepted=heard))
            ticks += 1
    finally:
        await bus.close()


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.relay", description="What the supervisor is measured against."
    )
    parser.add_argument("--endpoint", required=True, help="where to listen")
    endpoint = parser.parse_args().endpoint

    async def run(stop: asyncio.Event) -> int:
        await relay(endpoint, stop)
        return 0

    run_process("relay", run)


if __name__ == "__main__":
    main()
