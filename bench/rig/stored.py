"""Stored runs of the longer benchmarks: one JSON object a line, the run first, then its measurements, each with its kind.

Measurements that take hours are appended to their file one by one, and the run follows them.
"""

import json
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from pydantic import TypeAdapter, ValidationError

from bench.rig.load import averages
from bench.rig.program import ROOT
from deploy.stack.provenance import commit, machine, now
from faults.trial import PROVENANCE_BEGINS, Provenance, parse
from faults.trial_file import whole_lines

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

FOLDER = ROOT / "docs/campaign"
Row = tuple[str, dict[str, Any]]
"""The kind of a measurement, and its fields."""
T = TypeVar("T")


class StoredRun(NamedTuple):
    """The content of a file."""

    run: dict[str, str]
    """Command, date, machine and commit."""
    rows: list[Row]

    def of(self, kind: str, made: type[T]) -> tuple[T, ...]:
        """Return the measurements of a kind as objects of a data class.

        Raises:
            RuntimeError: a measurement lacks a field, or a field has another type.
        """
        try:
            return tuple(TypeAdapter(made).validate_python(row) for name, row in self.rows if name == kind)
        except ValidationError as error:
            raise RuntimeError(f"a stored run has a damaged {kind}: {error}") from error


def this_run(command: str) -> dict[str, str]:
    """Return command, date, machine and commit of a run that has just ended; the machine with its load, and whether it was idle."""
    before, during = averages()
    loads = f"load average {before:.1f} before and {during:.1f} during"
    text = f"{re.sub(r'load average [0-9.]+', loads, machine())}, numpy {version('numpy')}"
    return {"command": command, "date": now(), "machine": text, "idle": _idle(text), "commit": commit()}


def was_idle(run: Mapping[str, str]) -> bool:
    """Return whether no load average of a run exceeded the number of cores; earlier runs have only that before them."""
    return _idle(run["machine"]) == "yes"


def loads(machine: str) -> list[float]:
    """Return the load averages in the description of a machine: before a run, and during it if that is known."""
    found = re.findall(r"load average ([\d.]+)(?: before)?(?: and ([\d.]+) during)?", machine)
    return [float(load) for pair in found for load in pair if load]


def _idle(machine: str) -> str:
    cores = re.match(r"\d+(?= cores)", machine)
    return "yes" if cores and max(loads(machine), default=math.inf) <= int(cores[0]) else "no"


def read_appended(path: Path, made: type[T]) -> tuple[list[T], list[Provenance]]:
    """Return the measurements of a file to which they were appended, compressed or not, and their provenances.

    Raises:
        DeployError: the file cannot be read, or a provenance is damaged.
        ValueError: a line is not such a measurement.
    """
    measured, origins, read = list[T](), list[Provenance](), TypeAdapter(made).validate_json
    for line in whole_lines(path, "the measurements"):
        if line.startswith(PROVENANCE_BEGINS):
            origins.append(parse(Provenance, line))
        else:
            measured.append(read(line))
    return measured, origins


def origin(run: Mapping[str, str]) -> str:
    """Return a sentence that describes a run."""
    mark = "" if was_idle(run) else " **The machine was not idle.**"
    return "Run of {date} by `{command}`: {machine}; commit {commit}.".format(**run) + mark


def rows_of(kind: str, measured: "Iterable[DataclassInstance]", digits: int | None = None) -> list[Row]:
    """Return measurements as rows, with their figures rounded to so many digits after the point; None: as they are."""
    return [(kind, {name: _short(value, digits) for name, value in asdict(one).items()}) for one in measured]


def _short(value: Any, digits: int | None) -> object:  # noqa: ANN401 - any field
    if isinstance(value, tuple):
        return [_short(one, digits) for one in value]  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, dict):
        return {name: _short(one, digits) for name, one in value.items()}  # pyright: ignore[reportUnknownVariableType]
    return round(value, digits) if isinstance(value, float) and digits is not None else value


def write_rows(path: Path, run: dict[str, str], rows: Iterable[Row]) -> None:
    lines = [{"row": "run", **run}, *({"row": kind, **fields} for kind, fields in rows)]
    text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
    # A process that is killed while it writes leaves the earlier measurements.
    written = path.with_name(f".{path.name}.{os.getpid()}")
    written.write_text(text)
    written.replace(path)


def read_rows(path: Path) -> StoredRun:
    """Return the run and its measurements.

    Raises:
        RuntimeError: the file is not a stored run.
    """
    try:
        run, *rows = map(json.loads, path.read_text().splitlines())
        del run["row"]
        return StoredRun(run, [(row.pop("row"), row) for row in rows])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RuntimeError(f"{path} is not a stored run of a bench") from error
