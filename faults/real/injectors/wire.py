"""Faults on the wire: an attacker, or a sender whose clock steps."""

from contextlib import suppress
from random import Random

from faults.attacks import ATTACKS
from faults.real.injectors.injection import Injection, Pillar, Plan, lasting
from faults.real.rig.attacker import SECOND
from faults.real.rig.stage import Stage, StageError
from wire import topics

PAUSE_AFTER_S, PAUSE_S = 0.4, 0.6
"""Start and duration of the real lidar's pause."""


class Attacked(Injection):
    """Run an attack for a while."""

    def __init__(self, attack: str, seed: int, lasts_s: float) -> None:
        super().__init__(lasts_s)
        self._attack, self._seed = attack, seed

    async def prepare(self, stage: Stage) -> None:
        _ = stage.attacker

    async def do(self, stage: Stage) -> float:
        return stage.attack(self._attack, self._seed, self.lasts_s)

    async def lift(self, stage: Stage) -> None:
        self.parameters["sent"] = stage.end_attack()


class SecondWriter(Attacked):
    """A second client's scans of free space, with a pillar straight ahead; the real lidar pauses once."""

    pillar = Pillar.AHEAD

    async def do(self, stage: Stage) -> float:
        at_s = await super().do(stage)
        await stage.observer.watch(PAUSE_AFTER_S)
        await stage.sensors("silent")
        await stage.observer.watch(PAUSE_S)
        await stage.sensors("none")
        return at_s

    async def lift(self, stage: Stage) -> None:
        with suppress(StageError):
            await stage.sensors("none")
        await super().lift(stage)


class ClockStep(Injection):
    """Step the clock of teleop's stamps, and step it back."""

    def __init__(self, by_s: float, lasts_s: float) -> None:
        super().__init__(lasts_s, by_s=by_s)
        self._by_s = by_s

    async def do(self, stage: Stage) -> float:
        stage.observer.trusts_stamps = False
        return stage.order(topics.TELEOP, f"clock {self._by_s}")

    async def lift(self, stage: Stage) -> None:
        stage.order(topics.TELEOP, f"clock {-self._by_s}")


def _attacked(attack: str) -> Plan:
    return lambda chance: Attacked(attack, chance.randrange(1 << 31), lasting(chance, 0.5, 1.0))


def _second_writer(attack: str, low_s: float, high_s: float) -> Plan:
    return lambda chance: SecondWriter(attack, chance.randrange(1 << 31), lasting(chance, low_s, high_s))


def _clock_step(chance: Random) -> Injection:
    by_s = chance.choice((-1, 1)) * chance.choice((0.05, 0.15, 0.3, 1.0, 3600.0))
    return ClockStep(by_s, lasting(chance, 0.5, 1.0))


PLANS: dict[str, Plan] = {
    **{f"wire_{attack}": _attacked(attack) for attack in (*ATTACKS, SECOND)},
    "wire_second_lidar_steady": _second_writer("second_lidar_steady", 3.0, 4.0),
    "wire_second_lidar_flood": _second_writer("second_lidar_flood", 1.5, 1.6),
    "wire_clock_step": _clock_step,
}
