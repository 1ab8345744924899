"""The base class of a fault of real processes."""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from random import Random

from faults.real.rig.stage import Route, Stage


class Pillar(Enum):
    """Whether a pillar is placed for a trial."""

    BY_CHANCE = auto()
    AHEAD = auto()
    """Straight ahead; the robot drives straight."""
    NONE = auto()
    """None; the robot drives straight."""


class Injection:
    """One fault of one trial: `prepare`, `do`, and after `lasts_s` `lift`.

    Args:
        lasts_s: time from `do` to `lift`.
        parameters: parameters for the record.
    """

    teleop = Route.DIRECT
    """Teleop's route to the hub."""
    sim = Route.DIRECT
    also: tuple[str, ...] = ()
    """Other classes of faults that it includes, and whose bounds hold."""
    leeway_s = 0.0
    """Additional scheduling delay that it causes on the machine; part of the record."""

    pillar = Pillar.BY_CHANCE
    keys: Sequence[str] = "wwadxs"
    """The keys that the operator presses at random meanwhile, unless the fault must stop the robot."""

    def __init__(self, lasts_s: float = 0.0, **parameters: float | str) -> None:
        self.lasts_s = lasts_s
        self.parameters: dict[str, float | str] = parameters
        if lasts_s > 0.0:
            self.parameters["lasts_s"] = lasts_s

    async def prepare(self, stage: Stage) -> None:
        """Prepare the fault: everything that takes time."""

    async def do(self, stage: Stage) -> float:
        """Inject the fault; return the time just before."""
        raise NotImplementedError

    async def lift(self, stage: Stage) -> None:
        """End the fault; harmless if it has ended already."""


Plan = Callable[[Random], Injection]
"""Draws the fault of a trial at random."""


def lasting(chance: Random, low_s: float, high_s: float) -> float:
    """Return a random time between the two, in whole milliseconds."""
    return round(chance.uniform(low_s, high_s), 3)
