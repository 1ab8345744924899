"""What may differ between two simulated robots: the values, and their bounds. scene.py makes the world from them."""

from dataclasses import dataclass
from enum import StrEnum

DEFAULT = "warehouse"

MAX_PAYLOAD_KG = 100.0
MAX_SLIP = 0.95


class SceneError(ValueError):
    """The scene is refused; the message says why, and what to do."""


class Hull(StrEnum):
    """Shape of the robot from above."""

    ROUND = "round"
    RECTANGULAR = "rectangular"


@dataclass(frozen=True, slots=True)
class Build:
    """Options of the robot and the scene.

    Attributes:
        hull: round, 0.5 m in diameter, or rectangular, 0.6 m × 0.4 m. A scene with its own robot keeps that hull.
        payload_kg: Payload in the hull, 0 to 100 kg.
        wheel_slip: Lost share of the wheels' grip, 0 to 0.95; with too little grip, the wheels spin and slide.
        moving: Whether the people and forklifts of the layout are present.
        scenery: Whether to add purely visual elements; they take time and have no other effect.

    Raises:
        SceneError: A value is invalid; the message names it.
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
