"""Reference process with the supervisor's traffic but without a law, to measure the cost of the traffic.

`python -m bench.relay --endpoint ENDPOINT` runs the hub, decodes every message, and publishes the newest command each
tick and a status ten times a second. The difference to the supervisor is the cost of the law, the black box and
the steps between two ticks.
"""

import asyncio
import sys

from wire import topics
from wire.bus import wait_until
from wire.host.process import run_process
from wire.messages import SafetyStatus, header, zero_twist
from wire.zenoh.bus import BusConfig, open_bus

TICK_S = 0.02
TICKS_PER_STATUS = 5
COMMAND_DEPTH = 32


async def relay(stop: asyncio.Event) -> int:
    """Run the hub and relay until `stop` is set; return the exit code."""
    _, endpoint = sys.argv[1:]
    bus = await open_bus(BusConfig(endpoint), "hub")
    try:
        commands = bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=COMMAND_DEPTH)
        scans = bus.subscribe(topics.SCAN)
        odometry = bus.subscribe(topics.ODOM)
        cmd_vel, statuses = bus.publisher(topics.CMD_VEL), bus.publisher(topics.STATUS)
        loop = asyncio.get_running_loop()
        ticks, heard, next_s, newest = 0, 0, loop.time(), zero_twist()
        while not stop.is_set():
            await wait_until(stop, next_s)
            next_s = max(next_s + TICK_S, loop.time())
            for arrival in commands.take():
                newest = arrival.message or newest
            odometry.take()
            heard += len(scans.take())
            cmd_vel.put(newest)
            if ticks % TICKS_PER_STATUS == 0:
                statuses.put(SafetyStatus(header("base_link"), scans_accepted=heard))
            ticks += 1
    finally:
        await bus.close()
    return 0


if __name__ == "__main__":
    run_process("relay", relay)
