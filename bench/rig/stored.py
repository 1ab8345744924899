"""Stored runs of the longer benchmarks: one JSON object a line, the run first, then its measurements, each with its kind."""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bench.rig.sheet import commit, machine, now

Row = tuple[str, dict[str, Any]]
"""The kind of a measurement, and its fields."""


def this_run(command: str) -> dict[str, str]:
    """Return command, date, machine and commit of a run that has just ended."""
    return {"command": command, "date": now(), "machine": machine(), "commit": commit()}


def origin(run: dict[str, str]) -> str:
    """Return a sentence that describes a run."""
    return "Run of {date} by `{command}`: {machine}; commit {commit}.".format(**run)


def write_rows(path: Path, run: dict[str, str], rows: Iterable[Row]) -> None:
    lines = [{"row": "run", **run}, *({"row": kind, **fields} for kind, fields in rows)]
    text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
    # A process that is killed while it writes leaves the earlier measurements.
    written = path.with_name(f".{path.name}.{os.getpid()}")
    written.write_text(text)
    written.replace(path)


def read_rows(path: Path) -> tuple[dict[str, str], list[Row]] | None:
    """Return the run and its measurements; None if the file does not exist.

    Raises:
        RuntimeError: the file is not a stored run.
    """
    if not path.exists():
        return None
    try:
        run, *rows = map(json.loads, path.read_text().splitlines())
        del run["row"]
        return run, [(row.pop("row"), row) for row in rows]
    except (ValueError, KeyError, TypeError) as error:
        raise RuntimeError(f"{path} is not a stored run of a bench") from error
