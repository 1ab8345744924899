"""A fault that is about to happen to real processes."""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from random import Random

from deploy.campaign.real.rig.stage import Route, Stage


class Pillar(Enum):
    """What stands in the way of a trial's drive."""

    BY_CHANCE = auto()
    AHEAD = auto()
    """In the middle of a way that leads straight on."""
    NONE = auto()
    """And the way leads straight on."""


class Injection:
    """One fault of one trial: `prepare`, `do`, and after `lasts_s` `lift`.

    Args:
        lasts_s: from `do` to `lift`.
        parameters: for the record.
    """

    teleop = Route.DIRECT
    """How teleop must reach the hub."""
    sim = Route.DIRECT
    also: tuple[str, ...] = ()
    """Other classes of faults that it does as well, and whose bounds hold."""
    leeway_s = 0.0
    """What it makes a machine's scheduling slower by; told in the record."""

    pillar = Pillar.BY_CHANCE
    keys: Sequence[str] = "wwadxs"
    """What the operator types meanwhile, one of these again and again, unless something has to stop the robot."""

    def __init__(self, lasts_s: float = 0.0, **parameters: float | str) -> None:
        self.lasts_s = lasts_s
        self.parameters: dict[str, float | str] = parameters
        if lasts_s > 0.0:
            self.parameters["lasts_s"] = lasts_s

    async def prepare(self, stage: Stage) -> None:
        """What takes time and is no fault yet."""

    async def do(self, stage: Stage) -> float:
        """Inject it; returns the time just before."""
        raise NotImplementedError

    async def lift(self, stage: Stage) -> None:
        """End it: wake, heal, take away. Harmless where nothing is left."""


Plan = Callable[[Random], Injection]
"""Draws the fault of a trial."""


def lasting(chance: Random, low_s: float, high_s: float) -> float:
    """A time between the two, in whole milliseconds."""
    return round(chance.uniform(low_s, high_s), 3)
