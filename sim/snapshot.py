"""A moment of the simulation, kept: from it the same commands lead on to the same trajectory, bit for bit.

A snapshot is a plain value. It pickles, compares, and goes through bytes: JSON, the same on every machine, so that
nothing in a file is ever run.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import ConfigDict, TypeAdapter, ValidationError


class SnapshotError(ValueError):
    """The bytes are no snapshot, or the snapshot is of another world."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that the future of a plant depends on, and everything that it says of its past.

    Attributes:
        world: A fingerprint of the model; another world's snapshot is refused.
        physics: MuJoCo's integration state, float64.
        sensors: The readings of the last step, float64.
        noise: The state of each lidar's noise generator.
        drive: v and ω that the drive's ramp had come to.
        walked_s: How long each mover has been on its way.
        steps_to_tick: Steps until the movers move next.
        pillar: Where it stands, or None.
        collisions: Since the last reset.
        touching: Whether the hull had contact.
        last_contact: With what.
    """

    __pydantic_config__: ClassVar = ConfigDict(
        extra="forbid", strict=True, ser_json_bytes="base64", val_json_bytes="base64"
    )

    world: str
    physics: bytes
    sensors: bytes
    noise: tuple[Mapping[str, Any], ...]
    drive: tuple[float, float]
    walked_s: tuple[float, ...]
    steps_to_tick: int
    pillar: tuple[float, float] | None
    collisions: int
    touching: bool
    last_contact: str | None

    def to_bytes(self) -> bytes:
        return _ADAPTER.dump_json(self)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Snapshot":
        """Reads what `to_bytes` wrote.

        Raises:
            SnapshotError: It is something else.
        """
        try:
            return _ADAPTER.validate_json(data)
        except ValidationError as error:
            raise SnapshotError("these bytes are no snapshot of this version; take a new one") from error


_ADAPTER = TypeAdapter(Snapshot)
