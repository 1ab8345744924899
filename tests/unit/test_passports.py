"""The passports that are stored in docs/passports, and the sentence of README.md about one of them."""

import json
import math
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from docs.generate import fresh_runs, readme
from docs.generate.passports import DEMO, ROS2, certificate_of, page_of, read
from lifeline.cli.app import app


def verify(page: Path, certificate: Path) -> tuple[int, str]:
    """Run `lifeline passport verify`; return its exit code and output."""
    result = CliRunner().invoke(app, ["passport", "verify", str(page), "--keys", str(certificate)])
    return result.exit_code, " ".join(result.output.split())


@pytest.mark.parametrize("robot", [DEMO, ROS2])
def test_a_stored_passport_is_verified_by_the_certificate_beside_it_and_by_no_other(robot: str) -> None:
    code, output = verify(page_of(robot), certificate_of(robot))
    assert (code, f"signed by {robot} (supervisor@robot)" in output) == (0, True), output
    other = ROS2 if robot == DEMO else DEMO
    code, output = verify(page_of(robot), certificate_of(other))
    assert (code, "signed by" in output) == (1, False), output


def test_each_number_in_the_readmes_sentence_about_a_passport_is_that_of_the_record() -> None:
    """Computed here from the runs: the limits of cells with few runs are their largest values."""
    record, _ = read(DEMO)
    top_m_s = record.conditions.top_speed_m_s
    cells = [
        cell for cell in record.cells if cell.with_lifeline and cell.speed_m_s == top_m_s and not cell.turn
    ]
    timed = [cell for cell in cells if all(run.t3_s is not None for run in cell.runs)]
    moved_m = max(run.distance_m or math.nan for cell in cells for run in cell.runs)
    lasted_s = max(run.t3_s or math.nan for cell in timed for run in cell.runs)
    fewest = min(len(cell.runs) for cell in cells)
    numbers = [float(text) for text in re.findall(r"\d+(?:\.\d+)?", readme.passport())]
    assert numbers == [
        len(cells),
        top_m_s,
        0.0,
        math.ceil(100 * (moved_m + record.instrument.uncertainty_m)) / 100,
        len(timed),
        math.ceil(100 * (lasted_s + record.instrument.uncertainty_s)) / 100,
        *([fewest] if fewest > 1 else []),
    ]


def test_the_further_runs_that_exceed_a_limit_are_counted_and_few() -> None:
    """Computed here from the runs: the limit of 117 runs for 11 cells together is their largest value."""
    further = json.loads(fresh_runs.FILE.read_text())
    record, _ = read(DEMO)
    (cell,) = [
        one
        for one in record.cells
        if (one.fault, one.speed_m_s) == (further["fault"], further["speed_m_s"]) and one.with_lifeline
    ]
    limit_m = max(run.distance_m or math.nan for run in cell.runs) + record.instrument.uncertainty_m
    farther = further["not_stopped"] + sum(one > limit_m for one in further["distances_m"])
    runs = further["not_stopped"] + len(further["distances_m"])
    assert f"Of {runs} further runs, {farther} exceeded the distance" in fresh_runs.part()
    assert runs == 300
    assert farther <= 35
