"""`lifeline up`, `status` and `down` with the real supervisord, and the errors that they report."""

import asyncio
import json
import os
import pty
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from deploy.stack import processes, supervisord, takedown
from deploy.stack.launch import DEFAULT_CONFIG
from deploy.stack.statedir import StateDir
from supervisor.service import STALLED
from tests.system import fake_ros2
from tests.system.operators import AGAIN_S
from tests.system.ports import free_endpoint
from tests.system.rogue import freezing
from tests.unit.lifeline.test_own_passport import passport_of
from tests.unit.passport.test_reading import bundle
from wire import topics
from wire.bundle import AUTHORITY
from wire.bus import NoReplyError
from wire.messages import Bool, SafetyStatus
from wire.zenoh.bus import BusConfig, open_bus

COMMAND_LIMIT_S = 60
WAIT_LIMIT_S = 45
"""Time limit for expected events on a loaded machine."""
POLL_S = 0.05


@dataclass
class Robot:
    """One state directory and endpoint, and the commands on them."""

    state: StateDir
    endpoint: str

    def command(self, name: str, *options: str) -> list[str]:
        here = ["--endpoint", self.endpoint, "--no-viewer"] if name == "up" else []
        return [
            sys.executable,
            "-m",
            "lifeline.cli.app",
            name,
            "--state-dir",
            str(self.state.path),
            *here,
            *options,
        ]

    def run(self, name: str, *options: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(name, *options),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
            timeout=COMMAND_LIMIT_S,
        )

    def status(self) -> dict[str, Any]:
        look = self.run("status", "--json")
        seen = json.loads(look.stdout)
        assert seen["running"] is (look.returncode == 0), look
        return seen

    def seen(self, what: Callable[[dict[str, Any]], bool], otherwise: str) -> dict[str, Any]:
        """Repeat `lifeline status` until it shows this; on a busy machine, one call may show nothing."""
        shown: dict[str, Any] = {}

        def shows() -> bool:
            shown.update(self.status())
            return what(shown)

        _wait_for(shows, otherwise)
        return shown

    def prints(self, text: str, *command: str) -> str:
        """Repeat a command until its output contains this text, which may span lines; return the output."""
        shown = ""

        def shows() -> bool:
            nonlocal shown
            shown = self.run(*command).stdout
            return text in " ".join(shown.split())

        _wait_for(shows, f"not printed: {text}")
        return shown

    def pids(self) -> dict[str, int]:
        return {process.name: process.pid for process in processes.of(self.state.path)}


@pytest.fixture
def robot() -> Generator[Robot]:
    """Not in pytest's own directory, which has too long a path for a socket on some machines."""
    directory = Path(tempfile.mkdtemp(prefix="lifeline-test-")).resolve()
    robot = Robot(StateDir(directory), free_endpoint())
    yield robot
    takedown.stop(robot.state)
    shutil.rmtree(directory)


RESTART_LIMIT_S = 0.7
"""Less than the sleep of supervisord's loop, 1 s."""


def _wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline_s = time.monotonic() + WAIT_LIMIT_S
    while not condition():
        assert time.monotonic() < deadline_s, what
        time.sleep(POLL_S)


def _refused(done: subprocess.CompletedProcess[str], sentence: str) -> None:
    """Exit code 2, and one message on stderr that is no traceback."""
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr.startswith("lifeline: ")
    assert "Traceback" not in done.stderr
    assert re.search(sentence, done.stderr), done.stderr


def test_beside_the_pid_file_of_a_dead_supervisord_a_robot_comes_up_is_seen_and_goes_down(
    robot: Robot,
) -> None:
    robot.state.pid_file.write_text("1\n")
    robot.state.socket.touch()
    up = robot.run("up", "--detach")
    assert up.returncode == 0, up.stderr
    assert "waiting for sim and supervisor" in up.stdout
    assert robot.pids().keys() == {"supervisord", "supervisor", "sim"}

    seen = robot.seen(lambda seen: seen["running"] and seen["reasons"] == ["NO_COMMAND"], "not standing by")
    assert [name for name, node in seen["nodes"].items() if node["alive"]] == ["supervisor", "sim"]
    assert (seen["mode"], seen["reasons"]) == ("STOPPED", ["NO_COMMAND"])
    assert (seen["causes"], seen["latched"]) == (["NO_COMMAND"], [])
    assert seen["linear_m_s"] == pytest.approx(0, abs=0.01)
    assert seen["nearest_m"] > 0.3
    robot.prints("NO_COMMAND", "status")

    before = robot.pids()
    _refused(
        robot.run("up", "--detach"),
        r"already runs in .*: drive it with `lifeline teleop .*`lifeline down .*`",
    )
    assert robot.pids() == before, "a refused second `up` must not touch the first"
    robot.seen(lambda seen: seen["running"], "not running")

    down = robot.run("down")
    assert (down.returncode, down.stdout) == (0, "lifeline: everything is stopped\n")
    assert robot.pids() == {}
    assert not robot.state.socket.exists()

    again = robot.run("down")
    assert (again.returncode, again.stdout) == (0, "lifeline: nothing is running\n")
    assert robot.run("status").returncode == 3


def test_the_page_of_a_station_runs_beside_the_nodes_and_ends_with_them(robot: Robot, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'{DEFAULT_CONFIG.read_text()}\n[[supervisor.estop_stations]]\nname = "phone"\n')
    port = free_endpoint().rpartition(":")[2]
    options = ("--no-sim", "--config", str(config), "--station", "--port", port)
    up = robot.run("up", "--detach", *options)
    assert up.returncode == 0, up.stderr
    assert robot.pids().keys() == {"supervisord", "supervisor", "station"}
    addresses = [re.search(rf"http://127\.0\.0\.1:{port}/#\w+", up.stdout)]
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/") as page:
        assert b"STOP" in page.read()
    more = robot.run("station", "--new-code")
    addresses.append(re.search(rf"http://127\.0\.0\.1:{port}/#\w+", more.stdout))
    assert len({found[0] for found in addresses if found}) == 2, (up, more)
    assert robot.run("down").returncode == 0
    assert robot.pids() == {}
    _refused(robot.run("station", "--new-code"), "no e-stop station runs in .*`lifeline up --station`")


def test_a_station_beside_the_nodes_opens_to_the_network_only_as_the_command_station_does(
    robot: Robot,
) -> None:
    _refused(robot.run("up", "--detach", "--station", "--open"), "--open needs TLS: issue a certificate with")
    assert robot.pids() == {}


def test_a_page_beside_the_nodes_that_cannot_drive_starts_nothing(robot: Robot, tmp_path: Path) -> None:
    for option in ("--drive", "--open", "--passport=page.html", "--authority=authority.pem"):
        name = option.partition("=")[0]
        _refused(robot.run("up", "--detach", option), f"{name} is for the page of a station: add --station")
    _refused(
        robot.run("up", "--station", "--drive"), "a new code for the page needs a terminal: add --detach"
    )
    config = tmp_path / "robot.toml"
    config.write_text(DEFAULT_CONFIG.read_text().replace('source = "teleop"', 'source = "guest"'))
    drives = ("--detach", "--station", "--drive", "--config", str(config))
    _refused(
        robot.run("up", *drives), r"--drive: \[teleop\] source = 'guest' is not in \[supervisor\] sources"
    )
    assert robot.pids() == {}


def test_a_passport_that_the_page_beside_the_nodes_cannot_show_starts_nothing(
    robot: Robot, tmp_path: Path
) -> None:
    config, other = tmp_path / "robot.toml", tmp_path / "other.toml"
    config.write_text(DEFAULT_CONFIG.read_text())
    other.write_text(f"{DEFAULT_CONFIG.read_text()}\n")
    keys = bundle(tmp_path / "keys")
    passport = ("--passport", str(passport_of(config, keys)))
    up = ("up", "--detach", "--station", *passport)
    _refused(robot.run(*up, "--config", str(config)), "name its certificate with --authority")
    trusting = ("--authority", str(keys / AUTHORITY))
    _refused(
        robot.run(*up, *trusting, "--config", str(other)),
        "was measured with another configuration than .*other.toml: measure this robot again",
    )
    assert robot.pids() == {}


@pytest.mark.timed
def test_a_killed_supervisor_of_a_real_robot_is_restarted_immediately(robot: Robot) -> None:
    """Without a sim, no log line wakes supervisord from its sleep of a second: only the plug-in does."""
    assert robot.run("up", "--detach", "--no-sim").returncode == 0
    _wait_for(
        lambda: [p.state for p in supervisord.programs(robot.state) or ()] == ["RUNNING"],
        "the supervisor is not RUNNING",
    )
    first = robot.pids()["supervisor"]
    os.kill(first, signal.SIGKILL)
    killed_s = time.monotonic()
    _wait_for(lambda: robot.pids().get("supervisor", first) != first, "no restart")
    assert time.monotonic() - killed_s < RESTART_LIMIT_S


def test_a_program_that_is_still_ending_counts_as_started_only_when_it_starts_again(robot: Robot) -> None:
    assert robot.run("up", "--detach").returncode == 0
    before = robot.pids()["supervisor"]
    os.kill(before, signal.SIGSTOP)
    assert supervisord.stop_program(robot.state, "supervisor")
    assert not supervisord.start_program(robot.state, "supervisor"), "it does not end while it is stopped"
    os.kill(before, signal.SIGCONT)
    _wait_for(lambda: supervisord.start_program(robot.state, "supervisor"), "the start")
    _wait_for(lambda: robot.pids().get("supervisor", before) != before, "a new supervisor")


def test_a_hung_supervisor_is_restarted_without_a_person_and_doctor_says_so(robot: Robot) -> None:
    assert robot.run("up", "--detach").returncode == 0
    before = robot.pids()["supervisor"]
    with freezing(robot.endpoint):
        _wait_for(lambda: robot.pids().get("supervisor", before) != before, "a new supervisor")
    robot.seen(lambda seen: seen["running"], "the new supervisor answers")
    findings = json.loads(robot.run("doctor", "--json", "--seconds", "1").stdout)
    (hang,) = (one for one in findings if one["check"] == "hangs")
    assert hang["what"].startswith("supervisor hung once, was ended by the kernel and started again")


@pytest.mark.smoke
def test_a_killed_supervisor_is_restarted_and_a_killed_supervisord_is_cleaned_up_after(robot: Robot) -> None:
    assert robot.run("up", "--detach").returncode == 0
    first = robot.pids()

    os.kill(first["supervisor"], signal.SIGKILL)
    killed_s = time.monotonic()
    _wait_for(
        lambda: robot.pids().get("supervisor", first["supervisor"]) != first["supervisor"], "no restart"
    )
    _wait_for(lambda: robot.status()["running"], "not alive after the restart")
    print(f"supervisor killed: running again after {time.monotonic() - killed_s:.1f} s")
    assert robot.pids()["sim"] == first["sim"]

    os.kill(first["supervisord"], signal.SIGKILL)
    _wait_for(lambda: robot.pids().keys() == {"supervisor", "sim"}, "supervisord lives on")
    _refused(
        robot.run("up", "--detach"),
        r"supervisord was killed and left .*supervisor \(pid \d+\).*`lifeline down --state-dir .*`",
    )

    down = robot.run("down")
    assert down.returncode == 0
    assert (
        down.stdout
        == "lifeline: supervisord had been killed; stopped its remaining processes: sim, supervisor\n"
    )
    assert robot.pids() == {}


def test_a_port_in_use_is_one_sentence_and_starts_nothing(robot: Robot) -> None:
    with socket.create_server(("127.0.0.1", int(robot.endpoint.rsplit(":", 1)[1]))):
        _refused(
            robot.run("up", "--detach"), r"port \d+ on 127\.0\.0\.1 is in use by another program.*--endpoint"
        )
    assert robot.pids() == {}


def test_a_missing_configuration_is_one_sentence(robot: Robot) -> None:
    _refused(
        robot.run("up", "--detach", "--config", "/nowhere/robot.toml"), r"cannot read .*/nowhere/robot\.toml"
    )


def test_a_missing_uv_is_one_sentence(robot: Robot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("UV", str(tmp_path / "uv"))
    monkeypatch.setenv("PATH", str(tmp_path))
    root = supervisord.checkout()
    if root and (root / ".uv" / "bin" / "uv").exists():
        pytest.skip("`make setup` fetched one, which is found")
    _refused(robot.run("up", "--detach"), r"uv, which runs supervisord, is missing.*`make setup`")


def test_a_python_path_with_this_project_in_it_is_not_supervisords(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its import name is `supervisor`, and so is ours."""
    monkeypatch.setenv("PYTHONPATH", str(supervisord.checkout()))
    said: list[str] = []
    supervisord.fetch(supervisord.find_uv(), said.append)
    assert said == [], "it was there, and runs"


def test_without_a_terminal_up_says_what_to_do_instead(robot: Robot) -> None:
    _refused(robot.run("up"), r"teleop needs a terminal.*--detach.*lifeline demo")


def test_a_process_that_ends_at_once_is_reported_with_the_end_of_its_log(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    _refused(
        robot.run("up", "--detach", "--viewer"),
        r"sim exits soon after each start; the end of .*sim\.log:\n(.*\n)*.*no display for a window",
    )
    assert robot.pids() == {}


def test_a_section_that_is_refused_is_reported_before_anything_starts(robot: Robot) -> None:
    config = robot.state.path / "robot.toml"
    config.write_text("[sim]\nscan_hz = -1.0\n")
    _refused(robot.run("up", "--detach", "--config", str(config)), r"sim\.scan_hz = -1")
    assert not robot.state.log("supervisor").exists()


@dataclass
class Terminal:
    """`lifeline up` in a terminal of its own."""

    process: subprocess.Popen[bytes]
    master: int
    output: Path
    """Everything that was written to it."""

    def press(self, keys: str) -> None:
        os.write(self.master, keys.encode())


@pytest.fixture
def terminal(robot: Robot, tmp_path: Path) -> Generator[Terminal]:
    master, slave = pty.openpty()
    environment = os.environ | {"TERM": "xterm-256color"}
    process = subprocess.Popen(
        robot.command("up"), stdin=slave, stdout=slave, stderr=slave, start_new_session=True, env=environment
    )
    os.close(slave)
    # The screen must be read, or its buffer fills up.
    output = tmp_path / "terminal"
    with output.open("wb") as written:
        reader = subprocess.Popen(["cat"], stdin=master, stdout=written)
    yield Terminal(process, master, output)
    process.kill()
    process.wait()
    os.close(master)
    reader.kill()
    reader.wait()


def _drive(robot: Robot, terminal: Terminal) -> None:
    """On a busy machine, a late process may stop the robot; the operator then starts again."""
    _wait_for(robot.state.record.exists, "the stack does not start")
    asyncio.run(_driven(robot.endpoint, terminal))


async def _driven(endpoint: str, terminal: Terminal) -> None:
    keys = {SafetyStatus.STOPPED: "s", SafetyStatus.READY: "www"}
    async with asyncio.timeout(WAIT_LIMIT_S):
        bus = await open_bus(BusConfig(endpoint), "client")
        try:
            statuses, odometry = bus.subscribe(topics.STATUS), bus.subscribe(topics.ODOM, depth=200)
            # This terminal answers nothing, which limits the speed.
            while not any(one.message and one.message.twist.twist.linear.x > 0.05 for one in odometry.take()):
                if (newest := statuses.latest()) is not None and newest.message is not None:
                    print(f"mode {newest.message.mode}: {newest.message.reasons}")  # for a failed test
                    terminal.press(keys.get(newest.message.mode, ""))
                await asyncio.sleep(AGAIN_S)
        finally:
            await bus.close()


@pytest.mark.smoke
def test_up_drives_from_this_terminal_and_takes_everything_down_on_q(
    robot: Robot, terminal: Terminal
) -> None:
    _drive(robot, terminal)
    assert "teleop" in robot.pids()
    terminal.press("q")
    assert terminal.process.wait(WAIT_LIMIT_S) == 0
    assert robot.pids() == {}


def test_a_killed_teleop_leaves_a_screen_that_a_shell_can_use(robot: Robot, terminal: Terminal) -> None:
    _drive(robot, terminal)
    os.kill(robot.pids()["teleop"], signal.SIGKILL)
    assert terminal.process.wait(WAIT_LIMIT_S) == 128 + signal.SIGKILL
    _wait_for(lambda: b"everything is stopped" in terminal.output.read_bytes(), "its last words are missing")
    *_, shown = terminal.output.read_bytes().split(b"\x1b[?1049h")
    picture, _, words = shown.rpartition(b"\x1b[?1049l")
    assert picture.rpartition(b"\x1b[?25")[2].startswith(b"h")  # the cursor is seen again
    assert b"teleop was ended by SIGKILL" in words
    assert robot.pids() == {}
    assert processes.keepers(robot.state.path) == []


def test_down_from_another_terminal_ends_a_driving_up(robot: Robot, terminal: Terminal) -> None:
    """By SIGTERM, as a service manager would."""
    _drive(robot, terminal)
    down = robot.run("down")
    assert (down.returncode, down.stdout) == (0, "lifeline: everything is stopped\n")
    assert terminal.process.wait(WAIT_LIMIT_S) == 128 + signal.SIGTERM
    assert robot.pids() == {}


def test_a_signal_while_it_still_waits_leaves_nothing_behind(robot: Robot, terminal: Terminal) -> None:
    _wait_for(lambda: "supervisord" in robot.pids(), "supervisord does not start")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.process.wait(WAIT_LIMIT_S) == 128 + signal.SIGINT
    assert robot.pids() == {}


@pytest.mark.timeout(240)  # three starts of the stack
def test_the_estop_outlives_the_whole_stack_and_up_and_status_say_how_to_reset_it(robot: Robot) -> None:
    assert "e-stop" not in robot.run("up", "--detach").stdout
    asyncio.run(_press_at(robot.endpoint))

    killed = robot.pids()["supervisor"]
    os.kill(killed, signal.SIGKILL)
    _wait_for(lambda: robot.pids().get("supervisor", killed) != killed, "no restart")
    _wait_for(lambda: robot.status()["running"], "not alive after the restart")
    assert "ESTOP" in robot.seen(lambda seen: seen["running"], "not running")["reasons"]

    for pid in [robot.pids()[name] for name in ("supervisord", "supervisor", "sim")]:
        os.kill(pid, signal.SIGKILL)
    assert robot.run("down").returncode == 0
    ended = ("status", "--endpoint", robot.endpoint)  # the default endpoint may have another robot
    assert "reset" in robot.run(*ended).stdout

    up = robot.run("up", "--detach")
    assert up.returncode == 0
    by = r"\(pressed by another program, \d{4}-\d\d-\d\d \d\d:\d\d:\d\d\)"
    assert re.search(rf"the e-stop is still latched from an earlier run {by}", up.stdout)
    assert "press r in teleop" in up.stdout
    assert "ESTOP" in robot.seen(lambda seen: seen["running"], "not running")["reasons"]
    robot.prints("press r in teleop", "status")

    asyncio.run(_reset_at(robot.endpoint))
    assert robot.run("down").returncode == 0
    assert "reset" not in robot.run(*ended).stdout


async def _press_at(endpoint: str) -> None:
    """Press, and wait until the status shows a recorded e-stop."""
    bus = await open_bus(BusConfig(endpoint), "client")
    told = asyncio.Event()
    statuses = bus.subscribe(topics.STATUS, depth=50, wake=told)
    try:
        async with asyncio.timeout(20.0):
            while not any(
                a.message and "ESTOP" in a.message.reasons and not a.message.estop_record_problem
                for a in statuses.take()
            ):
                bus.publisher(topics.ESTOP).put(Bool(data=True))
                told.clear()
                await told.wait()
    finally:
        await bus.close()


async def _reset_at(endpoint: str) -> None:
    bus = await open_bus(BusConfig(endpoint), "client")
    deadline_s = time.monotonic() + 20.0
    try:
        while True:
            with suppress(NoReplyError):
                reply = await bus.call(topics.SUPERVISOR_RESET)
                if reply.message != STALLED:
                    assert reply.message == "the emergency stop is reset"
                    return
            assert time.monotonic() < deadline_s
    finally:
        await bus.close()


# --- a robot that is not simulated


@pytest.fixture
def ros2_config(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A configuration with `[ros2]`, whose interpreter runs a stand-in for the ROS 2 process."""
    monkeypatch.setenv(fake_ros2.OUTPUT, str(tmp_path / "started"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")  # as if its setup.sh had been sourced
    monkeypatch.setenv("PYTHONPATH", "/opt/ros/jazzy/lib/python3.12/site-packages")
    config = tmp_path / "robot.toml"
    config.write_text(f'[ros2]\npython = "{fake_ros2.interpreter(tmp_path)}"\n')
    return config


def test_a_ros_2_robot_comes_up_without_a_sim_is_seen_and_goes_down(
    robot: Robot, ros2_config: Path, tmp_path: Path
) -> None:
    up = robot.run("up", "--detach", "--config", str(ros2_config))
    assert up.returncode == 0, up.stderr
    assert "starting supervisor and ros2, because the configuration has [ros2]" in up.stdout
    assert robot.pids().keys() == {"supervisord", "supervisor", "ros2"}

    seen = robot.seen(lambda seen: seen["running"], "not running")
    assert list(seen["nodes"]) == ["supervisor", "ros2", "teleop"]
    assert "sim" not in robot.run("status").stdout

    started = json.loads((tmp_path / "started").read_text())
    assert started["arguments"] == [
        *("-m", "ros2", "--config", str(ros2_config), "--endpoint", robot.endpoint)
    ]
    packages, ros = started["environment"]["PYTHONPATH"].split(":")
    assert ros == "/opt/ros/jazzy/lib/python3.12/site-packages"
    assert sorted(link.name for link in Path(packages).iterdir()) == ["passport", "ros2", "wire"]
    assert (Path(packages) / "ros2" / "config.py").is_file()

    reported = robot.seen(lambda seen: "ros2" in seen, "no reports")["ros2"]
    assert [(one["name"], one["level"]) for one in reported] == [("source joy", "warn"), ("scan", "error")]
    assert reported[0]["values"]["guards"] == "process 12 on this host, command timeout"
    shown = robot.prints("no program publishes on /joy/cmd_vel", "status")
    assert "\x1b[2J" not in shown
    robot.prints("source joy: no program publishes on /joy/cmd_vel", "doctor")

    killed = robot.pids()["ros2"]
    os.kill(killed, signal.SIGKILL)
    _wait_for(lambda: robot.pids().get("ros2", killed) != killed, "no restart")
    robot.seen(lambda seen: seen["running"], "no restart")

    assert robot.run("down").stdout == "lifeline: everything is stopped\n"
    assert robot.pids() == {}


def test_without_a_sim_only_the_supervisor_starts(robot: Robot) -> None:
    up = robot.run("up", "--detach", "--no-sim")
    assert up.returncode == 0, up.stderr
    assert f"without a sim: the base must connect to {robot.endpoint}" in up.stdout
    assert robot.pids().keys() == {"supervisord", "supervisor"}
    seen = robot.seen(lambda seen: seen["running"], "not running")
    assert list(seen["nodes"]) == ["supervisor", "teleop"]


def test_a_base_alone_starts_only_where_a_supervisor_answers(robot: Robot) -> None:
    refused = robot.run("up", "--only", "sim")
    _refused(refused, r"no supervisor answers at .*, and sim cannot run without one")
    assert robot.pids() == {}
    assert robot.run("up", "--only", "supervisor").returncode == 0
    assert robot.pids().keys() == {"supervisord", "supervisor"}
    beside = Robot(StateDir(robot.state.path / "beside"), robot.endpoint)
    try:
        started = beside.run("up", "--only", "sim")
        assert started.returncode == 0, started.stderr
        assert f"starting sim for the supervisor at {robot.endpoint}" in started.stdout
        assert beside.pids().keys() == {"supervisord", "sim"}
        beside.seen(lambda seen: seen["nodes"]["sim"]["alive"] and seen["running"], "no sim")
    finally:
        beside.run("down")


def test_a_missing_python_of_ros_2_is_one_sentence_and_starts_nothing(
    robot: Robot, ros2_config: Path
) -> None:
    ros2_config.write_text('[ros2]\npython = "nowhere/python"\n')
    done = robot.run("up", "--detach", "--config", str(ros2_config))
    _refused(done, r"nowhere/python is missing: run `make ros2`.*\[ros2\] python")
    assert robot.pids() == {}


def test_a_sim_is_not_needed_to_start_without_one(robot: Robot) -> None:
    code = "import sys; sys.modules['mujoco'] = sys.modules['PIL'] = None; from lifeline.cli.entry import main; main()"
    command = [sys.executable, "-c", code, *robot.command("up", "--detach", "--no-sim")[3:]]
    up = subprocess.run(command, capture_output=True, text=True, check=False, timeout=COMMAND_LIMIT_S)
    assert up.returncode == 0, up.stderr


def test_the_base_is_checked_in_the_environment_of_ros_2_and_its_exit_code_is_passed_on(
    robot: Robot, ros2_config: Path
) -> None:
    options = ["--config", str(ros2_config), "--endpoint", robot.endpoint, "--yes"]
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "lifeline.cli.app",
            "ros2",
            "check-base",
            "--state-dir",
            str(robot.state.path),
            *options,
        ],
        capture_output=True,
        text=True,
        check=False,
        timeout=COMMAND_LIMIT_S,
    )
    words = f"-m ros2 --config {ros2_config} --endpoint {robot.endpoint} --check-base --yes"
    assert (done.returncode, done.stdout) == (7, f"checked {words}\n")
