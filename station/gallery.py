"""Shows the robot to the pages, one picture at a time: the next one is made when the page has drawn the one before.

So nothing waits in a slow link, and the pictures have a connection of their own: they never delay the lease.
"""

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from station import messages
from station.driving import Pictures
from station.messages import BadMessageError

PERIOD_S = 0.05
"""Least time between two pictures."""
DRAW_LIMIT_S = 3.0
"""A page that has not drawn a picture after this time has ended."""


class Painter(Protocol):
    """Makes the pictures, as objects for JSON without NaN and infinity."""

    def robot(self) -> dict[str, object]:
        """Return what does not change."""
        ...

    def picture(self) -> tuple[dict[str, object], float]:
        """Return the newest picture, and when its oldest scan arrived; -inf if it shows none."""
        ...


class Page(Protocol):
    """The connection for the pictures of a page."""

    async def send(self, text: str) -> None:
        """Send a message."""
        ...

    async def read(self, limit_s: float) -> str:
        """Return the next message; raise an error after `limit_s`."""
        ...


async def show(page: Page, painter: Painter, pictures: Pictures, may_watch: Callable[[], bool]) -> None:
    """Show pictures while the page may watch; `pictures` remembers them.

    Raises:
        BadMessageError: an answer is not the number of the last picture.
    """
    loop = asyncio.get_running_loop()
    await page.send(json.dumps({"kind": "robot", **painter.robot()}, allow_nan=False))
    number, round_trip_s = 0, 0.0
    while may_watch():
        number, sent_s = number + 1, loop.time()
        head = {"kind": "picture", "number": number, "round_trip_s": round(round_trip_s, 4)}
        picture, scan_s = painter.picture()
        pictures.sent(number, scan_s)
        await page.send(json.dumps({**head, **picture}, allow_nan=False))
        if messages.read_drawn(await page.read(DRAW_LIMIT_S)) != number:
            raise BadMessageError("not the number of the last picture")
        round_trip_s = loop.time() - sent_s
        await asyncio.sleep(PERIOD_S - round_trip_s)
