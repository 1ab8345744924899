"""The nodes of the system: the sessions at the hub, with their names and processes. Pure.

A program that writes without declaring a publisher does not appear here; its samples do (traffic.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import PurePath

from lifeline.inspection.keys import matches
from lifeline.inspection.sockets import Process
from wire import topics
from wire.zenoh.local_socket import pid_in
from wire.zenoh.network import Network, Session


@dataclass(frozen=True, slots=True)
class Node:
    """A session at the hub. All keys are full keys."""

    name: str
    """The name in its liveliness token; without one, its program, else its session id."""
    is_named: bool
    """Whether the name is from a token."""
    session: Session
    process: Process | None
    """None if it runs on another machine or as another user, or is a foreign program at the hub's socket."""
    host: str
    """The address of its machine; `local` if its process was found."""

    def reads(self, key: str) -> bool:
        """Return whether it subscribes to a key, directly or by an expression with wildcards."""
        return any(matches(expression, key) for expression in self.session.reads)

    @property
    def pid(self) -> int | None:
        return None if self.process is None else self.process.pid


def addresses(network: Network, endpoint: str) -> set[str]:
    """Return the addresses whose processes are wanted: of each client, and of the hub."""
    return {one.address or _listening(endpoint) for one in network.sessions}


def claimed_pids(network: Network) -> dict[str, int]:
    """Return the pid in the id of each session at the hub's socket, by its address; those of foreign programs are random."""
    return {one.address: pid_in(one.session_id) for one in network.sessions if one.is_at_socket}


def nodes_of(
    network: Network,
    processes: Mapping[str, Process],
    namespace: str,
    endpoint: str,
    own_id: str = "",
) -> list[Node]:
    """Return the nodes, the hub first, then by name; without the session `own_id`."""
    nodes = [
        _node(one, processes.get(one.address or _listening(endpoint)), namespace, endpoint)
        for one in network.sessions
        if one.session_id != own_id
    ]
    return sorted(nodes, key=lambda node: (bool(node.session.address), not node.is_named, node.name))


def find(nodes: list[Node], wanted: str) -> list[Node]:
    """Return the nodes with this name, pid, or beginning of a session id; a leading slash is ignored."""
    name = wanted.strip("/")
    return [
        node
        for node in nodes
        if name in (node.name, str(node.pid)) or (len(name) >= 4 and node.session.session_id.startswith(name))
    ]


def describe(node: Node) -> str:
    """Return a node with its process: `sim, pid 812` or `client 92e37599 at 10.0.0.7:40112`."""
    if node.process is not None:
        return f"{node.name}, pid {node.pid}"
    if node.session.is_at_socket:
        return f"{node.name} at the supervisor's socket, a program of the same user"
    return f"{node.name} at {node.session.address or node.host}, on another machine or of another user"


def program(arguments: tuple[str, ...]) -> str:
    """Return the short name of a program: `sim` for `python -m sim --seed 1`, `lifeline topic echo` for our command."""
    names = [PurePath(one).name for one in arguments]
    first = 0
    if "-m" in names[:-1]:
        first = names.index("-m") + 1
    elif names and names[0].startswith("python"):
        first = next((n for n, one in enumerate(arguments) if n and not one.startswith("-")), 0)
    name, *rest = names[first:] or [""]
    if name in {"lifeline", "lifeline.cli.app"}:
        return " ".join(["lifeline", *takewhile(str.isalpha, rest[:2])])
    return name


def _node(session: Session, process: Process | None, namespace: str, endpoint: str) -> Node:
    prefix = f"{namespace}/{topics.alive('')}"
    # A token with a slash is that of one run; a token with a dot belongs to a candidate for a source's name (teleop/holder.py).
    names = sorted(
        token.removeprefix(prefix)
        for token in session.tokens
        if token.startswith(prefix) and "." not in token and "/" not in token.removeprefix(prefix)
    )
    fallback = program(process.arguments) if process is not None else ""
    is_here = process is not None or session.is_at_socket
    host = "local" if is_here else (session.address or _listening(endpoint)).rpartition(":")[0]
    return Node("+".join(names) or fallback or session.session_id[:8], bool(names), session, process, host)


def _listening(endpoint: str) -> str:
    return endpoint.partition("/")[2]
