"""A TCP link that can be cut, healed and slowed down, in a process of its own: `python -m faults.real.rig.proxy`.

    python -m faults.real.rig.proxy HUB_HOST HUB_PORT LISTEN_HOST NAME[:PORT]…

prints one line of JSON with the port of each named link, by default a free one, and then takes orders on stdin, one JSON object per line:

    {"link": "teleop", "up": false, "down": true, "delay_s": [0.05, 0.5]}

`up` is the direction to the hub. A closed direction passes nothing, not even the end of a
connection. Data waits here and then in the sender's buffers, and is delivered in one burst when the direction opens
again, as by TCP after a partition. With a delay, each chunk is delayed by a random time; their order is kept. Each
order is answered with an empty line.
"""

import asyncio
import json
import random
import signal
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from faults.real.rig.helper_process import serve
from wire.zenoh.local_socket import socket_of

CHUNK_BYTES = 1 << 16
HELD_CHUNKS = 64
"""Buffer of one direction: 4 MiB, about as much as two kernels hold for a long link."""
RETRY_S = 0.02


@dataclass(eq=False)
class Direction:
    """One direction of a link, for all its connections."""

    opened: asyncio.Event = field(default_factory=asyncio.Event)
    delay_s: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self.opened.set()


class Link:
    """A listening port whose connections are forwarded to the hub.

    Args:
        hub: host and port of the hub.
    """

    def __init__(self, hub: tuple[str, int]) -> None:
        self._hub = hub
        self.up, self.down = Direction(), Direction()
        self._server: asyncio.Server | None = None
        self._connections: set[asyncio.Task[None]] = set()

    async def listen(self, host: str, port: int = 0) -> int:
        """Listen, by default on a free port; return the port."""
        self._server = await asyncio.start_server(self._on_connection, host, port, limit=CHUNK_BYTES)
        return self._server.sockets[0].getsockname()[1]

    def obey(self, order: dict[str, Any]) -> None:
        """Apply an order; settings that it does not name remain."""
        for name, direction in (("up", self.up), ("down", self.down)):
            if name in order:
                (direction.opened.set if order[name] else direction.opened.clear)()
            direction.delay_s = order.get("delay_s", direction.delay_s)

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
        for task in self._connections:
            task.cancel()
        await asyncio.gather(*self._connections, return_exceptions=True)

    def _on_connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.ensure_future(self._serve(reader, writer))
        self._connections.add(task)
        task.add_done_callback(self._connections.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        sides = [writer]
        try:
            hub_reader, hub_writer = await self._connect()
            sides.append(hub_writer)
            await asyncio.gather(
                carry(reader, hub_writer, self.up),
                carry(hub_reader, writer, self.down),
            )
        finally:
            for side in sides:
                side.transport.abort()

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Connect to the hub as soon as both directions are open and it listens; a handshake needs both."""
        while True:
            await self.up.opened.wait()
            await self.down.opened.wait()
            try:
                path = socket_of("tcp/{}:{}".format(*self._hub))
                if path is not None and path.exists():  # over TCP, teleop and sim could only read
                    return await asyncio.open_unix_connection(path, limit=CHUNK_BYTES)
                return await asyncio.open_connection(*self._hub, limit=CHUNK_BYTES)
            except OSError:
                await asyncio.sleep(RETRY_S)


async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, direction: Direction) -> None:
    """Forward the bytes of one direction until their end."""
    loop = asyncio.get_running_loop()
    held: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(HELD_CHUNKS)

    async def read() -> None:
        data = b"-"
        while data:
            try:
                data = await reader.read(CHUNK_BYTES)
            except OSError:
                data = b""  # a reset also ends the connection
            await held.put((loop.time() + random.uniform(*direction.delay_s), data))  # noqa: S311 - no secret

    async def write() -> None:
        while True:
            due_s, data = await held.get()
            if (left_s := due_s - loop.time()) > 0.0:
                await asyncio.sleep(left_s)
            await direction.opened.wait()
            if not data:
                break
            writer.write(data)
            await writer.drain()
        if writer.can_write_eof():
            writer.write_eof()

    reading = asyncio.ensure_future(read())
    try:
        with suppress(OSError):  # the receiver is gone
            await write()
    finally:
        reading.cancel()


async def _main(hub: tuple[str, int], host: str, names: list[str]) -> None:
    ports = {name: int(port or 0) for name, _, port in (one.partition(":") for one in names)}
    links = {name: Link(hub) for name in ports}
    print(
        json.dumps({name: await links[name].listen(host, port) for name, port in ports.items()}), flush=True
    )

    async def obey(order: dict[str, Any]) -> str:
        links[order.pop("link")].obey(order)
        return ""

    try:
        await serve(obey)
    finally:
        for link in links.values():
            await link.close()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign handles Ctrl-C
    hub_host, hub_port, listen_host, *link_names = sys.argv[1:]
    asyncio.run(_main((hub_host, int(hub_port)), listen_host, link_names))
