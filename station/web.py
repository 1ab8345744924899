"""The page and its websocket, as an ASGI application: pairs a page, then carries its messages to the relay.

The run of a page ends with its websocket, after `SILENCE_S` without a message, and with a message that is not one of the page.
"""

import asyncio
import json
import logging
import math
import secrets
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from importlib.resources import files
from typing import Protocol

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from station import messages
from station.admission import RESPONSE_HEADERS, Address
from station.driving import Driving, Person, Pictures
from station.messages import BadMessageError, Fields, HandOver, Hello, Wanted
from station.pairing import Pairing, Session
from station.relay import MAX_PAGES, Relay, Run
from station.visitors import VISIT_S
from wire.message_types import EstopLease

_log = logging.getLogger(__name__)

SCRIPTS = ("browser.js", "station.js", "lease.js", "drive.js", "wish.js", "picture.js")
FILES = {"index.html": "html", "style.css": "css", **dict.fromkeys(SCRIPTS, "javascript")}
SILENCE_S = 1.0
"""The lease has ended long before; then the connection ends, too, so that the page can connect again."""
MAX_MESSAGES_PER_S = 100
"""A page sends about 20 a second: the answers to the challenges; or, if it drives, about 33, and one for each thing
that is held or released."""
COMMAND_LIMIT_S = 0.5
"""A page that drives, or asks to, and is silent for longer loses its turn; the robot has stopped long before."""
PICTURE_PERIOD_S = 0.05
"""Least time between two pictures."""
DRAW_LIMIT_S = 3.0
"""A page that draws no picture for longer loses its connection for pictures."""
MAX_REASON = 120
"""Bytes of the reason for which a websocket is closed."""


class ClosingError(Exception):
    """Closes a websocket with a code and a sentence, which the page shows."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code, self.sentence = code, sentence.encode()[:MAX_REASON].decode(errors="ignore")


# These are no errors: one that is raised again keeps the frames of each raise, and with them what each page had in memory.
NOT_PAIRED = 4401, "Not paired: open the address with a new code, which the terminal shows."
BAD_MESSAGE = 4400, "The page's messages were refused: open the address with a new code."
SILENT = 4408, "The page was silent: keep it visible. If it drove, press Drive again."
REPLACED = 4409, "The page has a newer connection: use that one."
NO_DRIVING = 4405, "This station does not drive: start it with --drive."
NO_NAME = 4403, "Enter your name first."
HAS_PLACE = 4411, "This page drives or asks already: press Drive again in a second."
NAME_TAKEN = 4412, "A person with this name drives or asks already: enter another name."
NO_PICTURE = 4404, "This station shows no pictures: start it with the robot's --config."
TOO_MANY_PAGES = 4429, "Too many pages of this station are open: close one."
ANOTHER_ASKS = "That person no longer asks to drive: look who asks now."


class Painter(Protocol):
    """Makes the pictures, without NaN and infinity."""

    def robot(self) -> Fields:
        """Return what does not change."""
        ...

    def picture(self) -> tuple[Fields, float]:
        """Return the newest picture, and when its oldest scan arrived; -inf if it shows none."""
        ...


class Socket:
    """The websocket of one page, and what waits to be sent to it: at most one message of each kind."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._waiting: dict[str, Fields] = {}
        self._wake = asyncio.Event()
        self._since_s, self._count = -math.inf, 0
        """The messages of the page within the present second."""

    def show(self, kind: str, fields: Fields) -> None:
        self._waiting[kind] = fields
        self._wake.set()

    async def write(self) -> None:
        """Send what waits, until the connection ends."""
        with suppress(WebSocketDisconnect, RuntimeError):  # RuntimeError: it is being closed
            while await self._wake.wait():
                self._wake.clear()
                while self._waiting:
                    kind = next(iter(self._waiting))
                    await self.send(kind, self._waiting.pop(kind))

    async def send(self, kind: str, fields: Fields) -> None:
        """Send a message, and wait until it fits into the connection's buffer."""
        await self._websocket.send_text(json.dumps({"kind": kind, **fields}, allow_nan=False))

    async def read(self, limit_s: float = SILENCE_S) -> str:
        """Return the next message.

        Raises:
            WebSocketDisconnect: the connection has ended.
            ClosingError: none arrives within the limit, it is not text, or the page sends too many.
        """
        try:
            async with asyncio.timeout(limit_s):
                message = await self._websocket.receive()
        except TimeoutError as error:
            raise ClosingError(*SILENT) from error
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect
        now_s = asyncio.get_running_loop().time()
        if now_s - self._since_s >= 1.0:
            self._since_s, self._count = now_s, 0
        self._count += 1
        if (text := message.get("text")) is None or self._count > MAX_MESSAGES_PER_S:
            raise ClosingError(*BAD_MESSAGE)
        return text


class Application:
    """Serves the page of one station.

    Args:
        name: of the station.
        address: where the page is served.
        relay: carries the leases.
        pairing: decides who may hold one.
        clock: returns the time of codes and sessions [s]; it goes on while the machine is suspended.
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
        clock: Callable[[], float],
        say: Callable[[str], None],
        painter: Painter | None,
        driving: Driving | None,
    ) -> None:
        self._name, self._address, self._relay, self._pairing, self._say = name, address, relay, pairing, say
        self._clock = clock
        self._painter, self._driving = painter, driving
        self._runs: dict[Session, Run] = {}
        self._pictures: dict[Session, Pictures] = {}
        """Of the pages that watch."""
        sockets = {"/lease": self._lease, "/picture": self._picture, "/drive": self._drive}
        routes = [WebSocketRoute(path, partial(self._on_websocket, one)) for path, one in sockets.items()]
        self._inner = Starlette(routes=[*(_route(file, kind) for file, kind in FILES.items()), *routes])

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

    async def _on_websocket(
        self, serve: Callable[[Socket, Session], Awaitable[None]], websocket: WebSocket
    ) -> None:
        """Serve a page until its connection ends, or the server ends it with an error."""
        visitor, socket = websocket.state.visitor, Socket(websocket)
        try:
            await websocket.accept()
            hello = messages.read_hello(await socket.read(VISIT_S))  # until then, the page holds no lease
            session = self._session(hello, begins=serve == self._lease)
            if hello.name is not None:
                session.name = hello.name
            visitor.stay()
            writing = asyncio.ensure_future(socket.write())
            try:
                await serve(socket, session)
            finally:
                visitor.leave(asyncio.get_running_loop().time())
                writing.cancel()
        except WebSocketDisconnect:
            return
        except (ClosingError, BadMessageError) as error:
            closing = error if isinstance(error, ClosingError) else ClosingError(*BAD_MESSAGE)
            with suppress(WebSocketDisconnect, RuntimeError):  # it has ended meanwhile
                await websocket.close(closing.code, closing.sentence)
        except Exception:
            _log.exception("a page ended with an unexpected error")
            raise

    def _session(self, hello: Hello, *, begins: bool) -> Session:
        """Return the session of a page that is paired, with a code or a token, and holds its lease now unless it begins.

        Raises:
            ClosingError: there is none.
        """
        now_s = self._clock()
        if hello.code and begins:
            session = self._pairing.pair(hello.code, secrets.token_urlsafe(32), now_s, self._runs)
        else:
            session = self._pairing.resume(hello.token, now_s)
        if session is None or not (begins or session in self._runs):
            raise ClosingError(*NOT_PAIRED)
        return session

    async def _lease(self, socket: Socket, session: Session) -> None:
        """Hold the lease of a page."""
        if (before := self._runs.pop(session, None)) is not None:
            self._relay.leave(before)
        if self._relay.is_full:
            raise ClosingError(*TOO_MANY_PAGES)
        may_drive = self._driving is not None
        socket.show("welcome", {"station": self._name, "token": session.token, "may_drive": may_drive})
        run = self._runs[session] = self._relay.enter(socket)
        self._say(f"{self._name}: a page is connected")
        try:
            while True:
                heard = messages.read_lease(await socket.read())
                if heard is None:
                    self._relay.press(run)
                    session.is_pressed = False
                elif isinstance(heard, str):
                    session.name = heard
                else:
                    self._hear(session, run, heard)
        finally:
            self._relay.leave(run)
            if self._runs.get(session) is run:
                del self._runs[session]
            self._say(f"{self._name}: the connection to a page has ended")

    def _hear(self, session: Session, run: Run, message: EstopLease) -> None:
        """Pass on a message of a page, and record a press once: the page stays pressed when it connects again.

        Raises:
            ClosingError: the run has ended.
        """
        if not self._relay.hear(run, message):
            raise ClosingError(*REPLACED)
        if self._driving is not None and run.is_pressed and not session.is_pressed:
            name = session.name or "a person without a name"
            self._driving.record(session, f"{name} pressed the e-stop")
        session.is_pressed = run.is_pressed

    async def _picture(self, socket: Socket, session: Session) -> None:
        """Show a page one picture at a time: the next one is made when the page has drawn the one before.

        So nothing waits in a slow link, and the pictures have a connection of their own: they never delay the lease.
        """
        if self._painter is None:
            raise ClosingError(*NO_PICTURE)
        if len(self._pictures) >= MAX_PAGES or session in self._pictures:
            raise ClosingError(*TOO_MANY_PAGES)
        pictures = self._pictures[session] = Pictures()
        loop, number, round_trip_s = asyncio.get_running_loop(), 0, 0.0
        try:
            await socket.send("robot", self._painter.robot())
            while session in self._runs:
                number, sent_s = number + 1, loop.time()
                picture, scan_s = self._painter.picture()
                pictures.sent(number, scan_s)
                head = {"number": number, "round_trip_s": round(round_trip_s, 4)}
                await socket.send("picture", {**head, **picture})
                if messages.read_drawn(await socket.read(DRAW_LIMIT_S)) != number:
                    raise ClosingError(*BAD_MESSAGE)
                round_trip_s = loop.time() - sent_s
                await asyncio.sleep(PICTURE_PERIOD_S - round_trip_s)
        finally:
            del self._pictures[session]

    async def _drive(self, socket: Socket, session: Session) -> None:
        """Let a page ask to drive, and drive."""
        if self._driving is None:
            raise ClosingError(*NO_DRIVING)
        if not session.name:
            raise ClosingError(*NO_NAME)
        if self._driving.has(session):
            raise ClosingError(*HAS_PLACE)
        if self._driving.has_name(session.name):
            raise ClosingError(*NAME_TAKEN)
        person = self._driving.enter(session.name, session)
        try:
            await self._follow(socket, session, self._driving, person)
        finally:
            self._driving.leave(person)
            self._relay.driver = self._driving.driver

    async def _follow(self, socket: Socket, session: Session, driving: Driving, person: Person) -> None:
        """Follow a person who asks to drive, and then drives, until the turn ends."""
        loop = asyncio.get_running_loop()
        refusal, turn, resetting = "", None, None
        try:
            while True:
                heard = messages.read_wanted(await socket.read(COMMAND_LIMIT_S))
                if session not in self._runs:  # its lease may have ended while it was read
                    return
                heard_s = loop.time()
                if problem := await driving.take(person, heard_s):
                    raise ClosingError(4423, problem)
                self._relay.driver = driving.driver
                hand_over_to = heard.name if isinstance(heard, HandOver) else ""
                if ending := driving.ending(person, heard_s, hand_over_to):
                    raise ClosingError(4410, ending)
                if heard == "reset":
                    if resetting is None or resetting.done():
                        resetting = asyncio.ensure_future(self._reset(socket, driving, person))
                    continue
                pictures, before = self._pictures.get(session), refusal
                refusal = (
                    driving.hear(person, heard, pictures, heard_s)
                    if isinstance(heard, Wanted)
                    else ANOTHER_ASKS
                )
                if refusal not in ("", before):
                    socket.show("answer", {"sentence": refusal})
                if (shown := driving.turn(person, heard_s)) != turn:
                    turn = shown
                    socket.show("turn", turn)
        finally:
            if resetting is not None:
                resetting.cancel()

    async def _reset(self, socket: Socket, driving: Driving, person: Person) -> None:
        if refusal := await driving.reset(person):
            socket.show("answer", {"sentence": refusal})


def _route(file: str, kind: str) -> Route:
    content = (files("station") / "page" / file).read_bytes()

    async def respond(_: Request) -> Response:
        return Response(content, media_type=f"text/{kind}")

    return Route("/" if file == "index.html" else f"/{file}", respond)
