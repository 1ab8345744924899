"""Statistics of the robot's distance from the path."""

import math
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrackError:
    """Number, root mean square and maximum of the distances from the path [m]."""

    count: int
    rms_m: float
    max_m: float

    @classmethod
    def of(cls, distances_m: Iterable[float]) -> "TrackError | None":
        """Return the statistics of distances; None if there are none."""
        distances = list(distances_m)
        if not distances:
            return None
        rms_m = math.sqrt(math.fsum(d * d for d in distances) / len(distances))
        return cls(len(distances), rms_m, max(distances))
