"""The HTTP server of a station: uvicorn in the process's own event loop, on a socket that is open already."""

import asyncio
import socket
from collections.abc import Generator
from contextlib import contextmanager

import uvicorn

from station.messages import MAX_MESSAGE_BYTES
from station.web import Application
from wire.bundle import Bundle

MAX_CONNECTIONS = 32
END_LIMIT_S = 1
MAX_HEAD_BYTES = 8192
"""Of a request."""


class _Server(uvicorn.Server):
    @contextmanager
    def capture_signals(self) -> Generator[None]:
        """Leave the signals to the process."""
        yield


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Args:
        host: an address of this machine, or a name of one.
        port: 0 for any free port.

    Raises:
        OSError: it cannot listen there.
    """
    family, kind, number, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    listening = socket.socket(family, kind, number)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(MAX_CONNECTIONS)
    except OSError:
        listening.close()
        raise
    return listening


async def serve(
    application: Application, listening: socket.socket, bundle: Bundle | None, stop: asyncio.Event
) -> None:
    """Serve until `stop`.

    Args:
        application: what is served.
        listening: closed at the end.
        bundle: the certificate and the key for TLS; None: without TLS.
        stop: ends the server.
    """
    config = uvicorn.Config(
        application,
        http="h11",
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False,
        ws_ping_interval=None,  # the messages of the lease show more: the page's own loop has sent them
        lifespan="off",
        log_config=None,
        log_level="critical",  # its other lines are about what strangers send
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=END_LIMIT_S,
        h11_max_incomplete_event_size=MAX_HEAD_BYTES,
        ssl_certfile=None if bundle is None else bundle.certificate,
        ssl_keyfile=None if bundle is None else bundle.key,
    )
    server = _Server(config)
    serving = asyncio.ensure_future(server.serve(sockets=[listening]))
    stopping = asyncio.ensure_future(stop.wait())
    await asyncio.wait({serving, stopping}, return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    server.should_exit = True
    await serving
