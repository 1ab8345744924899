"""The sessions in the hub's report of itself, in Zenoh's admin space (`@/HUB/peer`) (pure)."""

import json
from contextlib import suppress
from typing import Any


def sessions_in(payload: bytes) -> frozenset[bytes] | None:
    """Return the ids of the hub's clients, 16 bytes each; None if the report is unreadable, or names a router.

    A router has clients of its own, which the hub does not know.
    """
    with suppress(ValueError, RecursionError, TypeError, KeyError, AttributeError):
        sessions: list[dict[str, Any]] = json.loads(payload)["sessions"]
        if all(session["whatami"] == "client" for session in sessions):
            return frozenset(bytes.fromhex(session["peer"].zfill(32)) for session in sessions)
    return None
