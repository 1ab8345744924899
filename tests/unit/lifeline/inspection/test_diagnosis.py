"""The checks of `lifeline doctor`, on what may be observed."""

import math

import pytest

from deploy.stack.ros2_reports import Level, Report
from lifeline.inspection.diagnosis import Finding, Observed, Terminal, Verdict, diagnose, is_healthy
from lifeline.inspection.keys import by_full_key
from lifeline.inspection.nodes import Node
from lifeline.inspection.sockets import Process
from lifeline.inspection.traffic import Traffic
from supervisor.config import SupervisorSection
from wire.bus import Overheard
from wire.messages import SafetyStatus, header
from wire.reasons import StopReason
from wire.stamp import Stamp
from wire.zenoh.network import Session

HUB = "127.0.0.1:4001"


def node(name: str, writes: str = "", reads: str = "", pid: int = 1, *, is_named: bool = True) -> Node:
    session = Session(name, HUB, frozenset(writes.split()), frozenset(reads.split()))
    return Node(name, is_named, session, Process(pid, (name,), 1.0), "local")


def traffic(longest_gap_s: float = 0.05, age_s: float = 0.001, key: str = "robot/scan") -> Traffic:
    heard = Traffic()
    arrivals_s = [10.0, 10.05, 10.1, 10.1 + longest_gap_s]
    for number, at_s in enumerate(arrivals_s):
        stamp = Stamp(number, round((at_s - age_s) * 1e9), b"a" * 16)
        heard.add(Overheard(key, b"x", stamp.pack(), at_s))
    return heard


def running(**fields: object) -> Observed:
    """A robot at which nothing is wrong."""
    config = SupervisorSection()
    seen = Observed(
        versions={"numpy": "2.0"},
        config_path="robot.toml",
        config=config,
        endpoint="tcp/127.0.0.1:7447",
        is_connected=True,
        nodes=[
            node("supervisor", "robot/cmd_vel", "robot/scan"),
            node("sim", "robot/scan robot/odom", "robot/cmd_vel", 2),
            node("teleop", "robot/teleop/cmd_vel", "", 3),
        ],
        traffic=traffic(),
        known=by_full_key("robot", config),
        status=SafetyStatus(header(""), mode=SafetyStatus.READY),
        header_offset_s={"robot/scan": -0.01},
        terminal=Terminal(120, 40, "truecolor", reports_releases=True),
    )
    for name, value in fields.items():
        setattr(seen, name, value)
    return seen


def problems(seen: Observed) -> list[Finding]:
    findings = diagnose(seen)
    assert is_healthy(findings) == (not [f for f in findings if f.verdict is Verdict.PROBLEM])
    return [finding for finding in findings if finding.verdict is Verdict.PROBLEM]


def test_nothing_is_wrong_with_a_healthy_robot() -> None:
    assert problems(running()) == []
    assert [finding.check for finding in diagnose(running())] == [
        "packages",
        "configuration",
        "supervisor",
        "command source",
        "writers",
        "rates",
        "clocks",
        "mode",
        "terminal",
        "key releases",
    ]


def test_each_program_that_hung_is_one_note_and_no_problem() -> None:
    seen = running(hangs=[("20:00:02", "supervisor"), ("20:00:04", "sim"), ("20:00:09", "supervisor")])
    assert [(f.verdict, f.what) for f in diagnose(seen) if f.check == "hangs"] == [
        (
            Verdict.NOTE,
            "supervisor hung 2 times, was ended by the kernel and started again, last at 20:00:09",
        ),
        (Verdict.NOTE, "sim hung once, was ended by the kernel and started again, last at 20:00:04"),
    ]
    assert problems(seen) == []


def test_nodes_that_may_not_be_read_are_one_note_and_not_reported_as_missing() -> None:
    seen = running(nodes=[], nodes_problem="run this command as that user")
    notes = [finding for finding in diagnose(seen) if finding.verdict is Verdict.NOTE]
    assert [(f.check, f.what) for f in notes] == [("nodes", "not checked: run this command as that user")]
    assert problems(seen) == []


def test_every_problem_names_what_to_do() -> None:
    status = SafetyStatus(header(""), reasons=["SCAN_STALE"], causes=["SCAN_STALE"])
    for seen in (
        Observed(endpoint="tcp/127.0.0.1:1"),
        running(nodes=[], traffic=Traffic(), status=None),
        running(status=status),
        running(config_problem="robot.toml: [bus] is wrong"),
    ):
        for finding in problems(seen):
            assert finding.remedy, finding


@pytest.mark.parametrize(
    ("fields", "check", "words"),
    [
        ({"config_problem": "r.toml: [bus] endpoint is refused"}, "configuration", "endpoint is refused"),
        ({"state_problem": "/x is not writable"}, "state directory", "/x is not writable"),
        ({"is_connected": False}, "supervisor", "nothing listens on tcp/127.0.0.1:7447"),
        ({"is_connected": False, "port_problem": "port 7447 is in use"}, "supervisor", "port 7447 is in use"),
        ({"is_connected": False, "is_stale": True}, "supervisor", "has ended without cleaning up"),
        ({"nodes": [node("supervisor"), node("teleop")]}, "base", "no program reads robot/cmd_vel"),
        ({"nodes": [node("supervisor"), node("sim")]}, "command source", "none of teleop, joy, path runs"),
        ({"traffic": Traffic()}, "rates", "nothing is heard on robot/scan"),
        ({"traffic": traffic(longest_gap_s=0.25)}, "rates", "longest gap 250 ms of 240"),
        ({"traffic": traffic(age_s=0.3)}, "ages", "300 ms old"),
        ({"status": None}, "status", "no status"),
    ],
)
def test_each_fault_has_its_finding(fields: dict[str, object], check: str, words: str) -> None:
    found = [finding for finding in problems(running(**fields)) if finding.check == check]
    assert any(words in finding.what for finding in found), problems(running(**fields))


@pytest.mark.parametrize(
    ("fields", "causes", "latched"),
    [
        ({"is_connected": False, "is_stale": True, "status": None}, [], []),
        ({"nodes": [node("supervisor"), node("teleop")], "traffic": Traffic()}, ["SCAN_STALE"], []),
        ({"traffic": Traffic()}, ["SCAN_STALE"], []),
        ({"nodes": [*running().nodes[:2]]}, ["SOURCE_LOST"], []),
        ({"nodes": [*running().nodes[:2]]}, ["NO_COMMAND"], ["SOURCE_LOST"]),
        ({"nodes": [*running().nodes, node("spoof.py", "robot/scan", pid=99)]}, ["SENSOR_CONFLICT"], []),
    ],
)
def test_one_cause_is_one_problem(fields: dict[str, object], causes: list[str], latched: list[str]) -> None:
    status = SafetyStatus(header(""), reasons=[*causes, *latched], causes=causes, latched=latched)
    seen = running(**{"status": status, **fields})
    assert len(problems(seen)) == 1
    consequences = [finding for finding in diagnose(seen) if finding.check in ("stop", "latched")]
    assert all((one.verdict, one.remedy) == (Verdict.NOTE, "") for one in consequences)


def test_without_a_command_source_nobody_is_told_to_release_keys() -> None:
    status = SafetyStatus(header(""), causes=["ESTOP", "OVERRUN"], latched=["OBSTACLE"])
    text = " ".join(finding.remedy for finding in diagnose(running(nodes=running().nodes[:2], status=status)))
    assert "release" not in text
    assert "start a command source, then r to reset" in text
    assert "release the keys" in " ".join(finding.remedy for finding in diagnose(running(status=status)))


def test_a_recorded_estop_is_reported_with_who_pressed_it_and_when() -> None:
    by = "pressed by teleop, 2026-11-26 14:20:05"
    seen = running(is_connected=False, is_estop_recorded=True, estop_pressed_by=by, status=None)
    (finding,) = (finding for finding in diagnose(seen) if finding.check == "e-stop")
    assert by in finding.what


def test_a_supervisor_that_hangs_is_not_another_program() -> None:
    hung = running(is_connected=False, silent_pid=41, port_problem="port 7447 is in use by another program")
    (finding,) = (found for found in problems(hung) if found.check == "supervisor")
    assert "it runs (pid 41) but does not answer" in finding.what
    assert "another program" not in finding.what
    assert "`lifeline down`, then `lifeline up`" in finding.remedy


def test_a_program_that_is_refused_blames_no_supervisor() -> None:
    for silence in (None, "nothing answers at tls/robot7:7447, which is on another machine"):
        refused = running(is_connected=False, refusal="its certificate: copy", silent_pid=41, silence=silence)
        (finding,) = (found for found in problems(refused) if found.check == "supervisor")
        assert (finding.what, finding.remedy) == ("its certificate: copy", "")


def test_of_a_robot_on_another_machine_the_network_is_to_be_checked() -> None:
    (finding,) = problems(running(is_connected=False, silence="the name robot7 cannot be resolved"))
    assert (finding.check, finding.what) == ("supervisor", "the name robot7 cannot be resolved")
    assert finding.remedy.startswith("check the name, the address and the network")


def test_two_writers_of_a_sensor_are_named() -> None:
    spoof = node("spoof.py", "robot/scan", pid=99, is_named=False)
    (finding,) = problems(running(nodes=[*running().nodes, spoof]))
    assert finding.check == "writers"
    assert finding.what == "2 programs write robot/scan: sim, pid 2; spoof.py, pid 99"
    assert finding.remedy == "stop all but sim"


def test_a_writer_that_declares_nothing_is_counted() -> None:
    heard = traffic()
    for at_s in (10.02, 10.12):
        heard.add(Overheard("robot/scan", b"x", None, at_s))
    (finding,) = problems(running(traffic=heard))
    assert finding.what == "2 programs write robot/scan: sim, pid 2; 1 without a declaration"


def test_two_programs_with_one_name_are_found() -> None:
    (finding,) = problems(running(nodes=[*running().nodes, node("teleop", "", "", 77)]))
    assert finding.what == "two programs are teleop (pid 3, 77)"


def test_topics_that_anyone_may_write_may_have_many_writers() -> None:
    panels = [node(name, "robot/estop", pid=n) for n, name in enumerate(("a.py", "b.py"))]
    assert problems(running(nodes=[*running().nodes, *panels])) == []


def test_a_bridge_to_a_base_is_a_base() -> None:
    bridge = node("bridge.py", "robot/scan robot/odom", "robot/cmd_vel", is_named=False)
    nodes = [node("supervisor", "robot/cmd_vel"), bridge, node("teleop")]
    assert problems(running(nodes=nodes)) == []


@pytest.mark.parametrize("reason", list(StopReason))
def test_a_cause_and_a_latched_reason_are_explained(reason: StopReason) -> None:
    held = SafetyStatus(header(""), reasons=[reason], causes=[reason], owner="teleop", detail="all NaN")
    (finding,) = problems(running(status=held))
    assert finding.what.startswith(f"{reason}: ")
    assert finding.what.endswith("all NaN")
    assert "WHO" not in finding.what
    assert "NEUTRAL" not in finding.remedy
    over = SafetyStatus(header(""), reasons=[reason], latched=[reason])
    (finding,) = problems(running(status=over))
    assert (finding.check, finding.what.endswith("Over now")) == ("latched", True)


def test_nodes_that_use_the_keys_of_rmw_zenoh_are_a_note_with_their_names() -> None:
    seen = running(status=SafetyStatus(header(""), rmw_zenoh_nodes=["/talker", "and 3 more"]))
    (finding,) = [finding for finding in diagnose(seen) if finding.check == "rmw_zenoh"]
    assert finding.verdict is Verdict.NOTE
    assert "/talker, and 3 more" in finding.what
    assert not [finding for finding in diagnose(running()) if finding.check == "rmw_zenoh"]


def test_nothing_from_the_wire_can_control_the_terminal() -> None:
    status = SafetyStatus(
        header(""),
        causes=["\x1b[2J"],
        latched=["\x9b"],
        detail="\x07",
        unknown_sources=["\x1b]0;x"],
        estop_record_problem="\x1b",
        rmw_zenoh_nodes=["\x1b]0;x"],
        alarm=True,
    )
    heard = traffic(key="foreign/\x1b[2J")
    text = "".join(f"{f.what}{f.remedy}" for f in diagnose(running(status=status, traffic=heard)))
    assert text.isprintable()


def test_the_clock_of_another_machine_and_a_small_terminal_are_only_notes() -> None:
    seen = running(
        header_offset_s={"robot/odom": 3.0},
        traffic=traffic(age_s=-5.0),
        terminal=Terminal(79, 24, "", reports_releases=None),
        has_sim=False,
    )
    assert problems(seen) == []
    notes = [finding.check for finding in diagnose(seen) if finding.verdict is Verdict.NOTE]
    assert notes == ["base", "ages", "clocks", "terminal", "key releases"]


def test_simulated_time_in_a_header_is_named() -> None:
    seen = running(header_offset_s={"robot/scan": -1.7e9})
    (clocks,) = (finding for finding in diagnose(seen) if finding.check == "clocks")
    assert "use_sim_time:=false" in clocks.remedy


def test_for_stale_scans_whose_stamps_do_not_run_like_real_time_the_remedy_is_not_to_wait() -> None:
    detail = "the stamps of the lidar's scans run at 0.90 of real time"
    seen = running(status=SafetyStatus(header(""), causes=["SCAN_STALE"], detail=detail))
    (stop,) = (finding for finding in diagnose(seen) if finding.check == "stop")
    assert stop.what.endswith(detail)
    assert "wait" not in stop.remedy


def test_a_gap_is_a_problem_just_above_the_timeout() -> None:
    limit_s = SupervisorSection().scan_timeout_of(SupervisorSection().all_lidars()[0])
    assert problems(running(traffic=traffic(longest_gap_s=limit_s - 1e-6))) == []
    assert len(problems(running(traffic=traffic(longest_gap_s=limit_s + 1e-6)))) == 1
    assert math.isclose(limit_s, 0.24)


def test_a_flood_is_a_problem_and_no_reason_to_doubt_the_rest() -> None:
    seen = running(status=None, header_offset_s={"robot/scan": -3.0})
    seen.traffic.uncounted = 5
    problems = [finding for finding in diagnose(seen) if finding.verdict is Verdict.PROBLEM]
    assert [finding.check for finding in problems] == ["flood"]
    assert "5 messages arrived too fast to be counted, most of them on robot/scan" in problems[0].what
    assert not [finding for finding in diagnose(seen) if finding.check in ("rates", "clocks", "status")]


# --- ROS 2


def ros2(**fields: object) -> Observed:
    """A ROS 2 robot at which nothing is wrong."""
    nodes = [
        node("supervisor", "robot/cmd_vel", "robot/scan"),
        node("joy+ros2", "robot/scan robot/odom robot/joy/cmd_vel", "robot/cmd_vel", 2),
    ]
    return running(**{"has_sim": False, "has_ros2": True, "nodes": nodes, **fields})


def test_a_ros_2_robot_is_healthy_and_its_base_can_be_measured() -> None:
    seen = ros2(ros2_reports=[Report("source joy", Level.OK, "/teleop, guarded by process 12", {})])
    assert problems(seen) == []
    findings = {(finding.check, finding.what): finding for finding in diagnose(seen)}
    assert findings["ros2", "source joy: /teleop, guarded by process 12"].verdict is Verdict.OK
    (base,) = (finding for finding in findings.values() if finding.check == "base")
    assert (base.verdict, base.remedy) == (Verdict.NOTE, "measure it with `lifeline ros2 check-base`")


def test_what_ros_2_reports_is_a_problem_or_a_note_by_its_level() -> None:
    reports = [
        Report("supervisor", Level.ERROR, "the mode is reported elsewhere", {}),
        Report("source joy", Level.WARN, "no program publishes on /joy/cmd_vel", {}),
        Report("cmd_vel", Level.ERROR, "/nav2 also publishes on /cmd_vel", {}),
    ]
    seen = ros2(ros2_reports=reports)
    assert [finding.what for finding in problems(seen)] == ["cmd_vel: /nav2 also publishes on /cmd_vel"]
    notes = [f.what for f in diagnose(seen) if f.check == "ros2" and f.verdict is Verdict.NOTE]
    assert notes == ["source joy: no program publishes on /joy/cmd_vel"]


def test_a_ros_2_process_that_does_not_run_or_cannot_start_is_a_problem() -> None:
    missing, source = problems(ros2(nodes=[one for one in ros2().nodes if one.name == "supervisor"]))
    assert (missing.what, source.check) == ("the ROS 2 process does not run", "command source")
    (problem,) = problems(ros2(ros2_problem="x is missing: run `make ros2`"))
    assert problem.what == "x is missing: run `make ros2`"


def test_the_writer_of_the_sensors_of_a_ros_2_robot_is_its_ros_2_process() -> None:
    (silent,) = problems(ros2(traffic=traffic(key="robot/odom")))
    assert silent.remedy == "start ros2, or check its log"
