"""Which requests and messages are served: those of the page itself, and not too many (pure).

A browser names the server in `Host`, and the page that opens a websocket in `Origin`. Pages of other servers, also those
whose name was changed to point here (DNS rebinding), are therefore refused.
"""

from collections.abc import Iterable
from dataclasses import dataclass

Headers = Iterable[tuple[bytes, bytes]]
"""Names in small letters, and values, as ASGI has them."""

DEFAULT_PORTS = {"http": 80, "https": 443}
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
RESPONSE_HEADERS = {
    "cache-control": "no-store",
    "content-security-policy": CONTENT_SECURITY_POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}
"""Of every response."""

MESSAGES_PER_S = 60.0
"""A page sends about 20 a second: the answers to the challenges."""
BURST = 60.0
"""What a page may send at once, after the network has delayed it."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page is served."""

    scheme: str
    """`http` or `https`."""
    hosts: tuple[str, ...]
    """The names by which a browser may reach it, as in a URL; the first one is printed."""
    port: int

    def url(self, code: str) -> str:
        """Return the page's address with a pairing code in its fragment, which a browser does not send to the server."""
        return f"{self.scheme}://{self._places[0]}/#{code}"

    @property
    def _places(self) -> list[str]:
        port = "" if self.port == DEFAULT_PORTS[self.scheme] else f":{self.port}"
        return [f"{host}{port}" for host in self.hosts]

    def admits(self, headers: Headers, *, needs_origin: bool) -> bool:
        """Return whether a request is to this address, and from its own page if it has an origin.

        Args:
            headers: of the request.
            needs_origin: whether it must have an origin, as that of each websocket of a browser.
        """
        places = [place.encode().lower() for place in self._places]
        origins = [f"{self.scheme}://".encode() + place for place in places]
        named = [value.lower() for name, value in headers if name == b"host"]
        came_from = [value.lower() for name, value in headers if name == b"origin"]
        is_here = len(named) == 1 and named[0] in places
        is_own = len(came_from) == 1 and came_from[0] in origins
        return is_here and (is_own or (not came_from and not needs_origin))


class Rate:
    """Counts the messages of one page.

    Args:
        now_s: the present time.
    """

    def __init__(self, now_s: float) -> None:
        self._left, self._counted_s = BURST, now_s

    def allows(self, now_s: float) -> bool:
        """Count a message, and return whether the page may send it."""
        self._left = min(BURST, self._left + (now_s - self._counted_s) * MESSAGES_PER_S)
        self._counted_s = now_s
        self._left -= 1.0
        return self._left >= 0.0
