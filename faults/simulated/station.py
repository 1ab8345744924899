"""The server of a station on the virtual clock: the real application, to which a page opens simulated websockets.

Not simulated: HTTP, TLS, the limits for unpaired connections, the content of the pictures, the browser, and a slow link to the page.
"""

import asyncio
import math
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import Any

from starlette.types import Message

from station.admission import Address
from station.driving import Driving
from station.pairing import Pairing
from station.relay import Relay
from station.web import Application
from teleop.wheel import SourceWheel
from virtual.network import DEATH_NOTICE_S, HOP_S, VirtualBus, VirtualNetwork
from wire import topics

ADDRESS = Address("http", ("page",), 8470)
HEADERS = [(b"host", b"page:8470"), (b"origin", b"http://page:8470")]
NAME, CODE = "phone", "code"
MOST = (1.0, 2.0)
"""The largest velocity [m/s] and rate [rad/s]."""


class End:
    """One end of a websocket.

    Args:
        network: gives the time of a message.
        bus: the bus of the process at this end.
    """

    def __init__(self, network: VirtualNetwork, bus: VirtualBus) -> None:
        self._network, self.bus = network, bus
        self._arrived = asyncio.Queue[str | None]()
        self.other = self

    async def send(self, text: str, /) -> None:
        self._network.after(HOP_S, self.other.arrive, text)

    async def recv(self) -> str:
        """Return the next message.

        Raises:
            ConnectionError: the other end is closed.
        """
        text = await self._arrived.get()
        if text is None:
            raise ConnectionResetError
        return text

    def arrive(self, text: str | None) -> None:
        self._arrived.put_nowait(text)

    def close(self, after_s: float = HOP_S) -> None:
        self._network.after(after_s, self.other.arrive, None)


class _Painter:
    """Pictures with the age of the scan only: the server checks nothing else."""

    def __init__(self, bus: VirtualBus) -> None:
        self._scans = bus.subscribe(topics.SCAN)
        self._scan_s = -math.inf

    def robot(self) -> dict[str, object]:
        return {}

    def picture(self) -> tuple[dict[str, object], float]:
        if (scan := self._scans.latest()) is not None:
            self._scan_s = scan.arrival_s
        return {}, self._scan_s


class _Visitor:
    """A connection without a limit of time and bytes."""

    def stay(self) -> None: ...

    def leave(self, now_s: float) -> None: ...


class StationServer:
    """The server of a page that drives.

    Args:
        bus: its bus.
        network: carries its websockets.
    """

    def __init__(self, bus: VirtualBus, network: VirtualNetwork) -> None:
        self._bus, self._network = bus, network
        self._accepting = asyncio.Queue[tuple[str, End]]()
        self._ends: list[End] = []

    async def run(self, stop: asyncio.Event) -> None:
        """Serve pages, each paired with the same code, until `stop`."""
        wheel, relay, pairing = SourceWheel(topics.TELEOP, MOST), Relay(NAME, "virtual"), Pairing()
        for part in (wheel, relay):
            part.join(self._bus)
        loop = asyncio.get_running_loop()
        application = Application(
            NAME,
            ADDRESS,
            relay,
            pairing,
            loop.time,
            lambda _: None,
            _Painter(self._bus),
            Driving(wheel),
        )

        async def accept() -> None:
            while True:
                name, end = await self._accepting.get()
                pairing.offer(CODE, loop.time())
                asyncio.ensure_future(_serve(application, name, end)).add_done_callback(_check)

        asyncio.ensure_future(accept()).add_done_callback(_check)
        await relay.run(stop)

    @asynccontextmanager
    async def opened(self, page: VirtualBus, name: str) -> AsyncGenerator[End]:
        """Open a websocket for a page."""
        if self._bus.is_dead:
            raise ConnectionRefusedError
        own, other = End(self._network, page), End(self._network, self._bus)
        own.other, other.other = other, own
        self._ends += [own, other]
        self._network.after(HOP_S, self._accepting.put_nowait, (name, other))
        try:
            yield own
        finally:
            own.close()

    def lose(self, bus: VirtualBus) -> None:
        """Close the connections of a process that was killed."""
        for end in self._ends:
            if end.bus is bus:
                end.close(DEATH_NOTICE_S)


def _check(task: asyncio.Task[None]) -> None:
    """Report an error in a task to the loop."""
    task.result()


async def _serve(application: Application, name: str, end: End) -> None:
    connecting: list[Message] = [{"type": "websocket.connect"}]

    async def receive() -> Message:
        if connecting:
            return connecting.pop()
        try:
            return {"type": "websocket.receive", "text": await end.recv()}
        except ConnectionError:
            return {"type": "websocket.disconnect", "code": 1006}

    async def send(message: Message) -> None:
        if message["type"] == "websocket.send":
            await end.send(message["text"])
        elif message["type"] == "websocket.close":
            end.close()

    state = {"visitor": _Visitor()}
    scope: dict[str, Any] = {"type": "websocket", "path": f"/{name}", "headers": HEADERS, "state": state}
    await application(scope, receive, send)
    end.close()
