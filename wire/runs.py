"""What the sessions and their links say about runs and samples: which runs have ended, which samples count (pure).

A token can be held by any client that may hold it, and exists until its last holder is gone. A session cannot be copied:
the hub sees when its link ends. The epoch of a run of ours therefore begins with the first bytes of its session's id, and
the end of that session ends the run. An epoch that belongs to no session, such as that of a foreign client, ends with its
token only.
"""

import json
import math
from collections import defaultdict
from contextlib import suppress
from typing import Any

SESSION_BYTES = 8
"""How much of a session's id an epoch contains; the rest is new for each run."""

Run = tuple[str, bytes]
"""The node and the epoch."""


class Runs:
    """The runs whose tokens exist, by the session that they belong to."""

    def __init__(self) -> None:
        self._runs: defaultdict[bytes, set[Run]] = defaultdict(set)

    def token(self, node: str, epoch: bytes, *, exists: bool) -> None:
        """Note a change of the token of a run."""
        mark = epoch[:SESSION_BYTES]
        if exists:
            self._runs[mark].add((node, epoch))
        else:
            self._runs[mark].discard((node, epoch))
            if not self._runs[mark]:
                del self._runs[mark]

    def of(self, session: bytes) -> list[Run]:
        """Return the runs of a session, which end and return with it.

        Args:
            session: its id, 16 bytes.
        """
        return sorted(self._runs.get(session[:SESSION_BYTES], ()))


def sessions_in(payload: bytes) -> frozenset[bytes] | None:
    """Return the ids of the hub's clients, 16 bytes each; None if the report is unreadable, or names a router.

    The report is that of the hub about itself, in Zenoh's admin space (`@/HUB/peer`).
    A router has clients of its own, which the hub does not know.
    """
    with suppress(ValueError, RecursionError, TypeError, KeyError, AttributeError):
        sessions: list[dict[str, Any]] = json.loads(payload)["sessions"]
        if all(session["whatami"] == "client" for session in sessions):
            return frozenset(bytes.fromhex(session["peer"].zfill(32)) for session in sessions)
    return None


class Reconnection:
    """Follows the connections of one session to its hub, and decides which samples count after a reconnection.

    If a hub is stopped for longer than the lease, its clients reconnect while the hub still has their old links. Zenoh
    may then put the new link into the old transport, which it is about to close. Until it is closed, the hub sends with
    the key numbers of the old link, and the client reads them with those of the new one: samples arrive under other keys
    (docs/decisions/0051).

    Args:
        settle_s: how long samples are refused after a reconnection to the same hub [s], positive.
    """

    def __init__(self, settle_s: float) -> None:
        self._settle_s = settle_s
        self._hub: str | None = None
        self._settled_s = -math.inf

    def opened(self, hub: str, now_s: float) -> None:
        """Note a new connection to the hub with this id; a restarted hub has another id and no old links."""
        if hub == self._hub:
            self._settled_s = now_s + self._settle_s
        self._hub = hub

    def is_settled(self, now_s: float) -> bool:
        """Return whether a sample that arrives now came under its own key."""
        return now_s >= self._settled_s
