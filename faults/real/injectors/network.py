"""Faults of a link between the hub and teleop or the sim: by the proxy, or by a cable that is unplugged."""

import time
from random import Random

from faults.real.injectors.injection import Injection, Plan, lasting
from faults.real.rig.stage import Route, Stage
from wire import topics

FOR_GOOD_S = 1.5
"""It is healed only so that the next trial can begin."""
HEALED_AFTER_S = (0.3, 1.0, 3.0)


class Proxied(Injection):
    """A fault of the link of one node."""

    def __init__(self, node: str, lasts_s: float, **parameters: float | str) -> None:
        super().__init__(lasts_s, **parameters)
        self._node = node
        if node == topics.TELEOP:
            self.teleop = Route.PROXY
        else:
            self.sim = Route.PROXY

    async def prepare(self, stage: Stage) -> None:
        stage.links.heal(self._node)

    async def lift(self, stage: Stage) -> None:
        stage.links.heal(self._node)


class Cut(Proxied):
    """Cut one or both directions; `up` leads to the hub."""

    def __init__(self, node: str, lasts_s: float, *, up: bool = False, down: bool = False) -> None:
        super().__init__(node, lasts_s)
        self._up, self._down = up, down

    async def do(self, stage: Stage) -> float:
        now_s = time.monotonic()
        stage.links.open(self._node, up=self._up, down=self._down)
        return now_s


class Delayed(Proxied):
    """Delay all data, each chunk by a different time."""

    def __init__(self, node: str, lasts_s: float, low_s: float, high_s: float) -> None:
        super().__init__(node, lasts_s, delay_s=high_s, least_delay_s=low_s)
        self._low_s, self._high_s = low_s, high_s

    async def do(self, stage: Stage) -> float:
        now_s = time.monotonic()
        stage.links.delay(self._node, self._low_s, self._high_s)
        return now_s


class Unplugged(Injection):
    """Unplug teleop's cable, with the kernel's own TCP on both sides."""

    teleop = Route.CABLE

    async def do(self, stage: Stage) -> float:
        now_s = time.monotonic()
        stage.cable.unplug()
        return now_s

    async def lift(self, stage: Stage) -> None:
        stage.cable.plug()


def _cut(node: str, *, up: bool = False, down: bool = False) -> Plan:
    return lambda _: Cut(node, FOR_GOOD_S, up=up, down=down)


def _healed(node: str) -> Plan:
    return lambda chance: Cut(node, chance.choice(HEALED_AFTER_S))


def _delayed(node: str) -> Plan:
    def plan(chance: Random) -> Injection:
        low_s, high_s = sorted(lasting(chance, 0.05, 0.5) for _ in range(2))
        return Delayed(node, lasting(chance, 1.0, 1.5), low_s, high_s)

    return plan


PLANS: dict[str, Plan] = {
    "net_cut": _cut(topics.TELEOP),
    "net_cut_base": _cut(topics.SIM),
    "net_healed": _healed(topics.TELEOP),
    "net_healed_base": _healed(topics.SIM),
    "net_delayed": _delayed(topics.TELEOP),
    "net_delayed_base": _delayed(topics.SIM),
    "net_up_only": _cut(topics.TELEOP, up=True),
    "net_down_only": _cut(topics.TELEOP, down=True),
    "net_base_deaf": _cut(topics.SIM, up=True),
    "net_base_mute": _cut(topics.SIM, down=True),
    "net_unplugged": lambda chance: Unplugged(chance.choice(HEALED_AFTER_S)),
}
