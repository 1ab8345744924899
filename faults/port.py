"""What a fault may do to a robot: the port that real processes and the virtual world implement; and a drawn fault."""

from collections.abc import AsyncGenerator, Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from typing import Generic, Protocol, TypeVar

from faults.page import PageFault

Parameters = dict[str, float | str]

PAGE = "page"
"""The process of the page that drives through a station; the process of the source is then the station's server."""


class Hold(StrEnum):
    """The ways to hold a process for a while."""

    STOP = "stop"
    """SIGSTOP, until SIGCONT."""
    BLOCK = "block"
    """Its event loop is blocked."""
    GIL = "gil"
    """A thread holds the interpreter's lock."""
    DECIDED = "decided"
    """The supervisor sends its next decided motion late; in the virtual world like BLOCK."""


class End(StrEnum):
    """The ways in which a process ends by itself."""

    TERM = "term"
    """SIGTERM."""
    RAISE = "raise"
    """An uncaught exception."""
    INPUT = "input"
    """The end of teleop's keyboard input."""
    HANG_UP = "hang up"
    """Teleop's terminal is closed."""


class Pillar(Enum):
    """Whether a fault needs a pillar."""

    BY_CHANCE = auto()
    AHEAD = auto()
    """Straight ahead; the robot drives straight."""
    NONE = auto()
    """None; the robot drives straight."""


class Port(Protocol):
    """A robot under test. Actions that begin a fault return the time before it [s]; impossible ones fail."""

    async def pause(self, duration_s: float) -> None:
        """Let time pass."""

    def kill(self, *nodes: str) -> float:
        """SIGKILL nodes together."""
        ...

    def end(self, node: str, how: End) -> float: ...

    async def restart(self, *nodes: str) -> None:
        """Restart nodes that have ended, unless the robot under test restarts them itself."""

    def hold(self, node: str, how: Hold, for_s: float) -> float:
        """Hold a node until `let_go`; some ways end after `for_s` by themselves."""
        ...

    def let_go(self, node: str, how: Hold) -> None: ...

    async def sensors(self, faults: str) -> float:
        """Apply a text of `topics.SIM_FAULTS`; it replaces the one before."""
        ...

    async def mend_sensors(self) -> None:
        """End all sensor faults as soon as a sim runs; another fault may have ended the sim."""

    def cut(self, node: str, *, up: bool, down: bool) -> float:
        """Cut the named directions of a node's link; `up` leads to the hub."""
        ...

    def delay(self, node: str, least_s: float, most_s: float) -> float:
        """Delay all messages of a node's link in both directions, each by a different time."""
        ...

    def heal(self, node: str) -> None:
        """End cuts and delays of a node's link."""

    def attack(self, name: str, seed: int, for_s: float) -> float:
        """Begin an attack of attacks.py."""
        ...

    def end_attack(self, name: str) -> int:
        """End an attack; return the number of sent messages."""
        ...

    def step_clock(self, node: str, by_s: float) -> float:
        """Step the clock of a node's stamps."""
        ...

    def set_page_fault(self, fault: PageFault) -> float:
        """Replace the faulty behaviour of the page that drives."""
        ...

    async def press_estop(self) -> float:
        """Press the e-stop, and wait for zero; it is not reset before `insist` ends."""
        ...

    async def insist(self) -> None:
        """Request motion for a while, after neutral but without a reset."""


P_contra = TypeVar("P_contra", contravariant=True)


@dataclass(frozen=True, eq=False)
class Fault(Generic[P_contra]):
    """A drawn fault, with the steps that inject it through a port.

    Attributes:
        steps: begins the fault, yields the time just before, and then ends the fault.
        parameters: parameters for the record; the steps may add results.
        lasts_s: time from the beginning to the end.
        any_length: whether `lasts_s` is only typical; the virtual campaign draws it from a wider range.
        pillar: whether it needs a pillar.
        also: other classes of faults that it includes, and whose bounds hold.
        leeway_s: additional scheduling delay that it causes on the machine; part of the record.
    """

    steps: Callable[[P_contra], AsyncGenerator[float]]
    parameters: Parameters = field(default_factory=Parameters)
    lasts_s: float = 0.0
    any_length: bool = False
    pillar: Pillar = Pillar.BY_CHANCE
    also: Sequence[str] = ()
    leeway_s: float = 0.0

    def __post_init__(self) -> None:
        if self.lasts_s > 0.0:
            self.parameters["lasts_s"] = self.lasts_s
