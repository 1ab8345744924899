"""How long a connection lasts: a few seconds and few bytes, unless its page is paired.

Anyone who reaches the server can connect. A stranger must not keep a new page away, and must not delay the lease of the page
that is open.
"""

import math
import socket
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass

VISIT_S = 5.0
"""Time for a page to load and to pair, and for a connection to end after its page."""
MAX_VISITORS = 32
"""A further one ends the oldest of the address with the most."""
MAX_BYTES = 16384
"""Of one visitor: all requests of a page have a fraction of it."""


@dataclass(eq=False, slots=True)
class Visitor:
    """One connection. Times are of one monotonic clock."""

    connection: socket.socket
    address: str
    ends_s: float
    bytes_left: int = MAX_BYTES

    def stay(self) -> None:
        """Let the connection last: its page is paired."""
        self.ends_s = math.inf

    def leave(self, now_s: float) -> None:
        """Let the connection end soon: its page has ended."""
        self.ends_s = now_s + VISIT_S

    def may_send(self, size: int) -> bool:
        """Count bytes that have arrived, and return whether the connection may go on."""
        if self.ends_s < math.inf:
            self.bytes_left -= size
        return self.bytes_left >= 0

    def end(self) -> None:
        """End the connection, whatever state its protocol is in; nothing waits for the peer."""
        with suppress(OSError):  # it has ended
            self.connection.shutdown(socket.SHUT_RDWR)


class Visitors:
    """All connections."""

    def __init__(self) -> None:
        self._all: list[Visitor] = []

    def enter(self, connection: socket.socket, address: str, now_s: float) -> Visitor:
        """Admit a connection, and end another one if there are too many."""
        self.expire(now_s)
        visitor = Visitor(connection, address, now_s + VISIT_S)
        self._all.append(visitor)
        strangers = [one for one in self._all if one.ends_s < math.inf]
        if len(strangers) > MAX_VISITORS:
            crowd = Counter(one.address for one in strangers).most_common(1)[0][0]
            oldest = next(one for one in strangers if one.address == crowd)
            oldest.end()
            self._all.remove(oldest)
        return visitor

    def expire(self, now_s: float) -> None:
        """End the connections whose time is over."""
        for visitor in self._all:
            if now_s >= visitor.ends_s:
                visitor.end()
        # A connection that has ended has no descriptor any more.
        self._all = [one for one in self._all if now_s < one.ends_s and one.connection.fileno() >= 0]
