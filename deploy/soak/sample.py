"""What is written down each ten seconds."""

import json
import math
from dataclasses import asdict, dataclass

from deploy.soak.heard import Gaps
from deploy.soak.usage import Usage


@dataclass(frozen=True, slots=True)
class Sample:
    """One line of the file."""

    time_s: float
    """Since the soak began."""
    processes: dict[str, Usage]
    ticks: Gaps
    """Of cmd_vel: its gaps, as an independent subscriber hears it."""
    heartbeat: Gaps
    """Of teleop: how much later than 50 ms after the one before."""
    lost: dict[str, int]
    """Of each topic, by its sequence."""
    false_stops: tuple[str, ...]
    obstacle_stops: int
    """Since the soak began, as are the two that follow."""
    black_boxes: int
    driven_m: float
    load: float
    """Of the machine, over the last minute."""

    def to_json(self) -> str:
        gaps = {"ticks": _spelled(self.ticks), "heartbeat": _spelled(self.heartbeat)}
        return json.dumps({"kind": "sample", **asdict(self), **gaps})


def _spelled(gaps: Gaps) -> dict[str, float | None]:
    """JSON has no NaN."""
    return {name: None if math.isnan(value) else value for name, value in gaps._asdict().items()}
