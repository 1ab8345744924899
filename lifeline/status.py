"""`lifeline status`: print the status of a running robot once."""

import asyncio
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from rich.console import Console
from rich.text import Text

from deploy.stack import processes, ros2_reports, supervisord
from deploy.stack.errors import EXIT_NOT_RUNNING
from deploy.stack.formatting import (
    CHECK_NETWORK,
    COLOURS,
    GO_NEUTRAL,
    mode_name,
    nearest,
    speed,
    status_json,
)
from deploy.stack.launch import ANY_BASE, SIMULATED, Launch
from deploy.stack.reach import check_refusal, observing, silence_of
from deploy.stack.ros2_reports import Report
from deploy.stack.statedir import StateDir
from deploy.stack.table import Table, facts
from deploy.stack.takedown import listed
from wire import tls, topics
from wire.host.installation import runnable
from wire.messages import Odometry, SafetyStatus, Twist
from wire.reasons import words_of
from wire.text import printable, printable_lines

CONNECT_LIMIT_S = 1.0
SECURE_CONNECT_LIMIT_S = 3.0
"""With certificates, and over links that lose packets."""
LISTEN_LIMIT_S = 1.0
"""Status and odometry arrive at least ten times in this period."""
ROS2_LIMIT_S = 1.5
"""The ROS 2 process reports once a second."""

EXIT_PARTLY = 1

ESTOP = "ESTOP"


@dataclass(frozen=True, slots=True)
class Look:
    """The observed status of the stack."""

    endpoint: str
    connected: bool
    programs: dict[str, str]
    """supervisord's state of each of its programs."""
    alive: frozenset[str] = frozenset()
    status: SafetyStatus | None = None
    odometry: Odometry | None = None
    latched: str | None = None
    """The message that a robot started now has its e-stop latched; None if it is not latched."""
    needed: tuple[str, ...] = SIMULATED
    """The nodes without which the robot does not run."""
    left_over: str = ""
    """The processes of an interrupted start or stop, if no node runs."""
    silence: str | None = None
    """Why nothing answers at an endpoint on another machine; None for one of this machine."""
    ros2: tuple[Report, ...] = ()
    """The reports of the ROS 2 process; empty without one."""

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes that are always shown."""
        return (*self.needed, topics.TELEOP)

    @property
    def exit_code(self) -> int:
        if all(self.runs(node) for node in self.needed) and self.status is not None:
            return 0
        return EXIT_PARTLY if self.connected or self.programs else EXIT_NOT_RUNNING

    def runs(self, node: str) -> bool:
        """Return whether a node is alive; a base that is no node of ours sends odometry."""
        return self.odometry is not None if node == ANY_BASE else node in self.alive

    @property
    def mode(self) -> str | None:
        return None if self.status is None else mode_name(self.status)

    @property
    def twist(self) -> Twist | None:
        return None if self.odometry is None else self.odometry.twist.twist

    def to_json(self) -> str:
        status = self.status
        document: dict[str, Any] = {
            "endpoint": self.endpoint,
            "running": self.exit_code == 0,
            "nodes": {
                node: {"alive": self.runs(node), "process": self.programs.get(node)} for node in self.nodes
            },
            **status_json(status, self.twist),
            "reasons": status.reasons if status else None,
            "estop_record_problem": status.estop_record_problem if status else None,
            "rmw_zenoh_nodes": status.rmw_zenoh_nodes if status else None,
            "estop_stations": {station.name: station.words() for station in status.estop_stations}
            if status
            else None,
        }
        if self.ros2:
            document["ros2"] = [report._asdict() for report in self.ros2]
        return json.dumps(document, indent=2)


def show_status(state: StateDir, launch: Launch, *, as_json: bool) -> int:
    """Print the status and return the exit code: 0 running, 1 partly running, 3 not running."""
    look = asyncio.run(_look(state, launch))
    if as_json:
        print(look.to_json())
    else:
        Console().print(table(look))
    return look.exit_code


async def _look(state: StateDir, launch: Launch) -> Look:
    silence = silence_of(launch.bus.endpoint)
    is_ours = silence is None or launch.is_started(state)
    programs = {p.name: p.state for p in supervisord.programs(state) or ()} if is_ours else {}
    with_ros2 = topics.ROS2 in launch.nodes
    limit_s = SECURE_CONNECT_LIMIT_S if tls.is_secure(launch.bus.endpoint) else CONNECT_LIMIT_S
    look = Look(launch.bus.endpoint, connected=False, programs=programs, needed=launch.nodes, silence=silence)
    try:
        async with observing(launch.bus, limit_s) as observer:
            await observer.until(
                lambda robot: (
                    robot.status is not None
                    and robot.odometry is not None
                    and robot.alive.issuperset(node for node in launch.nodes if node != ANY_BASE)
                    and (bool(robot.ros2) or not with_ros2)
                ),
                ROS2_LIMIT_S if with_ros2 else LISTEN_LIMIT_S,
            )
            # Replace a base of unknown kind by the one that is alive.
            base = next((name for name in (topics.SIM, topics.ROS2) if name in observer.alive), ANY_BASE)
            return replace(
                look,
                connected=True,
                alive=frozenset(observer.alive),
                status=observer.status,
                odometry=observer.odometry,
                needed=tuple(base if node == ANY_BASE else node for node in launch.nodes),
                ros2=observer.ros2,
                silence=None,
            )
    except TimeoutError:
        await check_refusal(launch.bus)
        return replace(
            look,
            latched=launch.latched_sentence(state) if silence is None else None,
            left_over=listed(processes.of(state.path)) if is_ours else "",
        )


def table(look: Look) -> Table | Text:
    """Format the status as a table for the terminal."""
    if look.exit_code == EXIT_NOT_RUNNING:
        idle = _idle(look) if look.latched is None else f"{_idle(look)}\n{look.latched}"
        return Text(runnable(printable_lines(idle)))
    table = facts(look.endpoint)
    for node in (*look.nodes, *sorted(look.alive.difference(look.nodes))):
        alive = look.runs(node)
        note = f" (process {look.programs[node]})" if node in look.programs else ""
        style = "green" if alive else "red" if node in look.needed else "dim"
        table.add_row(
            Text(printable(node)), Text(printable(f"{'alive' if alive else 'not alive'}{note}"), style=style)
        )
    if look.status is None:
        table.add_row("mode", Text(f"unknown: no status within {LISTEN_LIMIT_S:g} s", style="bold red"))
    else:
        status = look.status
        table.add_row("mode", Text(printable(look.mode or ""), style=COLOURS[look.mode or "STOPPED"]))
        for name, why in _why(status):
            table.add_row(name, why)
        for name, text in _estop(status):
            table.add_row(name, text)
        if status.rmw_zenoh_nodes:
            nodes = ", ".join(status.rmw_zenoh_nodes)
            table.add_row(
                "not read", Text(printable(f"{nodes}: they use the keys of rmw_zenoh"), style="yellow")
            )
        table.add_row("speed", speed(look.twist) if look.twist else "unknown: no odometry")
        table.add_row("nearest", nearest(status.nearest_m, status.nearest_bearing_rad, " from the hull"))
    for report in look.ros2:
        if report.name != ros2_reports.SUPERVISOR:
            table.add_row(
                report.name,
                Text(runnable(printable(report.message)), style=ros2_reports.COLOURS[report.level]),
            )
    return table


def _idle(look: Look) -> str:
    if look.left_over:
        return f"no node is running at {look.endpoint}, but {look.left_over}: clean up with `lifeline down`"
    if look.silence is not None:
        return f"{look.silence}: {CHECK_NETWORK}"
    return f"nothing is running at {look.endpoint}; start with `lifeline up`"


def _estop(status: SafetyStatus) -> Iterator[tuple[str, Text]]:
    """Yield the rows about the e-stop, its record and its stations."""
    if ESTOP in status.causes_and_latched()[0]:
        yield (
            "e-stop",
            Text(
                "latched until reset, even after a restart: press r in teleop, or Reset on the page that drives"
            ),
        )
    if status.estop_record_problem:
        yield "e-stop record", Text(printable(status.estop_record_problem), style="bold red")
    for station in status.estop_stations:
        style = ("bold red" if station.required else "yellow") if station.is_missed else "green"
        need = "" if station.required else ", not required"
        yield (
            "e-stop station",
            Text(printable(f"{station.name}: {station.words()}{need}"), style=style),
        )


def _why(status: SafetyStatus) -> Iterator[tuple[str, str]]:
    """Yield the rows about a stop or limit: present causes, then latched ones."""
    causes, latched = status.causes_and_latched()
    if causes:
        words = words_of(causes[0])
        detail = status.detail or ("" if words is None else words.caption)
        first = f"{causes[0]}: {detail}" if detail else causes[0]
        yield "causes", printable("; also ".join(filter(None, (first, ", ".join(causes[1:])))))
    if latched:
        hint = "" if causes else f": no longer present; {GO_NEUTRAL} to drive again"
        yield "latched", printable(f"{', '.join(latched)}{hint}")
