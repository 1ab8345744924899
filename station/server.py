"""The HTTP server of a station: uvicorn in the process's own event loop, on a socket that is open already."""

import asyncio
import socket
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from station.messages import MAX_MESSAGE_BYTES
from station.visitors import VISIT_S, Visitors
from station.web import Application
from wire.bundle import Bundle

END_LIMIT_S = 1
MAX_HEAD_BYTES = 8192
"""Of a request."""
ACCEPT_PERIOD_S = 0.01
"""The time between two connections: a flood of them must leave time for the lease of the page that is open."""


class _Limited(asyncio.Protocol):
    """The part of a protocol of uvicorn that ends a connection which has sent too much."""

    app_state: dict[str, Any]
    transport: asyncio.Transport

    def data_received(self, data: bytes) -> None:
        if self.app_state["visitor"].may_send(len(data)):
            super().data_received(data)
        else:
            self.transport.abort()


class _Http(_Limited, H11Protocol):
    pass


class _WebSocket(_Limited, WebSocketsSansIOProtocol):
    pass


class _Server(uvicorn.Server):
    """Accepts the connections itself, so that each is limited from its first byte, also before and during its TLS handshake."""

    def __init__(self, config: uvicorn.Config, listening: socket.socket, stop: asyncio.Event) -> None:
        super().__init__(config)
        self._listening, self._stop, self._visitors = listening, stop, Visitors()
        self._beginning: set[asyncio.Future[None]] = set()

    @contextmanager
    def capture_signals(self) -> Generator[None]:
        """Leave the signals to the process."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:  # noqa: ARG002 - it has its own
        self.servers = []
        self._accepting = asyncio.ensure_future(self._accept())
        self.started = True

    async def on_tick(self, counter: int) -> bool:
        self._visitors.expire(asyncio.get_running_loop().time())
        return await super().on_tick(counter) or self._stop.is_set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:  # noqa: ARG002
        self._accepting.cancel()
        for task in self._beginning:
            task.cancel()
        await super().shutdown([self._listening])

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        self._listening.settimeout(0)
        while True:
            with suppress(OSError):  # it has ended already, or there are no descriptors
                connection, address = await loop.sock_accept(self._listening)
                task = asyncio.ensure_future(self._begin(connection, address[0]))
                self._beginning.add(task)
                task.add_done_callback(self._beginning.discard)
            await asyncio.sleep(ACCEPT_PERIOD_S)

    async def _begin(self, connection: socket.socket, address: str) -> None:
        loop = asyncio.get_running_loop()
        visitor = self._visitors.enter(connection, address, loop.time())

        def protocol() -> asyncio.Protocol:
            return _Http(self.config, self.server_state, {"visitor": visitor})

        tls = self.config.ssl
        with suppress(OSError):  # the handshake failed, or the connection has ended
            await loop.connect_accepted_socket(
                protocol, connection, ssl=tls, ssl_handshake_timeout=VISIT_S if tls else None
            )


async def serve(
    application: Application, listening: socket.socket, bundle: Bundle | None, stop: asyncio.Event
) -> None:
    """Serve until `stop`, with the certificate of the bundle; without one, without TLS. It closes the socket."""
    config = uvicorn.Config(
        application,
        http=_Http,
        ws=_WebSocket,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False,
        ws_ping_interval=None,  # the messages of the lease show more: the page's own loop has sent them
        lifespan="off",
        log_config=None,
        log_level="critical",  # its other lines are about what strangers send
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=END_LIMIT_S,
        h11_max_incomplete_event_size=MAX_HEAD_BYTES,
        ssl_certfile=None if bundle is None else bundle.certificate,
        ssl_keyfile=None if bundle is None else bundle.key,
    )
    await _Server(config, listening, stop).serve()
