"""The page of a station at its server, without a browser: `python -m faults.real.rig.page ADDRESS`, with the code in the address.

It takes orders on stdin, one JSON object per line:

    {"keys": "wwa"}                       press keys, as in faults/page.py
    {"frozen": true}                      freeze the picture; false: no longer
    {"garbage": "drive", "seed": 7}       send garbage on this connection; "": no longer
"""

import asyncio
import signal
import sys
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException
from websockets.typing import Origin

from faults.page import Page
from faults.real.rig.helper_process import serve


@contextmanager
def _connection_errors() -> Generator[None]:
    try:
        yield
    except (WebSocketException, OSError) as error:
        raise ConnectionError(str(error)) from error


class _Socket:
    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket

    async def send(self, text: str) -> None:
        with _connection_errors():
            await self._socket.send(text)

    async def recv(self) -> str | bytes:
        with _connection_errors():
            return await self._socket.recv()


async def _main(address: str) -> None:
    parts = urlsplit(address)
    origin = Origin(f"{parts.scheme}://{parts.netloc}")

    @asynccontextmanager
    async def opened(name: str) -> AsyncGenerator[_Socket]:
        with _connection_errors():
            async with connect(f"ws://{parts.netloc}/{name}", origin=origin, proxy=None) as socket:
                yield _Socket(socket)

    page = Page(opened, parts.fragment)

    async def obey(order: dict[str, Any]) -> None:
        match order:
            case {"keys": str(keys)}:
                await page.press(keys)
            case {"frozen": bool(frozen)}:
                page.freeze_picture(frozen=frozen)
            case {"garbage": str(name), "seed": int(seed)}:
                page.send_garbage(name, seed)
            case _:
                raise ValueError(f"no such order: {order!r}")

    driving = asyncio.ensure_future(page.run())
    serving = asyncio.ensure_future(serve(obey))
    await asyncio.wait({driving, serving}, return_when=asyncio.FIRST_COMPLETED)
    for task in (driving, serving):
        if task.done():
            task.result()
        task.cancel()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign handles Ctrl-C
    asyncio.run(_main(*sys.argv[1:]))
