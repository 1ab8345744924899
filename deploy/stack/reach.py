"""A client's way onto the wire, for commands that stay there until Ctrl-C."""

import asyncio

from deploy.stack.errors import DeployError
from wire.bus import Bus
from wire.zenoh_bus import BusConfig, open_bus

CONNECT_LIMIT_S = 2.0


class NotRunningError(DeployError):
    """Nobody answers at the endpoint."""


async def reach(config: BusConfig, stop: asyncio.Event) -> Bus | None:
    """Open the bus; None: `stop` was set before.

    Raises:
        NotRunningError: nobody answers.
        BusError: the endpoint makes no sense.
    """
    opening = asyncio.ensure_future(open_bus(config, "client"))
    stopping = asyncio.ensure_future(stop.wait())
    try:
        await asyncio.wait({opening, stopping}, timeout=CONNECT_LIMIT_S, return_when=asyncio.FIRST_COMPLETED)
        if opening.done():
            return opening.result()
        if stop.is_set():
            return None
        raise NotRunningError(f"nobody answers at {config.endpoint}: start the robot with `lifeline up`")
    finally:
        opening.cancel()
        stopping.cancel()
