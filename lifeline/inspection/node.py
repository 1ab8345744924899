"""`lifeline node`: the nodes of a running robot, with their processes and what each writes, reads and serves."""

import json
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.launch import Launch
from lifeline.inspection.listening import Robot, inspect
from lifeline.inspection.nodes import Node, find
from lifeline.inspection.traffic import Traffic
from wire.text import printable


def show_list(launch: Launch, *, as_json: bool) -> NoReturn:
    """Print all nodes."""

    async def body(robot: Robot) -> int:
        nodes = await robot.nodes()
        if as_json:
            print(json.dumps([to_json(node) for node in nodes], indent=2))
        else:
            Console().print(_table(nodes))
        return 0

    inspect(launch, body)


def to_json(node: Node) -> dict[str, Any]:
    """Return a node as JSON values."""
    return {
        "node": node.name,
        "named": node.is_named,
        "pid": node.pid,
        "host": node.host,
        "uptime_s": None if node.process is None else round(node.process.uptime_s, 2),
        "session": node.session.session_id,
        "address": node.session.address,
        "writes": sorted(node.session.writes),
        "reads": sorted(node.session.reads),
        "serves": sorted(node.session.serves),
    }


def _table(nodes: Iterable[Node]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("node", overflow="fold")
    for name in ("pid", "host", "uptime", "writes", "reads", "serves"):
        table.add_column(name, justify="left" if name == "host" else "right")
    for node in nodes:
        session = node.session
        table.add_row(
            Text(printable(node.name), style="" if node.is_named else "dim"),
            "" if node.pid is None else str(node.pid),
            node.host,
            "" if node.process is None else uptime(node.process.uptime_s),
            str(len(session.writes)),
            str(len(session.reads)),
            str(len(session.serves)),
        )
    return table


def uptime(duration_s: float) -> str:
    """Return a duration in hours, minutes and seconds: `5:03:20`."""
    seconds = max(0, int(duration_s))
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def show_info(launch: Launch, name: str, seconds: float, *, as_json: bool) -> NoReturn:
    """Print a node's process, and the keys that it writes, reads and serves, with their rates."""

    async def body(robot: Robot) -> int:
        traffic, nodes = await robot.traffic(seconds), await robot.nodes()
        found = find(nodes, name)
        if not found:
            there = ", ".join(dict.fromkeys(node.name for node in nodes))
            raise DeployError(f"there is no node {name!r}; there are {there}")
        if as_json:
            print(
                json.dumps([to_json(node) | {"rates_hz": rates(node, traffic)} for node in found], indent=2)
            )
        else:
            _print(found, traffic)
        return 0

    inspect(launch, body)


def rates(node: Node, traffic: Traffic) -> dict[str, float | None]:
    """Return the rate [Hz] of each key that was heard and that a node writes or reads."""
    return {
        key: number(heard.rate_hz)
        for key, heard in sorted(traffic.keys.items())
        if key in node.session.writes or node.reads(key)
    }


def _print(found: Sequence[Node], traffic: Traffic) -> None:
    console = Console()
    for node in found:
        table = Table(show_header=False, box=None, pad_edge=False)
        table.add_column(style="bold")
        table.add_column(overflow="fold")
        table.add_row("node", Text(printable(node.name)))
        if node.process is not None:
            table.add_row("pid", str(node.pid))
            table.add_row("uptime", uptime(node.process.uptime_s))
            table.add_row("command", Text(printable(" ".join(node.process.arguments))))
        table.add_row("host", node.host)
        for title, keys in (
            ("writes", node.session.writes),
            ("reads", node.session.reads),
            ("serves", node.session.serves),
        ):
            for key in sorted(keys):
                heard = traffic.keys.get(key)
                rate = "" if heard is None else f"  {heard.rate_hz:.1f} Hz"
                table.add_row(title, Text(printable(f"{key}{rate}")))
        console.print(table)
        console.print()
