"""Connects a client to the hub, for commands that run until Ctrl-C."""

import asyncio

from deploy.stack.errors import DeployError
from wire.zenoh_bus import BusConfig, ZenohBus, open_bus

CONNECT_LIMIT_S = 2.0


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
        raise NotRunningError(
            f"no supervisor answers at {config.endpoint}: start the robot with `lifeline up`"
        )
    finally:
        opening.cancel()
        stopping.cancel()
