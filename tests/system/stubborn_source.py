"""A command source without recovery: neutral first, then 0.5 m/s permanently, whatever happens.

python stubborn_source.py ENDPOINT     (drives from the first line on its stdin)
"""

import asyncio
import sys

from wire import topics
from wire.messages import planar_twist
from wire.zenoh.bus import BusConfig, open_bus


async def main() -> None:
    bus = await open_bus(BusConfig(sys.argv[1]), "client")
    bus.declare_alive(topics.TELEOP)
    publisher = bus.publisher(topics.source_cmd_vel(topics.TELEOP))
    told = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), told.set)
    while True:
        publisher.put(planar_twist(0.5 if told.is_set() else 0.0, 0.0))
        await asyncio.sleep(0.05)


asyncio.run(main())
