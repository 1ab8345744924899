"""Connects a client to the hub, for commands that run until Ctrl-C."""

import asyncio
from collections.abc import Awaitable, Callable

from deploy.stack import elsewhere
from deploy.stack.errors import DeployError
from deploy.stack.formatting import CHECK_NETWORK
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

CONNECT_LIMIT_S = 2.0
CLOSE_LIMIT_S = 0.1


class NotRunningError(DeployError):
    """No supervisor answers at the endpoint."""


async def reach(config: BusConfig, stop: asyncio.Event) -> ZenohBus | None:
    """Open the bus; return None if `stop` is set first.

    Raises:
        NotRunningError: no supervisor answers within 2 s.
        BusError: the endpoint is invalid.
    """
    opening = asyncio.ensure_future(open_bus(config, "client"))
    stopping = asyncio.ensure_future(stop.wait())
    try:
        await asyncio.wait({opening, stopping}, timeout=CONNECT_LIMIT_S, return_when=asyncio.FIRST_COMPLETED)
        if opening.done():
            return opening.result()
        if stop.is_set():
            return None
        silence = elsewhere.silence(config.endpoint)
        raise NotRunningError(
            f"no supervisor answers at {config.endpoint}: start the robot with `lifeline up`"
            if silence is None
            else f"{silence}: {CHECK_NETWORK}"
        )
    finally:
        opening.cancel()
        stopping.cancel()


async def run_connected(
    config: BusConfig, stop: asyncio.Event, work: Callable[[ZenohBus], Awaitable[None]]
) -> None:
    """Connect as soon as a supervisor answers, and run `work`, until `stop`; Zenoh itself connects again after that.

    Args:
        config: the endpoint and the namespace.
        stop: `work` must end soon after it is set, and is abandoned otherwise.
        work: the session closes when it returns.

    Raises:
        BusError: the endpoint is invalid.
    """

    async def run() -> None:
        bus = await open_bus(config, "client")
        try:
            await work(bus)
        finally:
            await bus.close()

    running = asyncio.ensure_future(run())
    stopping = asyncio.ensure_future(stop.wait())
    await asyncio.wait({running, stopping}, return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    await asyncio.wait({running}, timeout=CLOSE_LIMIT_S)
    if running.done():
        running.result()
