"""Plays the supervisor at an endpoint, also as another user, and drives the base that believes it.

    python -m tests.system.fake_hub ENDPOINT USER SPEED

holds the supervisor's token, sends commands of SPEED [m/s] with stamps and a status that shows a latched e-stop, and prints
"listens". For each line on its stdin, it prints how many odometry messages it has heard since the last one, and
the fastest speed in them [m/s]; it ends with its stdin.
"""

import asyncio
import os
import sys

from wire import topics
from wire.access import LOCAL_ROLES
from wire.bus_config import BusConfig
from wire.messages import Odometry, SafetyStatus, encode, header, planar_twist
from wire.reasons import StopReason
from wire.zenoh.bus import open_bus

PERIOD_S = 0.02


async def main(endpoint: str, speed_m_s: float) -> None:
    bus = await open_bus(BusConfig(endpoint, unproven=LOCAL_ROLES), "hub")
    token = bus.declare_alive(topics.SUPERVISOR)
    commands, statuses = bus.publisher(topics.CMD_VEL), bus.publisher(topics.STATUS)
    odometry = bus.subscribe(topics.ODOM, depth=5000)
    status = SafetyStatus(header(""), causes=[StopReason.ESTOP])
    speeds_m_s: list[float] = []

    over = asyncio.Event()

    def answer() -> None:
        if not sys.stdin.readline():
            over.set()
        print(len(speeds_m_s), f"{max(speeds_m_s, default=0.0):.3f}", flush=True)
        speeds_m_s.clear()

    asyncio.get_running_loop().add_reader(0, answer)
    print("listens", flush=True)
    while not over.is_set():
        commands.put(planar_twist(speed_m_s, 0.0))
        statuses.put(status)
        messages = (one.message for one in odometry.take())
        speeds_m_s.extend(one.twist.twist.linear.x for one in messages if one is not None)
        await asyncio.sleep(PERIOD_S)
    token.withdraw()


# What is imported later may be unreadable for the other user.
IMPORTED = (encode(planar_twist(0.0, 0.0)), encode(SafetyStatus(header(""))), Odometry)
if (user := int(sys.argv[2])) != os.getuid():
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
asyncio.run(main(sys.argv[1], float(sys.argv[3])))
