"""Opens sessions that listen to everything: `python -m tests.system.viewers ENDPOINT NUMBER`. Prints `watching`, and waits."""

import asyncio
import sys
import threading

from wire.bus_config import BusConfig
from wire.inbox import Overheard
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession


def _ignore(_: Overheard) -> None:
    return


async def main(endpoint: str, number: int) -> None:
    config = BusConfig(endpoint)
    sessions = [ZenohSession(await open_session(config, "client"), config.namespace) for _ in range(number)]
    for session in sessions:
        session.hear(f"{config.namespace}/**", _ignore)
    await sessions[-1].hub_entry()  # the hub has received all that was declared before
    print("watching", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
