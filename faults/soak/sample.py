"""The record of each ten seconds."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from faults.soak.heard import Gaps
from faults.soak.usage import Usage
from faults.trial import PROVENANCE_BEGINS, Provenance, parse_provenance
from faults.trial_file import whole_lines


@dataclass(frozen=True, slots=True)
class Sample:
    """One line of the file; see the fields."""

    time_s: float
    """Time since the soak began."""
    processes: dict[str, Usage]
    ticks: Gaps
    """Gaps of cmd_vel at an independent subscriber."""
    heartbeat: Gaps
    """Lateness of teleop's commands beyond their period of 50 ms."""
    lost: dict[str, int]
    """Lost samples of each topic, by sequence number."""
    false_stops: tuple[str, ...]
    obstacle_stops: int
    """Since the soak began; the next two fields as well."""
    black_boxes: int
    driven_m: float
    load: float
    """Load average of the last minute."""

    def to_json(self) -> str:
        gaps = {"ticks": _spelled(self.ticks), "heartbeat": _spelled(self.heartbeat)}
        return json.dumps({"kind": "sample", **asdict(self), **gaps})


def _spelled(gaps: Gaps) -> dict[str, float | None]:
    """JSON has no NaN."""
    return {name: None if math.isnan(value) else value for name, value in gaps._asdict().items()}


def read_samples(path: Path) -> tuple[list[Sample], Provenance | None]:
    """Return the samples of a soak's file, compressed or not, and their provenance; None if there is none.

    Raises:
        DeployError: the file cannot be read, or its provenance is damaged.
        ValueError: a line is not a sample of a soak.
    """
    samples: list[Sample] = []
    provenance = None
    for line in whole_lines(path, "a soak"):
        if line.startswith(PROVENANCE_BEGINS):
            provenance = parse_provenance(line)
        else:
            samples.append(_read(json.loads(line)))
    return samples, provenance


def _read(fields: dict[str, Any]) -> Sample:
    try:
        del fields["kind"]
        read: dict[str, Any] = {
            **fields,
            "processes": {name: Usage(**used) for name, used in fields["processes"].items()},
            "ticks": _gaps(fields["ticks"]),
            "heartbeat": _gaps(fields["heartbeat"]),
            "false_stops": tuple(fields["false_stops"]),
        }
        return Sample(**read)
    except (KeyError, TypeError) as error:
        raise ValueError(f"not a sample of a soak: {error}") from error


def _gaps(fields: dict[str, float | None]) -> Gaps:
    read: dict[str, Any] = {name: math.nan if value is None else value for name, value in fields.items()}
    return Gaps(**read)
