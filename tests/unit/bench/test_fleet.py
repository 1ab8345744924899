"""The tables of `bench.fleet`."""

from dataclasses import replace

from bench.fleet import COLUMNS, STOP_LIMIT_MS, sheet, soak_verdicts
from tests.unit.bench.test_robots import crowd


def test_there_is_a_row_for_each_number_of_robots() -> None:
    rows = sheet([replace(crowd(1), router_percent=3.0), crowd(5)]).rows
    assert [(len(row), row[0]) for row in rows] == [(len(COLUMNS), "1"), (len(COLUMNS), "5")]
    assert rows[0][1] == "3.0"


def test_a_long_run_keeps_its_promises_only_without_late_or_missing_stops_and_stops_without_cause() -> None:
    kept = crowd(10)

    def broken(**changes: object) -> int:
        verdicts = soak_verdicts(replace(kept, **changes))  # pyright: ignore[reportArgumentType]
        return sum(verdict.sentence().startswith("OVER TARGET") for verdict in verdicts)

    assert broken() == 0
    assert broken(stop_ms=(2.0, STOP_LIMIT_MS + 1.0)) == 1
    assert broken(missed=1) == broken(stood=1) == broken(stood_in_kills=1) == 1


def test_where_no_killed_operator_had_driven_the_times_are_dashes() -> None:
    [row] = sheet([replace(crowd(20), stop_ms=())]).rows
    assert [cell for (name, _), cell in zip(COLUMNS, row, strict=True) if name == "stop p50"] == ["–"]
