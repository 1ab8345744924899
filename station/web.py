"""The page and its websocket, as an ASGI application: pairs a page, then carries its messages to the relay.

The run of a page ends with its websocket, after `SILENCE_S` without a message, and with a message that is not one of the page.
"""

import asyncio
import logging
import secrets
from collections.abc import Awaitable, Callable
from contextlib import suppress
from importlib.resources import files

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from station import gallery, messages
from station.admission import RESPONSE_HEADERS, Address
from station.driving import Driving, Person, Pictures
from station.gallery import Painter
from station.messages import BadMessageError, Wanted
from station.pairing import Pairing, Session
from station.relay import MAX_PAGES, Relay, Run
from station.visitors import Visitor

_log = logging.getLogger(__name__)

FILES = {
    "index.html": "html",
    "station.js": "javascript",
    "lease.js": "javascript",
    "drive.js": "javascript",
    "wish.js": "javascript",
    "picture.js": "javascript",
    "style.css": "css",
}
SILENCE_S = 1.0
"""The lease has ended long before; then the connection ends, too, so that the page can connect again."""
MAX_MESSAGES_PER_S = 100
"""A page sends about 20 a second: the answers to the challenges; or, if it drives, about 33, and one for each thing
that is held or released."""
COMMAND_LIMIT_S = 0.5
"""A page that drives, or asks to, and is silent for longer loses its turn; the robot has stopped long before."""
MAX_REASON = 120
"""Bytes of the reason for which a websocket is closed."""


class ClosingError(Exception):
    """Closes a websocket with a code and a sentence, which the page shows."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code, self.sentence = code, sentence


NOT_PAIRED = ClosingError(4401, "Not paired: open the address with a new code, which the terminal shows.")
BAD_MESSAGE = ClosingError(4400, "The page's messages were refused.")
SILENT = ClosingError(4408, "The page was silent.")
REPLACED = ClosingError(4409, "The page has a newer connection.")
NO_DRIVING = ClosingError(4405, "This station does not drive: start it with --drive.")
NO_NAME = ClosingError(4403, "Enter your name first.")
HAS_PLACE = ClosingError(4411, "This page drives or asks already.")
NO_PICTURE = ClosingError(4404, "This station shows no pictures.")
TOO_MANY_PAGES = ClosingError(4429, "Too many pages of this station are open: close one.")


class Socket:
    """The websocket of one page, and what waits to be sent to it: at most one message of each kind."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._waiting: dict[str, str] = {}
        self._wake = asyncio.Event()

    def show(self, kind: str, text: str) -> None:
        self._waiting[kind] = text
        self._wake.set()

    async def write(self) -> None:
        """Send what waits, until the connection ends."""
        with suppress(WebSocketDisconnect, RuntimeError):  # RuntimeError: it is being closed
            while await self._wake.wait():
                self._wake.clear()
                while self._waiting:
                    await self._websocket.send_text(self._waiting.pop(next(iter(self._waiting))))

    async def send(self, text: str) -> None:
        """Send a message, and wait until it fits into the connection's buffer."""
        await self._websocket.send_text(text)

    async def read(self, limit_s: float = SILENCE_S) -> str:
        """Return the next message.

        Raises:
            WebSocketDisconnect: the connection has ended.
            ClosingError: none arrives within the limit, or it is not text.
        """
        try:
            async with asyncio.timeout(limit_s):
                message = await self._websocket.receive()
        except TimeoutError as error:
            raise SILENT from error
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect
        if (text := message.get("text")) is None:
            raise BAD_MESSAGE
        return text


class Allowance:
    """Counts the messages of a page within each second."""

    def __init__(self, now_s: float) -> None:
        self._since_s, self._count = now_s, 0

    def spend(self, now_s: float) -> None:
        """Count a message.

        Raises:
            ClosingError: the page sends too many.
        """
        is_same = now_s - self._since_s < 1.0
        self._since_s, self._count = (self._since_s, self._count + 1) if is_same else (now_s, 1)
        if self._count > MAX_MESSAGES_PER_S:
            raise BAD_MESSAGE


class Application:
    """Serves the page of one station.

    Args:
        name: of the station.
        address: where the page is served.
        relay: carries the leases.
        pairing: decides who may hold one.
        say: called with a sentence about each page that comes or goes.
        painter: makes pictures of the robot; None: the pages show none.
        driving: gives the wheel to a page; None: the pages do not drive.
    """

    def __init__(
        self,
        name: str,
        address: Address,
        relay: Relay,
        pairing: Pairing,
        say: Callable[[str], None],
        painter: Painter | None = None,
        driving: Driving | None = None,
    ) -> None:
        self._name, self._address, self._relay, self._pairing, self._say = name, address, relay, pairing, say
        self._painter, self._driving = painter, driving
        self._runs: dict[Session, Run] = {}
        self._pictures: dict[Session, Pictures] = {}
        """Of the pages that watch."""
        sockets = [
            WebSocketRoute("/lease", self._on_lease),
            WebSocketRoute("/picture", self._on_picture),
            WebSocketRoute("/drive", self._on_drive),
        ]
        self._inner = Starlette(routes=[*(_route(file, kind) for file, kind in FILES.items()), *sockets])

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request of the page itself, and refuse all others."""
        is_websocket = scope["type"] == "websocket"

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                more = [(name.encode(), value.encode()) for name, value in RESPONSE_HEADERS.items()]
                message["headers"] = [*message.get("headers", ()), *more]
            await send(message)

        if self._address.admits(scope["headers"], needs_origin=is_websocket):
            await self._inner(scope, receive, send_with_headers)
        elif is_websocket:
            await send({"type": "websocket.close"})  # before it is accepted: the response is 403
        else:
            refused = PlainTextResponse("This server has another name.\n", 403)
            await refused(scope, receive, send_with_headers)

    async def _on_lease(self, websocket: WebSocket) -> None:
        await self._on_websocket(websocket, self._serve)

    async def _on_picture(self, websocket: WebSocket) -> None:
        await self._on_websocket(websocket, self._show)

    async def _on_drive(self, websocket: WebSocket) -> None:
        await self._on_websocket(websocket, self._drive)

    async def _on_websocket(
        self, websocket: WebSocket, serve: Callable[[Socket, Visitor], Awaitable[None]]
    ) -> None:
        try:
            await websocket.accept()
            await serve(Socket(websocket), websocket.state.visitor)
        except WebSocketDisconnect:
            return
        except (ClosingError, BadMessageError) as error:
            closing = error if isinstance(error, ClosingError) else BAD_MESSAGE
            with suppress(WebSocketDisconnect, RuntimeError):  # it has ended meanwhile
                await websocket.close(closing.code, closing.sentence)
        except Exception:
            _log.exception("a page ended with an unexpected error")
            raise

    async def _serve(self, socket: Socket, visitor: Visitor) -> None:
        """Pair a page and hold its lease, until the connection ends, or the server ends it with an error."""
        session = self._admit(*messages.read_hello(await socket.read()))
        if (before := self._runs.pop(session, None)) is not None:
            self._relay.leave(before)
        if self._relay.is_full:
            raise TOO_MANY_PAGES
        socket.show(
            "welcome", messages.welcome(self._name, session.token, may_drive=self._driving is not None)
        )
        run = self._runs[session] = self._relay.enter(socket)
        visitor.stay()
        self._say(f"{self._name}: a page is connected")
        writing = asyncio.ensure_future(socket.write())
        try:
            await self._hold(socket, run, session)
        finally:
            visitor.leave(asyncio.get_running_loop().time())
            self._relay.leave(run)
            writing.cancel()
            if self._runs.get(session) is run:
                del self._runs[session]
            self._say(f"{self._name}: the connection to a page has ended")

    async def _show(self, socket: Socket, visitor: Visitor) -> None:
        """Show pictures to a page that holds its lease now, until the connection ends, or the server ends it with an error."""
        session = await self._session(socket)
        if self._painter is None:
            raise NO_PICTURE
        if len(self._pictures) >= MAX_PAGES or session in self._pictures:
            raise TOO_MANY_PAGES
        visitor.stay()
        pictures = self._pictures[session] = Pictures()
        try:
            await gallery.show(socket, self._painter, pictures, lambda: session in self._runs)
        finally:
            del self._pictures[session]
            visitor.leave(asyncio.get_running_loop().time())

    async def _drive(self, socket: Socket, visitor: Visitor) -> None:
        """Let a page that holds its lease ask to drive and drive, until the connection ends, or the server ends it with an error."""
        session = await self._session(socket)
        if self._driving is None:
            raise NO_DRIVING
        if not session.name:
            raise NO_NAME
        if self._driving.has(session):
            raise HAS_PLACE
        visitor.stay()
        person = self._driving.enter(session.name, session)
        writing = asyncio.ensure_future(socket.write())
        try:
            await self._follow(socket, session, self._driving, person)
        finally:
            self._driving.leave(person)
            self._relay.driver = self._driving.driver
            visitor.leave(asyncio.get_running_loop().time())
            writing.cancel()

    async def _follow(self, socket: Socket, session: Session, driving: Driving, person: Person) -> None:
        """Follow a person who asks to drive, and then drives, until the turn ends."""
        loop = asyncio.get_running_loop()
        allowance = Allowance(loop.time())
        told, shown, resetting = "", "", None
        try:
            while True:
                heard = messages.read_wanted(await socket.read(COMMAND_LIMIT_S))
                if session not in self._runs:  # its lease may have ended while it was read
                    return
                heard_s = loop.time()
                allowance.spend(heard_s)
                if problem := await driving.take(person, heard_s):
                    raise ClosingError(4423, problem.encode()[:MAX_REASON].decode(errors="ignore"))
                self._relay.driver = driving.driver
                if isinstance(heard, Wanted):
                    problem = driving.hear(person, heard, self._pictures.get(session), heard_s)
                    if problem != told:
                        told = problem
                        socket.show("told", messages.told(problem))
                elif heard == "reset" and (resetting is None or resetting.done()):
                    resetting = asyncio.ensure_future(self._reset(socket, driving, person))
                if ending := driving.ending(person, loop.time(), hands_over=heard == "hand_over"):
                    raise ClosingError(4410, ending)
                if (turn := driving.turn(person, loop.time())) != shown:
                    shown = turn
                    socket.show("turn", turn)
        finally:
            if resetting is not None:
                resetting.cancel()

    async def _reset(self, socket: Socket, driving: Driving, person: Person) -> None:
        socket.show("told", messages.told(await driving.reset(person)))

    async def _session(self, socket: Socket) -> Session:
        """Return the session of a page that holds its lease now.

        Raises:
            ClosingError: the page has none.
        """
        _, token = messages.read_hello(await socket.read())
        session = self._pairing.resume(token, asyncio.get_running_loop().time())
        if session is None or session not in self._runs:
            raise NOT_PAIRED
        return session

    def _admit(self, code: str, token: str) -> Session:
        now_s = asyncio.get_running_loop().time()
        session = (
            self._pairing.resume(token, now_s)
            if token
            else self._pairing.pair(code, secrets.token_urlsafe(32), now_s)
        )
        if session is None:
            raise NOT_PAIRED
        return session

    async def _hold(self, socket: Socket, run: Run, session: Session) -> None:
        loop = asyncio.get_running_loop()
        allowance = Allowance(loop.time())
        while True:
            heard = messages.read_lease(await socket.read())
            if isinstance(heard, str):
                session.name = heard
            else:
                was_pressed = run.is_pressed
                if not self._relay.hear(run, heard):
                    raise REPLACED
                if self._driving is not None and run.is_pressed and not was_pressed:
                    name = session.name or "a person without a name"
                    self._driving.tell(session, f"{name} pressed the e-stop")
            allowance.spend(loop.time())


def _route(file: str, kind: str) -> Route:
    content = (files("station") / "page" / file).read_bytes()

    async def respond(_: Request) -> Response:
        return Response(content, media_type=f"text/{kind}")

    return Route("/" if file == "index.html" else f"/{file}", respond)
