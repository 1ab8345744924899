"""Snapshot of the simulation: after a restore, the same commands give the same trajectory, bit for bit.

A snapshot is a plain value that can be pickled and compared. Its bytes are JSON, the same on every machine; reading them
never executes code.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import ConfigDict, TypeAdapter, ValidationError


class SnapshotError(ValueError):
    """The bytes are not a snapshot, or the snapshot is of another world."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The complete state of a plant, including its record of contacts.

    Attributes:
        world: A fingerprint of the model; the snapshot of another world is refused.
        physics: MuJoCo's integration state, float64.
        sensors: The readings of the last step, float64.
        noise: The state of each lidar's noise generator.
        drive: v and ω of the drive's ramp.
        walked_s: Time in motion of each mover.
        steps_to_tick: Steps until the next update of the movers.
        pillar: Position of the pillar, or None.
        collisions: Number of collisions since the last reset.
        touching: Whether the hull had contact.
        last_contact: Object of the last contact.
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
        """Read the bytes of `to_bytes`.

        Raises:
            SnapshotError: The bytes are not a snapshot of this version.
        """
        try:
            return _ADAPTER.validate_json(data)
        except ValidationError as error:
            raise SnapshotError("these bytes are no snapshot of this version; take a new one") from error


_ADAPTER = TypeAdapter(Snapshot)
