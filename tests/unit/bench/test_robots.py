"""The statistics of `bench.robots`: gaps, stops and their reasons, promises and the stored file."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from bench.rig.load import Machine, busy_percent
from bench.rig.sheet import percentile
from bench.robots.results import (
    Crowd,
    Heard,
    Robots,
    gaps_ms,
    promises,
    read,
    reasons,
    sheet,
    stood,
    stop_ms,
    transits_ms,
    write,
)

WINDOW = (1.0, 2.0)
MOVES, STANDS = True, False
RUN = {
    "command": "python -m bench.robots",
    "date": "today",
    "machine": "2 cores, load average 1.0",
    "commit": "abc",
}


def crowd(robots: int, gap_p99_ms: float = 21.0, stop_ms: tuple[float, ...] = (2.0, 4.0)) -> Crowd:
    return Crowd(
        robots=robots,
        seconds=20.0,
        cpu_percent=(5.0,) * robots,
        delay_percent=2.0,
        feeder_percent=20.0,
        busy_percent=60.0,
        kills_busy_percent=70.0,
        other_percent=1.0,
        gap_p50_ms=20.0,
        gap_p99_ms=gap_p99_ms,
        gap_max_ms=25.0,
        transit_p99_ms=1.5,
        late_p99_ms=0.5,
        garbled=0,
        stood=0,
        reasons={},
        kills=2,
        stop_ms=stop_ms,
    )


def test_gaps_are_between_the_commands_within_the_window() -> None:
    heard: list[Heard] = [
        (0.99, 0.98, MOVES),
        (1.0, 0.99, MOVES),
        (1.02, 1.0, MOVES),
        (1.05, 1.04, MOVES),
        (2.0, 1.99, MOVES),
    ]
    assert gaps_ms(WINDOW, heard) == pytest.approx([20.0, 30.0])
    assert transits_ms(WINDOW, heard) == pytest.approx([10.0, 20.0, 10.0])


def test_a_robot_with_one_zero_command_within_the_window_has_stopped() -> None:
    assert not stood(WINDOW, [(0.9, 0.9, STANDS), (1.0, 1.0, MOVES), (2.0, 2.0, STANDS)])
    assert stood(WINDOW, [(1.0, 1.0, MOVES), (1.5, 1.5, STANDS), (1.6, 1.6, MOVES)])


def test_a_robot_without_commands_has_stopped() -> None:
    assert stood(WINDOW, [(0.9, 0.9, MOVES)])


def test_the_reasons_are_those_of_stopped_statuses_within_the_window() -> None:
    statuses = [
        (0.9, "STOPPED", ["NO_COMMAND"]),
        (1.0, "STOPPED", ["OVERRUN", "SCAN_STALE"]),
        (1.1, "LIMITED", ["OBSTACLE"]),
        (1.2, "STOPPED", ["OVERRUN"]),
        (2.0, "STOPPED", ["ESTOP"]),
    ]
    assert reasons(WINDOW, statuses) == {"OVERRUN", "SCAN_STALE"}


def test_a_stop_lasts_from_the_kill_to_the_first_zero() -> None:
    heard: list[Heard] = [(0.9, 0.9, STANDS), (0.99, 0.99, MOVES), (1.01, 1.0, MOVES), (1.02, 1.01, STANDS)]
    assert stop_ms(1.0, heard) == pytest.approx(20.0)


@pytest.mark.parametrize(
    "heard",
    [
        [],
        [(0.9, 0.9, STANDS), (1.01, 1.0, STANDS)],  # it did not move when its operator was killed
        [(0.9, 0.9, MOVES), (1.01, 1.0, MOVES)],
    ],
)
def test_a_stop_needs_motion_before_the_kill_and_a_zero_after_it(heard: list[Heard]) -> None:
    assert stop_ms(1.0, heard) is None


def test_the_busy_share_is_computed_between_two_readings() -> None:
    assert busy_percent(Machine(100.0, 1000.0), Machine(150.0, 1200.0)) == 75.0


def test_the_percentile_of_no_values_is_nan() -> None:
    assert math.isnan(percentile([], 99))
    assert percentile([1.0, 3.0], 50) == 2.0


def test_promises_are_kept_only_without_missing_stops_and_stops_without_cause() -> None:
    def broken(**changes: object) -> int:
        found = promises(replace(crowd(10), **changes))  # pyright: ignore[reportArgumentType]
        return sum(verdict.sentence(is_judged=True).startswith("OVER TARGET") for verdict in found)

    assert broken() == 0
    assert broken(missed=1) == broken(stood=1) == broken(stood_in_kills=1) == 1


def test_the_table_has_a_row_for_each_number_of_robots_and_the_run() -> None:
    table = sheet(
        Robots(RUN, (crowd(1), replace(crowd(30), stood=2, reasons={"OVERRUN": 2, "SCAN_STALE": 1})))
    )
    assert [row[0] for row in table.rows] == ["1", "30"]
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert [row[10] for row in table.rows] == ["0", "2 (OVERRUN 2, SCAN_STALE 1)"]
    assert (
        table.notes[-1] == "Run of today by `python -m bench.robots`: 2 cores, load average 1.0; commit abc."
    )


def test_robots_behind_a_router_have_its_processor_time_and_traffic() -> None:
    table = sheet(Robots(RUN, (replace(crowd(5), router_percent=3.0, crossing_bytes_s=6300.0),)))
    assert dict(zip(table.columns[-2:], table.rows[0][-2:], strict=True)) == {
        "CPU of the router": "3.0",
        "KB/s of each": "6.3",
    }


def test_where_no_killed_operator_had_driven_the_times_are_dashes() -> None:
    table = sheet(Robots(RUN, (replace(crowd(20), stop_ms=()),)))
    assert table.rows[0][table.columns.index("stop p50")] == "–"


def test_a_stored_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "robots.jsonl"
    robots = Robots(RUN, (crowd(1), replace(crowd(2), stood=1, reasons={"OVERRUN": 1})))
    write(robots, file)
    assert read(file) == robots
