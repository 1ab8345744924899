"""Everything that the law remembers between two steps.

It consists of named tuples, because the law replaces them often: they cost a third of a frozen dataclass.
"""

import math
from typing import NamedTuple

from supervisor.law.base import Base
from supervisor.law.interlock import Interlock
from supervisor.law.model import LawConfig
from supervisor.law.sight import Sight


class Clock(NamedTuple):
    """Times of the law's own steps."""

    now_s: float | None = None
    """The last step's time; None before the first."""
    resumed_s: float = -math.inf
    """When a suspend of the machine was last detected."""


class State(NamedTuple):
    """The configuration and the four parts of the state; no function of one part changes another."""

    config: LawConfig
    interlock: Interlock
    base: Base
    sight: Sight
    clock: Clock
