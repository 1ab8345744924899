"""The wheel of a page: the real application of a station on the virtual clock."""

import asyncio
import json
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from functools import partial

import pytest

from faults.page import Page
from faults.simulated.station import CODE, End, StationServer
from virtual.loop import VirtualLoop
from virtual.network import VirtualNetwork
from wire import topics

DRIVES_S = 3.0
ZERO = json.dumps({"linear": 0, "angular": 0, "time_s": 1, "picture": 0})


def test_the_time_that_the_claim_of_the_wheel_takes_does_not_shift_the_time_of_its_commands() -> None:
    """Commands from the future had no age: an observer took them for as new as their arrival."""

    async def drive() -> list[float]:
        network = VirtualNetwork()
        hub = network.open_hub("supervisor")
        commands = hub.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=1000)
        bus = network.open_client("station")
        await bus.connect()
        server = StationServer(bus, network)
        page = Page(partial(server.opened, network.open_client("page")), CODE)
        tasks = [asyncio.ensure_future(one) for one in (server.run(asyncio.Event()), page.run())]
        await asyncio.sleep(DRIVES_S)
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
        return [
            one.arrival_s - one.stamp.source_time_ns * 1e-9
            for one in commands.take()
            if one.stamp is not None
        ]

    loop = VirtualLoop()
    ages_s = loop.run_until_complete(drive())
    loop.close()
    assert len(ages_s) > 50
    assert min(ages_s) > 0.0


async def beat(end: End, text: str) -> None:
    while True:
        await end.send(text)
        await asyncio.sleep(0.1)


@asynccontextmanager
async def lease(
    server: StationServer, network: VirtualNetwork, *, stop: bool, **hello: str
) -> AsyncGenerator[tuple[End, str]]:
    """Connect a page that is pressed or not; yield its connection and its token."""
    async with server.opened(network.open_client("page"), "lease") as own:
        await own.send(json.dumps(hello))
        token = json.loads(await own.recv())["token"]
        beating = asyncio.ensure_future(
            beat(own, json.dumps({"challenge": "1", "response": "0", "stop": stop}))
        )
        try:
            yield own, token
        finally:
            beating.cancel()


@asynccontextmanager
async def driving(server: StationServer, network: VirtualNetwork, **hello: str) -> AsyncGenerator[None]:
    """Connect a page that drives, and requests zero."""
    async with server.opened(network.open_client("page"), "drive") as own:
        await own.send(json.dumps(hello))
        beating = asyncio.ensure_future(beat(own, ZERO))
        try:
            yield
        finally:
            beating.cancel()


@asynccontextmanager
async def station() -> AsyncGenerator[tuple[VirtualNetwork, StationServer]]:
    network = VirtualNetwork()
    network.open_hub("supervisor")
    bus = network.open_client("station")
    await bus.connect()
    server = StationServer(bus, network)
    running = asyncio.ensure_future(server.run(asyncio.Event()))
    try:
        yield network, server
    finally:
        running.cancel()


async def test_a_person_drives_under_the_name_that_the_page_shows_when_drive_is_pressed() -> None:
    """The name on the connection of the lease may be an older one, or may still be on its way."""
    async with station() as (network, server), lease(server, network, stop=False, code=CODE) as (own, token):
        await own.send(json.dumps({"name": "Anna"}))
        async with driving(server, network, token=token, name="Ben"):
            driver = ""
            while driver == "":
                driver = json.loads(await own.recv()).get("driver", "")
            assert driver == "Ben"


async def test_a_page_that_stays_pressed_and_connects_again_has_not_been_pressed_again() -> None:
    async with station() as (network, server):
        async with lease(server, network, stop=True, code=CODE) as (own, token):
            await own.send(json.dumps({"name": "Anna"}))
            async with driving(server, network, token=token, name="Anna"):
                await asyncio.sleep(1.0)
        await asyncio.sleep(1.0)
        async with lease(server, network, stop=True, token=token):
            await asyncio.sleep(1.0)
            hub = network.hub
            assert hub is not None
            report = (await hub.call(topics.source_holder("teleop"))).message
    newest, *_, oldest = report.split("; ")[1:]
    assert newest.endswith("Anna ended driving")
    assert oldest.endswith("pressed the e-stop")


async def test_two_persons_with_one_name_do_not_drive_and_ask_at_the_same_time() -> None:
    async with (
        station() as (network, server),
        lease(server, network, stop=False, code=CODE) as (_, first),
        driving(server, network, token=first, name="Ben"),
        lease(server, network, stop=False, code=CODE) as (_, second),
    ):
        await asyncio.sleep(0.5)
        async with server.opened(network.open_client("page"), "drive") as own:
            await own.send(json.dumps({"token": second, "name": "ben"}))
            await own.send(ZERO)
            with pytest.raises(ConnectionError):
                await own.recv()  # neither a turn nor a place in the queue
