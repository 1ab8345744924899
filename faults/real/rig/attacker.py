"""Zenoh client that ignores the protocol: `python -m faults.real.rig.attacker ENDPOINT NAMESPACE`.

It takes orders on stdin, one JSON object per line, and answers each with a line when it has begun:

    {"attack": "malformed", "seed": 7, "for_s": 0.8}    one of attacks.py, at its rate
    {"attack": "second_teleop", "seed": 7, "for_s": 0.8}  a program with teleop's name that requests motion
    {"attack": "stop"}                                  end the attack; the answer is the number of sent messages
"""

import asyncio
import json
import random
import signal
import sys
from typing import Any

from faults.attacks import ATTACKS, SPEED_M_S
from wire import topics
from wire.messages import planar_twist
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

PERIOD_S = 0.01
"""At higher rates, several messages are sent together."""
SECOND = "second_teleop"
SECOND_PERIOD_S = 0.05


class Attacker:
    """One session, and at most one attack at a time."""

    def __init__(self, bus: ZenohBus, namespace: str) -> None:
        self._bus, self._namespace = bus, namespace
        self._attack: asyncio.Task[None] | None = None
        self._sent = 0

    async def obey(self, order: dict[str, Any]) -> str:
        await self._end()
        if order["attack"] == "stop":
            return str(self._sent)
        self._sent = 0
        chance = random.Random(order["seed"])  # noqa: S311 - to be repeated is what it is for
        work = self._pose_as_teleop if order["attack"] == SECOND else self._shoot
        self._attack = asyncio.ensure_future(work(order["attack"], chance, order["for_s"]))
        await asyncio.sleep(0)
        return "under way"

    async def _shoot(self, name: str, chance: random.Random, for_s: float) -> None:
        clock = asyncio.get_running_loop().time
        attack, rate_hz = ATTACKS[name]
        shots = attack(chance)
        began_s = clock()
        while (elapsed_s := clock() - began_s) < for_s:
            while self._sent <= elapsed_s * rate_hz:
                shot = next(shots, None)
                if shot is None:
                    return
                self._sent += 1
                self._bus.put_raw(f"{self._namespace}/{shot.key}", shot.payload, shot.attachment)
            await asyncio.sleep(PERIOD_S)

    async def _pose_as_teleop(self, _name: str, chance: random.Random, for_s: float) -> None:
        """Publish as a second teleop, with a token and valid stamps: neutral first or not, then motion."""
        token = self._bus.declare_alive(topics.TELEOP)
        commands = self._bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        neutral_first = chance.randrange(6)
        try:
            for number in range(round(for_s / SECOND_PERIOD_S)):
                commands.put(planar_twist(0.0 if number < neutral_first else SPEED_M_S, 0.0))
                self._sent += 1
                await asyncio.sleep(SECOND_PERIOD_S)
        finally:
            token.withdraw()

    async def _end(self) -> None:
        if self._attack is not None:
            self._attack.cancel()
            await asyncio.wait({self._attack})
            self._attack = None


async def _main(endpoint: str, namespace: str) -> None:
    loop = asyncio.get_running_loop()
    orders = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(orders), sys.stdin)
    bus = await open_bus(BusConfig(endpoint, namespace), "client")
    attacker = Attacker(bus, namespace)
    print("ready", flush=True)
    try:
        while line := await orders.readline():
            print(await attacker.obey(json.loads(line)), flush=True)
    finally:
        await bus.close()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign handles Ctrl-C
    asyncio.run(_main(*sys.argv[1:]))
