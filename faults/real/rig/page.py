"""The page of a station at its server, without a browser: `python -m faults.real.rig.page ADDRESS`, with the code in the address.

It takes orders on stdin, one JSON object per line:

    {"keys": "wwa"}                                       press keys, as in faults/page.py
    {"frozen": false, "garbage_on": "drive", "seed": 7}   replace the faulty behaviour: a PageFault
"""

import asyncio
import signal
import sys
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.typing import Origin

from faults.page import Page, PageFault
from faults.real.rig.helper_process import serve


async def _main(address: str) -> None:
    parts = urlsplit(address)
    origin = Origin(f"{parts.scheme}://{parts.netloc}")

    def opened(name: str) -> connect:
        return connect(f"ws://{parts.netloc}/{name}", origin=origin, proxy=None)

    page = Page(opened, parts.fragment, (WebSocketException, OSError))

    async def obey(order: dict[str, Any]) -> None:
        if "keys" in order:
            await page.press(order["keys"])
        else:
            page.set_fault(PageFault(**order))

    async with asyncio.TaskGroup() as group:
        driving = group.create_task(page.run())
        await serve(obey)
        driving.cancel()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign handles Ctrl-C
    asyncio.run(_main(*sys.argv[1:]))
