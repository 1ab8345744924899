"""`lifeline watch`: its rows, its JSON lines, and which robots its options name."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from deploy.stack.errors import DeployError
from deploy.stack.formatting import HEARD_LIMIT_S
from lifeline.watch.rows import LINE_PERIOD_S, Lines, Watched, cells, row_at, table, to_json
from lifeline.watch.watch import launches
from wire.messages import SafetyStatus, header, odometry

ENDPOINT = "tcp/127.0.0.1:7447"


def status(mode: int = SafetyStatus.STOPPED, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - any field
    return SafetyStatus(header("", 0), mode=mode, **fields)


def watched(heard: SafetyStatus | None = None, **fields: Any) -> Watched:  # noqa: ANN401 - any field
    return Watched("robot", ENDPOINT, since_s=0.0, status=heard, status_s=10.0, **fields)


def document(robot: Watched, now_s: float = 10.0) -> dict[str, Any]:
    return json.loads(to_json(row_at(robot, now_s), 1000.0))


def test_a_line_names_the_robot_and_what_its_status_says() -> None:
    stopped = status(causes=["OBSTACLE"], latched=["OVERRUN"], owner="teleop", nearest_m=0.3)
    line = document(watched(stopped))
    assert (line["robot"], line["namespace"]) == (f"robot@{ENDPOINT}", "robot")
    assert (line["up"], line["mode"], line["owner"]) == (True, "STOPPED", "teleop")
    assert line["reasons"] == ["OBSTACLE", "OVERRUN"]
    assert (line["causes"], line["latched"]) == (["OBSTACLE"], ["OVERRUN"])
    assert line["nearest_m"] == pytest.approx(0.3)
    assert line["unix_time_s"] == 1000.0


def test_unknown_values_are_null_and_not_nan() -> None:
    line = document(watched(status(nearest_m=math.nan)))
    assert line["nearest_m"] is None
    assert line["linear_m_s"] is None


def test_a_status_is_shown_until_its_limit_and_not_after() -> None:
    robot = watched(status(SafetyStatus.DRIVING))
    at_limit_s = 10.0 + HEARD_LIMIT_S
    assert row_at(robot, at_limit_s).mode == "DRIVING"
    late = row_at(robot, math.nextafter(at_limit_s, math.inf))
    assert late.mode is None
    assert late.link == "no supervisor for 1 s"
    assert document(robot, 15.0)["status_age_s"] == 5.0


def test_outdated_odometry_is_not_shown() -> None:
    moving = odometry((1.0, 2.0, 0.0), (0.5, 0.1))
    robot = watched(status(SafetyStatus.DRIVING), odometry=moving, odometry_s=10.0)
    assert document(robot)["linear_m_s"] == 0.5
    robot.status_s = 12.0
    assert document(robot, 12.0)["linear_m_s"] is None


def test_without_a_status_the_link_says_connecting_then_no_supervisor() -> None:
    assert row_at(watched(), 0.5).link == "connecting"
    assert row_at(watched(), 5.0).link == "no supervisor"
    assert row_at(watched(problem="bad\x1b[2J"), 5.0).link == "bad?[2J"


def test_causes_come_before_latched_reasons_in_the_table() -> None:
    row = row_at(watched(status(causes=["OBSTACLE"], latched=["OVERRUN"])), 10.0)
    assert cells(row)[-1] == "OBSTACLE, OVERRUN (over)"


def test_a_fleet_names_its_endpoint_once_shows_no_speed_and_has_short_rows_on_80_columns() -> None:
    stopped = status(
        causes=["ESTOP_STATION_LOST", "NO_COMMAND"], owner="teleop", nearest_m=0.31, nearest_bearing_rad=-1.8
    )
    silent = watched(status())
    silent.namespace, silent.status_s = "warehouse_12", 0.0
    console = Console(width=80)
    with console.capture() as capture:
        console.print(table([row_at(one, 10.0) for one in (watched(stopped), silent)], ENDPOINT))
    lines = capture.get().splitlines()
    assert sum(ENDPOINT in line for line in lines) == 1
    assert "speed" not in capture.get()
    title, heading = 1, 1
    assert len(lines) <= title + heading + 2 + 2, capture.get()


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
@pytest.mark.parametrize("endpoint", [None, ENDPOINT])
def test_a_value_of_another_length_moves_no_column(columns: int, endpoint: str | None) -> None:
    quiet = watched(status(SafetyStatus.READY, nearest_m=math.nan))
    busy = watched(
        status(causes=["ESTOP_STATION_LOST"], owner="teleop", nearest_m=12.31, nearest_bearing_rad=-1.8),
        odometry=odometry((1.0, 2.0, 0.0), (-0.31, -0.52)),
        odometry_s=10.0,
    )
    silent = watched(status())
    silent.status_s = 0.0
    console = Console(width=columns)
    headings = set[str]()
    for robot in (quiet, busy, silent):
        robot.namespace = "rover"
        with console.capture() as capture:
            console.print(table([row_at(robot, 10.0)], endpoint))
        headings.add(capture.get().partition("rover")[0])
    assert len(headings) == 1


def test_control_sequences_from_the_network_do_not_reach_the_terminal() -> None:
    row = row_at(watched(status(causes=["[bold]\x1b[2J"], owner="\x07")), 10.0)
    console = Console(width=160)
    with console.capture() as capture:
        console.print(table([row]))
    assert "[bold]?[2J" in capture.get()
    assert "\x07" not in capture.get()
    assert "\x1b" not in to_json(row, 0.0)


def test_a_line_is_due_on_a_change_and_after_the_period_only() -> None:
    lines = Lines(10.0)
    robot = watched(status(owner="teleop", nearest_m=1.0))
    assert lines.due(row_at(robot, 10.0), 10.0)
    robot.status = status(owner="teleop", nearest_m=0.9)
    assert not lines.due(row_at(robot, 10.1), 10.1)
    robot.status = status(SafetyStatus.READY, owner="teleop")
    assert lines.due(row_at(robot, 10.2), 10.2)
    assert not lines.due(row_at(robot, 10.3), 10.3)
    assert lines.due(row_at(robot, 10.9), 10.21 + LINE_PERIOD_S)


def test_the_loss_of_the_supervisor_is_a_change() -> None:
    lines = Lines(10.0)
    robot = watched(status())
    assert lines.due(row_at(robot, 10.9), 10.9)
    assert lines.due(row_at(robot, 11.1), 11.1)


def test_a_robot_that_never_answers_has_a_line_after_the_first_period() -> None:
    lines = Lines(0.0)
    assert not lines.due(row_at(watched(), 0.0), 0.0)
    assert lines.due(row_at(watched(), LINE_PERIOD_S), LINE_PERIOD_S)


def test_each_endpoint_and_each_configuration_is_a_robot(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text('[bus]\nnamespace = "rover"\n')
    other = tmp_path / "b.toml"
    other.write_text('[bus]\nnamespace = "cart"\n')
    one, two = "tcp/127.0.0.1:18441", "tcp/127.0.0.1:18442"
    assert [robot.bus.endpoint for robot in launches([], [one, two, one])] == [one, two]
    assert [robot.bus.namespace for robot in launches([file, other], [])] == ["rover", "cart"]
    both = launches([file], [one, two])
    assert {(robot.bus.namespace, robot.bus.endpoint) for robot in both} == {("rover", one), ("rover", two)}
    with pytest.raises(DeployError, match="ambiguous"):
        launches([file, other], [one])
