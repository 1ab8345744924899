"""`lifeline topic list`, `info` and `type`: the topics of a running robot, with their writers and readers."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.launch import Launch
from lifeline.inspection.listening import Robot, inspect
from lifeline.inspection.nodes import Node, describe
from lifeline.inspection.traffic import KeyTraffic, Traffic
from wire.messages import definition
from wire.text import printable
from wire.topics import ANYONE, Topic


@dataclass(frozen=True, slots=True)
class Entry:
    """A topic of the list."""

    key: str
    type: str
    """Empty if it is not known."""
    permitted: str
    """The permitted writer; empty for foreign keys."""
    writers: tuple[str, ...]
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


def entries(robot: Robot, nodes: Sequence[Node], traffic: Traffic) -> list[Entry]:
    """Return all known topics, then all other keys that are declared or were heard."""
    declared = {key for node in nodes for key in node.session.writes if "*" not in key}
    others = sorted((declared | set(traffic.keys)) - set(robot.known))
    return [_entry(key, robot.topic(key), nodes, traffic.keys.get(key)) for key in (*robot.known, *others)]


def _entry(key: str, topic: Topic[Any] | None, nodes: Sequence[Node], heard: KeyTraffic | None) -> Entry:
    return Entry(
        key,
        "" if topic is None else topic.type.__msgtype__,
        "" if topic is None else topic.writer,
        writers_of(key, nodes, heard),
        math.nan if heard is None else heard.rate_hz,
        None if topic is None else topic.rate_hz,
    )


def writers_of(key: str, nodes: Iterable[Node], heard: KeyTraffic | None) -> tuple[str, ...]:
    """Return the names of a key's writers; those that were heard but declare nothing are counted."""
    names = [node.name for node in nodes if key in node.session.writes]
    hidden = (0 if heard is None else heard.concurrent()) - len(names)
    return (*names, *(["undeclared"] * hidden))


def show_list(launch: Launch, seconds: float, *, as_json: bool) -> NoReturn:
    """Print all topics with their types, writers and rates."""

    async def body(robot: Robot) -> int:
        traffic, nodes = await robot.traffic(seconds), await robot.nodes()
        found = entries(robot, nodes, traffic)
        if as_json:
            print(json.dumps([entry.to_json() for entry in found], indent=2))
        else:
            Console().print(_list_table(found))
        return 0

    inspect(launch, body)


def _list_table(found: Iterable[Entry]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("topic", "type", "may write", "writes"):
        table.add_column(name, overflow="fold")
    table.add_column("Hz", justify="right")
    for entry in found:
        table.add_row(
            Text(printable(entry.key)),
            entry.type.rpartition("/")[2] or Text("unknown", style="dim"),
            entry.permitted or Text("foreign", style="dim"),
            Text(printable(", ".join(entry.writers)), style="bold red" if _problem(entry) else ""),
            "" if math.isnan(entry.rate_hz) else f"{entry.rate_hz:.1f}",
        )
    return table


def show_info(launch: Launch, name: str, seconds: float, *, as_json: bool) -> NoReturn:
    """Print the type, writers and readers of a topic. Exit 1 if more than the permitted writer writes it."""

    async def body(robot: Robot) -> int:
        key = robot.key(name)
        traffic, nodes = await robot.traffic(seconds, key), await robot.nodes()
        heard, topic = traffic.keys.get(key), robot.topic(key)
        entry = _entry(key, topic, nodes, heard)
        writing = [node for node in nodes if key in node.session.writes]
        reading = [node for node in nodes if node.reads(key)]
        if topic is None and heard is None and not writing and not reading:
            raise DeployError(f"no program declares or writes {key}: see `lifeline topic list`")
        problem = _problem(entry)
        if as_json:
            document = entry.to_json() | {
                "writers": [_node_json(node) for node in writing],
                "undeclared_writers": entry.writers.count("undeclared"),
                "readers": [_node_json(node) for node in reading],
                "problem": problem or None,
            }
            print(json.dumps(document, indent=2))
        else:
            _print_info(entry, writing, reading, heard, problem)
        return 1 if problem else 0

    inspect(launch, body)


def _problem(entry: Entry) -> str:
    if not entry.permitted or entry.permitted == ANYONE or len(entry.writers) < 2:
        return ""
    return (
        f"{len(entry.writers)} programs write {entry.key}, but only one may: stop all but {entry.permitted}"
    )


def _print_info(
    entry: Entry, writing: Sequence[Node], reading: Sequence[Node], heard: KeyTraffic | None, problem: str
) -> None:
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    table.add_row("topic", Text(entry.key))
    table.add_row("type", entry.type or "unknown")
    table.add_row("permitted writer", entry.permitted or "not a topic of this robot")
    rate = "nothing heard" if heard is None else f"{heard.rate_hz:.1f} Hz"
    expected = "" if entry.expected_hz is None else f", expected {entry.expected_hz:g} Hz"
    table.add_row("rate", f"{rate}{expected}")
    for title, nodes in (("writer", writing), ("reader", reading)):
        for node in nodes:
            table.add_row(title, Text(printable(describe(node))))
    for _ in range(entry.writers.count("undeclared")):
        table.add_row("writer", "a program that declares no publisher (undeclared)")
    if not entry.writers:
        table.add_row("writer", "none")
    if problem:
        table.add_row("problem", Text(problem, style="bold red"))
    Console().print(table)


def _node_json(node: Node) -> dict[str, Any]:
    return {"node": node.name, "pid": node.pid, "host": node.host, "session": node.session.session_id}


def show_type(launch: Launch, name: str, *, full: bool, as_json: bool = False) -> NoReturn:
    """Print the type of a topic, with --full also its definition."""

    async def body(robot: Robot) -> int:
        key = robot.key(name)
        topic = robot.topic(key)
        if topic is None:
            raise DeployError(f"the type of {key} is unknown: it is not a topic of this robot")
        type_name = topic.type.__msgtype__
        text = definition(type_name).text if full else None
        if as_json:
            print(json.dumps({"key": key, "type": type_name, "definition": text}, indent=2))
        else:
            print("\n".join((type_name, text) if text is not None else (type_name,)))
        return 0

    inspect(launch, body)
