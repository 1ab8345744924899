"""The statistics of `bench.start`, and its part of the report."""

import pytest

from bench.start import Start, starts_sheet, summary, verdicts


def test_imports_are_compared_with_the_libraries_of_the_same_round() -> None:
    imports = summary("sim", [200.0, 300.0, 900.0], [100.0, 100.0, 300.0])
    assert (imports.median_ms, imports.runs) == (300.0, 3)
    assert imports.to_libraries == pytest.approx(3.0)


def test_the_verdicts_are_for_the_medians() -> None:
    starts = (Start(1.0, 0.0, 0.5), Start(2.1, 0.1, 0.8), Start(3.0, 1.0, 0.9))
    assert [verdict.measured for verdict in verdicts(starts)] == [2.1, 0.8]
    assert len(starts_sheet(starts).rows) == 3
