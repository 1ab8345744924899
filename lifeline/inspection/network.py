"""Which session declares what, from the hub's report in Zenoh's admin space. Pure.

The hub answers queries on `@/**`. Its report has one entry for each declared key and kind, with the ids of the sessions
that declare it, and one entry for the hub itself with the addresses of its links:

    @/HUB/peer                              {"sessions": [{"peer": ID, "links": [{"src": …, "dst": …}]}]}
    @/HUB/peer/publisher/robot/scan         {"routers": [], "peers": [], "clients": [ID]}

A program that writes without declaring a publisher does not appear here; its samples do (traffic.py).
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

KINDS = ("publisher", "subscriber", "queryable", "token")


@dataclass(frozen=True, slots=True)
class Session:
    """A connection to the hub, or the hub's own session. All keys are full keys."""

    session_id: str
    address: str
    """Its end of the link, such as `127.0.0.1:37276`; empty for the hub, and a random name without a port at its socket."""
    writes: frozenset[str] = frozenset()
    reads: frozenset[str] = frozenset()
    serves: frozenset[str] = frozenset()
    tokens: frozenset[str] = frozenset()

    @property
    def is_at_socket(self) -> bool:
        """Whether it uses the hub's socket (wire/zenoh/local_socket.py), so that its process is one of this machine."""
        return bool(self.address) and ":" not in self.address


@dataclass(frozen=True, slots=True)
class Network:
    """All sessions, the hub's first."""

    hub: str
    """The session id of the hub; empty if it gave no report."""
    sessions: tuple[Session, ...]


def network_of(report: Mapping[str, bytes]) -> Network:
    """Return the network in a hub's report; entries that cannot be read are ignored."""
    hub = _hub(report)
    if hub is None:
        return Network("", ())
    hub_id, prefix, document = hub
    address = dict(_addresses(document))
    declared: dict[str, dict[str, set[str]]] = {kind: {} for kind in KINDS}
    for entry, payload in report.items():
        kind, _, key = entry.removeprefix(f"{prefix}/").partition("/")
        if entry.startswith(prefix) and kind in KINDS:
            for session_id in _declarers(payload, hub_id):
                declared[kind].setdefault(session_id, set()).add(key)
    ids = {hub_id, *address, *(one for sessions in declared.values() for one in sessions)}
    sessions = (
        Session(one, address.get(one, ""), *(frozenset(declared[kind].get(one, ())) for kind in KINDS))
        for one in sorted(ids, key=lambda one: (one != hub_id, one))
    )
    return Network(hub_id, tuple(sessions))


def _hub(report: Mapping[str, bytes]) -> tuple[str, str, dict[str, Any]] | None:
    """Return the hub's id, the prefix of its entries, and its own entry."""
    for entry, payload in report.items():
        parts = entry.split("/")
        document = _object(payload) if len(parts) == 3 else {}
        if "sessions" in document and document.get("locators"):
            return parts[1], entry, document
    return None


def _addresses(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield each connected session's id and the address of its end of the link."""
    for session in _list(document.get("sessions")):
        links = _list(_dict(session).get("links"))
        locators = [str(_dict(link).get("dst", "")) for link in links]
        if locators:
            yield str(_dict(session).get("peer", "")), locators[0].partition("/")[2]


def _declarers(payload: bytes, hub_id: str) -> Iterator[str]:
    """Yield the sessions that declare an entry's key.

    The hub names itself among the peers whenever it forwards a client's declaration, and among the clients where it
    declares the key itself.
    """
    document = _object(payload)
    for group in ("routers", "peers", "clients"):
        for session_id in _list(document.get(group)):
            if group == "clients" or session_id != hub_id:
                yield str(session_id)


def _object(payload: bytes) -> dict[str, Any]:
    try:
        return _dict(json.loads(payload))
    except (ValueError, RecursionError):
        return {}


def _dict(value: object) -> dict[str, Any]:
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _list(value: object) -> list[Any]:
    return cast("list[Any]", value) if isinstance(value, list) else []
