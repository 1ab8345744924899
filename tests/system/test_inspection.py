"""`lifeline topic`, `node`, `graph` and `doctor` beside a real robot: names, pids, rates and writers that the tests know.

Tests that only read share one standing robot, and run the commands in this process.
"""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import AsyncGenerator, Callable, Generator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from random import Random
from typing import Any

import pytest
import zenoh

from deploy.stack.errors import EXIT_NOT_RUNNING, EXIT_REFUSED
from faults.attacks import free_scan
from supervisor.estop_record import record_path
from tests.scan_stamps import PROBLEMS, STAMPS
from tests.system.commands import run_here
from tests.system.harness import DRIVE_TRIES, PATIENCE_S, Robot, free_endpoint, patiently, robot
from tests.system.rogue import answer, open_rogue
from wire import topics
from wire.messages import encode, odometry
from wire.stamp import Stamper

ROOT = Path(__file__).parents[2]
PARTICIPANTS = '[bus]\nwithout_certificate = "participant"\nmore_keys = ["camera/**"]\n'
FOREIGN = """
import sys, threading
sys.path.insert(0, ".")
from tests.system.rogue import open_rogue
session = open_rogue(sys.argv[1])
print("open", flush=True)
threading.Event().wait()
"""

pytestmark = pytest.mark.timeout(120)


def say(text: str) -> None:
    print(f"\n    measured: {text}")


def in_process(subject: Robot, *arguments: str) -> tuple[int, str, str]:
    """Run a command in this process; return its exit code, output and errors."""
    return run_here([*arguments, "--endpoint", subject.endpoint], subject.environment)


def listed(subject: Robot, *arguments: str) -> Any:  # noqa: ANN401 - any JSON
    _, output, errors = in_process(subject, *arguments, "--json")
    assert output, errors
    return json.loads(output)


def command(subject: Robot, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "lifeline.cli.app", *arguments, "--endpoint", subject.endpoint]


async def start(subject: Robot, *arguments: str) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        *command(subject, *arguments),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env=subject.environment,
    )


async def lifeline(subject: Robot, *arguments: str) -> tuple[int, str, str]:
    """Run a command as a process to its end; return its exit code, output and errors."""
    process = await start(subject, *arguments)
    output, errors = await asyncio.wait_for(process.communicate(), PATIENCE_S)
    assert process.returncode is not None
    assert b"Traceback" not in errors
    return process.returncode, output.decode(), errors.decode()


@asynccontextmanager
async def standing(directory: Path) -> AsyncGenerator[Robot]:
    """A robot without an operator, whose sim publishes; foreign programs take part over TCP, where the kernel knows their pids."""
    config = directory / "robot.toml"
    config.write_text(PARTICIPANTS)
    async with robot(directory, teleop=False, config=config) as subject:
        await subject.until(
            lambda: "SCAN_STALE" not in subject.status.reasons and bool(subject.travel), "scans"
        )
        yield subject


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Generator[Robot]:
    """A standing robot for all tests that only read."""
    with asyncio.Runner() as runner:
        context = standing(tmp_path_factory.mktemp("robot"))
        yield runner.run(context.__aenter__())
        runner.run(context.__aexit__(None, None, None))


@contextmanager
def rogue_of(subject: Robot) -> Generator[zenoh.Session]:
    """A bare Zenoh session of this process."""
    session = open_rogue(subject.endpoint)
    try:
        yield session
    finally:
        session.close()  # pyright: ignore[reportUnknownMemberType]


@contextmanager
def repeated(write: Callable[[], None], period_s: float) -> Generator[None]:
    """Call a function again and again in a thread."""
    ended = threading.Event()

    def work() -> None:
        while not ended.wait(period_s):
            write()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.timed
def test_the_list_names_each_topics_type_writer_and_rate(shared: Robot) -> None:
    entries = {one["key"]: one for one in listed(shared, "topic", "list", "--seconds", "4")}
    for key, writer, type_name, rate_hz in (
        ("robot/scan", "sim", "sensor_msgs/msg/LaserScan", 20.0),
        ("robot/odom", "sim", "nav_msgs/msg/Odometry", 50.0),
        ("robot/cmd_vel", "supervisor", "geometry_msgs/msg/Twist", 50.0),
        ("robot/imu", "sim", "sensor_msgs/msg/Imu", 100.0),
    ):
        entry = entries[key]
        assert (entry["type"], entry["permitted_writer"], entry["writers"]) == (type_name, writer, [writer])
        say(f"{key}: {entry['rate_hz']:.2f} of {rate_hz:g} Hz")
        assert entry["rate_hz"] == pytest.approx(rate_hz, rel=0.05)
    assert entries["robot/teleop/cmd_vel"]["writers"] == []


@pytest.mark.smoke
def test_the_nodes_have_the_pids_of_their_processes(shared: Robot, tmp_path: Path) -> None:
    nodes = {one["node"]: one for one in listed(shared, "node", "list")}
    pids = {node: shared.pid(node) for node in (topics.SUPERVISOR, topics.SIM)}
    assert {name: nodes[name]["pid"] for name in pids} == pids
    assert in_process(shared, "pid", "sim") == (0, f"{pids['sim']}\n", "")
    code, output, errors = in_process(shared, "pid", "teleop")
    assert (code, output, "there is no node 'teleop'" in errors) == (EXIT_REFUSED, "", True)
    # The test's own session has no token, so it has the name of its program.
    assert os.getpid() in {one["pid"] for one in nodes.values()}
    (info,) = listed(shared, "node", "info", "/sim", "--seconds", "1")
    assert (info["pid"], info["host"]) == (pids["sim"], "local")
    assert {"robot/scan", "robot/odom"} <= set(info["writes"])
    assert "robot/sim/reset" in info["serves"]
    assert info["rates_hz"]["robot/odom"] > 0.0
    code, text, _ = in_process(shared, "graph", "--seconds", "1")
    assert code == 0
    assert any("►" in line and "cmd_vel" in line for line in text.splitlines())
    for name in ("graph.svg", "graph.png", "graph.dot"):
        assert in_process(shared, "graph", "--seconds", "0.1", "--out", str(tmp_path / name))[0] == 0
        assert (tmp_path / name).stat().st_size > 500


def test_messages_are_printed_as_yaml_csv_and_fields(shared: Robot) -> None:
    code, text, _ = in_process(shared, "topic", "echo", "/robot/cmd_vel", "--once")
    assert (code, text) == (
        0,
        "linear: {x: 0.0, y: 0.0, z: 0.0}\nangular: {x: 0.0, y: 0.0, z: 0.0}\n---\n",
    )
    code, text, _ = in_process(shared, "topic", "echo", "odom", "--field", "twist.twist.linear.x", "--once")
    assert abs(float(text.splitlines()[0])) < 0.05
    code, text, _ = in_process(shared, "topic", "echo", "cmd_vel", "--csv", "--once")
    assert text.splitlines()[0] == "linear.x,linear.y,linear.z,angular.x,angular.y,angular.z"
    code, _, errors = in_process(shared, "topic", "echo", "cmd_vel", "--field", "linear.w", "--once")
    assert code == EXIT_REFUSED
    assert "there is no field 'w'; there are x, y, z" in errors
    assert in_process(shared, "topic", "type", "scan")[1] == "sensor_msgs/msg/LaserScan\n"
    code, text, _ = in_process(shared, "topic", "hz", "nobody", "--seconds", "0.3")
    assert (code, text) == (1, "robot/nobody: nothing heard\n")


def test_echo_names_the_topics_that_are_silent(shared: Robot) -> None:
    process = subprocess.Popen(
        command(shared, "topic", "echo", "joy/cmd_vel", "nosuch"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=shared.environment,
        text=True,
    )
    with process:
        assert process.stderr is not None
        lines = [process.stderr.readline() for _ in range(2)]
        process.send_signal(signal.SIGINT)
    assert lines[0].startswith("lifeline: nothing heard on robot/joy/cmd_vel: see `lifeline topic list`")
    assert "robot/nosuch, which is not a topic of this robot" in lines[1]


@pytest.mark.timed
def test_rates_sizes_and_ages_are_measured(shared: Robot) -> None:
    figures: dict[str, Any] = {}
    for measure in ("hz", "bw", "delay"):
        code, text, _ = in_process(shared, "topic", measure, "scan", "odom", "--seconds", "4", "--json")
        scan, odom = (json.loads(line) for line in text.splitlines())
        assert (code, scan["key"], odom["key"]) == (0, "robot/scan", "robot/odom")
        figures |= scan
    say(str(figures))
    assert figures["rate_hz"] == pytest.approx(20.0, rel=0.05)
    assert figures["bytes_per_s"] == pytest.approx(20.0 * figures["size_max_bytes"], rel=0.05)
    assert 0.0 < figures["age_mean_s"] < 0.1


MOMENTS = 10
"""So many moments are not all at the beginning of a second."""


@pytest.mark.parametrize(
    "stamps",
    ["slow", "whole", "constant"],
)
async def test_scans_of_a_bridge_whose_stamps_do_not_run_like_real_time_are_named_as_the_cause(
    tmp_path: Path, stamps: str
) -> None:
    stamp_ns, problem = STAMPS[stamps], PROBLEMS[stamps]
    config, chance = tmp_path / "robot.toml", Random(1)
    config.write_text(PARTICIPANTS)
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False, config=config) as subject:
        with rogue_of(subject) as bridge:

            def write() -> None:
                bridge.put("robot/odom", encode(odometry((0.0, 0.0, 0.0), (0.0, 0.0))))
                bridge.put("robot/scan", encode(free_scan(chance, stamp_ns(time.time_ns()))))

            with repeated(write, 0.05):
                await subject.until(
                    lambda: problem in subject.status.detail and "SCAN_STALE" in subject.status.reasons,
                    problem,
                )
                found = f"SCAN_STALE: there is no fresh scan: the stamps of the lidar's scans {problem}"
                texts = [" ".join((await lifeline(subject, "doctor"))[1].split())]
                # Whole seconds are fresh at the beginning of each second: doctor may see just that moment. On a busy
                # machine, late scans change a measured rate.
                while len(texts) < MOMENTS and found not in texts[-1]:
                    texts.append(" ".join((await lifeline(subject, "doctor"))[1].split()))
    assert found in texts[-1]
    assert "wait for the lidar" not in texts[-1]


@pytest.mark.parametrize("declares", [True, False], ids=["declared", "undeclared"])
def test_a_second_writer_of_the_scan_is_found(shared: Robot, *, declares: bool) -> None:
    stamper = Stamper()
    with rogue_of(shared) as rogue:
        publisher = rogue.declare_publisher("robot/scan") if declares else None

        def write() -> None:
            stamp = stamper.next().pack()
            if publisher is None:
                rogue.put("robot/scan", b"x", attachment=stamp)
            else:
                publisher.put(b"x", attachment=stamp)

        with repeated(write, 0.05):
            code, output, _ = in_process(shared, "topic", "info", "scan", "--seconds", "1", "--json")
    info = json.loads(output)
    assert code == 1
    assert info["problem"] == "2 programs write robot/scan, but only one may: stop all but sim"
    pids = {one["node"]: one["pid"] for one in info["writers"]}
    assert "sim" in pids
    if declares:
        assert os.getpid() in pids.values()
    else:
        assert info["undeclared_writers"] == 1


def test_the_info_of_a_topic_listens_only_if_it_is_asked_to(shared: Robot) -> None:
    code, output, _ = in_process(shared, "topic", "info", "scan", "--json")
    info = json.loads(output)
    assert (code, [one["node"] for one in info["writers"]]) == (0, ["sim"])
    assert "supervisor" in [one["node"] for one in info["readers"]]
    assert (info["rate_hz"], info["undeclared_writers"], info["expected_hz"]) == (None, None, 20.0)
    _, output, _ = in_process(shared, "topic", "info", "scan", "--seconds", "1", "--json")
    info = json.loads(output)
    assert (info["rate_hz"] > 0.0, info["undeclared_writers"]) == (True, 0)
    text = in_process(shared, "topic", "info", "scan")[1]
    assert "rate              not measured without --seconds, expected 20 Hz" in text


def test_a_forged_report_of_the_hub_does_not_hide_a_second_writer(shared: Robot) -> None:
    with rogue_of(shared) as rogue:
        forged = json.dumps({"sessions": [], "locators": ["tcp/x"]}).encode()
        hub = f"@/{rogue.info.peers_zid()[0]}/peer"
        declared = [
            answer(rogue, "@/000/peer", forged),
            answer(rogue, hub, forged),
            rogue.declare_publisher("robot/scan"),
        ]
        code, output, _ = in_process(shared, "topic", "info", "scan", "--json")
    assert len(declared) == 3
    assert code == 1
    assert {one["pid"] for one in json.loads(output)["writers"]} >= {os.getpid()}


def test_a_foreign_name_in_an_error_does_not_control_the_terminal(shared: Robot, tmp_path: Path) -> None:
    program = tmp_path / "\x1b]0;title\x07"
    program.write_text(FOREIGN)
    foreign = subprocess.Popen(
        [sys.executable, str(program), shared.endpoint], cwd=ROOT, stdout=subprocess.PIPE
    )
    with foreign:
        assert foreign.stdout is not None
        foreign.stdout.readline()
        code, _, errors = in_process(shared, "node", "info", "nobody")
        foreign.kill()
    assert code == EXIT_REFUSED
    assert "?]0;title?" in errors
    assert "\x1b" not in errors


def test_the_key_of_another_topic_is_listed_if_the_configuration_admits_it(shared: Robot) -> None:
    with rogue_of(shared) as rogue:

        def write() -> None:
            rogue.put("robot/camera/front", b"\x00\x01\xff")
            rogue.put("another/robot/scan", b"refused")
            rogue.put("robot/secret", b"refused")

        with repeated(write, 0.02):
            entries = {one["key"]: one for one in listed(shared, "topic", "list", "--seconds", "1")}
            code, text, _ = in_process(shared, "topic", "echo", "camera/front", "--once")
    assert entries["robot/camera/front"]["type"] is None
    assert entries["robot/camera/front"]["writers"] == ["undeclared"]
    assert not {"another/robot/scan", "robot/secret"} & entries.keys()
    assert (code, text) == (0, 'bytes: 3\nhex: "00 01 ff"\n---\n')


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("scan", "{}"), "robot/scan belongs to sim"),
        (("cmd_vel", "{}"), "robot/cmd_vel belongs to supervisor"),
        (("ghost/cmd_vel", "{}"), "ghost is not a command source of this robot"),
        (("nothing", "{}"), "robot/nothing is not a topic of this robot"),
        (("estop", "{data: 1}"), "data is true or false"),
        (("path/cmd_vel", "{}", "--rate", "2"), "choose --rate 10 or more"),
        (("path/cmd_vel", "{}", "--once"), "leave out --once"),
        (("robot/**", "{}"), "is not a key"),
    ],
)
def test_a_message_that_the_caller_may_not_publish_is_refused(
    shared: Robot, arguments: tuple[str, ...], words: str
) -> None:
    code, output, errors = in_process(shared, "topic", "pub", *arguments)
    assert (code, output) == (EXIT_REFUSED, "")
    assert words in errors


async def test_a_source_has_one_publisher_and_one_press_of_the_estop_is_published(tmp_path: Path) -> None:
    async with standing(tmp_path) as subject:
        holder = await start(subject, "topic", "pub", "path/cmd_vel", "{}")
        assert holder.stdout is not None
        await holder.stdout.readline()
        code, _, errors = await lifeline(subject, "topic", "pub", "path/cmd_vel", "{linear: {x: 0.1}}")
        assert (code, f"pid {holder.pid}" in errors) == (EXIT_REFUSED, True)
        holder.send_signal(signal.SIGINT)
        await asyncio.wait_for(holder.communicate(), PATIENCE_S)
        assert (await lifeline(subject, "topic", "pub", "estop", "{data: true}"))[:2] == (
            0,
            "lifeline: published on robot/estop\n",
        )
        await subject.until(lambda: "ESTOP" in subject.status.reasons, "the e-stop")


async def test_published_commands_drive_after_a_zero_and_end_without_a_lost_source(tmp_path: Path) -> None:
    async with standing(tmp_path) as subject:

        async def attempt() -> None:
            """The program sends zero only at its start. A stop caused by a busy machine ends the attempt, and latches its reason."""
            process = await start(subject, "topic", "pub", "path/cmd_vel", "{angular: {z: 0.3}}")
            try:
                assert process.stdout is not None
                await asyncio.wait_for(process.stdout.readline(), PATIENCE_S)
                await subject.until(
                    lambda: subject.turn_rad_s > 0.2, "a turn", within_s=PATIENCE_S / DRIVE_TRIES
                )
            finally:
                process.send_signal(signal.SIGINT)
                await asyncio.wait_for(process.communicate(), PATIENCE_S)
            assert process.returncode == 0
            await subject.until(
                lambda: subject.status.reasons == ["NO_COMMAND"] and abs(subject.turn_rad_s) < 0.01,
                "a stop without another reason",
                within_s=PATIENCE_S / DRIVE_TRIES,
            )

        for _ in range(3):
            await patiently(attempt)


@pytest.mark.parametrize(
    "arguments", [("topic", "list"), ("node", "list"), ("graph",), ("topic", "echo", "scan")]
)
def test_an_error_states_that_no_supervisor_answers(arguments: tuple[str, ...], tmp_path: Path) -> None:
    code, _, errors = in_process(Robot(free_endpoint(), tmp_path), *arguments)
    assert code == EXIT_NOT_RUNNING
    assert "no supervisor answers" in errors


@pytest.mark.smoke
def test_doctor_finds_what_prevents_motion(shared: Robot) -> None:
    with rogue_of(shared) as rogue:
        publisher = rogue.declare_publisher("robot/scan")
        code, output, _ = in_process(shared, "doctor", "--seconds", "1", "--json")
        publisher.undeclare()  # pyright: ignore[reportUnknownMemberType]
    findings = json.loads(output)
    problems = [one for one in findings if one["verdict"] == "problem"]
    assert code == 1
    assert {one["check"] for one in problems} >= {"command source", "writers"}
    (writers,) = (one for one in problems if one["check"] == "writers")
    assert f"sim, pid {shared.pid('sim')}" in writers["what"]
    assert f"pid {os.getpid()}" in writers["what"]
    (consequence,) = (one for one in findings if one["what"].startswith("NO_COMMAND: "))
    assert (consequence["verdict"], consequence["remedy"]) == ("note", "")


def test_a_program_that_does_not_reach_the_socket_is_shown_in_one_sentence_what_it_may_not_see(
    shared: Robot, tmp_path: Path
) -> None:
    """As one of another user: it connects over TCP."""
    apart = shared.environment | {"LIFELINE_RUN_DIR": str(tmp_path / "apart")}
    words = ["--endpoint", shared.endpoint]
    for name in (["node", "list"], ["topic", "info", "scan"], ["topic", "list"], ["graph"], ["pid", "sim"]):
        code, output, errors = run_here([*name, *words], apart)
        assert (code, output) == (EXIT_REFUSED, ""), name
        assert "only to programs of its own user" in errors
        assert len(errors.splitlines()) == 1
    code, output, _ = run_here(["doctor", "--seconds", "1", "--json", *words], apart)
    (nodes,) = (one for one in json.loads(output) if one["check"] == "nodes")
    assert nodes["verdict"] == "note"
    assert "run this command as that user" in nodes["what"]
    assert not any(one["check"] in {"base", "command source"} for one in json.loads(output))


async def test_doctor_distinguishes_a_supervisor_that_hangs_from_another_program(tmp_path: Path) -> None:
    async with standing(tmp_path) as subject:
        pid = subject.pid("supervisor")
        os.kill(pid, signal.SIGSTOP)
        try:
            code, output, _ = await lifeline(subject, "doctor", "--json")
        finally:
            os.kill(pid, signal.SIGCONT)
    (problem,) = (one for one in json.loads(output) if one["check"] == "supervisor")
    assert code == 1
    assert f"it runs (pid {pid}) but does not answer" in problem["what"]


def test_records_of_this_machine_are_ignored_for_a_robot_on_another(tmp_path: Path) -> None:
    subject = Robot("tcp/robot7.invalid:7447", tmp_path)
    record_path(subject.logs, "robot").touch()
    texts = [in_process(subject, name)[1] for name in ("doctor", "status")]
    errors = in_process(subject, "topic", "list")[2]
    for text in (*texts, errors):
        assert "the name robot7.invalid of the endpoint cannot be resolved" in " ".join(text.split())
        assert "e-stop" not in text
        assert "lifeline up" not in text


def test_doctor_names_the_program_that_holds_the_port(tmp_path: Path) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    port = int(subject.endpoint.rpartition(":")[2])
    with socket.create_server(("127.0.0.1", port)):
        code, output, _ = in_process(subject, "doctor", "--json")
    (problem,) = (one for one in json.loads(output) if one["verdict"] == "problem")
    assert code == 1
    assert "is in use by another program" in problem["what"]
    assert f"(pid {os.getpid()}: " in problem["what"]
    code, text, _ = in_process(subject, "doctor")
    assert (code, "start the robot with `lifeline up`" in text, "\x1b" in text) == (1, True, False)
