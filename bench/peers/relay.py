"""Passes each message on: `python -m bench.peers.relay LINK ADDRESS callback|asyncio`.

`callback` sends on the transport's own thread. `asyncio` wakes an event loop, which sends, as the supervisor does.
"""

import argparse
import asyncio
import threading
from collections import deque
from collections.abc import Callable

from bench.peers.links import link_of

Send = Callable[[bytes], None]


def in_callback(link: str, address: str) -> None:
    ready, send = threading.Event(), list[Send]()

    def heard(payload: bytes) -> None:
        ready.wait()
        send[0](payload)

    send.append(link_of(link).connect(address, "relay", heard))
    ready.set()
    threading.Event().wait()


async def in_loop(link: str, address: str) -> None:
    loop, wake, waiting = asyncio.get_running_loop(), asyncio.Event(), deque[bytes]()

    def heard(payload: bytes) -> None:
        waiting.append(payload)
        loop.call_soon_threadsafe(wake.set)

    send = link_of(link).connect(address, "relay", heard)
    while True:
        await wake.wait()
        wake.clear()
        while waiting:
            send(waiting.popleft())


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.peers.relay", description=__doc__)
    parser.add_argument("link")
    parser.add_argument("address")
    parser.add_argument("mode", choices=("callback", "asyncio"))
    options = parser.parse_args()
    if options.mode == "callback":
        in_callback(options.link, options.address)
    else:
        asyncio.run(in_loop(options.link, options.address))


if __name__ == "__main__":
    main()
