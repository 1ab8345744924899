"""Further runs of a cell of the simulated robot's passport, compared with its limits: `python -m docs.generate.fresh_runs RECORD...`.

Each RECORD is that of `python -m docs.generate.measure_passport --fault NAME --runs N --record RECORD`. Their distances and times go to
docs/passports/fresh.json; docs/passport.md states how many exceed the limits of the stored page.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from docs.generate import sections
from docs.generate.passports import DEMO, FOLDER, read
from passport.record import Cell, Passport, from_json
from passport.statistics import rounded_up
from passport.summary import Row, rows
from wire.foreign import ForeignError

FILE = FOLDER / "fresh.json"


class Fresh(BaseModel):
    """Runs of one cell in which the robot stopped, in the order of the measurement."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    fault: str
    speed_m_s: float
    load_percent: int
    commit: str
    date: str
    machine_load: str
    distances_m: Annotated[tuple[float, ...], Field(min_length=1)]
    times_s: tuple[float | None, ...]
    not_stopped: int


def fresh(records: Sequence[Passport]) -> Fresh:
    """Return the runs of records of one cell each.

    Raises:
        ValueError: a record has more cells, or that of another fault, speed, load or version.
    """
    cells = [one.cells for one in records]
    if any(len(found) != 1 for found in cells):
        raise ValueError("each record must have one cell: measure one fault")
    conditions = {
        (one.cells[0].fault, one.cells[0].speed_m_s, one.cells[0].load_percent, one.commit) for one in records
    }
    if len(conditions) != 1:
        raise ValueError("the records differ in fault, speed, load or version")
    ((fault, speed_m_s, load_percent, commit),) = conditions
    runs = [run for (cell,) in cells for run in cell.runs]
    stopped = [run for run in runs if run.stopped]
    return Fresh(
        fault=fault,
        speed_m_s=speed_m_s,
        load_percent=load_percent,
        commit=commit,
        date=records[0].date,
        machine_load=records[0].conditions.machine_load,
        distances_m=tuple(run.distance_m or math.nan for run in stopped),
        times_s=tuple(run.t3_s for run in stopped),
        not_stopped=len(runs) - len(stopped),
    )


def _is_cell_of(found: Fresh, cell: Cell) -> bool:
    return (
        (cell.fault, cell.speed_m_s, cell.load_percent) == (found.fault, found.speed_m_s, found.load_percent)
        and cell.with_lifeline
        and not cell.turn
    )


def part() -> str:
    """Return how many of the further runs exceed the limits of the stored page."""
    found = Fresh.model_validate_json(FILE.read_text())
    stored, _ = read(DEMO)
    (row,) = [one for one in rows(stored) if _is_cell_of(found, one.cell)]
    return _sentence(found, row)


def _sentence(found: Fresh, row: Row) -> str:
    assert row.distance_m is not None
    assert row.stopping_s is not None
    runs = len(found.distances_m) + found.not_stopped
    farther = found.not_stopped + sum(one > row.distance_m.value for one in found.distances_m)
    longer = found.not_stopped + sum(one is None or one > row.stopping_s.value for one in found.times_s)
    return (
        f"The limits were tried on the simulated robot. The page gives {rounded_up(row.distance_m.value)} m and {rounded_up(row.stopping_s.value)} s for "
        f"“{found.fault}” at {row.cell.speed}, from {row.runs} runs. Of {runs} further runs, {farther} exceeded the distance and {longer} the time, before "
        f"these limits were rounded up; if they were exactly the 95 % quantiles, {0.05 * runs:.0f} of each would be expected. The further runs were measured by "
        f"`python -m docs.generate.measure_passport --fault NAME --runs N --record FILE` and counted by `python -m docs.generate.fresh_runs FILE...`: "
        f"commit {found.commit[:8]}, {found.date}, {found.machine_load}."
    )


PARTS: sections.Parts = {"fresh": part}


def main() -> int:
    """Store the runs; return 1 with one sentence on stderr if the records cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.fresh_runs")
    parser.add_argument("records", metavar="RECORD", type=Path, nargs="+")
    try:
        found = fresh([from_json(record.read_text()) for record in parser.parse_args().records])
    except (OSError, ForeignError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    FILE.write_text(found.model_dump_json() + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
