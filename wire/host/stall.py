"""Whether requests may have waited while this process was stopped or starved (pure).

A person whose request is not answered in time is informed that it has failed. If the process then goes on and carries the
request out, an e-stop ends, or a planner is armed, although nobody asks for it any more.
"""

from dataclasses import dataclass

STALL_S = 0.2
"""A shorter pause makes no request fail: callers wait for 1 s, or until their link counts as lost, after 0.4 s of silence."""
BACKLOG_S = 1.0
"""After a stall, requests that waited in the network arrive within this time."""


@dataclass(slots=True)
class StallMeter:
    """Follows the turns of an event loop.

    Args:
        turned_s: time of the last turn [s].
    """

    turned_s: float
    _until_s: float = 0.0

    def turn(self, now_s: float) -> None:
        """Note a turn of the loop, which must come more often than every `STALL_S`."""
        if now_s - self.turned_s > STALL_S:
            self._until_s = now_s + BACKLOG_S
        self.turned_s = now_s

    def may_be_old(self, now_s: float) -> bool:
        """Return whether a request that is read now may be one that waited."""
        return now_s < self._until_s or now_s - self.turned_s > STALL_S
