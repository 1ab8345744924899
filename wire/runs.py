"""Which runs of the robot's nodes have ended though a token of theirs exists: the hub's view (pure).

A token can be held by any client that may hold it, and exists until its last holder is gone. A session cannot be copied:
the hub sees when its link ends. The epoch of a run of ours therefore begins with the first bytes of its session's id, and
the end of that session ends the run. An epoch that belongs to no session, such as that of a foreign client, ends with its
token only.
"""

from collections import defaultdict

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
