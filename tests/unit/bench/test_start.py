"""The statistics of `bench.start` and `bench.process`."""

import pytest

from bench import process, start
from bench.process import PHASES, Load
from bench.rig.sheet import Times
from bench.start import Start


def test_the_restart_is_compared_with_the_import_of_the_same_round() -> None:
    starts = (Start(0.5, 1.0, 0.9), Start(0.2, 2.0, 0.8), Start(0.1, 3.0, 0.9))
    [verdict] = start.verdicts(starts)
    assert verdict.measured == pytest.approx(0.6)
    assert len(start.starts_sheet(starts).rows) == 3


def test_processor_time_is_compared_with_the_relay_of_the_same_round() -> None:
    def load(phase: str, number: int, cpu_percent: float) -> Load:
        gaps = Times(400, 20.0, 21.0, 25.0)
        return Load(phase, number, 8.0, "DRIVING", cpu_percent, 1.0, 50.0, 70.0, 50.0, gaps)

    names = [phase.name for phase in PHASES]
    loads = [
        load(name, number, busy * cpu)
        for number, busy in enumerate((1.0, 2.0, 3.0))
        for name, cpu in zip(names, (2.0, 3.0, 5.0), strict=True)
    ]
    assert [verdict.measured for verdict in process.verdicts(loads)] == [1.5, 2.5]
    assert [row[4] for row in process.load_sheet(loads).rows][1:] == [
        "1.50 (1.50 to 1.50)",
        "2.50 (2.50 to 2.50)",
    ]
