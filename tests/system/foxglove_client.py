"""An independent client of Foxglove's WebSocket protocol, subprotocol foxglove.sdk.v1."""

import asyncio
import json
import struct
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA, CLIENT_MESSAGE, SERVICE_CALL = 1, 1, 2


@dataclass
class FoxgloveClient:
    """A connected client."""

    connection: ClientConnection
    server_info: dict[str, Any] = field(default_factory=dict[str, Any])
    channels: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    """The advertised channels by topic."""
    answers: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    """All other JSON messages of the server."""
    topics: dict[int, str] = field(default_factory=dict[int, str])
    """By number of the subscription."""

    async def send(self, operation: str, **fields: object) -> None:
        await self.connection.send(json.dumps({"op": operation, **fields}))

    async def subscribe(self, *topics: str) -> None:
        wanted: list[dict[str, int]] = []
        for topic in topics:
            number = 100 + len(self.topics)
            self.topics[number] = topic
            wanted.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self.send("subscribe", subscriptions=wanted)

    async def receive(self) -> tuple[str, int, bytes] | None:
        """Return the topic, log time [ns] and payload of the next message; None after a JSON message."""
        received = await self.connection.recv()
        if isinstance(received, str):
            message = json.loads(received)
            if message["op"] == "serverInfo":
                self.server_info = message
            elif message["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in message["channels"]}
            else:
                self.answers.append(message)
            return None
        kind, number, time_ns = struct.unpack_from("<BIQ", received)
        assert kind == MESSAGE_DATA
        return self.topics[number], time_ns, received[13:]

    async def until_advertised(self, *topics: str) -> None:
        while not self.server_info or not set(topics) <= set(self.channels):
            await self.receive()

    async def next_of(self, topic: str) -> tuple[int, bytes]:
        """Return the log time [ns] and the payload of the next message of a topic."""
        while True:
            received = await self.receive()
            if received is not None and received[0] == topic:
                return received[1:]

    async def answer_to(self, request: str | bytes) -> dict[str, Any]:
        """Send a request and return the server's next JSON message."""
        known = len(self.answers)
        await self.connection.send(request)
        while len(self.answers) == known:
            await self.receive()
        return self.answers[-1]

    async def heard_for(self, seconds: float) -> dict[str, list[tuple[int, bytes]]]:
        """Return the messages of a period by topic."""
        heard: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in self.topics.values()}
        loop = asyncio.get_running_loop()
        end_s = loop.time() + seconds
        while loop.time() < end_s:
            try:
                received = await asyncio.wait_for(self.receive(), max(0.0, end_s - loop.time()))
            except TimeoutError:
                break
            if received is not None:
                heard[received[0]].append(received[1:])
        return heard


@asynccontextmanager
async def foxglove_client(address: str, **options: Any) -> AsyncGenerator[FoxgloveClient]:  # noqa: ANN401 - of `connect`
    """A client; `options` are those of `websockets.asyncio.client.connect`."""
    async with connect(address, subprotocols=[SUBPROTOCOL], **options) as connection:  # pyright: ignore[reportArgumentType]
        assert connection.subprotocol == SUBPROTOCOL
        yield FoxgloveClient(connection)
