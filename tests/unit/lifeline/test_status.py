"""`lifeline status`: what it prints of a stop, for people and as JSON."""

import json
from dataclasses import replace
from typing import Any

from rich.console import Console

from deploy.stack.ros2_reports import Level, Report
from lifeline.status import Look, table
from wire.host.installation import runnable
from wire.messages import SafetyStatus, header, odometry


def look(mode: int = SafetyStatus.STOPPED, **fields: Any) -> Look:  # noqa: ANN401 - any field of the status
    return Look(
        endpoint="tcp/127.0.0.1:7447",
        connected=True,
        alive=frozenset({"supervisor", "sim"}),
        programs={},
        status=SafetyStatus(header("", 0), mode=mode, **fields),
        odometry=None,
    )


def printed(seen: Look) -> str:
    console = Console(width=160)
    with console.capture() as capture:
        console.print(table(seen))
    return capture.get()


def row(seen: Look, name: str) -> str | None:
    lines = (line for line in printed(seen).splitlines() if line.startswith(f"{name}  "))
    return next((line.removeprefix(name).strip() for line in lines), None)


def test_what_holds_and_what_is_over_have_a_row_each() -> None:
    seen = look(
        reasons=["OVERRUN", "SCAN_BLIND"],
        causes=["SCAN_BLIND"],
        latched=["OVERRUN"],
        detail="unseen space at 40° left",
    )
    assert row(seen, "causes") == "SCAN_BLIND: unseen space at 40° left"
    assert row(seen, "latched") == "OVERRUN"


def test_the_details_stand_beside_the_cause_that_they_explain() -> None:
    detail = "pressed by teleop, 2026-11-26 17:02:04"
    seen = look(reasons=["ESTOP", "NO_COMMAND"], causes=["ESTOP", "NO_COMMAND"], detail=detail)
    assert row(seen, "causes") == f"ESTOP: {detail}; also NO_COMMAND"


def test_a_cause_without_details_is_explained() -> None:
    seen = look(reasons=["SOURCE_LOST"], causes=["SOURCE_LOST"])
    assert row(seen, "causes") == "SOURCE_LOST: command source lost"


def test_where_all_is_over_it_says_what_to_do() -> None:
    seen = look(reasons=["OVERRUN", "SCAN_STALE"], latched=["OVERRUN", "SCAN_STALE"])
    assert row(seen, "causes") is None
    assert (
        row(seen, "latched")
        == "OVERRUN, SCAN_STALE: no longer present; release the keys or the stick (teleop: s) to drive again"
    )


def test_an_estop_that_was_reset_is_not_shown_as_latched_until_reset() -> None:
    pressed = look(reasons=["ESTOP"], causes=["ESTOP"])
    assert (row(pressed, "e-stop") or "").startswith("latched until reset")
    reset = look(reasons=["ESTOP", "SCAN_STALE"], causes=["SCAN_STALE"], latched=["ESTOP"])
    assert row(reset, "e-stop") is None


def test_the_reasons_of_an_older_supervisor_are_taken_to_hold() -> None:
    seen = look(reasons=["OVERRUN", "SCAN_STALE"])
    assert row(seen, "causes") == "OVERRUN: the supervisor was late; also SCAN_STALE"
    assert row(seen, "latched") is None


def test_a_robot_that_is_ready_has_neither_row() -> None:
    seen = look(SafetyStatus.READY)
    assert row(seen, "mode") == "READY"
    assert row(seen, "causes") is None
    assert row(seen, "latched") is None


def test_control_sequences_from_the_network_do_not_reach_the_terminal() -> None:
    seen = look(reasons=["[bold]\x1b[2J"], causes=["[bold]\x1b[2J"], detail="\x07")
    assert row(seen, "causes") == "[bold]?[2J: ?"


def test_nodes_that_use_the_keys_of_rmw_zenoh_have_a_row_only_if_there_are_any() -> None:
    assert row(look(), "not read") is None
    seen = look(rmw_zenoh_nodes=["/talker", "/\x1b[2J", "and 3 more"])
    assert row(seen, "not read") == "/talker, /?[2J, and 3 more: they use the keys of rmw_zenoh"
    assert json.loads(seen.to_json())["rmw_zenoh_nodes"] == ["/talker", "/\x1b[2J", "and 3 more"]


def test_json_has_what_holds_what_is_over_and_the_detail() -> None:
    document = json.loads(
        look(reasons=["OVERRUN", "OBSTACLE"], causes=["OBSTACLE"], latched=["OVERRUN"], detail="x").to_json()
    )
    assert document["reasons"] == ["OVERRUN", "OBSTACLE"]
    assert (document["causes"], document["latched"], document["detail"]) == (["OBSTACLE"], ["OVERRUN"], "x")
    older = json.loads(look(reasons=["ESTOP"]).to_json())
    assert (older["causes"], older["latched"], older["detail"]) == (["ESTOP"], [], "")


def test_only_the_nodes_that_were_started_are_needed() -> None:
    real = replace(look(), alive=frozenset({"supervisor", "ros2"}), needed=("supervisor", "ros2"))
    assert (real.exit_code, row(real, "ros2"), row(real, "sim")) == (0, "alive", None)
    assert list(json.loads(real.to_json())["nodes"]) == ["supervisor", "ros2", "teleop"]
    assert replace(real, alive=frozenset({"supervisor"})).exit_code == 1
    alone = replace(look(), alive=frozenset({"supervisor"}), needed=("supervisor",))
    assert alone.exit_code == 0


def test_a_base_of_unknown_kind_runs_if_it_sends_odometry() -> None:
    silent = replace(look(), alive=frozenset({"supervisor"}), needed=("supervisor", "base"))
    assert (silent.exit_code, row(silent, "base")) == (1, "not alive")
    moving = replace(silent, odometry=odometry((0.0, 0.0, 0.0), (0.1, 0.0)))
    assert (moving.exit_code, row(moving, "base")) == (0, "alive")


def test_the_reports_of_ros_2_have_a_row_each_but_the_one_that_repeats_the_mode() -> None:
    reports = (
        Report("supervisor", Level.WARN, "STOPPED", {}),
        Report("source joy", Level.OK, "/teleop on /joy/cmd_vel, guarded by process 12", {"hold_s": "0.6"}),
        Report("scan scan", Level.ERROR, "no node publishes on /scan [bold]", {}),
    )
    seen = replace(look(), ros2=reports)
    assert row(seen, "source joy") == "/teleop on /joy/cmd_vel, guarded by process 12"
    assert row(seen, "scan scan") == "no node publishes on /scan [bold]"
    assert printed(seen).count("STOPPED") == 1
    assert [report["name"] for report in json.loads(seen.to_json())["ros2"]] == [r.name for r in reports]
    assert "ros2" not in json.loads(look().to_json())


def test_what_an_interrupted_start_left_is_named_with_the_way_to_clean_up() -> None:
    nothing = replace(look(), connected=False, alive=frozenset[str](), status=None)
    assert printed(nothing) == runnable(
        "nothing is running at tcp/127.0.0.1:7447; start with `lifeline up`\n"
    )
    left = replace(nothing, left_over="supervisord (pid 4)")
    assert printed(left) == runnable(
        "no node is running at tcp/127.0.0.1:7447, but supervisord (pid 4): clean up with `lifeline down`\n"
    )


def test_a_robot_on_another_machine_that_does_not_answer_is_not_to_be_started_here() -> None:
    nothing = replace(look(), connected=False, alive=frozenset[str](), status=None)
    words = printed(replace(nothing, silence="the name robot7 cannot be resolved"))
    assert words.startswith("the name robot7 cannot be resolved: check the name, the address and the network")
    assert "lifeline up" not in words
