"""Which requests are served: those to this server that come from its own page (pure).

A browser names the server in `Host`, and the page that opens a websocket in `Origin`. Pages of other servers, also those
whose name was changed to point here (DNS rebinding), are therefore refused.
"""

from collections.abc import Iterable
from dataclasses import dataclass

RESPONSE_HEADERS = {
    "cache-control": "no-store",
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}
"""Of every response."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page is served."""

    scheme: str
    """`http` or `https`."""
    hosts: tuple[str, ...]
    """The names by which a browser may reach it, as in a URL; the first one is printed."""
    port: int
    """Not the default port of the scheme, which browsers leave out."""

    def url(self, code: str) -> str:
        """Return the page's address with a pairing code in its fragment, which a browser does not send to the server."""
        return f"{self.scheme}://{self.hosts[0]}:{self.port}/#{code}"

    def admits(self, headers: Iterable[tuple[bytes, bytes]], *, needs_origin: bool) -> bool:
        """Return whether a request is to this address, and from its own page if it has an origin.

        Args:
            headers: names in small letters, and values, as ASGI has them.
            needs_origin: whether it must have an origin, as that of each websocket of a browser.
        """
        places = [f"{host}:{self.port}".encode().lower() for host in self.hosts]
        named = [value.lower() for name, value in headers if name == b"host"]
        origins = [value.lower() for name, value in headers if name == b"origin"]
        is_own = len(origins) == 1 and origins[0] in [
            b"%s://%s" % (self.scheme.encode(), one) for one in places
        ]
        return len(named) == 1 and named[0] in places and (is_own or not (origins or needs_origin))
