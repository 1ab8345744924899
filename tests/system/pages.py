"""A server of a station's page in a terminal of its own, and a page without a browser."""

import asyncio
import json
import re
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from enum import IntEnum
from itertools import count
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from teleop.station.state import Lease, Word, pressed, received, sent
from tests.system.harness import PATIENCE_S, Robot, robot
from tests.system.operators import LIMIT_S, Operator, until
from tests.system.ports import free_endpoint
from tests.system.test_estop_stations import LIFELINE, config_with, state
from wire import topics
from wire.messages import EstopLease

URL = re.compile(r"https?://\S+#\w+(?=\s)")
"""An address with its complete code. A terminal may deliver a line in parts."""
CHALLENGES = count(1)


class Code(IntEnum):
    """Why the server closes a connection."""

    BAD_MESSAGE = 4400
    NOT_PAIRED = 4401
    NO_NAME = 4403
    NO_DRIVING = 4405
    SILENT = 4408
    REPLACED = 4409
    HANDED_OVER = 4410
    HAS_PLACE = 4411
    HELD = 4423
    TOO_MANY = 4429


async def closing_code(socket: ClientConnection) -> int:
    """Wait until a connection is closed; return the code."""
    await asyncio.wait_for(socket.wait_closed(), LIMIT_S)
    assert socket.close_code is not None
    return socket.close_code


class Server(Operator):
    """`lifeline station --name NAME` at a free port."""

    def __init__(self, endpoint: str, config: Path, *more: str, name: str = "phone") -> None:
        self._serve("station", "--name", name, "--endpoint", endpoint, "--config", str(config), *more)

    def _serve(self, *command: str) -> None:
        self.port = free_endpoint().rpartition(":")[2]
        self.origin = f"http://127.0.0.1:{self.port}"
        super().__init__(LIFELINE, *command, "--port", self.port)

    async def address(self, number: int = 1) -> str:
        """Return the page's address with the code that was printed as the first, second, …."""
        await until(lambda: len(URL.findall(self.output)) >= number)
        return URL.findall(self.output)[number - 1]

    async def new_address(self) -> str:
        """Press Enter, and return the page's address with the new code."""
        before = len(URL.findall(self.output))
        self.type(b"\r")
        return await self.address(before + 1)

    @asynccontextmanager
    async def page(self, **hello: str) -> AsyncGenerator["Page"]:
        """A page that answers the challenges; without `code` or `token`, it is paired with a new code."""
        hello = hello or {"code": (await self.new_address()).partition("#")[2]}
        page = Page(self, await self.socket())
        answering = asyncio.ensure_future(page.answer(hello))
        try:
            yield page
        finally:
            answering.cancel()
            print(f"close code of the page's connection: {page.socket.close_code}")  # for a failed test
            await page.socket.close()

    @asynccontextmanager
    async def heard_page(self, subject: Robot) -> AsyncGenerator["Page"]:
        """A page that is heard."""
        async with self.page() as page:
            await subject.until(lambda: state(subject, "phone") == "heard", "heard", PATIENCE_S)
            yield page

    def socket(self, origin: str | None = "", host: str = "127.0.0.1", path: str = "lease") -> connect:
        """Open one of the page's websockets, with an origin (by default, its own), as if this computer was named `host`."""
        given = origin if origin != "" else self.origin
        return connect(
            f"ws://{host}:{self.port}/{path}",
            origin=None if given is None else Origin(given),
            host="127.0.0.1",
            port=int(self.port),
        )


class Beside(Server):
    """`lifeline up --station --drive` with the default configuration, at a free port."""

    def __init__(self, endpoint: str, state: Path) -> None:
        options = ("--no-viewer", "--endpoint", endpoint, "--state-dir", str(state))
        self._serve("up", "--station", "--drive", *options)


class Page:
    """Holds the lease like the page in JavaScript, and connects again when the server has closed it as silent."""

    def __init__(self, server: Server, socket: ClientConnection) -> None:
        self._server, self.socket = server, socket
        self.lease, self.token, self.view, self.hangs = Lease(), "", dict[str, Any](), False

    async def answer(self, hello: Mapping[str, str]) -> None:
        await self._answer(hello)
        while self.socket.close_code == Code.SILENT and self.token and not self.hangs:
            self.socket = await self._server.socket()
            await self._answer({"token": self.token})

    async def _answer(self, hello: Mapping[str, str]) -> None:
        with suppress(ConnectionClosed):
            await self.socket.send(json.dumps(hello))
            async for text in self.socket:
                message = json.loads(text)
                if message["kind"] == "welcome":
                    self.token = message["token"]
                    await self.rename("Anna")
                elif message["kind"] == "view":
                    self.view = message
                else:
                    challenge, response = int(message["challenge"]), int(message["response"])
                    self.lease = received(self.lease, EstopLease(challenge, response, stop=message["stop"]))
                if not self.hangs:
                    await self.send()

    async def rename(self, person: str) -> None:
        """Send the name of the person."""
        await self.socket.send(json.dumps({"name": person}))

    async def send(self) -> None:
        """Send the lease's next message; nothing if the websocket is closed, as in a browser."""
        self.lease, message = sent(self.lease, next(CHALLENGES), asyncio.get_running_loop().time())
        numbers = {"challenge": str(message.challenge), "response": str(message.response)}
        with suppress(ConnectionClosed):
            await self.socket.send(json.dumps(numbers | {"stop": message.stop}))

    async def press(self) -> None:
        self.lease = pressed(self.lease, asyncio.get_running_loop().time())
        await self.send()

    @property
    def word(self) -> Word:
        return self.lease.word(asyncio.get_running_loop().time())


@asynccontextmanager
async def served(
    tmp_path: Path,
    *nodes: str,
    teleop: bool = False,
    drives: bool = False,
    required: bool = True,
    options: Sequence[str] = (),
) -> AsyncGenerator[tuple[Robot, Server]]:
    """A robot with the station `phone`, by default only its supervisor, and the server of its page."""
    config = config_with(tmp_path, phone=required)
    async with robot(tmp_path, *(nodes or (topics.SUPERVISOR,)), teleop=teleop, config=config) as subject:
        server = Server(subject.endpoint, config, *(["--drive"] if drives else []), *options)
        try:
            await server.address()
            yield subject, server
        finally:
            server.close()


class Line:
    """A forwarder of TCP connections that can lose those that it has, as a phone does that comes to another network."""

    def __init__(self, to_port: int) -> None:
        self._to_port = to_port
        self._ways: list[asyncio.Future[None]] = []
        self._writers: list[asyncio.StreamWriter] = []
        self.port = 0

    async def forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection("127.0.0.1", self._to_port)
        self._writers += [writer, server_writer]
        for source, target in ((reader, server_writer), (server_reader, writer)):
            self._ways.append(asyncio.ensure_future(self._copy(source, target)))

    async def _copy(self, source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await source.read(4096):
                target.write(data)
        target.close()

    def lose(self) -> None:
        """Forward nothing more on the connections that exist; they stay open."""
        for way in self._ways:
            way.cancel()

    async def close(self) -> None:
        self.lose()
        await asyncio.gather(*self._ways, return_exceptions=True)
        for writer in self._writers:
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()


@asynccontextmanager
async def line_to(port: int) -> AsyncGenerator[Line]:
    line = Line(port)
    server = await asyncio.start_server(line.forward, "127.0.0.1", 0)
    line.port = server.sockets[0].getsockname()[1]
    try:
        yield line
    finally:
        server.close()
        await line.close()
