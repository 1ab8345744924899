"""The sessions at the hub, and what each declares, from the hub's report in Zenoh's admin space. Pure.

The hub answers queries on `@/**` with one entry for each declared key and kind, with the ids of the sessions that declare it,
and one entry for the hub itself with the addresses of its links:

    @/HUB/peer                              {"sessions": [{"peer": ID, "links": [{"src": …, "dst": …}]}]}
    @/HUB/peer/publisher/robot/scan         {"routers": [], "peers": [], "clients": [ID]}
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

KINDS = ("publisher", "subscriber", "queryable", "token")
UNREADABLE = (ValueError, RecursionError, TypeError, KeyError, AttributeError, IndexError)
"""The exceptions that a report of an unexpected form raises."""


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
    hub_id, prefix, address = hub
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


def _hub(report: Mapping[str, bytes]) -> tuple[str, str, dict[str, str]] | None:
    """Return the hub's id, the prefix of its entries, and by session the address of the client's end of the link."""
    for entry, payload in report.items():
        parts = entry.split("/")
        if len(parts) == 3:
            with suppress(*UNREADABLE):
                document: Any = json.loads(payload)
                linked = [session for session in document["sessions"] if session["links"]]
                addresses = {
                    str(one["peer"]): str(one["links"][0]["dst"]).partition("/")[2] for one in linked
                }
                if document["locators"]:
                    return parts[1], entry, addresses
    return None


def _declarers(payload: bytes, hub_id: str) -> list[str]:
    """Return the sessions that declare an entry's key.

    The hub names itself among the peers whenever it forwards a client's declaration, and among the clients where it
    declares the key itself.
    """
    with suppress(*UNREADABLE):
        document: Any = json.loads(payload)
        others = [one for one in (*document["routers"], *document["peers"]) if one != hub_id]
        return [str(one) for one in (*others, *document["clients"])]
    return []
