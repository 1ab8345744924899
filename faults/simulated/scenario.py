"""Draw the scenario of a virtual trial from its seed. Pure: the same seed gives the same scenario."""

from dataclasses import dataclass
from enum import StrEnum
from random import Random

from faults.classes import BY_NAME, Group, classes_by_themselves, virtual_classes

EPISODE_S = 7.1
"""From the first heartbeat until all faults are lifted."""
RECOVERY_S = 2.5
"""Maximum time from there until the robot must be drivable."""
FIRST_FAULT_S = 0.8
MOVING_LIMIT_S = 1.2
"""Maximum time that a fault waits for the robot to move."""
STRAIGHT_LIMIT_S = 3.0
"""The same, if the operator only drives straight on."""

FROM_M_S = (0.1, 0.9)
PAIR_SHARE = 0.2
PAIR_APART_S = 0.4


BY_THEMSELVES_EVERY, BY_THEMSELVES_REST = 10, 7
"""Seeds that end in 7 try the classes with trials of their own, one after the other. What the other seeds mean
does not depend on how many such classes there are."""


class Scene(StrEnum):
    """Layouts of the simulation, each with and without its movers."""

    WAREHOUSE = "warehouse"
    AISLE = "aisle"
    EMPTY = "empty"


class Drivers(StrEnum):
    """The sources that request motion."""

    TELEOP = "teleop"
    """The real program with a simulated operator."""
    STUBBORN = "stubborn"
    """A source with teleop's name and without any recovery: it requests motion all the time."""
    STATION = "station"
    """A page, by the server of a station, with a simulated operator."""
    BOTH = "both"
    """Teleop, and a source `joy` of lower priority that requests motion all the time."""


MIXED = (Drivers.TELEOP, Drivers.STUBBORN, Drivers.BOTH)
"""The sources of the trials that mix classes of faults."""

BY_PAGE_REST = 2
"""In mixed trials whose seed ends in 2, a page drives. Everything else is drawn as for another source."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A planned fault."""

    name: str
    at_s: float
    """The earliest time; the fault then waits until the robot moves."""
    lasts_s: float
    """The length of a fault that may have any length."""
    from_m_s: float
    """The speed that the fault waits for."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """The plan of one trial."""

    seed: int
    scene: Scene
    movers: bool
    rectangular: bool
    drivers: Drivers
    stubbornness: float
    """Probability that the operator continues to request motion after a stop."""
    pillars: tuple[float, ...]
    """The times at which a pillar is placed ahead of the robot; each replaces the previous one."""
    faults: tuple[Planned, ...]
    straight: bool = False
    """Whether the robot starts with free space ahead and the operator always drives straight on."""

    def stream(self, name: str) -> Random:
        """Return a separate random generator for each part, so that a change in one part does not affect the others."""
        return Random(f"{self.seed} {name}")  # noqa: S311 - to be repeated is what it is for


def draw(seed: int) -> Scenario:
    """Return the scenario of a seed."""
    if seed % BY_THEMSELVES_EVERY == BY_THEMSELVES_REST:
        return _draw_by_itself(seed)
    random = Random(f"{seed} scenario")  # noqa: S311 - to be repeated is what it is for
    names = [one.name for one in virtual_classes()]
    faults: list[Planned] = []
    at_s = FIRST_FAULT_S + random.uniform(0.0, 1.0)
    while at_s < EPISODE_S - 1.0:
        faults.append(_plan(random, random.choice(names), at_s))
        if random.random() < PAIR_SHARE:
            faults.append(_plan(random, random.choice(names), at_s + random.uniform(0.0, PAIR_APART_S)))
        at_s += random.uniform(1.5, 4.0)
    by_page = seed % BY_THEMSELVES_EVERY == BY_PAGE_REST
    return Scenario(
        seed,
        scene=random.choice(list(Scene)),
        movers=random.random() < 0.4,
        rectangular=random.random() < 0.25,
        drivers=_driver(random, MIXED, (6, 3, 1), by_page=by_page),
        stubbornness=random.choice((0.0, 0.3, 0.7, 1.0)),
        pillars=tuple(sorted(random.uniform(1.5, EPISODE_S) for _ in range(random.choice((0, 1, 1, 2))))),
        faults=tuple(faults),
    )


def _draw_by_itself(seed: int) -> Scenario:
    """Return the scenario of a class with its own trials: a single fault."""
    random = Random(f"{seed} by itself")  # noqa: S311 - as above
    names = [one.name for one in classes_by_themselves()]
    name = names[seed // BY_THEMSELVES_EVERY % len(names)]
    by_page = BY_NAME[name].group is Group.STATION
    at_s = FIRST_FAULT_S + random.uniform(0.0, 0.5)
    return Scenario(
        seed,
        scene=random.choice((Scene.WAREHOUSE, Scene.EMPTY)),
        movers=False,
        rectangular=random.random() < 0.25,
        drivers=_driver(random, (Drivers.TELEOP, Drivers.STUBBORN), (2, 1), by_page=by_page),
        stubbornness=random.choice((0.0, 0.3)),
        pillars=(),
        faults=(_plan(random, name, at_s),),
        straight=True,
    )


def _driver(
    random: Random, drivers: tuple[Drivers, ...], weights: tuple[int, ...], *, by_page: bool
) -> Drivers:
    drawn = random.choices(drivers, weights)[0]
    return Drivers.STATION if by_page else drawn


def _plan(random: Random, name: str, at_s: float) -> Planned:
    lasts_s = random.choice((0.05, 0.12, 0.3, 0.6, 1.0, 2.0, 3.0)) * random.uniform(0.8, 1.2)
    return Planned(name, at_s, lasts_s, random.uniform(*FROM_M_S))
