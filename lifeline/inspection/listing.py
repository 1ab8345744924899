"""`lifeline topic` and `node`, each with `list` and `info`: show nodes and topics, with the writers and readers of each topic."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from deploy.stack.console import show
from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.table import Column, Table, facts
from lifeline.inspection.listening import Robot, inspection
from lifeline.inspection.nodes import Node, describe, find
from lifeline.inspection.traffic import KeyTraffic, Traffic
from wire.text import printable
from wire.topics import ANYONE, Topic

# --- topics


@dataclass(frozen=True, slots=True)
class Entry:
    """A topic of the list."""

    key: str
    type: str
    """Empty if it is not known."""
    permitted: str
    """The permitted writer; empty for foreign keys."""
    writers: tuple[str, ...]
    """The names of the writers; each that was heard but declares nothing is `undeclared`."""
    rate_hz: float
    expected_hz: float | None

    def to_json(self) -> dict[str, Any]:
        return {
            "key": self.key,
            "type": self.type or None,
            "permitted_writer": self.permitted or None,
            "writers": list(self.writers),
            "rate_hz": number(self.rate_hz),
            "expected_hz": self.expected_hz,
        }

    @property
    def problem(self) -> str:
        """The sentence that other programs than the permitted writer write it; empty if none does."""
        if not self.permitted or self.permitted == ANYONE or len(self.writers) < 2:
            return ""
        return (
            f"{len(self.writers)} programs write {self.key}, but only one may: stop all but {self.permitted}"
        )


def _entry(key: str, topic: Topic[Any] | None, nodes: Sequence[Node], heard: KeyTraffic | None) -> Entry:
    names = [node.name for node in nodes if key in node.session.writes]
    hidden = (0 if heard is None else heard.concurrent()) - len(names)
    return Entry(
        key,
        "" if topic is None else topic.type.__msgtype__,
        "" if topic is None else topic.writer,
        (*names, *(["undeclared"] * hidden)),
        math.nan if heard is None else heard.rate_hz,
        None if topic is None else topic.rate_hz,
    )


@inspection
async def list_topics(robot: Robot, seconds: float, *, as_json: bool) -> int:
    """Print all known topics with their types, writers and rates, then all other keys that are declared or were heard."""
    traffic, nodes = await robot.traffic(seconds), await robot.nodes()
    declared = {key for node in nodes for key in node.session.writes if "*" not in key}
    others = sorted((declared | set(traffic.keys)) - set(robot.known))
    found = [_entry(key, robot.topic(key), nodes, traffic.keys.get(key)) for key in (*robot.known, *others)]
    show([entry.to_json() for entry in found], topic_table(found), as_json=as_json)
    return 0


def topic_table(found: Iterable[Entry]) -> Table:
    table = Table("topic", "type", "may write", "writes", Column("Hz", right=True))
    for entry in found:
        table.add_row(
            printable(entry.key),
            entry.type.rpartition("/")[2] or Text("unknown", style="dim"),
            entry.permitted or Text("foreign", style="dim"),
            Text(printable(", ".join(entry.writers)), style="bold red" if entry.problem else ""),
            "" if math.isnan(entry.rate_hz) else f"{entry.rate_hz:.1f}",
        )
    return table


@inspection
async def show_topic(robot: Robot, name: str, seconds: float | None, *, as_json: bool) -> int:
    """Print the type, writers and readers of a topic. Exit 1 if more than the permitted writer writes it.

    Without `seconds`, it does not listen: only declared writers are known, and no rate.
    """
    key = robot.key(name)
    heard = None if seconds is None else (await robot.traffic(seconds, key)).keys.get(key)
    nodes, topic = await robot.nodes(), robot.topic(key)
    entry = _entry(key, topic, nodes, heard)
    writing = [node for node in nodes if key in node.session.writes]
    reading = [node for node in nodes if node.reads(key)]
    if topic is None and heard is None and not writing and not reading:
        raise DeployError(f"no program declares {key}: see `lifeline topic list`")
    document = entry.to_json() | {
        "writers": [_brief_json(node) for node in writing],
        "undeclared_writers": None if seconds is None else entry.writers.count("undeclared"),
        "readers": [_brief_json(node) for node in reading],
        "problem": entry.problem or None,
    }
    if seconds is None:
        rate = "not measured without --seconds"
    else:
        rate = "nothing heard" if heard is None else f"{heard.rate_hz:.1f} Hz"
    show(document, topic_facts(entry, writing, reading, rate), as_json=as_json)
    return 1 if entry.problem else 0


def topic_facts(entry: Entry, writing: Sequence[Node], reading: Sequence[Node], rate: str) -> Table:
    table = facts()
    table.add_row("topic", entry.key)
    table.add_row("type", entry.type or "unknown")
    table.add_row("permitted writer", entry.permitted or "not a topic of this robot")
    expected = "" if entry.expected_hz is None else f", expected {entry.expected_hz:g} Hz"
    table.add_row("rate", f"{rate}{expected}")
    for title, nodes in (("writer", writing), ("reader", reading)):
        for node in nodes:
            table.add_row(title, printable(describe(node)))
    for _ in range(entry.writers.count("undeclared")):
        table.add_row("writer", "a program that declares no publisher (undeclared)")
    if not entry.writers:
        table.add_row("writer", "none")
    if entry.problem:
        table.add_row("problem", Text(printable(entry.problem), style="bold red"))
    return table


def _brief_json(node: Node) -> dict[str, Any]:
    return {"node": node.name, "pid": node.pid, "host": node.host, "session": node.session.session_id}


# --- nodes


@inspection
async def list_nodes(robot: Robot, *, as_json: bool) -> int:
    """Print all nodes."""
    nodes = await robot.nodes()
    show([_node_json(node) for node in nodes], node_table(nodes), as_json=as_json)
    return 0


def _node_json(node: Node) -> dict[str, Any]:
    return _brief_json(node) | {
        "named": node.is_named,
        "uptime_s": None if node.process is None else round(node.process.uptime_s, 2),
        "address": node.session.address,
        "writes": sorted(node.session.writes),
        "reads": sorted(node.session.reads),
        "serves": sorted(node.session.serves),
    }


def node_table(nodes: Iterable[Node]) -> Table:
    counts = [Column(name, right=True) for name in ("uptime", "writes", "reads", "serves")]
    table = Table("node", Column("pid", right=True), "host", *counts)
    for node in nodes:
        session = node.session
        table.add_row(
            Text(printable(node.name), style="" if node.is_named else "dim"),
            "" if node.pid is None else str(node.pid),
            Text(printable(node.host)),
            "" if node.process is None else _uptime(node.process.uptime_s),
            *(str(len(keys)) for keys in (session.writes, session.reads, session.serves)),
        )
    return table


def _uptime(duration_s: float) -> str:
    """Return a duration in hours, minutes and seconds: `5:03:20`."""
    seconds = max(0, int(duration_s))
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


@inspection
async def show_node(robot: Robot, name: str, seconds: float, *, as_json: bool) -> int:
    """Print a node's process, and the keys that it writes, reads and serves, with their rates."""
    traffic = await robot.traffic(seconds)
    found = await _found(robot, name)
    documents = [_node_json(node) | {"rates_hz": _rates(node, traffic)} for node in found]
    pages: list[RenderableType] = [page for node in found for page in (node_facts(node, traffic), "")]
    show(documents, *pages, as_json=as_json)
    return 0


@inspection
async def print_pid(robot: Robot, name: str) -> int:
    """Print the pid of a node; exactly one process of this computer must have its name."""
    pids = [node.pid for node in await _found(robot, name) if node.pid is not None]
    if len(pids) != 1:
        what = f"several processes ({', '.join(map(str, pids))})" if pids else "no process"
        raise DeployError(f"the node {name!r} has {what} on this computer: see `lifeline node list`")
    print(pids[0])
    return 0


async def _found(robot: Robot, name: str) -> list[Node]:
    """Return the nodes with a name.

    Raises:
        DeployError: there is none.
    """
    nodes = await robot.nodes()
    found = find(nodes, name)
    if not found:
        there = ", ".join(dict.fromkeys(node.name for node in nodes))
        raise DeployError(f"there is no node {name!r}; there are {there}")
    return found


def _rates(node: Node, traffic: Traffic) -> dict[str, float | None]:
    """Return the rate [Hz] of each key that was heard and that a node writes or reads."""
    return {
        key: number(heard.rate_hz)
        for key, heard in sorted(traffic.keys.items())
        if key in node.session.writes or node.reads(key)
    }


def node_facts(node: Node, traffic: Traffic) -> Table:
    table = facts()
    table.add_row("node", printable(node.name))
    if node.process is not None:
        table.add_row("pid", str(node.pid))
        table.add_row("uptime", _uptime(node.process.uptime_s))
        table.add_row("command", printable(" ".join(node.process.arguments)))
    table.add_row("host", node.host)
    session = node.session
    for title, keys in (("writes", session.writes), ("reads", session.reads), ("serves", session.serves)):
        for key in sorted(keys):
            heard = traffic.keys.get(key)
            rate = "" if heard is None else f"  {heard.rate_hz:.1f} Hz"
            table.add_row(title, printable(f"{key}{rate}"))
    return table
