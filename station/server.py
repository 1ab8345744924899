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


async def serve(
    application: Application, listening: socket.socket, bundle: Bundle | None, stop: asyncio.Event
) -> None:
    """Serve until `stop`, with the certificate of the bundle; without one, without TLS. It closes the socket."""
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

    async def end() -> None:
        await stop.wait()
        server.should_exit = True

    ending = asyncio.ensure_future(end())
    await server.serve(sockets=[listening])
    ending.cancel()
