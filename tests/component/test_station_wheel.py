"""The wheel of a page: the real application of a station on the virtual clock."""

import asyncio
from functools import partial

from faults.page import Page
from faults.simulated.station import CODE, StationServer
from virtual.loop import VirtualLoop
from virtual.network import VirtualNetwork
from wire import topics

DRIVES_S = 3.0


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
