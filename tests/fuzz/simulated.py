"""The real sim on a perfect network in virtual time, fed with arbitrary commands and requests."""

import asyncio
import math
from collections import deque
from contextlib import suppress
from random import Random

from sim.config import SimSection
from sim.pace import Request, TimeRequestError, parse_time_request
from sim.plant import Plant
from sim.service import SimService
from tests.fuzz import payloads
from tests.fuzz.decoding import Finding
from tests.fuzz.warned import Warned, warned
from virtual.loop import VirtualLoop
from virtual.network import VirtualBus, VirtualNetwork
from wire import topics
from wire.messages import planar_twist

SIM_PAYLOADS = 4000
BURST = 100
APART_S = 0.002
FASTEST_M_S, FASTEST_RAD_S = 3.0, 12.0
"""Speed beyond the motors' limits and the effect of a collision."""
MOVES_M_S = 0.2
KEPT = 6


def simulate(seed: int, count: int, replay: str) -> tuple[int, tuple[Finding, ...], Warned]:
    """Feed payloads to a sim, then drive it; return the number of payloads, the findings and the warnings."""
    loop = VirtualLoop()
    complaints: list[str] = []
    play = _Play(loop, Random((seed << 40) | (1 << 38)))
    try:
        with warned() as warnings:
            loop.on_error = lambda name, error: complaints.append(f"{name}: {error!r}")
            try:
                loop.run_until_complete(play.run(count))
            except Exception as error:  # noqa: BLE001 - that there is none is what is tested
                complaints.append(f"{type(error).__name__}: {error}")
    finally:
        loop.close()
    fed = "\n".join(play.last)
    return play.fed, tuple(Finding(f"sim: {what[:500]}", fed, replay) for what in complaints), warnings


class _Play:
    def __init__(self, loop: VirtualLoop, random: Random) -> None:
        self._random = random
        network = VirtualNetwork(loop)
        self._supervisor = network.open_hub(topics.SUPERVISOR)
        self._sim = network.open_joined(topics.SIM)
        self._plant = Plant()
        self.fed = 0
        self.last: deque[str] = deque(maxlen=KEPT)

    async def run(self, count: int) -> None:
        stop = asyncio.Event()
        service = SimService(self._sim, SimSection(), self._plant)
        running = asyncio.ensure_future(service.run(stop))
        self._supervisor.declare_alive(topics.SUPERVISOR)
        try:
            while self.fed < count:
                for _ in range(BURST):
                    await self._feed()
                self._check(running)
            await self._drives(self._supervisor, running)
            stop.set()
            await running
        finally:
            running.cancel()
            with suppress(asyncio.CancelledError, Exception):
                await running

    async def _feed(self) -> None:
        random = self._random
        self.fed += 1
        stamp = payloads.attachment(random, 0.0, [bytes(16)])
        match int(random.random() * 10):
            case 0:
                await self._ask(random.choice((topics.SIM_FAULTS, topics.SIM_TIME)), payloads.text(random))
            case 1:
                await self._ask(topics.SIM_RESET, "")
            case 2:
                self._sim.tell_alive(topics.SUPERVISOR, alive=random.random() < 0.8)
            case 3 | 4:
                self._deliver(topics.OBSTACLE.key, payloads.mutated(random, topics.OBSTACLE.type), stamp)
            case _:
                self._deliver(topics.CMD_VEL.key, payloads.mutated(random, topics.CMD_VEL.type), stamp)
        await asyncio.sleep(random.random() * APART_S)

    def _deliver(self, key: str, payload: bytes, stamp: bytes | None) -> None:
        self.last.append(f"{key} {payload.hex()}")
        self._supervisor.send(key, payload, stamp)

    async def _ask(self, service: topics.Service, text: str) -> None:
        if service is topics.SIM_TIME and _takes_long(text):
            return
        self.last.append(f"{service.key} {text!r}")
        await self._sim.services[service.key](text)

    def _check(self, running: "asyncio.Future[None]") -> None:
        if running.done():
            running.result()
            raise AssertionError("the sim has ended")
        (x_m, y_m, yaw_rad), velocity = self._plant.true_pose, self._plant.true_velocity
        assert math.isfinite(x_m + y_m + yaw_rad), "the robot is nowhere"
        assert abs(velocity.linear_m_s) <= FASTEST_M_S, f"the robot drives at {velocity.linear_m_s} m/s"
        assert abs(velocity.angular_rad_s) <= FASTEST_RAD_S, f"it turns at {velocity.angular_rad_s} rad/s"

    async def _drives(self, supervisor: VirtualBus, running: "asyncio.Future[None]") -> None:
        """Reset the sim, and check that it follows a valid command."""
        point = payloads.seeds(topics.OBSTACLE.type)[1].payload  # below the floor: no pillar
        supervisor.send(topics.OBSTACLE.key, point, None)
        for service, text in (
            (topics.SIM_FAULTS, "none"),
            (topics.SIM_TIME, "run"),
            (topics.SIM_TIME, "speed 1"),
        ):
            answer = await supervisor.call(service, text)
            assert answer.success, answer.message
        self._sim.tell_alive(topics.SUPERVISOR, alive=True)
        publisher = supervisor.publisher(topics.CMD_VEL)
        for _ in range(20):
            publisher.put(planar_twist(0.0, 0.0))
            await asyncio.sleep(0.05)
        answer = await supervisor.call(topics.SIM_RESET)
        assert answer.success, answer.message
        for _ in range(20):
            publisher.put(planar_twist(2.0 * MOVES_M_S, 0.0))
            await asyncio.sleep(0.05)
        self._check(running)
        assert self._plant.true_velocity.linear_m_s > MOVES_M_S, "the robot does not follow a good command"


def _takes_long(text: str) -> bool:
    """Thousands of steps and a hundred times real time are valid, but would take too long here."""
    try:
        return parse_time_request(text).what in {Request.STEP, Request.SPEED}
    except TimeRequestError:
        return False
