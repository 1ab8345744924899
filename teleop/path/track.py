"""How far from the path the robot was."""

import math
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrackError:
    """Of distances to the path [m]: how many, their root mean square, their maximum."""

    count: int
    rms_m: float
    max_m: float

    @classmethod
    def of(cls, distances_m: Iterable[float]) -> "TrackError | None":
        """None where there are none."""
        distances = list(distances_m)
        if not distances:
            return None
        rms_m = math.sqrt(math.fsum(d * d for d in distances) / len(distances))
        return cls(len(distances), rms_m, max(distances))
