"""Inject the scenario's faults into the simulated processes, and record when each was injected."""

import asyncio
import math
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import replace
from random import Random

from faults.attacks import Attacker, Shot
from faults.demands import Done
from faults.injection import DRAWS, LOOK_S
from faults.page import PageFault
from faults.port import End, Fault, Hold, Pillar
from faults.seen import Asked
from faults.simulated.scenario import MOVING_LIMIT_S, STRAIGHT_LIMIT_S, Planned
from faults.simulated.world import RESTART_S, Life, World
from wire import topics
from wire.bus import NoReplyError
from wire.messages import Bool, Point, Twist, UndecodableError, decode, encode

POLL_S = 0.02
INSISTS_S = 3.0
PILLAR_AHEAD_M = (1.0, 2.2)
"""Distance between the centres."""


class NotDoneError(Exception):
    """The target of the fault does not exist at this moment."""


class Injector:
    """Injects the faults of a scenario into a world, as their `Port`."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._random: Random = world.scenario.stream("injector")
        self.done: list[Done] = []
        self._open: list[Done] = []
        self._rogue = world.network.open_client("rogue")
        self._attackers: dict[str, Attacker] = {}
        self._stepped: dict[str, Life] = {}
        """The runs whose clocks have stepped; a new run of a process has a correct clock."""

    async def run(self, planned: Planned) -> None:
        """Wait for the fault's moment, inject it, and end it."""
        world, loop = self.world, self.world.loop
        fault = _drawn(planned, world.scenario.stream(f"{planned.name} {planned.at_s}"))
        await asyncio.sleep(max(0.0, planned.at_s - loop.time()))
        limit_s = loop.time() + (STRAIGHT_LIMIT_S if world.scenario.straight else MOVING_LIMIT_S)
        while world.speed_m_s < planned.from_m_s and loop.time() < limit_s:  # noqa: ASYNC110 - nothing tells it
            await asyncio.sleep(POLL_S)
        if fault.pillar is Pillar.AHEAD:
            fault.parameters["pillar_m"] = ahead_m = round(self._random.uniform(*PILLAR_AHEAD_M), 3)
            self._put_pillar(ahead_m, 0.0)
        entry = Done(planned.name, loop.time(), math.inf, fault.parameters)
        self._open.append(entry)
        is_done = True
        try:
            async with aclosing(fault.steps(self)) as steps:
                await anext(steps)
                await asyncio.sleep(fault.lasts_s)
                await anext(steps, None)
        except NotDoneError:
            is_done = False
        finally:
            self._open.remove(entry)
            if is_done:
                self.done.append(replace(entry, until_s=loop.time()))

    def finished(self) -> list[Done]:
        """Return the injected faults in order of time; those that have not ended yet end now."""
        still = [replace(one, until_s=self.now_s) for one in self._open]
        return sorted([*self.done, *still], key=lambda one: (one.at_s, one.name))

    @property
    def now_s(self) -> float:
        return self.world.loop.time()

    async def connect(self) -> None:
        await self._rogue.connect()

    async def put_pillars(self) -> None:
        """Place a pillar ahead of the robot from time to time."""
        for at_s in self.world.scenario.pillars:
            await asyncio.sleep(max(0.0, at_s - self.world.loop.time()))
            self._put_pillar(self._random.uniform(0.5, 2.0), self._random.uniform(-0.4, 0.4))

    def _put_pillar(self, ahead_m: float, left_m: float) -> None:
        pose = self.world.plant.true_pose
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        x_m, y_m = pose.x_m + ahead_m * cos - left_m * sin, pose.y_m + ahead_m * sin + left_m * cos
        self._put(Shot(topics.OBSTACLE.key, encode(Point(x_m, y_m, 0.0))))

    # --- the port of the faults

    async def pause(self, duration_s: float) -> None:
        await asyncio.sleep(duration_s)

    def kill(self, *nodes: str) -> float:
        for node in nodes:
            self.world.kill(node)
        return self.now_s

    def end(self, node: str, how: End) -> float:
        keyboard = self.world.keyboard
        if how is End.RAISE:
            self.world.kill(node)
        elif how is End.INPUT and keyboard is not None:
            keyboard.end()
        else:
            self.world.terminate(node)
        return self.now_s

    async def restart(self, *nodes: str) -> None:
        await asyncio.sleep(RESTART_S)
        for node in nodes:
            self.world.start(node)

    def hold(self, node: str, how: Hold, for_s: float) -> float:  # noqa: ARG002 - until it is let go
        self.world.hold(node, deaf=how is Hold.GIL, stopped=how is Hold.STOP)
        return self.now_s

    def let_go(self, node: str, how: Hold) -> None:  # noqa: ARG002 - the world knows it
        if (life := self.world.lives.get(node)) is not None:
            self.world.let_go(life)

    async def sensors(self, faults: str) -> float:
        now_s = self.now_s
        if not await self._ask_sim(faults):
            raise NotDoneError(faults)
        return now_s

    async def mend_sensors(self) -> None:
        while not await self._ask_sim("none"):  # noqa: ASYNC110 - nothing tells it
            await asyncio.sleep(POLL_S)

    async def _ask_sim(self, text: str) -> bool:
        """Return whether the sim answered; a sim that does not run has no faults."""
        try:
            return (await self._rogue.call(topics.SIM_FAULTS, text, timeout_s=0.2)).success
        except NoReplyError:
            return False

    def cut(self, node: str, *, up: bool, down: bool) -> float:
        self.world.network.cut(node, up=up, down=down)
        return self.now_s

    def delay(self, node: str, least_s: float, most_s: float) -> float:
        for conditions in self.world.network.link(node):
            conditions.delay_s, conditions.jitter_s = least_s, most_s - least_s
        return self.now_s

    def heal(self, node: str) -> None:
        """End everything that disturbs a link."""
        for conditions in self.world.network.link(node):
            conditions.delay_s = conditions.jitter_s = conditions.loss = 0.0
            conditions.in_order = True
        self.world.network.heal(node)

    def attack(self, name: str, seed: int, for_s: float) -> float:
        world = self.world

        def now_ns() -> int:
            return round(world.loop.time() * 1e9)

        attacker = Attacker(self._rogue, self._put, (now_ns, now_ns), lambda: world.heard)
        self._attackers.setdefault(name, attacker).begin(name, seed, for_s)
        return self.now_s

    def end_attack(self, name: str) -> int:
        return self._attackers[name].end()

    def end_attacks(self) -> None:
        for attacker in self._attackers.values():
            attacker.end()

    def _put(self, shot: Shot) -> None:
        """Publish bytes on a key; a message under a source's name counts as that source's request."""
        self._rogue.send(*shot)
        source = topics.source_of(shot.key)
        if source is not None:
            try:
                twist = decode(shot.payload, Twist)
            except UndecodableError:
                return
            self.world.seen.asked.append(Asked.of(self.now_s, source, twist))

    def step_clock(self, node: str, by_s: float) -> float:
        life = self._stepped.pop(node, None) or self.world.lives.get(node)
        if life is not None:
            life.bus.clock_offset_s += by_s
            if life.bus.clock_offset_s:
                self._stepped[node] = life
        return self.now_s

    def set_page_fault(self, fault: PageFault) -> float:
        assert self.world.page is not None
        self.world.page.set_fault(fault)
        return self.now_s

    async def press_estop(self) -> float:
        self.world.may_reset = False
        self._put(Shot(topics.ESTOP.key, encode(Bool(data=True))))
        return self.now_s

    async def insist(self) -> None:
        """Let the operator request motion, as it does all the time."""
        await asyncio.sleep(INSISTS_S)
        self.world.may_reset = True


def _loss(chance: Random) -> Fault[Injector]:
    share = chance.uniform(0.1, 0.8)

    async def steps(port: Injector) -> AsyncGenerator[float]:
        for conditions in port.world.network.link(topics.TELEOP):
            conditions.loss = share
        yield port.now_s
        port.heal(topics.TELEOP)

    return Fault(steps, {"share": round(share, 3)}, any_length=True)


def _reorder(chance: Random) -> Fault[Injector]:
    within_s = chance.uniform(0.05, 0.25)

    async def steps(port: Injector) -> AsyncGenerator[float]:
        for conditions in port.world.network.link(topics.TELEOP):
            conditions.in_order, conditions.jitter_s = False, within_s
        yield port.now_s
        port.heal(topics.TELEOP)

    return Fault(steps, {"delay_s": round(within_s, 4)}, any_length=True)


async def _flapping(port: Injector) -> AsyncGenerator[float]:
    port.world.network.flap(topics.TELEOP)
    yield port.now_s


def _suspend(chance: Random) -> Fault[Injector]:
    """By the monotonic clock, all data is as fresh as before."""
    slept_s = round(0.2 + 60.0 * chance.random() ** 2, 3)

    async def steps(port: Injector) -> AsyncGenerator[float]:
        port.world.machine.sleep(slept_s)
        yield port.now_s

    return Fault(steps, {"slept_s": slept_s}, LOOK_S)


VIRTUAL_DRAWS: dict[str, Callable[[Random], Fault[Injector]]] = {
    "net_lossy": _loss,
    "net_reordered": _reorder,
    "net_flapping": lambda _: Fault(_flapping),
    "machine_suspend": _suspend,
}
"""The faults that exist in virtual time only."""


def _drawn(planned: Planned, chance: Random) -> Fault[Injector]:
    """Draw a planned fault; one that may have any length lasts as long as the scenario says."""
    name = planned.name
    fault: Fault[Injector] = VIRTUAL_DRAWS[name](chance) if name in VIRTUAL_DRAWS else DRAWS[name](chance)
    if not fault.any_length:
        return fault
    fault.parameters.pop("lasts_s", None)
    return replace(fault, lasts_s=round(planned.lasts_s, 3))
