"""The sensors of a robot in a free room, for the supervisor: `python -m bench.peers.feeder ENDPOINT`.

Its base follows each command at once.
"""

import asyncio
import itertools
import sys

from bench.rig import scenery
from bench.rig.feed import BEAMS, ODOM_HZ, SCAN_HZ, at_rate, client, feeding, scan
from wire import topics
from wire.messages import odometry

SCANS = 64


async def feed(endpoint: str) -> None:
    ranges = itertools.cycle(scenery.scans(BEAMS, SCANS, wall_m=scenery.ROOM_M))
    velocity = 0.0, 0.0
    async with client(endpoint) as bus:
        cmd_vel = bus.subscribe(topics.CMD_VEL)
        scans, odometries = bus.publisher(topics.SCAN), bus.publisher(topics.ODOM)

        def tell_motion() -> None:
            nonlocal velocity
            arrival = cmd_vel.latest()
            if arrival is not None and arrival.message is not None:
                velocity = arrival.message.linear.x, arrival.message.angular.z
            odometries.put(odometry((0.0, 0.0, 0.0), velocity))

        async with feeding(
            [at_rate(SCAN_HZ, lambda: scans.put(scan(next(ranges)))), at_rate(ODOM_HZ, tell_motion)]
        ):
            await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(feed(sys.argv[1]))
