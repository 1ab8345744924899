"""Zenoh client that ignores the protocol: `python -m faults.real.rig.attacker ENDPOINT NAMESPACE`.

It takes orders on stdin, one JSON object per line, and answers each with a line when it has begun:

    {"attack": "malformed", "seed": 7, "for_s": 0.8}    an attack of attacks.py
    {"attack": "stop"}                                  end the attack; the answer is the number of sent messages
"""

import asyncio
import signal
import sys
import time
from collections import deque
from typing import Any

from faults.attacks import Attacker, Shot
from faults.real.rig.helper_process import serve
from wire import topics
from wire.messages import Twist
from wire.stamp import Stamp
from wire.zenoh.bus import BusConfig, open_bus

HEARD = 100


async def _main(endpoint: str, namespace: str) -> None:
    bus = await open_bus(BusConfig(endpoint, namespace), "client")
    commands = bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=HEARD)
    heard: deque[tuple[Twist, Stamp]] = deque(maxlen=HEARD)

    def put(shot: Shot) -> None:
        bus.put_raw(f"{namespace}/{shot.key}", shot.payload, shot.attachment)

    def newly_heard() -> deque[tuple[Twist, Stamp]]:
        heard.extend(
            (one.message, one.stamp) for one in commands.take() if one.message is not None and one.stamp
        )
        return heard

    attacker = Attacker(bus, put, (time.monotonic_ns, time.time_ns), newly_heard)

    async def obey(order: dict[str, Any]) -> object:
        if order["attack"] == "stop":
            return attacker.end()
        attacker.begin(order["attack"], order["seed"], order["for_s"])
        await asyncio.sleep(0)
        return "under way"

    print("ready", flush=True)
    try:
        await serve(obey)
    finally:
        await bus.close()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign handles Ctrl-C
    asyncio.run(_main(*sys.argv[1:]))
