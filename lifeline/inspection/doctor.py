"""`lifeline doctor`: explain why the robot does not move, or why the system cannot start."""

import asyncio
import importlib.metadata
import os
import select
import sys
import termios
import time
import tty
from typing import NoReturn

from rich.text import Text

from deploy.stack import supervisord
from deploy.stack.console import show
from deploy.stack.errors import DeployError
from deploy.stack.launch import ANY_BASE, Launch, check_endpoint_is_free
from deploy.stack.reach import NotRunningError, Observer, reach, run_command, silence_of
from deploy.stack.robot_file import read_robot
from deploy.stack.statedir import StateDir
from deploy.stack.table import Column, Table
from lifeline.inspection.diagnosis import Finding, Observed, Terminal, Verdict, diagnose, is_healthy
from lifeline.inspection.listening import Robot, robot_at
from lifeline.inspection.nodes import program
from lifeline.inspection.sockets import processes_at
from supervisor.config import SupervisorSection
from supervisor.estop_record import is_recorded, pressed_by
from wire import topics
from wire.host.config import ConfigError, read_toml
from wire.host.installation import runnable
from wire.text import printable, printable_lines

PACKAGES = ("eclipse-zenoh", "numpy", "pydantic", "rich", "rosbags", "typer")
KEY_REPLY_S = 0.3
"""Time limit for the terminal's answer whether it reports key releases."""
COLOURS = {Verdict.OK: "green", Verdict.NOTE: "yellow", Verdict.PROBLEM: "bold red"}
MARKS = {Verdict.OK: "ok", Verdict.NOTE: "note", Verdict.PROBLEM: "PROBLEM"}


def doctor(launch: Launch, state: StateDir, seconds: float, *, as_json: bool) -> NoReturn:
    """Run all checks, and exit: 0 without a problem, else 1."""
    seen = _at_rest(launch, state)
    if not as_json:
        seen.terminal = _terminal()
    run_command(lambda stop: _examine(seen, launch, seconds, stop, as_json=as_json))


async def _examine(
    seen: Observed, launch: Launch, seconds: float, stop: asyncio.Event, *, as_json: bool
) -> int:
    try:
        bus = await reach(launch.bus, stop)
    except NotRunningError:
        bus = None
        if seen.silence is None:
            seen.port_problem, seen.silent_pid = _port_problem(launch.bus.endpoint)
    except DeployError as error:
        bus, seen.refusal = None, str(error)
    if stop.is_set():
        return 130
    if bus is not None and seen.config is not None:
        await _listen(seen, robot_at(bus, launch, seen.config, stop), seconds)
    findings = [one._replace(what=runnable(one.what), remedy=runnable(one.remedy)) for one in diagnose(seen)]
    found = [finding._asdict() for finding in findings]
    show(found, table_of(findings), Text(printable_lines(_summary(findings))), as_json=as_json)
    return 0 if is_healthy(findings) else 1


def _at_rest(launch: Launch, state: StateDir) -> Observed:
    """Observe what needs no connection."""
    seen = Observed(
        versions={name: importlib.metadata.version(name) for name in PACKAGES},
        config_path=str(launch.config),
        endpoint=launch.bus.endpoint,
        drive=launch.drive,
        namespace=launch.bus.namespace,
    )
    try:
        document = read_toml(launch.config)
        seen.has_sim = not {topics.SIM, ANY_BASE}.isdisjoint(launch.nodes)
        seen.config = read_robot(document, simulated=False)[SupervisorSection]
        seen.has_ros2 = topics.ROS2 in document
        seen.ros2_problem = _ros2_problem(launch) if seen.has_ros2 else ""
    except ConfigError as error:
        seen.config_problem = str(error)
    if state.path.exists() and not os.access(state.path, os.W_OK | os.X_OK):
        seen.state_problem = f"{state.path} is not writable"
    seen.silence = silence_of(launch.bus.endpoint)
    is_ours = seen.silence is None or launch.is_started(state)
    seen.is_stale = is_ours and state.record.exists() and supervisord.programs(state) is None
    seen.hangs = supervisord.hangs(state) if is_ours else ()
    seen.is_estop_recorded = seen.silence is None and is_recorded(state.path, launch.bus.namespace)
    seen.estop_pressed_by = pressed_by(state.path, launch.bus.namespace)
    return seen


def _ros2_problem(launch: Launch) -> str:
    """Return why the ROS 2 process cannot be started on this machine; empty if it can."""
    from deploy.stack.ros2_program import interpreter  # noqa: PLC0415 - not without [ros2]

    try:
        interpreter(launch.config)
    except DeployError as error:
        return str(error)
    return ""


def _port_problem(endpoint: str) -> tuple[str, int | None]:
    """Return why no supervisor could listen on an endpoint, empty if one could, and the pid of one that already does."""
    try:
        check_endpoint_is_free(endpoint)
    except DeployError as error:
        found = processes_at({endpoint.partition("/")[2]})
        holder = next(iter(found.values()), None)
        if holder is None:
            return str(error), None
        who = f"pid {holder.pid}: {printable(' '.join(holder.arguments))}"
        return f"{error} ({who})", holder.pid if program(holder.arguments) == topics.SUPERVISOR else None
    return "", None


async def _listen(seen: Observed, robot: Robot, seconds: float) -> None:
    """Observe a running robot."""
    seen.is_connected, seen.known = True, robot.known
    observer, scans = Observer(robot.bus), robot.bus.subscribe(topics.SCAN)
    seen.traffic = await robot.traffic(seconds)
    await observer.until(lambda _: True, 0.0)
    seen.status, seen.ros2_reports = observer.status, observer.ros2
    scan = scans.latest()
    for topic, message in (
        (topics.SCAN, None if scan is None else scan.message),
        (topics.ODOM, observer.odometry),
    ):
        if message is not None:
            stamp = message.header.stamp
            seen.header_offset_s[f"{robot.namespace}/{topic.key}"] = (
                stamp.sec + stamp.nanosec * 1e-9 - time.time()
            )
    try:
        seen.nodes = await robot.nodes()
    except DeployError as error:
        seen.nodes_problem = str(error)


def _terminal() -> Terminal | None:
    """Observe the terminal; None if there is none."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return None
    size = os.get_terminal_size(sys.stdout.fileno())
    colours = os.environ.get("COLORTERM") or os.environ.get("TERM", "")
    releases = None if os.environ.get("TERM") == "dumb" else _reports_releases(sys.stdin.fileno())
    return Terminal(size.columns, size.lines, colours, releases)


def _reports_releases(descriptor: int) -> bool | None:
    """Ask the terminal for the flags of the kitty keyboard protocol, then for its attributes, which every terminal answers."""
    before = termios.tcgetattr(descriptor)
    answer = b""
    try:
        tty.setcbreak(descriptor)
        os.write(sys.stdout.fileno(), b"\x1b[?u\x1b[c")
        deadline_s = time.monotonic() + KEY_REPLY_S
        while not answer.endswith(b"c") and (left_s := deadline_s - time.monotonic()) > 0.0:
            if select.select([descriptor], [], [], left_s)[0]:
                answer += os.read(descriptor, 64)
    finally:
        termios.tcsetattr(descriptor, termios.TCSAFLUSH, before)
    if not answer:
        return None
    return b"u" in answer


def table_of(findings: list[Finding]) -> Table:
    table = Table("", Column(style="dim"), "")
    for finding in findings:
        text = Text(printable_lines(finding.what))
        if finding.remedy:
            text.append(
                f"\n→ {printable_lines(finding.remedy)}",
                style="bold" if finding.verdict is Verdict.PROBLEM else "",
            )
        table.add_row(
            Text(MARKS[finding.verdict], style=COLOURS[finding.verdict]), Text(printable(finding.check)), text
        )
    return table


def _summary(findings: list[Finding]) -> str:
    number = sum(finding.verdict is Verdict.PROBLEM for finding in findings)
    if number == 0:
        return "lifeline: no problem found"
    return f"lifeline: {number} {'problem' if number == 1 else 'problems'} found"
