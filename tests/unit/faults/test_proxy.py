"""A link that can be cut, over real sockets in one event loop."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import pytest

from faults.real.rig.proxy import Link

LIMIT_S = 5.0
GRACE_S = 0.05
"""Observation time for events that must not happen."""


@dataclass
class Hub:
    """A server that keeps the received bytes and its connections."""

    heard: bytes = b""
    ended: int = 0
    writers: list[asyncio.StreamWriter] = field(default_factory=list[asyncio.StreamWriter])
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.append(writer)
        self.changed.set()
        while data := await reader.read(1 << 16):
            self.heard += data
            self.changed.set()
        self.ended += 1
        self.changed.set()
        writer.close()

    async def until_heard(self, data: bytes) -> None:
        async with asyncio.timeout(LIMIT_S):
            while self.heard != data:
                self.changed.clear()
                await self.changed.wait()

    async def until_ended(self, count: int) -> None:
        async with asyncio.timeout(LIMIT_S):
            while self.ended < count:
                self.changed.clear()
                await self.changed.wait()


@asynccontextmanager
async def _linked() -> AsyncGenerator[tuple[Hub, Link, int]]:
    hub = Hub()
    server = await asyncio.start_server(hub.serve, "127.0.0.1", 0)
    link = Link(("127.0.0.1", server.sockets[0].getsockname()[1]))
    try:
        yield hub, link, await link.listen("127.0.0.1")
    finally:
        await link.close()
        for writer in hub.writers:
            writer.close()
        server.close()


async def _within(work: Awaitable[bytes]) -> bytes:
    return await asyncio.wait_for(work, LIMIT_S)


async def _nothing_comes(reader: asyncio.StreamReader) -> None:
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(reader.read(1), GRACE_S)


async def test_an_open_link_carries_both_ways_and_hands_on_the_end() -> None:
    async with _linked() as (hub, _, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"up")
        await hub.until_heard(b"up")
        hub.writers[0].write(b"down")
        assert await _within(reader.readexactly(4)) == b"down"
        writer.close()
        await hub.until_ended(1)


async def test_what_was_said_during_a_cut_comes_at_once_when_it_heals() -> None:
    async with _linked() as (hub, link, port):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"0")
        await hub.until_heard(b"0")
        link.obey({"up": False, "down": False})
        for number in range(1, 6):
            writer.write(str(number).encode())
            await asyncio.sleep(0)
        await asyncio.sleep(GRACE_S)
        assert hub.heard == b"0"
        link.obey({"up": True, "down": True})
        await hub.until_heard(b"012345")
        writer.close()


async def test_even_the_end_of_a_connection_waits_for_the_link_to_heal() -> None:
    async with _linked() as (hub, link, port):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"0")
        await hub.until_heard(b"0")
        link.obey({"up": False})
        writer.close()
        await asyncio.sleep(GRACE_S)
        assert hub.ended == 0
        link.obey({"up": True})
        await hub.until_ended(1)


@pytest.mark.parametrize("shut", ["up", "down"])
async def test_one_direction_alone_can_be_cut(shut: str) -> None:
    async with _linked() as (hub, link, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"0")
        await hub.until_heard(b"0")
        link.obey({shut: False})
        writer.write(b"1")
        hub.writers[0].write(b"2")
        if shut == "up":
            assert await _within(reader.readexactly(1)) == b"2"
            assert hub.heard == b"0"
        else:
            await hub.until_heard(b"01")
            await _nothing_comes(reader)
        writer.close()


async def test_nobody_gets_through_to_the_hub_while_the_link_is_cut() -> None:
    async with _linked() as (hub, link, port):
        link.obey({"down": False})
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"hello")
        await asyncio.sleep(GRACE_S)
        assert not hub.writers
        link.obey({"down": True})
        await hub.until_heard(b"hello")
        writer.close()


async def test_delayed_messages_come_late_and_in_order() -> None:
    async with _linked() as (hub, link, port):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"0")
        await hub.until_heard(b"0")
        loop = asyncio.get_running_loop()
        link.obey({"delay_s": [0.1, 0.2]})
        began_s = loop.time()
        for number in range(1, 6):
            writer.write(str(number).encode())
            await asyncio.sleep(0.005)
        await hub.until_heard(b"012345")
        assert loop.time() - began_s >= 0.1
        writer.close()


async def test_a_client_waits_for_a_hub_that_is_not_there_yet() -> None:
    hub = Hub()
    server = await asyncio.start_server(hub.serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    server.close()
    await server.wait_closed()
    link = Link(("127.0.0.1", port))
    entrance = await link.listen("127.0.0.1")
    _, writer = await asyncio.open_connection("127.0.0.1", entrance)
    writer.write(b"early")
    await asyncio.sleep(GRACE_S)
    server = await asyncio.start_server(hub.serve, "127.0.0.1", port)
    await hub.until_heard(b"early")
    writer.close()
    await link.close()
    server.close()
