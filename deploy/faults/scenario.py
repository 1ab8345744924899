"""What happens in a trial of the virtual campaign, drawn from its seed. Pure: the same seed, the same scenario."""

from dataclasses import dataclass
from enum import StrEnum
from random import Random

from deploy.faults.classes import virtual_classes

EPISODE_S = 7.1
"""From the first heartbeat to the mending of everything."""
RECOVERY_S = 2.5
"""From there to the end at the latest: by then the robot has to be drivable."""
FIRST_FAULT_S = 0.8
MOVING_LIMIT_S = 1.2
"""A fault waits this long for a robot that moves."""

PAIR_SHARE = 0.2
PAIR_APART_S = 0.4


class Scene(StrEnum):
    """Layouts of the simulation, each with and without its movers."""

    WAREHOUSE = "warehouse"
    AISLE = "aisle"
    EMPTY = "empty"


class Drivers(StrEnum):
    """Who asks for motion."""

    TELEOP = "teleop"
    """The real program, with somebody at its keys."""
    STUBBORN = "stubborn"
    """A source under teleop's name that knows no recovery of its own: it asks on, whatever happened to it."""
    BOTH = "both"
    """Teleop, and a stubborn joy of lower priority."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A fault to come."""

    name: str
    at_s: float
    """Not before this, and then as soon as the robot moves."""
    lasts_s: float
    strength: float
    """0 to 1: where in its range what else it has lies."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One trial, before it runs."""

    seed: int
    scene: Scene
    movers: bool
    rectangular: bool
    drivers: Drivers
    stubbornness: float
    """How likely the operator goes on asking after a stop."""
    pillars: tuple[float, ...]
    """When a pillar is put somewhere ahead of the robot; the next one takes the last one's place."""
    faults: tuple[Planned, ...]

    def stream(self, name: str) -> Random:
        """A source of chance of its own for each part: a change in one does not shift the others."""
        return Random(f"{self.seed} {name}")  # noqa: S311 - to be repeated is what it is for


def draw(seed: int) -> Scenario:
    """The scenario of a seed."""
    random = Random(f"{seed} scenario")  # noqa: S311 - to be repeated is what it is for
    names = [one.name for one in virtual_classes()]
    faults: list[Planned] = []
    at_s = FIRST_FAULT_S + random.uniform(0.0, 1.0)
    while at_s < EPISODE_S - 1.0:
        faults.append(_plan(random, random.choice(names), at_s))
        if random.random() < PAIR_SHARE:
            faults.append(_plan(random, random.choice(names), at_s + random.uniform(0.0, PAIR_APART_S)))
        at_s += random.uniform(1.5, 4.0)
    return Scenario(
        seed,
        scene=random.choice(list(Scene)),
        movers=random.random() < 0.4,
        rectangular=random.random() < 0.25,
        drivers=random.choices(list(Drivers), weights=(6, 3, 1))[0],
        stubbornness=random.choice((0.0, 0.3, 0.7, 1.0)),
        pillars=tuple(sorted(random.uniform(1.5, EPISODE_S) for _ in range(random.choice((0, 1, 1, 2))))),
        faults=tuple(faults),
    )


def _plan(random: Random, name: str, at_s: float) -> Planned:
    lasts_s = random.choice((0.05, 0.12, 0.3, 0.6, 1.0, 2.0, 3.0)) * random.uniform(0.8, 1.2)
    return Planned(name, at_s, lasts_s, random.random())
