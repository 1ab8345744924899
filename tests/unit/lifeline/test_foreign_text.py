"""Names and sentences from the wire and from files reach the terminal printable, and are no markup."""

import io
from typing import Any, cast

import pytest
from rich.console import Console, RenderableType

from deploy.stack.console import StatusLine, note, say
from deploy.stack.ros2_reports import Level
from deploy.stack.ros2_reports import Report as Ros2Report
from faults.real.demo import Outcome, Verdict, print_verdicts
from faults.report.table import print_results, story
from faults.trial import BrokenPromise, Injected
from lifeline import status
from lifeline.inspection import doctor, listing, topic
from lifeline.inspection.diagnosis import problem
from lifeline.inspection.nodes import Node
from lifeline.inspection.sockets import Process
from lifeline.inspection.traffic import KeyTraffic, Traffic
from lifeline.watch import rows
from tests.unit.faults.test_trial import trial
from wire.messages import EstopStationStatus, SafetyStatus, header
from wire.zenoh.network import Session

HOSTILE = "\x1b]0;x\x07[red]name[/]\u202e\x9b31m"
"""Sets the title of a terminal, and is markup, with a closing tag that raises if it is read as such."""
SHOWN = "?]0;x?[red]name[/]??31m"


def printed(*pages: RenderableType) -> str:
    console = Console(width=400, file=io.StringIO())
    console.print(*pages)
    return cast("io.StringIO", console.file).getvalue()


def assert_harmless(text: str, times: int = 1) -> None:
    assert text.count(SHOWN) >= times, text
    assert all(char.isprintable() or char == "\n" for char in text), text


def hostile_status() -> SafetyStatus:
    """Return a status whose every text is hostile."""
    return SafetyStatus(
        header("", 0),
        mode=SafetyStatus.STOPPED,
        reasons=[HOSTILE],
        owner=HOSTILE,
        scan_problem=HOSTILE,
        causes=[HOSTILE],
        latched=[HOSTILE],
        detail=HOSTILE,
        estop_record_problem=HOSTILE,
        rmw_zenoh_nodes=[HOSTILE],
        estop_stations=[EstopStationStatus(HOSTILE, True, 1, False)],  # noqa: FBT003
    )


def node(name: str = HOSTILE) -> Node:
    keys = frozenset({HOSTILE})
    session = Session(HOSTILE, HOSTILE, keys, keys, keys, keys)
    return Node(name, True, session, Process(7, (HOSTILE,), 1.0), HOSTILE)  # noqa: FBT003


def entry() -> listing.Entry:
    return listing.Entry(HOSTILE, "", "teleop", (HOSTILE, HOSTILE), 1.0, None)


def test_the_status_of_a_robot() -> None:
    look = status.Look(
        endpoint=f"tcp/{HOSTILE}:1",
        connected=True,
        programs={HOSTILE: HOSTILE},
        alive=frozenset({HOSTILE, "supervisor"}),
        status=hostile_status(),
        ros2=(Ros2Report(HOSTILE, Level.OK, HOSTILE, {}),),
    )
    assert_harmless(printed(status.table(look)), 8)


@pytest.mark.parametrize("where", ["latched", "left_over", "silence", "endpoint"])
def test_the_status_of_a_robot_that_does_not_run(where: str) -> None:
    idle: dict[str, Any] = {"endpoint": "tcp/127.0.0.1:1", "connected": False, "programs": {}}
    idle[where] = HOSTILE
    assert_harmless(printed(status.table(status.Look(**idle))))


def test_topics_and_nodes() -> None:
    heard = Traffic()
    heard.keys[HOSTILE] = KeyTraffic()
    assert_harmless(printed(listing.topic_table([entry()])), 2)
    assert_harmless(printed(listing.topic_facts(entry(), [node()], [node()], "")), 4)
    assert_harmless(printed(listing.node_table([node()])), 2)
    assert_harmless(printed(listing.node_facts(node(), heard)), 5)


def test_messages_of_several_keys(capsys: pytest.CaptureFixture[str]) -> None:
    for wanted in (topic.Echo(), topic.Echo(as_csv=True)):
        topic.print_value(HOSTILE, {"a": 1}, wanted, set(), several=True)
        assert_harmless(capsys.readouterr().out)


def test_findings_of_the_doctor() -> None:
    assert_harmless(printed(doctor.table_of([problem(HOSTILE, HOSTILE, HOSTILE)])), 3)


@pytest.mark.parametrize("shared_endpoint", [None, HOSTILE])
def test_the_rows_of_a_fleet(shared_endpoint: str | None) -> None:
    watched = rows.Watched(HOSTILE, HOSTILE, 0.0, status=hostile_status())
    silent = rows.Watched(HOSTILE, HOSTILE, 0.0, problem=HOSTILE)
    shown = [rows.row_at(robot, 0.0) for robot in (watched, silent)]
    assert_harmless(printed(rows.table(shown, shared_endpoint)), 5)


def test_sentences_and_the_status_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    say(HOSTILE)
    assert_harmless(capsys.readouterr().out)
    note(HOSTILE)
    assert_harmless(capsys.readouterr().err)
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    line = StatusLine(stream)
    line.say(HOSTILE)
    assert_harmless(stream.getvalue())
    line.show(HOSTILE)
    assert SHOWN in stream.getvalue()


def test_the_verdicts_of_the_demo(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    print_verdicts([Verdict(1, HOSTILE, HOSTILE, HOSTILE, Outcome.KEPT)])
    assert_harmless(capsys.readouterr().out, 3)


def test_the_results_of_a_campaign() -> None:
    fault = Injected(fault=HOSTILE, time_s=1.0, detector=HOSTILE, to_zero_s=0.1)
    one = trial().model_copy(update={"faults": (fault,), "violations": (BrokenPromise(1, 1.0, HOSTILE),)})
    console = Console(width=400, file=io.StringIO())
    print_results([one], console)
    assert_harmless(cast("io.StringIO", console.file).getvalue(), 3)
    assert_harmless("\n".join(story(one)), 2)
