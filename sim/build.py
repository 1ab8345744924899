"""What may differ between two simulated robots: the values, and their bounds. scene.py makes the world from them."""

from dataclasses import dataclass
from enum import StrEnum

DEFAULT = "warehouse"

MAX_PAYLOAD_KG = 100.0
MAX_SLIP = 0.95


class SceneError(ValueError):
    """The scene is refused; the message says why, and what can be done."""


class Hull(StrEnum):
    """The robot's shape from above."""

    ROUND = "round"
    RECTANGULAR = "rectangular"


@dataclass(frozen=True, slots=True)
class Build:
    """What may differ between two robots, and between two days of one hall.

    Attributes:
        hull: round, 0.5 m across, or rectangular, 0.6 m × 0.4 m. A scene that has a robot of its own keeps its hull.
        payload_kg: Carried in the hull, 0 to 100 kg.
        wheel_slip: The share of the wheels' grip that is gone, 0 to 0.95: they spin and slide where it is not enough.
        moving: Whether people and forklifts are about, if the layout has any.
        scenery: Whether a layout has also what only the eye sees; it costs time and changes nothing else.

    Raises:
        SceneError: A value makes no sense, by name.
    """

    hull: Hull = Hull.ROUND
    payload_kg: float = 0.0
    wheel_slip: float = 0.0
    moving: bool = False
    scenery: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.payload_kg <= MAX_PAYLOAD_KG:
            raise SceneError(f"payload_kg must be from 0 to {MAX_PAYLOAD_KG:g}, not {self.payload_kg}.")
        if not 0.0 <= self.wheel_slip <= MAX_SLIP:
            raise SceneError(f"wheel_slip must be from 0 to {MAX_SLIP:g}, not {self.wheel_slip}.")
