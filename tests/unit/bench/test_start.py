"""The statistics of `bench.start`, and its part of the report."""

import pytest

from bench.report import Results
from bench.start import Start, summary

EMPTY = ((), (), (), (), ())


def test_imports_are_compared_with_the_libraries_of_the_same_round() -> None:
    imports = summary("sim", [200.0, 300.0, 900.0], [100.0, 100.0, 300.0])
    assert (imports.median_ms, imports.runs) == (300.0, 3)
    assert imports.to_libraries == pytest.approx(3.0)


def test_the_verdicts_are_for_the_medians() -> None:
    starts = (Start(1.0, 0.0, 0.5), Start(2.1, 0.1, 0.8), Start(3.0, 1.0, 0.9))
    results = Results(*EMPTY, (summary("sim", [2.0], [1.0]),), starts)
    assert [verdict.measured for verdict in results.verdicts()] == [2.1, 0.8]
    assert [len(sheet.rows) for sheet in results.sheets()] == [1, 3]


def test_without_starts_there_is_neither_a_verdict_nor_a_table() -> None:
    results = Results(*EMPTY, (), ())
    assert (results.verdicts(), results.sheets()) == ([], [])
