"""Which samples count after a client has reconnected to the same hub (pure).

If a hub is stopped for longer than the lease, its clients reconnect while the hub still has their old links. Zenoh may
then put the new link into the old transport, which it is about to close. Until it is closed, the hub sends with the key
numbers of the old link, and the client reads them with those of the new one: samples arrive under other keys
(docs/decisions/0051).
"""

import math


class Reconnection:
    """Follows the connections of one session to its hub.

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
